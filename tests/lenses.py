"""A scene as cameras with any lens see it: a surface over normalised places, and its flash-lit image."""

from __future__ import annotations

import functools

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera

_STEP = 1e-5


def depth(x: Array, y: Array) -> Array:
    """Two bumps on a wall."""
    one = 0.15 * np.exp(-((x - 0.1) ** 2 + y**2) / 0.03)
    other = 0.1 * np.exp(-((x + 0.25) ** 2 + (y - 0.1) ** 2) / 0.02)
    return np.asarray(1.0 - one - other)


@functools.cache
def places(camera: Camera, shape: tuple[int, int]) -> tuple[Array, Array]:
    """Normalised places of the pixels of a camera with any lens, to be read only."""
    rows, columns = np.indices(shape)
    found = camera.places(np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float64), shape)
    found.flags.writeable = False
    x, y = found.T.reshape(2, *shape)
    return x, y


@functools.cache
def flashed(camera: Camera, shape: tuple[int, int]) -> Array:
    """Brightness of the surface by a flash of gain 1 at the camera, from normal and distance, to be read only."""
    x, y = places(camera, shape)
    z = depth(x, y)
    along_x = (depth(x + _STEP, y) - depth(x - _STEP, y)) / (2 * _STEP) / z
    along_y = (depth(x, y + _STEP) - depth(x, y - _STEP)) / (2 * _STEP) / z
    # The surface is z (x, y, 1): across its two tangents lies the normal.
    normal = np.sqrt(along_x**2 + along_y**2 + (1.0 + x * along_x + y * along_y) ** 2)
    squared = 1.0 + x**2 + y**2
    brightness = np.asarray(1.0 / (normal * np.sqrt(squared)) / (z**2 * squared))
    brightness.flags.writeable = False
    return brightness
