"""A surface as matt clay under a fixed lamp, drawn from few of its pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Mask
from persfs_cl.surface.solved import SolvedSurface
from persfs_cl.surface.views.reduced import Samples

Numbers = NDArray[np.float32]
"""Single precision is far more than the levels of a picture tell apart."""

_LAMP = -0.55, -0.60, -0.58
"""Direction to the lamp in camera axes: from the upper left, as pictures of reliefs are lit since there are maps."""
_CLAY = 238, 228, 214
NOTHING = 118, 122, 128
"""Where there is no surface: a grey that suits a light page and a dark one."""


def shaded(surface: SolvedSurface, samples: Samples) -> NDArray[np.uint8]:
    """Pixels of a picture of the surface as the camera saw it, under a lamp from the upper left.

    Parameters
    ----------
    surface : SolvedSurface
    samples : Samples
        A pixel of the picture for each.

    Returns
    -------
    ndarray of uint8, shape (rows, columns, 3)
    """
    log_depth = np.log(surface.depth[samples.grid])
    solved = np.isfinite(log_depth)
    height, width = surface.depth.shape
    cx, cy = surface.camera.centre((height, width))
    x = ((samples.columns - cx) / surface.camera.fx).astype(np.float32)
    y = ((samples.rows - cy) / surface.camera.fy).astype(np.float32)
    right, down = samples.joined(surface.solved, surface.discontinuities)
    p = _slope(log_depth, x, right)
    q = _slope(log_depth.T, y, down.T).T
    # The normal is (p, q, -w) / S, eq. (3).
    w = 1 + x * p + y[:, None] * q
    cosine = (_LAMP[0] * p + _LAMP[1] * q - _LAMP[2] * w) / np.sqrt(p * p + q * q + w * w)
    # The light wraps round to the side away from the lamp, so that no side is a black spot.
    wrapped = 0.5 + 0.5 * cosine
    brightness = 0.12 + 0.88 * wrapped * np.sqrt(wrapped.clip(0))
    picture = np.empty((*solved.shape, 3), np.uint8)
    for channel, (clay, nothing) in enumerate(zip(_CLAY, NOTHING, strict=True)):
        picture[..., channel] = np.where(solved, clay * brightness, nothing)
    return picture


def _slope(values: NDArray[np.float64], places: Numbers, joined: Mask) -> Numbers:
    """Along rows, from the sample before to the one after, as far as they are joined; 0 where neither is."""
    steps = np.zeros((len(values), len(places) + 1), np.float32)
    lengths = np.zeros_like(steps)
    np.copyto(steps[:, 1:-1], np.diff(values), where=joined, casting="same_kind")
    np.copyto(lengths[:, 1:-1], np.diff(places), where=joined)
    length = lengths[:, 1:] + lengths[:, :-1]
    slope = np.zeros_like(length)
    np.divide(steps[:, 1:] + steps[:, :-1], length, out=slope, where=length > 0)
    return slope
