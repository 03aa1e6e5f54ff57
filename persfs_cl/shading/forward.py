"""The forward model in plain NumPy, float64: the brightness of a surface by its slopes, as the paper has it.

Lights use it, each in its own :meth:`persfs_cl.shading.model.Light.brightness`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.shading.reflectance import Reflectance


class Parallel(Protocol):
    """Of a parallel light, or of one for each cell: its slopes, and k = sqrt(1 + p0² + q0²)."""

    @property
    def p0(self) -> Array | float:
        """Slope along x."""

    @property
    def q0(self) -> Array | float:
        """Slope along y."""

    @property
    def norm(self) -> Array | float:
        """k."""


@dataclass(frozen=True)
class Direction:
    """Of a parallel light for each cell: its slopes, and k = sqrt(1 + p0² + q0²)."""

    p0: Array
    q0: Array
    norm: Array


def surface_norm(p: Array, q: Array, x: Array, y: Array) -> Array:
    """S = sqrt(p² + q² + w²) with w = 1 + x p + y q, the length of the unnormalised normal, eq. (3)."""
    w = 1.0 + x * p + y * q
    return np.asarray(np.sqrt(p**2 + q**2 + w**2))


def shade(p: Array, q: Array, x: Array, y: Array, light: Parallel) -> Array:
    """n / k = (1 + (x - p0) p + (y - q0) q) / k, the cosine between normal and light times S."""
    return np.asarray((1.0 + (x - light.p0) * p + (y - light.q0) * q) / light.norm)


def reflectance_map(
    p: ArrayLike,
    q: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    light: Parallel,
    reflectance: Reflectance,
) -> Array:
    """Brightness under a parallel light, eq. (6) and its kin for other materials.

    Parameters
    ----------
    p, q : array_like
        dZ/dx and dZ/dy of the log depth Z = ln z, in normalised image coordinates.
    x, y : array_like
        Normalised image coordinates; everything broadcasts.
    light : ParallelLight or Direction
    reflectance : Reflectance

    Returns
    -------
    ndarray of float64
        E, for a Lambertian surface n / (k S), at most 1. Negative where the surface turns its back to the light.
    """
    p, q, x, y = (np.asarray(value, np.float64) for value in (p, q, x, y))
    norm, ray = surface_norm(p, q, x, y), np.sqrt(1.0 + x**2 + y**2)
    cosine_light = shade(p, q, x, y, light) / norm
    cosine_between = (1.0 + x * light.p0 + y * light.q0) / (light.norm * ray)
    return reflectance.shade(cosine_light, 1.0 / (ray * norm), cosine_between)
