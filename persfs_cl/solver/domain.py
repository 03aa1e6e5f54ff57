"""Which pixels are solved, known, out of reach, or on the boundary: the geometry of one problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl.blocks import row_blocks
from persfs_cl.errors import InputError

Mask = NDArray[np.bool_]

# Bits of a cell's flags; kernels/shared/prelude.cl gives them the same values.
SWEPT, NO_LEFT, NO_RIGHT, NO_UP, NO_DOWN = 1, 2, 4, 8, 16

NOWHERE = 1e30
"""Value of a cell that is not there, for schemes that only want it to be high; as in kernels/shared/prelude.cl."""

NONE = -1
"""Index that stands for "does not look along this axis" in :attr:`Boundary.inwards`."""


@dataclass(frozen=True)
class Neighbours:
    """For every pixel, whether the pixel beside it satisfies a predicate; nothing outside does."""

    left: Mask
    right: Mask
    up: Mask
    down: Mask

    @classmethod
    def of(cls, pixels: Mask, rows: slice = slice(None)) -> Neighbours:
        """Look at `pixels`, or some rows of them, from each of the four sides."""
        begin, end, _ = rows.indices(len(pixels))
        above, below = min(begin, 1), min(len(pixels) - end, 1)
        padded = np.zeros((end - begin + 2, pixels.shape[1] + 2), bool)
        padded[1 - above : len(padded) - 1 + below, 1:-1] = pixels[begin - above : end + below]
        return cls(padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1])

    @property
    def any(self) -> Mask:
        """Pixels with at least one such neighbour."""
        return self.left | self.right | self.up | self.down

    @property
    def all(self) -> Mask:
        """Pixels with four such neighbours."""
        return self.left & self.right & self.up & self.down


@dataclass(frozen=True)
class Boundary:
    """Cells renewed from inside after each sweep, eq. (12), instead of being swept.

    Attributes
    ----------
    cells : ndarray of int32, shape (edges + corners,)
        Flat indices.
    inwards : ndarray of int32, shape (edges + corners, 4)
        Next and second next cell inwards along x, then along y; :data:`NONE` where a cell does not look that way.
    edges, corners : int
        Edges look at cells that are not renewed themselves; corners, which come last, look along an edge.
    """

    cells: NDArray[np.int32]
    inwards: NDArray[np.int32]
    edges: int
    corners: int


@dataclass(frozen=True)
class Domain:
    """The geometry of one problem.

    Attributes
    ----------
    known : ndarray of bool, shape (height, width)
        Pixels that keep their value.
    solved : ndarray of bool, shape (height, width)
        Pixels that a known value can reach and that get a value, swept or renewed.
    unreached : ndarray of bool, shape (height, width)
        Pixels that were to be solved but are cut off from every known value.
    flags : ndarray of uint8, shape (height, width)
        For the kernels: which cells are swept and which neighbours are missing.
    boundary : Boundary
    """

    known: Mask
    solved: Mask
    unreached: Mask
    flags: NDArray[np.uint8]
    boundary: Boundary


def rim(pixels: Mask) -> Mask:
    """Pixels of a set that have a neighbour outside it or outside the image."""
    return pixels & ~Neighbours.of(pixels).all


def lay_out(wanted: Mask, known: Mask, walls: Mask | None, boundary: str, *, needs_known: bool = True) -> Domain:
    """Classify the pixels of a problem.

    Parameters
    ----------
    wanted : ndarray of bool, shape (height, width)
        Pixels to solve.
    known : ndarray of bool, shape (height, width)
        Pixels whose depth is given, inside or outside `wanted`.
    walls : ndarray of bool, shape (height, width), or None
        Pixels that nothing crosses; they get no value.
    boundary : {"outflow", "extrapolate", "fixed", "wall"}
    needs_known : bool
        False where the image alone determines the depth: then all pixels are solved.

    Raises
    ------
    InputError
        When there is nothing to solve, no known value can reach any pixel, or ``boundary="fixed"`` lacks values.
    """
    unknown = wanted & ~known
    if walls is not None:
        known, unknown = known & ~walls, unknown & ~walls
    if not unknown.any():
        raise InputError(
            f"There is nothing to solve: of {wanted.size} pixels {int(known.sum())} are known, "
            f"{int((~wanted).sum())} masked out and {0 if walls is None else int(walls.sum())} walls. "
            "Leave some pixels unknown (NaN)."
        )
    if needs_known and not known.any():
        raise InputError("No depth is known: give known_depth at least one finite value that is not behind a wall.")
    reached = unknown & connected(known, unknown | known) if needs_known else unknown
    if not reached.any():
        raise InputError(
            f"None of the {int(known.sum())} known depths can reach the {int(unknown.sum())} pixels to solve: "
            "give a known depth inside the mask or beside it."
        )
    present = reached | known
    flags = missing_neighbours(present)
    if boundary == "fixed":
        open_rim = int(np.count_nonzero(flags[reached]))
        if open_rim:
            raise InputError(
                f"boundary='fixed' needs a known depth on every edge pixel of the image and mask, but {open_rim} "
                "have none: add them to known_depth, or use boundary='outflow'."
            )
    renewed = (
        _boundary(reached, known, present)
        if boundary in ("outflow", "extrapolate")
        else Boundary(np.empty(0, np.int32), np.empty((0, 4), np.int32), 0, 0)
    )
    np.bitwise_or(flags, SWEPT, out=flags, where=reached)
    flags.ravel()[renewed.cells] ^= SWEPT
    return Domain(
        known=known,
        solved=reached,
        unreached=unknown & ~reached,
        flags=flags,
        boundary=renewed,
    )


def missing_neighbours(present: Mask) -> NDArray[np.uint8]:
    """Flags NO_LEFT, NO_RIGHT, NO_UP and NO_DOWN of every pixel."""
    flags = np.zeros(present.shape, np.uint8)
    for rows in row_blocks(present.shape):
        beside = Neighbours.of(present, rows)
        sides = ((NO_LEFT, beside.left), (NO_RIGHT, beside.right), (NO_UP, beside.up), (NO_DOWN, beside.down))
        for bit, there in sides:
            flags[rows] |= ~there * np.uint8(bit)
    return flags


def connected(seeds: Mask, passable: Mask) -> Mask:
    """Pixels joined to a seed by steps along rows and columns through passable pixels, seeds included.

    What is joined is found among the runs of passable pixels in rows, which are far fewer than the pixels.
    """
    if passable.all():
        return passable if seeds.any() else seeds
    height, width = passable.shape
    stride = width + 1

    def in_line(pixels: Mask) -> Mask:
        """Row after row, with a blocked pixel before each and at the end, so that runs end with their rows."""
        line = np.zeros(height * stride + 1, bool)
        line[:-1].reshape(height, stride)[:, 1:] = pixels
        return line

    line = in_line(passable)
    bounds = np.flatnonzero(line[1:] != line[:-1]) + 1
    begins, ends = bounds[0::2], bounds[1::2]
    # In the next row a run touches those that end behind its begin and begin before its end.
    first, behind = np.searchsorted(ends, begins + stride, side="right"), np.searchsorted(begins, ends + stride)
    touched = behind - first
    upper = np.repeat(np.arange(begins.size), touched)
    lower = np.arange(upper.size) + np.repeat(first - (np.cumsum(touched) - touched), touched)
    groups = _groups(begins.size, upper, lower)

    seeded = np.logical_or.reduceat(in_line(seeds & passable), bounds)[0::2]
    reached = np.zeros(bounds.size + 1, bool)
    reached[1::2] = np.isin(groups, groups[seeded])
    pixels = np.repeat(reached, np.diff(bounds, prepend=0, append=line.size))
    return np.ascontiguousarray(pixels[:-1].reshape(height, stride)[:, 1:])


def _groups(count: int, one: NDArray[np.intp], other: NDArray[np.intp]) -> NDArray[np.intp]:
    """For each of so many nodes the lowest of those that edges join it to; an edge leads from `one` to `other`."""
    groups = np.arange(count)
    while one.size:
        one, other = groups[one], groups[other]
        apart = one != other
        one, other = one[apart], other[apart]
        np.minimum.at(groups, np.maximum(one, other), np.minimum(one, other))
        while (groups[groups] != groups).any():
            groups = groups[groups]
    return groups


def steps_from(seeds: Mask, passable: Mask) -> NDArray[np.int32]:
    """Fewest steps along rows and columns from a seed to each pixel through passable ones; -1 where there is no way."""
    padded = np.pad(passable, 1)
    width = padded.shape[1]
    # Flat and padded, so that a neighbour is an offset and no step leaves the image.
    steps = np.full(padded.size, -1, np.int32)
    free = padded.ravel().copy()
    frontier = np.flatnonzero(np.pad(seeds, 1))
    count = 0
    while frontier.size:
        steps[frontier] = count
        free[frontier] = False
        beside = np.concatenate([frontier - 1, frontier + 1, frontier - width, frontier + width])
        beside = beside[free[beside]]
        # Each only once: of the numbers that a pixel is given one stays.
        numbers = np.arange(beside.size)
        steps[beside] = numbers
        frontier = beside[steps[beside] == numbers]
        count += 1
    return np.ascontiguousarray(steps.reshape(padded.shape)[1:-1, 1:-1])


def _boundary(reached: Mask, known: Mask, present: Mask) -> Boundary:
    """Choose the cells that eq. (12) renews.

    A rim cell looks inwards along each axis on which just one neighbour is missing. Cells that no chain of looks
    joins to a swept cell (strips of one or two pixels) are swept like all others, and so are those beside known values
    that no inner cell would hear: a known corner of the image, say.
    """
    height, width = reached.shape
    beside = Neighbours.of(present)
    on_rim = reached & ~beside.all
    heard = connected(known & Neighbours.of(reached & ~on_rim).any, known)
    rows, columns = np.nonzero(on_rim & ~Neighbours.of(known & ~heard).any)
    index = rows * width + columns

    looks = []
    for before, after, line, length, stride in (
        (beside.left, beside.right, columns, width, 1),
        (beside.up, beside.down, rows, height, width),
    ):
        has_before, has_after = before[rows, columns], after[rows, columns]
        step = has_after.astype(np.int64) - has_before.astype(np.int64)
        near = np.where(step != 0, index + step * stride, NONE)
        second = line + 2 * step
        inside = (step != 0) & (second >= 0) & (second < length)
        far = np.where(inside, index + 2 * step * stride, NONE)
        far = np.where(inside & present.ravel()[far], far, near)
        looks.append((near, far))

    def take(goals: Mask) -> NDArray[np.int64]:
        """Looks whose next cell is one of `goals`, as (near x, far x, near y, far y)."""
        good = [(near != NONE) & goals.ravel()[near] for near, _ in looks]
        return np.stack(
            [np.where(ok, cell, NONE) for ok, pair in zip(good, looks, strict=True) for cell in pair], axis=1
        )

    edge_looks = take(present & ~on_rim)
    is_edge = (edge_looks != NONE).any(axis=1)
    edge_pixels = np.zeros_like(reached)
    edge_pixels[rows[is_edge], columns[is_edge]] = True
    corner_looks = take(edge_pixels)
    is_corner = ~is_edge & (corner_looks != NONE).any(axis=1)
    return Boundary(
        cells=np.concatenate([index[is_edge], index[is_corner]]).astype(np.int32),
        inwards=np.concatenate([edge_looks[is_edge], corner_looks[is_corner]]).astype(np.int32),
        edges=int(is_edge.sum()),
        corners=int(is_corner.sum()),
    )
