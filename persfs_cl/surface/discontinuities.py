"""Walls after the solve: their pixels get the depth of the side that they belong to, and are cut off from others.

A wall is drawn where the depth jumps, and it is wider than the jump, which has no width. So each of its pixels shows
one of the parts that the wall separates, and the photograph tells which: brightness goes on steadily on the right one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.preparation.highlights import dilate
from persfs_cl.surface.geometry import Discontinuities

Rows = NDArray[np.uint32]

REACH = 8
"""Depth is continued onto a wall for so many pixels at most."""

_DIRECTIONS = np.array([(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (1, 1), (-1, 1), (1, -1)])
"""Steps in rows and columns. Every two are opposites, and the first four lead to direct neighbours."""

_LENGTHS = np.hypot(*_DIRECTIONS.T)[:, None]
_ROUGHLY = 1.5
"""Ways across a wall that are longer than the shortest by more than this factor lead along it, and are not taken."""

_DARKEST = 0.01
"""Brightness below this share of the brightest next to walls is all one."""

_STEEPEST = 1.0 / 3.0
"""Largest change of log brightness from pixel to pixel that is believed to go on."""

_WORST, _A_PIXEL = 1.0, 0.1
"""Mismatch of log brightness beyond which a side is no worse, and how much of it a pixel of distance amounts to."""

_A_LINE = 0.5
"""Two pixels are equally deep in a wall where the difference of their ways to its two sides is the same, but for so
many pixels."""

_SMOOTHINGS = 8
"""Passes along a wall, most of whose pixels are on the same side as their neighbours."""

_MARGIN = REACH + 1
_CELLS = 1 << 22
"""Of the windows around pixels that are looked at together."""


@dataclass(frozen=True, eq=False)
class _Ways:
    """From the pixels of walls to what has a depth, in each direction; arrays of shape (8, n) but for the first two.

    Attributes
    ----------
    rows, columns : ndarray of int, shape (n,)
        Of the pixels of walls that something with a depth is near, in the order of the image.
    steps : ndarray of int
        To the first pixel with a depth; 0 where the direction leads to none, or along the wall.
    end_rows, end_columns : ndarray of int
        That pixel; the wall's own where there is none.
    """

    rows: Indices
    columns: Indices
    steps: Indices
    end_rows: Indices
    end_columns: Indices

    @classmethod
    def across(cls, solved: Mask, walls: Mask) -> _Ways:
        """Look from all pixels of walls over walls to what is solved."""
        # What is farther inside a wide wall would see nothing.
        rows, columns = np.nonzero(walls & dilate(solved, REACH))
        steps = np.zeros((len(_DIRECTIONS), len(rows)), dtype=np.intp)
        for number, (down, right) in enumerate(_DIRECTIONS):
            looking = np.arange(len(rows))
            for step in range(1, REACH + 1):
                row, column = rows[looking] + step * down, columns[looking] + step * right
                inside = (row >= 0) & (row < walls.shape[0]) & (column >= 0) & (column < walls.shape[1])
                looking, row, column = looking[inside], row[inside], column[inside]
                steps[number, looking[solved[row, column]]] = step
                looking = looking[walls[row, column]]
        length = np.where(steps > 0, steps * _LENGTHS, np.inf)
        through = (length[0::2] + length[1::2]).repeat(2, axis=0)
        # At the edge of the image or mask there may be something on one side only.
        length = np.where(np.isfinite(through).any(axis=0), through, length)
        steps[length > _ROUGHLY * length.min(axis=0)] = 0
        down, right = _DIRECTIONS.T[..., None]
        return cls(rows, columns, steps, rows + steps * down, columns + steps * right)

    def windows(self, padded: Mask) -> Iterator[tuple[Indices, int, Rows]]:
        """Surroundings of the pixels that see something, of one size at a time.

        Parameters
        ----------
        padded : ndarray of bool, shape (height + 2 MARGIN, width + 2 MARGIN)
            What is solved.

        Yields
        ------
        pixels : ndarray of int, shape (m,)
        radius : int
            So that all ends of their ways are inside.
        surroundings : ndarray of uint32, shape (m, 2 radius + 1)
            What is solved in each row, the first column being the lowest bit.
        """
        radii = self.steps.max(axis=0) + 1
        for radius in np.unique(radii[radii > 1]):
            span = np.arange(2 * radius + 1)
            bits = np.uint32(1) << span.astype(np.uint32)
            near = span + _MARGIN - radius
            pixels = np.flatnonzero(radii == radius)
            for some in np.array_split(pixels, 1 + pixels.size * span.size**2 // _CELLS):
                rows, columns = self.rows[some, None, None], self.columns[some, None, None]
                yield some, int(radius), padded[rows + near[:, None], columns + near] @ bits

    def sides(self, padded: Mask) -> Indices:
        """For each direction the first one that leads to the same side, -1 where there is no way; shape (8, n).

        Ends are on one side when they are joined by solved pixels near by. `padded` is as for :meth:`windows`.
        """
        sides = np.full(self.steps.shape, -1, dtype=np.intp)
        for some, radius, surroundings in self.windows(padded):
            down, right = (radius + self.steps[:, some] * axis[:, None] for axis in _DIRECTIONS.T)
            found = sides[:, some]
            for first in range(len(_DIRECTIONS)):
                fresh = np.flatnonzero((self.steps[first, some] > 0) & (found[first] < 0))
                region = _joined(surroundings[fresh], down[first, fresh], right[first, fresh])
                same = _holds(region, down[:, fresh], right[:, fresh]) & (found[:, fresh] < 0)
                found[:, fresh] = np.where(same, first, found[:, fresh])
            sides[:, some] = found
        return sides


def fill_walls(log_depth: Array, walls: Mask, image: Array, known: Array) -> Discontinuities:
    """Continue the depth onto walls, in place, and tell where the surface is interrupted there.

    From each side log depth and log brightness go on linearly along rows, columns and diagonals, whichever way across
    the wall is short; the depth by the flatter of its last two steps. A pixel belongs to the side that foretells its
    brightness best. The pixels along the wall that lie as deep in it have a say in that too, and a side that is nearer
    by a pixel has a small advantage. What is joined near by is one side: there is only one around the end of a wall.

    Parameters
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Z = ln z, NaN where there is none, and on all walls. Afterwards pixels on walls have a value too, but for those
        that are more than `REACH` from everything with a depth.
    walls : ndarray of bool, shape (height, width)
        Pixels to fill.
    image : ndarray of float64, shape (height, width)
        Brightness of the surface without its albedo, at walls and next to them. Where it is NaN the nearest side is
        taken.
    known : ndarray of float64, shape (n,)
        Z of the pixels on walls, in the order of the image, where it is known, which also tells their side; else NaN.

    Returns
    -------
    discontinuities : Discontinuities
        Between a pixel on a wall and each neighbour that is on another side.
    """
    padded = np.pad(np.isfinite(log_depth), _MARGIN)
    ways = _Ways.across(padded[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN], walls)
    links = _links(ways, walls.shape[1])
    continued = _Continued.along(ways, ways.sides(padded), log_depth, image)
    log_depth[walls] = known
    known = log_depth[ways.rows, ways.columns]
    chosen = continued.choose(links, known)
    depth = continued.log_depth[chosen, np.arange(chosen.size)]
    log_depth[ways.rows, ways.columns] = np.where(np.isfinite(known), known, depth)
    return _cuts(padded, ways, chosen, links)


@dataclass(frozen=True, eq=False)
class _Continued:
    """What each side says of a pixel, repeated for all ways to that side; arrays of shape (8, n).

    Attributes
    ----------
    sides : ndarray of int
        First way to the same side, -1 where there is no way.
    log_depth : ndarray of float64
        Mean over the ways, the shorter ones with more weight; NaN where there is none.
    mismatch : ndarray of float64
        How badly the brightness is foretold along the best way.
    length : ndarray of float64
        Of the shortest way, in pixels.
    """

    sides: Indices
    log_depth: Array
    mismatch: Array
    length: Array

    @classmethod
    def along(cls, ways: _Ways, sides: Indices, log_depth: Array, image: Array) -> _Continued:
        """Continue linearly along each way, then take the ways to one side together."""
        there = sides >= 0
        end, beyond = np.stack([ways.end_rows, ways.end_columns]), _DIRECTIONS.T[..., None]
        last, second, third = (_at(log_depth, *(end + count * beyond)) for count in range(3))
        rise, earlier = last - second, second - third
        # The flatter of the last two: next to an outline the last one is often too steep.
        flatter = np.where(rise * earlier < 0, 0.0, np.where(np.abs(earlier) < np.abs(rise), earlier, rise))
        depth = np.where(there, last + ways.steps * np.nan_to_num(flatter), 0.0)

        lights = image[ways.rows, ways.columns], _at(image, *end), _at(image, *(end + beyond))
        darkest = _DARKEST * lights[1].max(initial=0.0, where=there & np.isfinite(lights[1])) or 1.0
        here, at_end, before = (np.log(np.maximum(light, darkest)) for light in lights)
        change = np.where(np.isfinite(second), np.nan_to_num(at_end - before), 0.0).clip(-_STEEPEST, _STEEPEST)
        length = ways.steps * _LENGTHS
        mismatch = np.nan_to_num(np.abs(at_end + ways.steps * change - here), nan=_WORST).clip(max=_WORST)
        mismatch += _A_PIXEL * length

        # A way without a slope has next to no weight compared with one that has it.
        sloped = np.where(np.isfinite(second), 1.0, 1e-3)
        weight = np.divide(sloped, length**2, out=np.zeros_like(length), where=there)
        together = np.full_like(depth, np.nan), np.full_like(depth, np.inf), np.zeros_like(depth)
        for way in range(len(sides)):
            same = there & (sides == sides[way])
            total = (weight * same).sum(axis=0)
            np.divide((weight * same * depth).sum(axis=0), total, out=together[0][way], where=there[way])
            together[1][way] = mismatch.min(axis=0, where=same, initial=np.inf)
            together[2][way] = length.min(axis=0, where=same, initial=2 * REACH)
        return cls(sides, *together)

    def choose(self, links: Indices, known: Array) -> Indices:
        """A way to the side that a pixel belongs to, shape (n,); `known` is Z where it is known, of shape (n,)."""
        pixels, there = np.arange(self.sides.shape[1]), self.sides >= 0
        near = np.where(there, self.log_depth, np.inf).argmin(axis=0)
        far = np.where(there, self.log_depth, -np.inf).argmax(axis=0)
        two = (self.sides == np.arange(len(self.sides))[:, None]).sum(axis=0) == 2
        lead = np.zeros(pixels.size)
        lead[two] = self.mismatch[far[two], pixels[two]] - self.mismatch[near[two], pixels[two]]
        # How deep in the wall: on one line along it are those for which this is about the same.
        place = self.length[near, pixels] - self.length[far, pixels]
        beside = (links >= 0) & two[links] & (np.abs(place[links] - place) < _A_LINE)
        for _ in range(_SMOOTHINGS):
            lead = (2.0 * lead + np.where(beside, lead[links], 0.0).sum(axis=0)) / (2.0 + beside.sum(axis=0))
        # A wall is the edge of what is in front, more often than not.
        chosen = np.where(two, np.where(lead >= 0, near, far), self.mismatch.argmin(axis=0))
        off = np.where(there, np.abs(self.log_depth - known), np.inf)
        return np.asarray(np.where(np.isfinite(known), off.argmin(axis=0), chosen))


def _at(values: Array, rows: Indices, columns: Indices) -> Array:
    """Values of pixels; NaN outside the image."""
    height, width = values.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    return np.where(inside, values[rows.clip(0, height - 1), columns.clip(0, width - 1)], np.nan)


def _links(ways: _Ways, width: int) -> Indices:
    """Which pixel of a wall lies in each direction of each, -1 where there is none; shape (8, n)."""
    # With a margin of one column no step leads from the end of a row into the next one.
    places = ways.rows * (width + 1) + ways.columns
    wanted = places + (_DIRECTIONS @ (width + 1, 1))[:, None]
    found = np.searchsorted(places, wanted).clip(max=len(places) - 1)
    return np.where(places[found] == wanted, found, -1)


def _joined(passable: Rows, rows: Indices, columns: Indices) -> Rows:
    """What is joined to one pixel in each window by steps along rows and columns; windows as :meth:`_Ways.windows`."""
    joined = np.zeros_like(passable)
    joined[np.arange(len(rows)), rows] = np.uint32(1) << columns.astype(np.uint32)
    while True:
        grown = joined | joined << np.uint32(1) | joined >> np.uint32(1)
        grown[:, 1:] |= joined[:, :-1]
        grown[:, :-1] |= joined[:, 1:]
        grown &= passable
        if (grown == joined).all():
            return joined
        joined = grown


def _holds(windows: Rows, rows: Indices, columns: Indices) -> Mask:
    """Whether windows hold pixels, of which each has one, or one in each line of `rows` and `columns`."""
    return (windows[np.arange(len(windows)), rows] >> columns.astype(np.uint32) & 1).astype(bool)


def _cuts(padded: Mask, ways: _Ways, chosen: Indices, links: Indices) -> Discontinuities:
    """Where pixels of walls are cut from their neighbours, from what is joined to the ends of the chosen ways."""
    pixels = np.arange(chosen.size)
    end_rows, end_columns = ways.end_rows[chosen, pixels], ways.end_columns[chosen, pixels]
    joined = np.zeros((4, chosen.size), dtype=bool)
    for some, radius, surroundings in ways.windows(padded):
        rows, columns = radius - ways.rows[some], radius - ways.columns[some]
        region = _joined(surroundings, end_rows[some] + rows, end_columns[some] + columns)
        for way, (down, right) in enumerate(_DIRECTIONS[:4]):
            # A neighbour on a wall is where the end of its own way is.
            link = links[way, some]
            row = np.where(link >= 0, end_rows[link], ways.rows[some] + down) + rows
            column = np.where(link >= 0, end_columns[link], ways.columns[some] + right) + columns
            inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) <= 2 * radius)
            joined[way, some[inside]] = _holds(region[inside], row[inside], column[inside])
    joined |= (links[:4] >= 0) & joined[[[1], [0], [3], [2]], links[:4]]
    discontinuities = Discontinuities.none((padded.shape[0] - 2 * _MARGIN, padded.shape[1] - 2 * _MARGIN))
    for way, cut in enumerate(
        (discontinuities.right, discontinuities.right, discontinuities.down, discontinuities.down)
    ):
        # Each is marked at the left or upper one of two neighbours.
        rows, columns = np.stack([ways.rows, ways.columns]) + np.minimum(_DIRECTIONS[way], 0)[:, None]
        inside = (np.minimum(rows, columns) >= 0) & (rows < cut.shape[0]) & (columns < cut.shape[1])
        marked = inside & ~joined[way]
        cut[rows[marked], columns[marked]] = True
    return discontinuities
