"""The pixel centres of an image as rays of a pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class PixelGrid:
    """Normalised image coordinates of the pixel centres of one image.

    Attributes
    ----------
    x : ndarray of float64, shape (width,)
        (column - cx) / fx.
    y : ndarray of float64, shape (height, 1)
        (row - cy) / fy, a column so that it broadcasts against x.
    dx, dy : float
        Pixel spacing, 1/fx and 1/fy.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    dx: float
    dy: float

    def __repr__(self) -> str:
        return f"<PixelGrid, {self.x.size} x {self.y.size} pixels, dx={self.dx:.4g}, dy={self.dy:.4g}>"
