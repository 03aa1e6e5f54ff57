"""Weights of the steps between the pixels of a photograph: small where its brightness has an edge."""

from __future__ import annotations

import numpy as np

from persfs_cl.arrays import Array, Mask

_BLUR = 0.7
_EDGE = 0.05
"""Pixels, and a difference of ln brightness that halves a weight."""
_DARKEST = 1e-3
"""Share of the brightest value that a pixel is taken to have at least."""


def edge_weights(brightness: Array, mask: Mask) -> tuple[Array, Array]:
    """Weights from 0 to 1 of the steps to the right and downwards; 0 where either end is not in the mask.

    Parameters
    ----------
    brightness : ndarray of float64, shape (height, width)
        Anything outside the mask.
    mask : ndarray of bool, shape (height, width)

    Returns
    -------
    right, below : ndarray of float64, shape (height, width)
        0 in the last column, and in the last row.
    """
    from scipy.ndimage import gaussian_filter  # slow to import

    inside = mask & ~np.isnan(brightness)
    darkest = _DARKEST * float(brightness[inside].max()) if inside.any() else 1.0
    logarithm = np.log(np.where(inside, np.maximum(brightness, darkest), 1.0))
    # Of the pixels of the mask alone.
    weight = gaussian_filter(inside.astype(np.float64), _BLUR)
    blurred = np.divide(gaussian_filter(logarithm, _BLUR), weight, out=np.zeros_like(weight), where=inside)
    found = []
    for axis in (1, 0):
        steps = 1.0 / (1.0 + (np.diff(blurred, axis=axis) / _EDGE) ** 2)
        joined = np.minimum(inside, np.roll(inside, -1, axis))
        padded = np.pad(steps, [(0, int(axis == along)) for along in range(2)])
        padded[~joined] = 0.0
        found.append(padded)
    return found[0], found[1]
