"""The part of an image that a problem needs: rows and columns, without those that have nothing to do with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.grid import PixelGrid
from persfs_cl.masks import NONE

Stretches = tuple[slice, ...]

_COLOURS = 6
"""Rows and columns are left out by so many at a time: the colour of a pixel, row + column modulo 2 or 3, stays."""

_WORTH_IT = 7 / 8
"""A part that is a larger share of the image than this is not cut out: the results would have to be put back."""

_LEAST_GAP = 24
"""What lies between two stretches is kept where it is less than this: one stretch is copied faster than two."""


@dataclass(frozen=True)
class Window:
    """Rows and columns of an image.

    What is solved within them is solved as in the image, bit for bit: what is left out is neither solved nor known to
    what is, the order of the rest stays, and so does the colour of each pixel.

    Attributes
    ----------
    image_shape : (int, int)
    rows, columns : tuple of slice
        Stretches of them, in their order, with something left out between any two.
    """

    image_shape: tuple[int, int]
    rows: Stretches
    columns: Stretches

    @classmethod
    def whole(cls, image_shape: tuple[int, int]) -> Window:
        """All rows and columns."""
        height, width = image_shape
        return cls(image_shape, (slice(0, height),), (slice(0, width),))

    @classmethod
    def around(cls, pixels: Mask, margin: int) -> Window:
        """Those of some pixels, of which there is one at least, and so many next to them; all where few are others."""
        height, width = pixels.shape
        rows, columns = (_stretches(np.asarray(pixels.any(axis=axis)), margin) for axis in (1, 0))
        found = cls((height, width), rows, columns)
        cells = found.shape[0] * found.shape[1]
        return found if cells <= _WORTH_IT * pixels.size else cls.whole((height, width))

    @property
    def shape(self) -> tuple[int, int]:
        """Of the part."""
        return _length(self.rows), _length(self.columns)

    @property
    def is_whole(self) -> bool:
        """Whether it is the image itself."""
        return self.shape == self.image_shape

    def cut(self, image: NDArray[Any]) -> NDArray[Any]:
        """The part of an image: where it is in one piece, a view."""
        bands = [_joined([image[rows, columns] for columns in self.columns], axis=1) for rows in self.rows]
        return _joined(bands, axis=0)

    def spread(self, part: NDArray[Any], fill: float) -> NDArray[Any]:
        """The part within the image, `fill` around it; the very array where it is the whole."""
        if self.is_whole:
            return part
        if fill:
            image = np.empty(self.image_shape, part.dtype)
            in_row_blocks(lambda rows: image[rows].fill(fill), self.image_shape)
        else:
            # Memory that the system hands out as zeros is not touched.
            image = np.zeros(self.image_shape, part.dtype)
        self.paste(part, image)
        return image

    def paste(self, part: NDArray[Any], image: NDArray[Any]) -> None:
        """Put the part into the image."""
        for rows, rows_of_part in _places(self.rows):
            for columns, columns_of_part in _places(self.columns):
                image[rows, columns] = part[rows_of_part, columns_of_part]

    def grid(self, grid: PixelGrid) -> PixelGrid:
        """The coordinates of the part, from those of the image."""
        x = _joined([grid.x[columns] for columns in self.columns], axis=0)
        y = _joined([grid.y[rows] for rows in self.rows], axis=0)
        return PixelGrid(x, y, grid.dx, grid.dy)

    def pixels(self, pixels: NDArray[np.int32]) -> NDArray[np.int32]:
        """Flat indices in the part, from those in the image, of pixels that are in it; NONE stays."""
        height, width = self.image_shape
        row, column = np.divmod(pixels, width)
        found = _numbers(self.rows, height)[row] * self.shape[1] + _numbers(self.columns, width)[column]
        return np.where(pixels == NONE, NONE, found).astype(np.int32)


def _stretches(used: NDArray[np.bool_], margin: int) -> Stretches:
    places = np.flatnonzero(used)
    last = np.flatnonzero(np.diff(places) > 2 * margin + _LEAST_GAP)
    begins, ends = places[np.r_[0, last + 1]] - margin, places[np.r_[last, -1]] + margin + 1
    found: list[slice] = []
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        before = found[-1].stop if found else 0
        found.append(slice(max(0, begin - (begin - before) % _COLOURS), min(end, used.size)))
    return tuple(found)


def _length(stretches: Stretches) -> int:
    return sum(stretch.stop - stretch.start for stretch in stretches)


def _places(stretches: Stretches) -> Iterator[tuple[slice, slice]]:
    """Each stretch in the image, and in the part."""
    ends = np.cumsum([0, *(stretch.stop - stretch.start for stretch in stretches)]).tolist()
    for stretch, (begin, end) in zip(stretches, pairwise(ends), strict=True):
        yield stretch, slice(begin, end)


def _numbers(stretches: Stretches, length: int) -> NDArray[np.int64]:
    """Of each row of the image that of the part, or NONE."""
    numbers = np.full(length, NONE, np.int64)
    for stretch, place in _places(stretches):
        numbers[stretch] = np.arange(place.start, place.stop)
    return numbers


def _joined(parts: list[NDArray[Any]], axis: int) -> NDArray[Any]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=axis)
