"""Sets of pixels: neighbours, rims, what is connected, and the flags that tell the kernels of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Mask
from persfs_cl.blocks import row_blocks

# Bits of a cell's flags; kernels/shared/prelude.cl gives them the same values.
SWEPT, NO_LEFT, NO_RIGHT, NO_UP, NO_DOWN = 1, 2, 4, 8, 16
LACKING = NO_LEFT | NO_RIGHT | NO_UP | NO_DOWN
"""All that say that a neighbour is missing."""

NOWHERE = 1e30
"""Value of a cell that is not there, for schemes that only want it to be high; as in kernels/shared/prelude.cl."""

NONE = -1
"""Index that stands for "does not look along this axis" in :attr:`persfs_cl.solver.domain.Boundary.inwards`."""


_MANY = 0.5
"""Share of the blocks: to look at the pixels of more of them, block by block, takes longer than at all pixels."""

Steps = NDArray[np.int16] | NDArray[np.int32]


@dataclass(frozen=True)
class Neighbours:
    """For every pixel, whether its neighbour on each side satisfies a predicate; nothing outside does."""

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


def rim(pixels: Mask) -> Mask:
    """Pixels of a set that have a neighbour outside it or outside the image."""
    return pixels & ~Neighbours.of(pixels).all


def missing_neighbours(present: Mask) -> NDArray[np.uint8]:
    """Flags NO_LEFT, NO_RIGHT, NO_UP and NO_DOWN of every pixel."""
    flags = np.zeros(present.shape, np.uint8)
    if present.all():
        for bit, edge in ((NO_LEFT, np.s_[:, 0]), (NO_RIGHT, np.s_[:, -1]), (NO_UP, np.s_[0]), (NO_DOWN, np.s_[-1])):
            flags[edge] |= np.uint8(bit)
        return flags
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


class StraightSteps:
    """Fewest steps along rows and columns from a seed to pixels, whatever lies between."""

    def __init__(self, seeds: Mask) -> None:
        self._seeds = seeds

    @cached_property
    def _along_columns(self) -> Steps:
        """From the seeds of a pixel's column alone, found when first asked for."""
        height, width = self._seeds.shape
        farthest = height + width
        kind = np.dtype(np.int16 if farthest <= np.iinfo(np.int16).max else np.int32)
        rows = np.arange(height, dtype=kind)[:, None]
        steps = np.full(self._seeds.shape, farthest, kind)
        steps[self._seeds] = 0
        for lines in (steps, steps[::-1]):
            # What is one step longer in each row is the same less its row.
            np.subtract(lines, rows, out=lines)
            for before, line in pairwise(lines):
                np.minimum(line, before, out=line)
            np.add(lines, rows, out=lines)
        return steps

    def to(self, rows: slice, columns: slice, most: int | None = None) -> Steps:
        """To the pixels of some neighbouring rows and columns, from each of which a seed is at `most` so far away."""
        width = self._seeds.shape[1]
        begin, end, _ = columns.indices(width)
        first, last = (0, width) if most is None else (max(0, begin - most), min(width, end + most))
        lines = self._along_columns[rows]
        rightwards = self._from_left(lines[:, first:end], begin - first)
        leftwards = self._from_left(lines[:, begin:last][:, ::-1], last - end)
        steps: Steps = np.minimum(rightwards, leftwards[:, ::-1], out=rightwards)
        return steps

    @staticmethod
    def _from_left(lines: NDArray[Any], begin: int) -> NDArray[Any]:
        """From seeds of the same column or of one before it, to the columns from that one on."""
        columns = np.arange(lines.shape[1], dtype=lines.dtype)
        steps = lines - columns
        if begin:
            np.minimum(steps[:, begin], steps[:, :begin].min(axis=1), out=steps[:, begin])
        steps = np.minimum.accumulate(steps[:, begin:], axis=1)
        steps += columns[begin:]
        return steps


def straight_steps_from(seeds: Mask) -> Steps:
    """See :class:`StraightSteps`, to each pixel."""
    height, width = seeds.shape
    return StraightSteps(seeds).to(slice(0, height), slice(0, width))


def steps_to_blocks(seeds: Mask, side: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """For each block of side x side pixels no more, and no less, than the fewest steps from a seed to any pixel of it.

    Found much sooner than :func:`straight_steps_from`. Without a seed they have no meaning.
    """
    steps = side * straight_steps_from(in_square_blocks(np.logical_or, seeds, side)).astype(np.int32)
    # Within the first and the last block of a way there may be no step to go, or all of its rows and columns.
    within = 2 * (side - 1)
    return np.maximum(steps - within, 0), steps + within


def in_square_blocks(reduction: np.ufunc, values: NDArray[Any], side: int) -> NDArray[Any]:
    """Reduce each block of side x side pixels, those at the ends of rows and columns being smaller, to one value."""
    height, width = values.shape
    rows = [reduction.reduce(values[top : top + side], axis=0) for top in range(0, height, side)]
    return np.asarray(reduction.reduceat(np.stack(rows), range(0, width, side), axis=1))


def stretches_of_blocks(blocks: Mask, side: int) -> Iterator[tuple[slice, slice]]:
    """Rows and columns of pixels of the blocks of a set, those next to each other in a row of blocks together."""
    padded = np.zeros((blocks.shape[0], blocks.shape[1] + 2), bool)
    padded[:, 1:-1] = blocks
    rows, bounds = np.nonzero(padded[:, 1:] != padded[:, :-1])
    for row, begin, end in zip(rows[::2].tolist(), bounds[::2].tolist(), bounds[1::2].tolist(), strict=True):
        yield slice(row * side, (row + 1) * side), slice(begin * side, end * side)


def of_blocks(values: NDArray[Any], side: int, shape: tuple[int, ...]) -> NDArray[Any]:
    """For each pixel of an image of that shape the value of its block of side x side pixels."""
    height, width = shape
    return np.repeat(np.repeat(values, side, axis=1)[:, :width], side, axis=0)[:height]


def decided_by_blocks(
    looked_at: Mask, all_of: Mask, undecided: Mask, side: int, look: Callable[[tuple[slice, slice]], Mask]
) -> Mask:
    """A set of pixels that blocks of side x side pixels decide, for the most part.

    Parameters
    ----------
    looked_at : ndarray of bool, shape (height, width)
        No others belong to it.
    all_of, undecided : ndarray of bool, one for each block
        Blocks of which all pixels belong to it, and those whose pixels must be looked at.
    look : callable
        Which pixels of some rows and columns belong to it.
    """
    found: Mask = looked_at & of_blocks(all_of, side, looked_at.shape)
    parts = stretches_of_blocks(undecided, side)
    if np.count_nonzero(undecided) > _MANY * undecided.size:
        parts = ((rows, slice(None)) for rows in row_blocks(looked_at.shape))
    for part in parts:
        np.logical_and(looked_at[part], look(part), out=found[part])
    return found


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
