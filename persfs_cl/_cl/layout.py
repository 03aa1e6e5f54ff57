"""How an image lies in device memory: padding all round, and the order of the columns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.registers import WIDEST
from persfs_cl.blocks import in_row_blocks
from persfs_cl.masks import NONE

ALIGNMENT = 64
"""Bytes: vectors of an array that begins at a multiple of this do not lie across cache lines."""


def aligned(size: int) -> NDArray[np.uint8]:
    """So many bytes, not set to anything, in an array that begins at a multiple of :data:`ALIGNMENT`."""
    room = np.empty(size + ALIGNMENT, np.uint8)
    begin = -room.ctypes.data % ALIGNMENT
    return room[begin : begin + size]


@dataclass(frozen=True)
class Layout:
    """Place of a (height, width) image within its stored array of (rows, stride).

    Attributes
    ----------
    height, width : int
        Of the largest image.
    rows, stride : int
        Stored rows and columns.
    first_row, first_column : int
        Where the image begins.
    apart : bool
        Even columns are stored before odd ones.
    """

    height: int
    width: int
    rows: int
    stride: int
    first_row: int
    first_column: int
    apart: bool = False

    @classmethod
    def padded(cls, shape: tuple[int, int], rows: int, columns: int) -> Layout:
        """Rows and columns in their order, with so many more on every side."""
        height, width = shape
        # Rows of whole vectors, so that the stored size is one too.
        stride = -(-(width + 2 * columns) // WIDEST) * WIDEST
        return cls(height, width, height + 2 * rows, stride, rows, columns)

    @classmethod
    def columns_apart(cls, shape: tuple[int, int], lanes: int) -> Layout:
        """Even columns before odd ones; each half is padded, whole vectors long, and followed by a gap."""
        height, width = shape
        # A vector's worth between the halves is never written: cells at their ends look there for a neighbour.
        half = -(-(width // 2 + 2) // lanes) * lanes + max(lanes, 4)
        return cls(height, width, height + 2, 2 * half, 1, 2, apart=True)

    @property
    def size(self) -> int:
        """Stored cells."""
        return self.rows * self.stride

    @property
    def parity(self) -> int:
        """That of stored row + column of the first pixel."""
        return (self.first_row + self.first_column) % 2

    @property
    def _columns(self) -> NDArray[np.intp]:
        """Stored column of every column of the image."""
        columns = np.arange(self.first_column, self.first_column + self.width)
        return columns % 2 * (self.stride // 2) + columns // 2 if self.apart else columns

    def store(
        self,
        images: Sequence[Callable[[slice], NDArray[Any]]],
        fill: float,
        kind: np.dtype[Any],
        shapes: Sequence[tuple[int, ...]],
    ) -> NDArray[Any]:
        """The stored arrays of images given by blocks of their rows, `fill` in the padding.

        Images of fewer rows or columns have more padding after them.
        """
        (stored,) = self.store_copies(1, images, fill, kind, shapes)
        return stored

    def store_copies(
        self,
        copies: int,
        images: Sequence[Callable[[slice], NDArray[Any]]],
        fill: float,
        kind: np.dtype[Any],
        shapes: Sequence[tuple[int, ...]],
    ) -> list[NDArray[Any]]:
        """The same as several arrays, each of which is written while the rows are in the cache."""
        size = len(images) * self.size * kind.itemsize
        stored = [aligned(size).view(kind).reshape(-1, self.rows, self.stride) for _ in range(copies)]
        for number, (image, (height, width)) in enumerate(zip(images, shapes, strict=True)):
            lines = [each[number, self.first_row :] for each in stored]
            for each, below in zip(stored, lines, strict=True):
                each[number, : self.first_row] = fill
                below[height:] = fill
            in_row_blocks(partial(self._store, image, lines, width, fill), (height, width))
        return stored

    def _store(
        self,
        image: Callable[[slice], NDArray[Any]],
        lines: Sequence[NDArray[Any]],
        width: int,
        fill: float,
        rows: slice,
    ) -> None:
        """Some rows of an image."""
        block, stored, end = image(rows), lines[0][rows], 0
        for begin, columns in self._parts(width):
            part = block[:, columns]
            stored[:, end:begin] = fill
            end = begin + part.shape[1]
            stored[:, begin:end] = part
        stored[:, end:] = fill
        for other in lines[1:]:
            other[rows] = stored

    def take(self, stored: NDArray[Any], image: NDArray[Any]) -> None:
        """Copy what `store` has stored into an image."""
        height, width = image.shape
        lines = stored[self.first_row : self.first_row + height]
        for begin, columns in self._parts(width):
            part = image[:, columns]
            part[:] = lines[:, begin : begin + part.shape[1]]

    def _parts(self, width: int) -> list[tuple[int, slice]]:
        """Where stretches of stored columns begin, and the columns of an image of that width that they hold."""
        if not self.apart:
            return [(self.first_column, slice(0, width))]
        # Two strided copies are many times faster than one by an array of column numbers.
        begin = self.first_column // 2
        return [(begin + parity * (self.stride // 2), slice(parity, width, 2)) for parity in (0, 1)]

    def cells(self, pixels: NDArray[np.integer], width: int) -> NDArray[np.int32]:
        """Stored indices of flat indices in an image of a width; :data:`persfs_cl.masks.NONE` stays."""
        rows, columns = np.divmod(pixels, width)
        stored = (rows + self.first_row) * self.stride + self._columns[columns]
        return np.where(pixels == NONE, NONE, stored).astype(np.int32)

    def column_table(self, table: NDArray[np.float64], *, reversed_too: bool) -> NDArray[np.float64]:
        """Numbers of the columns, shape (n, width), as stored: (n, stride), or (2 n, stride) with reversed copies."""
        stored = np.repeat(table[:, -1:], self.stride, axis=1)
        stored[:, self._columns[: table.shape[1]]] = table
        return np.concatenate([stored, stored[:, ::-1]]) if reversed_too else stored

    def row_table(self, table: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of the rows, shape (n, height), as stored: (n, rows)."""
        after = self.rows - self.first_row - table.shape[1]
        return np.pad(table, ((0, 0), (self.first_row, after)), mode="edge")
