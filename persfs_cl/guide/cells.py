"""Where a guide says something, and what: cells of a coarse map, or points, on the pixels of an image."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask

_NOWHERE = -1
NEIGHBOURS = 8
"""Of a cell, at most."""
_REACH = 2.0
"""Spacings from a cell within which it is not too far to say anything."""
_MOST = 200_000
"""Cells of a map. What more of them say, the photograph says better."""
_FINE = 3.0
"""Pixels from cell to cell below which there is no need to interpolate."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a guide on an image.

    Attributes
    ----------
    values : ndarray of float64, shape (cells,)
        What the guide says there.
    of_pixel : ndarray of int32, shape (height, width)
        In which cell a pixel lies; negative for none.
    spacing : float
        Pixels from one to the next.
    neighbours : ndarray of int64, shape (cells, NEIGHBOURS)
        The nearest others; negative for none.
    """

    values: Array
    of_pixel: NDArray[np.int32]
    spacing: float
    neighbours: NDArray[np.int64]

    @classmethod
    def of_map(cls, guide: Array, wanted: Mask) -> Cells:
        """Those of a map of the same view, coarser or finer, NaN where it says nothing.

        A finer one is reduced to pixels by medians, and one of very many cells to fewer: their neighbours would take
        several times the memory of the image. Cells without a pixel that is `wanted` are left out.
        """
        shape = wanted.shape
        rows, columns = (min(length, most) for length, most in zip(guide.shape, shape, strict=True))
        edge = math.ceil(math.sqrt(max(1.0, rows * columns / _MOST)))
        rows, columns = -(-rows // edge), -(-columns // edge)
        if (rows, columns) != guide.shape:
            guide = _reduced(guide, (rows, columns))
        down, across = (part_of(length, count) for length, count in zip(shape, guide.shape, strict=True))
        of_pixel = np.where(wanted, down[:, None] * guide.shape[1] + across, _NOWHERE)
        says = ~np.isnan(guide.ravel())
        of_pixel[~says[of_pixel] & (of_pixel >= 0)] = _NOWHERE
        used = np.zeros(guide.size, bool)
        used[of_pixel[of_pixel >= 0]] = True
        number = np.full(guide.size + 1, _NOWHERE)
        number[:-1][used] = np.arange(np.count_nonzero(used))
        steps = [length / count for length, count in zip(shape, guide.shape, strict=True)]
        padded = np.pad(number[:-1].reshape(guide.shape), 1, constant_values=_NOWHERE)
        beside = [
            padded[1 + row : 1 + row + guide.shape[0], 1 + column : 1 + column + guide.shape[1]].ravel()[used]
            for row in (-1, 0, 1)
            for column in (-1, 0, 1)
            if row or column
        ]
        return cls(
            values=guide.ravel()[used],
            of_pixel=number[of_pixel].astype(np.int32),
            spacing=math.sqrt(steps[0] * steps[1]),
            neighbours=np.stack(beside, axis=1),
        )

    @classmethod
    def of_points(cls, columns: Array, rows: Array, values: Array, wanted: Mask) -> Cells:
        """Those of points, of which several in one pixel are one; those outside what is `wanted` are left out."""
        from scipy.spatial import cKDTree  # slow to import

        height, width = wanted.shape
        row, column = np.rint(rows).astype(np.int64), np.rint(columns).astype(np.int64)
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width) & ~np.isnan(values)
        pixel = (row * width + column)[inside]
        pixel, given = pixel[wanted.ravel()[pixel]], values[inside][wanted.ravel()[pixel]]
        pixels, number = np.unique(pixel, return_inverse=True)
        count = len(pixels)
        of_pixel = np.full(wanted.size, _NOWHERE, np.int32)
        of_pixel[pixels] = np.arange(count)
        places = np.stack(np.divmod(pixels, width), axis=1).astype(np.float64)
        neighbours = np.full((count, NEIGHBOURS), _NOWHERE)
        if count > 1:
            found = cKDTree(places).query(places, k=min(NEIGHBOURS + 1, count))[1]
            neighbours[:, : found.shape[1] - 1] = found[:, 1:]
        return cls(
            values=medians(given, number, count),
            of_pixel=of_pixel.reshape(wanted.shape),
            spacing=math.sqrt(np.count_nonzero(wanted) / max(1, count)),
            neighbours=neighbours,
        )

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.values)

    def saying(self, values: Array) -> Cells:
        """The same with other values."""
        return replace(self, values=values)

    def of_surface(self, log_depth: Array) -> Array:
        """Median of a map over the pixels of each cell; NaN where none has a value."""
        there = (self.of_pixel >= 0) & ~np.isnan(log_depth)
        return medians(log_depth[there], self.of_pixel[there], self.count)

    def near_median(self, log_depth: Array, medians_of_cells: Array) -> Mask:
        """The half of the pixels of each cell whose value is nearest to its median, where that is not NaN.

        They are what a median tells of. The others may belong to another part, beyond a jump.
        """
        apart = np.abs(log_depth - self.on_pixels(medians_of_cells, np.nan))
        return np.asarray(apart <= self.on_pixels(self.of_surface(apart), np.nan))

    def beside(self, values: Array) -> Array:
        """What the neighbours have, shape (cells, NEIGHBOURS); NaN for none."""
        return np.append(values, np.nan)[self.neighbours]

    def on_pixels(self, values: Array, elsewhere: float) -> Array:
        """A number of each cell on its pixels, and another where there is none."""
        return np.append(values, elsewhere)[self.of_pixel]

    @cached_property
    def pixels(self) -> NDArray[np.int64]:
        """How many each has."""
        return np.bincount(self.of_pixel[self.of_pixel >= 0], minlength=self.count)

    @property
    def are_points(self) -> bool:
        """Whether none has more than a pixel."""
        return int(self.pixels.max(initial=0)) <= 1

    @property
    def differing(self) -> float:
        """By how much the values of neighbours differ, as a rule; 0 where there are none."""
        apart = np.abs(self.beside(self.values) - self.values[:, None])
        return 0.0 if np.isnan(apart).all() else float(np.nanmedian(apart))

    def cut(self, window: Callable[[NDArray[Any]], NDArray[Any]]) -> Cells:
        """The same on a part of the image."""
        return replace(self, of_pixel=window(self.of_pixel))

    @cached_property
    def middles(self) -> Array:
        """Row and column in the middle of the pixels of each, shape (cells, 2); NaN where it has none."""
        pixels = np.flatnonzero(self.of_pixel >= 0)
        numbers = self.of_pixel.ravel()[pixels]
        places = np.divmod(pixels, self.of_pixel.shape[1])
        with np.errstate(invalid="ignore"):
            return np.stack(
                [np.bincount(numbers, along, minlength=self.count) / self.pixels for along in places], axis=1
            )

    def nearest(self, values: Array) -> tuple[Array, Array]:
        """At each pixel the value of the nearest cell that has one, and how far away that is; there is one at least."""
        from scipy.ndimage import distance_transform_edt  # slow to import

        placed = self.on_pixels(values, np.nan)
        distances, nearest = distance_transform_edt(np.isnan(placed), return_indices=True)
        return np.asarray(placed[tuple(nearest)]), np.asarray(distances)

    @property
    def reach(self) -> float:
        """Pixels from a cell within which it says something: of what is farther away nothing is known."""
        return _REACH * max(1.0, self.spacing)

    def reached(self, chosen: Mask) -> Mask:
        """Pixels within reach of some cells."""
        from scipy.ndimage import distance_transform_edt  # slow to import

        speaks = np.append(chosen, False)[self.of_pixel] & (self.of_pixel >= 0)
        if not speaks.any():
            return speaks
        return np.asarray(distance_transform_edt(~speaks) <= self.reach)

    def interpolated(self, values: Array) -> Array:
        """A map through the values of the cells: linear between their middles, the nearest outside; not NaN."""
        from scipy.interpolate import LinearNDInterpolator  # slow to import
        from scipy.spatial import QhullError

        known = ~np.isnan(values) & ~np.isnan(self.middles).any(axis=1)
        found, _ = self.nearest(np.where(known, values, np.nan))
        if self.spacing < _FINE:
            return found
        try:
            linear = LinearNDInterpolator(self.middles[known], values[known])
        except QhullError:
            # Fewer than three, or all on a line.
            return found
        height, width = self.of_pixel.shape
        between = linear(*np.ogrid[:height, :width])
        return np.where(np.isnan(between), found, between)


def medians(values: Array, groups: NDArray[np.integer], count: int) -> Array:
    """Median of the values of each of `count` groups; NaN where there is none. Of two in the middle their mean."""
    order = np.argsort(values)
    order = order[np.argsort(groups[order], kind="stable")]
    ordered = np.append(values[order], np.nan)
    sizes = np.bincount(groups, minlength=count)
    begins = np.cumsum(sizes) - sizes
    middle = 0.5 * (
        ordered[np.minimum(begins + np.maximum(sizes - 1, 0) // 2, len(values))]
        + ordered[np.minimum(begins + sizes // 2, len(values))]
    )
    return np.where(sizes > 0, middle, np.nan)


def part_of(length: int, count: int) -> NDArray[np.int64]:
    """In which of so many equal parts of a length each of its pixels has its middle."""
    return ((2 * np.arange(length) + 1) * count) // (2 * length)


def _reduced(guide: Array, shape: tuple[int, int]) -> Array:
    """A map with fewer pixels, by medians; NaN where there is nothing."""
    down, across = (part_of(count, length) for count, length in zip(guide.shape, shape, strict=True))
    groups = down[:, None] * shape[1] + across
    there = ~np.isnan(guide)
    return medians(guide[there], groups[there], shape[0] * shape[1]).reshape(shape)
