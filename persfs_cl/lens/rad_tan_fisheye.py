"""The fisheye with the most numbers that is in use: COLMAP's RAD_TAN_THIN_PRISM_FISHEYE, Project Aria's Fisheye624."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.lens import fisheye
from persfs_cl.lens.numbers import Lens


@dataclass(frozen=True, repr=False)
class RadTanFisheye(Lens):
    """Distortion of a fisheye lens as COLMAP's RAD_TAN_THIN_PRISM_FISHEYE has it, which is Project Aria's Fisheye624.

    A ray at the angle θ to the optical axis lies at r = θ (1 + k0 θ² + k1 θ⁴ + ... + k5 θ¹²) from the principal point,
    in units of the focal length and in its own direction: at (u, v). It is drawn at
    (u + 2 p1 u v + p0 (r² + 2 u²) + s0 r² + s1 r⁴, v + 2 p0 u v + p1 (r² + 2 v²) + s2 r² + s3 r⁴).

    Parameters
    ----------
    k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3 : float
        As COLMAP numbers them, and in its order.

    Raises
    ------
    CameraError
        When one is no finite number.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.RadTanFisheye(k0=0.02, p1=-0.001).coefficients
    (0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.001, 0.0, 0.0, 0.0, 0.0)
    """

    k0: float = 0.0
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    k5: float = 0.0
    p0: float = 0.0
    p1: float = 0.0
    s0: float = 0.0
    s1: float = 0.0
    s2: float = 0.0
    s3: float = 0.0


def draw(lens: RadTanFisheye, places: Array) -> Array:
    """Where the lens draws what a pinhole camera would have at some places."""
    ray = fisheye.angles(places)
    square = (ray**2).sum(axis=1)
    radial = np.polynomial.polynomial.polyval(square, (1.0, *lens.coefficients[:6]))
    u, v = (ray * radial[:, None]).T
    square = u**2 + v**2
    across = 2.0 * lens.p1 * u * v + lens.p0 * (square + 2.0 * u**2) + square * (lens.s0 + lens.s1 * square)
    down = 2.0 * lens.p0 * u * v + lens.p1 * (square + 2.0 * v**2) + square * (lens.s2 + lens.s3 * square)
    return np.stack([u + across, v + down], axis=1)


def nearly_straight(lens: RadTanFisheye, places: Array) -> Array:
    """About where a pinhole camera has what the lens draws at some places: as a fisheye of fewer numbers would."""
    return fisheye.nearly_straight(fisheye.Fisheye(lens.k0, lens.k1, lens.k2, lens.k3), places)
