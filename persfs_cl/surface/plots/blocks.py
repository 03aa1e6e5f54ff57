"""Maps for drawings: fewer numbers than pixels, more than the figure has dots."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks

MAP_SAMPLES = 1000
_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True)
class Blocks:
    """Blocks of pixels of an image, one for each number that is drawn; at its right and lower ends they may be smaller.

    Attributes
    ----------
    shape : tuple of int
        (height, width) of the image.
    """

    shape: tuple[int, int]

    @property
    def down(self) -> int:
        """Height of a block, in pixels."""
        return max(1, self.shape[0] // MAP_SAMPLES)

    @property
    def right(self) -> int:
        """Width of a block, in pixels."""
        return max(1, self.shape[1] // MAP_SAMPLES)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper end of all blocks, in pixels."""
        height, width = (
            -(-size // step) * step for size, step in zip(self.shape, (self.down, self.right), strict=True)
        )
        return -0.5, width - 0.5, height - 0.5, -0.5

    def rows(self) -> Iterator[slice]:
        """Rows of the image, some at a time, of whole blocks."""
        for rows in row_blocks((-(-self.shape[0] // self.down), self.down * self.shape[1])):
            yield slice(rows.start * self.down, min(rows.stop * self.down, self.shape[0]))

    def means(self, values: Array) -> Array:
        """Mean of each block over what is not NaN, of all rows or of some."""
        if self.down == self.right == 1:
            return values
        total = self.combined(np.add, values)
        if not np.isnan(total).any():
            rows, columns = map(_sizes, values.shape, (self.down, self.right))
            return np.asarray(total / (rows[:, None] * columns))
        there = ~np.isnan(values)
        total = self.combined(np.add, np.where(there, values, 0.0))
        count = self.combined(np.add, there.astype(np.float64))
        return np.asarray(np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0))

    def combined(self, combine: np.ufunc, values: NDArray[_Number]) -> NDArray[_Number]:
        """One number for every block, of all rows or of some."""
        # Rows first: each is one piece of memory.
        return _folded(combine, _folded(combine, values, self.down).T, self.right).T

    def collected(self, numbers: Callable[[slice], Array]) -> Array:
        """What a function makes of rows of whole blocks, for the whole image."""
        return np.concatenate([numbers(rows) for rows in self.rows()])


def _sizes(size: int, step: int) -> Array:
    """How many there are in each step."""
    return np.asarray(np.diff(np.r_[0:size:step, size]), dtype=np.float64)


def _folded(combine: np.ufunc, values: NDArray[_Number], step: int) -> NDArray[_Number]:
    """So many neighbours along the first axis made one, and what is left at the end."""
    whole = len(values) // step * step
    found = values[:whole:step].copy(order="K")
    for offset in range(1, step):
        combine(found, values[offset:whole:step], out=found)
    if whole == len(values):
        return found
    return np.concatenate([found, combine.reduce(values[whole:], axis=0, keepdims=True)])
