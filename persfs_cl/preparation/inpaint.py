"""Laplace's equation on any set of pixels, in a time that grows as their number.

Conjugate gradients alone need as many steps as the set is wide. Here each step begins on grids of 2 x 2, 4 x 4, ...
pixels, where few numbers tell the smooth part of an error (multigrid by aggregation: D. Braess, Computing 55, 1995,
pp. 379-393).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array, Indices, Mask

_TOLERANCE = 1e-12
"""Residual of the equations, as a share of their right-hand side."""
_DAMPING = 0.9
_FEWEST = 64
"""Cells below which no coarser grid is worth its while."""
_STIFFNESS = 0.5
"""Between cells twice as wide there are twice as many links, but the same difference lies over twice the way."""


@dataclass(frozen=True, eq=False)
class _Grid:
    """Links between cells: diagonal[i] x[i] - Σ weights[k, i] x[beside[k, i]] = right-hand side.

    Attributes
    ----------
    beside : ndarray of int, shape (4, n)
        Cells to the left, to the right, above and below; any where there is none.
    weights : ndarray of float64, shape (4, n)
        0 where there is none.
    diagonal : ndarray of float64, shape (n,)
        Sum of the weights, those of given neighbours included.
    parents : ndarray of int, shape (n,)
        Cell of the coarser grid that each is part of.
    coarser : _Grid or None
    """

    beside: Indices
    weights: Array
    diagonal: Array
    parents: Indices
    coarser: _Grid | None

    @classmethod
    def of(cls, rows: Indices, columns: Indices, beside: Indices, weights: Array, diagonal: Array) -> _Grid:
        """With all coarser ones."""
        width = columns.max() + 1
        blocks, parents = np.unique(rows // 2 * width + columns // 2, return_inverse=True)
        # Cells that all are far apart do not become fewer, and need no coarser grid.
        if rows.size < _FEWEST or 4 * blocks.size > 3 * rows.size:
            return cls(beside, weights, diagonal, parents, None)
        outwards = np.where(parents[beside] == parents, 0.0, _STIFFNESS * weights)
        among = np.stack([_sums(parents, weight, blocks.size) for weight in outwards])
        given = _sums(parents, diagonal - weights.sum(axis=0), blocks.size)
        next_to = np.zeros(among.shape, np.intp)
        for side, weight in enumerate(outwards):
            linked = np.flatnonzero(weight)
            next_to[side, parents[linked]] = parents[beside[side, linked]]
        coarser = cls.of(blocks // width, blocks % width, next_to, among, given + among.sum(axis=0))
        return cls(beside, weights, diagonal, parents, coarser)

    def apply(self, values: Array) -> Array:
        """Left-hand side of the equations."""
        return np.asarray(self.diagonal * values - np.einsum("ij,ij->j", self.weights, values[self.beside]))

    def correction(self, residual: Array) -> Array:
        """Roughly the solution for this right-hand side: a symmetric, positive definite function of it."""
        values: Array = _DAMPING * residual / self.diagonal
        if self.coarser is not None:
            left = _sums(self.parents, residual - self.apply(values), self.coarser.diagonal.size)
            values += self.coarser.correction(left)[self.parents]
            values += _DAMPING * (residual - self.apply(values)) / self.diagonal
        return values


def _sums(parents: Indices, values: Array, count: int) -> Array:
    return np.asarray(np.bincount(parents, values, count), dtype=np.float64)


def harmonic(values: Array, unknown: Mask, given: Mask) -> Array:
    """Values for which each unknown pixel is the mean of those of its four neighbours that are unknown or given.

    Parameters
    ----------
    values : ndarray of float64, shape (height, width)
        Anything but where given.
    unknown, given : ndarray of bool, shape (height, width)
        No pixel is both, and a way over unknown pixels leads from each of them to a given one.

    Returns
    -------
    ndarray of float64, shape (unknown pixels,)
        In the order of the image.
    """
    padded, around = np.pad(unknown, 1), np.pad(given, 1)
    width = padded.shape[1]
    cells = np.flatnonzero(padded)
    sides = cells + np.array([[-1], [1], [-width], [width]])
    numbers = np.zeros(padded.size, np.intp)
    numbers[cells] = np.arange(cells.size)
    weights, fixed = padded.ravel()[sides].astype(np.float64), around.ravel()[sides]
    diagonal = weights.sum(axis=0) + fixed.sum(axis=0, dtype=np.float64)
    grid = _Grid.of(cells // width, cells % width, numbers[sides], weights, diagonal)
    towards: Array = np.where(fixed, np.pad(values, 1).ravel()[sides], 0.0).sum(axis=0)

    solution = np.full(cells.size, towards.sum() / np.count_nonzero(fixed))
    residual = towards - grid.apply(solution)
    enough = _TOLERANCE**2 * (towards @ towards)
    direction, size = np.zeros(cells.size), 1.0
    while residual @ residual > enough:
        correction = grid.correction(residual)
        before, size = size, float(residual @ correction)
        direction = correction + size / before * direction
        image = grid.apply(direction)
        step = size / (direction @ image)
        solution += step * direction
        residual -= step * image
    return solution
