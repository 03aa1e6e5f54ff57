"""An image, what is known of its surface, and the same on coarser grids."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from persfs_cl import masks
from persfs_cl.arrays import Array, Mask
from persfs_cl.grid import PixelGrid

_Number = TypeVar("_Number", np.float64, np.uint8)


@dataclass(frozen=True)
class View:
    """An image, and what is known of its surface. Arrays have the shape (height, width).

    Z is ln z less a level, and the brightness that under a light of unit gain of depths in the unit of exp Z.

    Attributes
    ----------
    image : ndarray of float64
        Brightness; anything where nothing is solved.
    solved : ndarray of bool
        Pixels to find the depth of.
    known : ndarray of float64
        Z of pixels that keep it, NaN elsewhere; they are not solved.
    prior : ndarray of float64
        Z that may err, NaN where there is none.
    certainty : ndarray of float64
        1 / its tolerance, 0 where there is none.
    limits : ndarray of float64, shape (2, height, width), or None
        Bounds of Z from below and from above, NaN where there is none; None where there are none at all.
    grid : PixelGrid
    spacing : int
        Of the pixels, in those of the finest grid.
    """

    image: Array
    solved: Mask
    known: Array
    prior: Array
    certainty: Array
    limits: Array | None
    grid: PixelGrid
    spacing: int = 1

    @property
    def present(self) -> Mask:
        """Pixels that have a depth."""
        return np.asarray(self.solved | ~np.isnan(self.known))

    @property
    def flags(self) -> NDArray[np.uint8]:
        """For the kernels, see :mod:`persfs_cl.masks`; all neighbours are missing where there is no depth."""
        present = self.present
        flags = masks.missing_neighbours(present)
        flags[~present] = masks.LACKING
        flags[self.solved] |= np.uint8(masks.SWEPT)
        return flags

    def coarser(self) -> View:
        """On a grid of twice the spacing: the means of squares of four pixels.

        A square is solved where half of it is, or more, and none of it is known.
        """
        known, some_known = means(self.known, ~np.isnan(self.known))
        image, counted = means(self.image, self.solved)
        sure = self.certainty > 0.0
        prior, some_prior = means(self.prior, sure)
        tolerance = means(np.divide(1.0, self.certainty, out=np.ones_like(self.prior), where=sure), sure)[0]
        limits = None
        if self.limits is not None:
            # A bound of each of them, or none.
            limits = np.stack([means(bound, ~np.isnan(bound))[0] for bound in self.limits])
        return View(
            image=image,
            solved=(counted >= 2) & (some_known == 0),
            known=known,
            prior=prior,
            certainty=np.where(some_prior > 0, 1.0 / np.where(some_prior > 0, tolerance, 1.0), 0.0),
            limits=limits,
            grid=_coarser_grid(self.grid),
            spacing=2 * self.spacing,
        )


def means(values: Array, there: Mask) -> tuple[Array, NDArray[np.uint8]]:
    """Means of squares of four pixels over those that are there, NaN where none is; and how many there are."""
    height, width = values.shape
    odd = ((0, height % 2), (0, width % 2))
    if height % 2 or width % 2:
        values, there = np.pad(values, odd), np.pad(there, odd)
    count = _sums(there.view(np.uint8))
    added = _sums(np.where(there, values, 0.0))
    return np.divide(added, count, out=np.full(count.shape, np.nan), where=count > 0), count


def finer(values: Array, there: Mask, shape: tuple[int, ...]) -> Array:
    """Values between those of a coarser grid that are there, linear; NaN where none is near."""
    weights = _interpolated(there.astype(np.float64), shape)
    found = _interpolated(np.where(there, values, 0.0), shape)
    between: Array = np.divide(found, weights, out=np.full(shape, np.nan), where=weights > 0.0)
    return between


def _sums(values: NDArray[_Number]) -> NDArray[_Number]:
    rows: NDArray[_Number] = np.add(values[::2], values[1::2])
    sums: NDArray[_Number] = np.add(rows[:, ::2], rows[:, 1::2])
    return sums


def _interpolated(coarse: Array, shape: tuple[int, ...]) -> Array:
    """Linear between the middles of squares, 0 beyond the edge."""
    for axis, length in enumerate(shape):
        padded = np.pad(coarse, [(int(axis == other),) * 2 for other in range(2)])
        lines = np.moveaxis(padded, axis, 0)
        doubled = np.empty((2 * (len(lines) - 2), lines.shape[1]))
        doubled[0::2] = 0.75 * lines[1:-1] + 0.25 * lines[:-2]
        doubled[1::2] = 0.75 * lines[1:-1] + 0.25 * lines[2:]
        coarse = np.moveaxis(doubled[:length], 0, axis)
    return coarse


def _coarser_grid(grid: PixelGrid) -> PixelGrid:
    x, y = (
        coordinate[0] + spacing * (0.5 + 2.0 * np.arange((coordinate.size + 1) // 2))
        for coordinate, spacing in ((grid.x, grid.dx), (grid.y[:, 0], grid.dy))
    )
    return PixelGrid(x, y[:, None], 2.0 * grid.dx, 2.0 * grid.dy)
