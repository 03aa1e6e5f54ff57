"""One image in numbers, as the kernels want them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl.masks import LACKING, NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, SWEPT


@dataclass(frozen=True)
class Image:
    """One image in numbers, as the kernels want them.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Start values, known values included.
    brightness : ndarray of float, shape (height, width)
        E.
    flags : ndarray of uint8, shape (height, width)
        See :mod:`persfs_cl.masks`.
    parameters : mapping of str to float
        Of grid, scheme, light and material; see :mod:`persfs_cl._cl.parameters`.
    x_axis, y_axis : ndarray, shapes (3, width) and (3, height)
        Coordinates and the two terms of the viscosity: see kernels/schemes/lax_friedrichs.cl.
    cells, inwards, edges
        Boundary cells by their flat indices, the two cells that each looks at inwards along x and along y, shape
        (cells, 4), and how many of them come first, as edges: see kernels/shared/boundary.cl.
    settles : bool
        Whether most cells soon keep their value, as by the upwind scheme: it pays to keep account of which still
        change. As they take much arithmetic, vectors are as wide as can be.
    outside : float or None
        The value of what lies around the image, for a scheme that only wants a missing neighbour to be high; None for
        one that treats cells apart which lack a neighbour.
    limits : ndarray of float64, shape (2, height, width), or None
        Bounds of the values from below and from above, NaN where there is none; None where there are none at all.
        `log_depth` keeps to them.
    """

    log_depth: NDArray[np.float64]
    brightness: NDArray[np.floating]
    flags: NDArray[np.uint8]
    parameters: Mapping[str, float]
    x_axis: NDArray[np.float64]
    y_axis: NDArray[np.float64]
    cells: NDArray[np.int32]
    inwards: NDArray[np.int32]
    edges: int
    settles: bool
    outside: float | None = None
    limits: NDArray[np.float64] | None = None

    def marked_brightness(self, rows: slice) -> NDArray[np.floating]:
        """E as the kernels read it, in some rows: NaN where not swept, its sign set where a neighbour is missing."""
        flags = self.flags[rows]
        swept = (flags & SWEPT) != 0
        marked = np.where(swept, self.brightness[rows], np.nan)
        if self.outside is None:
            # Not so the others: a NaN with its sign set would send its whole block the slow way.
            on_rim = swept & ((flags & LACKING) != 0)
            np.negative(marked, out=marked, where=on_rim)
        return marked

    @property
    def beside(self) -> NDArray[np.int64]:
        """Pixels left, right, up and down of each boundary cell, or NONE; shape (cells, 4)."""
        width = self.flags.shape[1]
        flags = self.flags.ravel()[self.cells]
        steps = ((NO_LEFT, -1), (NO_RIGHT, 1), (NO_UP, -width), (NO_DOWN, width))
        return np.stack([np.where(flags & bit, NONE, self.cells + step) for bit, step in steps], axis=1)
