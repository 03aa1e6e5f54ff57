"""Fisheyes by a polynomial of the angle: OpenCV's, and COLMAP's THIN_PRISM_FISHEYE."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.lens.numbers import Lens
from persfs_cl.lens.opencv import opencv


@dataclass(frozen=True, repr=False)
class Fisheye(Lens):
    """Distortion of a fisheye lens, as OpenCV's module `fisheye` has it, and COLMAP's THIN_PRISM_FISHEYE.

    A ray at the angle θ to the optical axis is drawn at θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) from the principal
    point, in units of the focal length: with all of them 0, an equidistant lens. The others, which OpenCV has not,
    shift it by (2 p1 u v + p2 (θ² + 2 u²) + sx1 θ², 2 p2 u v + p1 (θ² + 2 v²) + sy1 θ²), where (u, v) is θ long and in
    the direction of the ray.

    Parameters
    ----------
    k1, k2, k3, k4, p1, p2, sx1, sy1 : float

    Raises
    ------
    CameraError
        When one is no finite number.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> camera = ps.Camera(focal_length=300.0, distortion=ps.Fisheye(0.02, -0.004))
    >>> camera.distortion
    Fisheye(k1=0.02, k2=-0.004, k3=0.0, k4=0.0)
    """

    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    sx1: float = 0.0
    sy1: float = 0.0

    @property
    def is_opencvs(self) -> bool:
        """Whether it has nothing that OpenCV does not know."""
        return not any((self.p1, self.p2, self.sx1, self.sy1))

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Those that tell it: four, or all eight."""
        return (self.k1, self.k2, self.k3, self.k4) if self.is_opencvs else astuple(self)


def angles(places: Array) -> Array:
    """Places as an equidistant lens draws them: as long as the angle of the ray, and in its direction."""
    radius = np.hypot(*places.T)
    ratio = np.divide(np.arctan(radius), radius, out=np.ones_like(radius), where=radius > 0.0)
    return np.asarray(places * ratio[:, None])


def draw(lens: Fisheye, places: Array) -> Array:
    """Where the lens draws what a pinhole camera would have at some places."""
    u, v = angles(places).T
    square = u**2 + v**2
    radial = square * (lens.k1 + square * (lens.k2 + square * (lens.k3 + square * lens.k4)))
    across = u * radial + 2.0 * lens.p1 * u * v + lens.p2 * (square + 2.0 * u**2) + lens.sx1 * square
    down = v * radial + 2.0 * lens.p2 * u * v + lens.p1 * (square + 2.0 * v**2) + lens.sy1 * square
    return np.stack([u + across, v + down], axis=1)


def nearly_straight(lens: Fisheye, places: Array) -> Array:
    """About where a pinhole camera has what the lens draws at some places: by its radial part."""
    radial = np.array([lens.k1, lens.k2, lens.k3, lens.k4])
    found = opencv().fisheye.undistortPoints(places[:, None, :], np.eye(3), radial)
    return np.reshape(found, (-1, 2)).astype(np.float64)
