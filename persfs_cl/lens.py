"""Lenses that bend straight lines: OpenCV's models, which the package OpenCV computes.

Places are normalised: (column - cx) / fx and (row - cy) / fy, in a pinhole camera and as the lens draws them.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from types import ModuleType
from typing import Any

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import finite_numbers
from persfs_cl.errors import CameraError

_COUNTS = (4, 5, 8, 12, 14)
"""Of OpenCV's coefficients."""
_MOST = 1e6
"""A coefficient that is larger is none."""
_ROUNDS = 6
_CLOSE = 1e-9
"""How near a place must come back to where it was, for its ray to be found."""
_AT_A_TIME = 2**15
_STEP = 1e-6
"""Over which derivatives are differences."""
_PARTS = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Of the way from the axis to a place, where what is drawn is looked at."""
_WIDEST = 1e3
"""Farther from the axis is no ray."""


@dataclass(frozen=True, repr=False)
class Fisheye:
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

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _coefficients(getattr(self, field.name), (1,))[0])

    def __repr__(self) -> str:
        said = zip((field.name for field in fields(self)), self.coefficients, strict=False)
        return f"Fisheye({', '.join(f'{name}={value}' for name, value in said)})"

    @property
    def is_opencvs(self) -> bool:
        """Whether it has nothing that OpenCV does not know."""
        return not any((self.p1, self.p2, self.sx1, self.sy1))

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Those that tell it: four, or all eight."""
        return (self.k1, self.k2, self.k3, self.k4) if self.is_opencvs else astuple(self)


Distortion = tuple[float, ...] | Fisheye
"""OpenCV's coefficients k1, k2, p1, p2, k3, ..., or those of a fisheye lens."""


def as_distortion(given: Any) -> Distortion | None:
    """What a user gave for the distortion of a camera; None for no distortion at all.

    Raises
    ------
    CameraError
        When it is neither OpenCV's coefficients nor a fisheye's.
    """
    if given is None or isinstance(given, Fisheye):
        return given
    found = _coefficients(given, _COUNTS)
    return found if any(found) else None


def _coefficients(given: Any, counts: tuple[int, ...]) -> tuple[float, ...]:
    # OpenCV's own functions return them as a row or a column.
    flat = given.ravel() if isinstance(given, np.ndarray) and given.size == max(given.shape, default=1) else given
    found = finite_numbers(flat)
    if found is None or len(found) not in counts or max(map(abs, found)) > _MOST:
        wanted = "a number" if counts == (1,) else "4, 5, 8, 12 or 14 numbers, k1, k2, p1, p2, k3, ..., or a Fisheye"
        raise CameraError.about("distortion", given, f"is impossible: give {wanted}, as OpenCV's calibration does.")
    return found


def opencv(why: str) -> ModuleType:
    """The package OpenCV.

    Raises
    ------
    CameraError
        When it is not installed; `why` it is wanted begins the message.
    """
    try:
        import cv2
    except ImportError as error:
        raise CameraError(
            f"{why}, and the package that knows such is missing: pip install 'persfs-cl[lens]'."
        ) from error
    return cv2


def distorted(distortion: Distortion, places: Array) -> Array:
    """Where a lens draws what a pinhole camera would have at some places.

    Parameters
    ----------
    distortion : tuple of float or Fisheye
    places : ndarray of float64, shape (n, 2)

    Returns
    -------
    ndarray of float64, shape (n, 2)
    """
    if isinstance(distortion, Fisheye) and not distortion.is_opencvs:
        return _by_prisms(distortion, places)
    cv2 = opencv("The camera has a distortion")
    found = np.empty_like(places)
    straight, nothing = np.eye(3), np.zeros(3)
    # The derivatives, which come with it, take far more memory than the places.
    for begin in range(0, len(places), _AT_A_TIME):
        some = places[begin : begin + _AT_A_TIME, None, :]
        if isinstance(distortion, Fisheye):
            drawn = cv2.fisheye.distortPoints(some, straight, np.array(distortion.coefficients[:4]))
        else:
            rays = np.concatenate([some, np.ones_like(some[..., :1])], axis=2)
            drawn, _ = cv2.projectPoints(rays, nothing, nothing, straight, np.array(distortion))
        found[begin : begin + _AT_A_TIME] = np.reshape(drawn, (-1, 2))
    return found


def undistorted(distortion: Distortion, places: Array) -> Array:
    """Where a pinhole camera has what a lens draws at some places; NaN where that cannot be told.

    Parameters
    ----------
    distortion : tuple of float or Fisheye
    places : ndarray of float64, shape (n, 2)

    Returns
    -------
    ndarray of float64, shape (n, 2)
    """
    cv2 = opencv("The camera has a distortion")
    straight = np.eye(3)
    if isinstance(distortion, Fisheye):
        first = cv2.fisheye.undistortPoints(places[:, None, :], straight, np.array(distortion.coefficients[:4]))
    else:
        first = cv2.undistortPoints(places[:, None, :], straight, np.array(distortion))
    found = np.reshape(first, (-1, 2)).astype(np.float64)
    with np.errstate(all="ignore"):
        # OpenCV ends its rounds early.
        for _ in range(_ROUNDS):
            right, down = _derivatives(distortion, found)
            off = distorted(distortion, found) - places
            determinant = right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0]
            found[:, 0] -= (off[:, 0] * down[:, 1] - off[:, 1] * down[:, 0]) / determinant
            found[:, 1] -= (off[:, 1] * right[:, 0] - off[:, 0] * right[:, 1]) / determinant
        close = np.abs(distorted(distortion, found) - places) < _CLOSE
        there = np.all(close & (np.abs(found) < _WIDEST), axis=1)
        there[there] = unfolded(distortion, found[there])
    found[~there] = np.nan
    return found


def _by_prisms(lens: Fisheye, places: Array) -> Array:
    """Where a fisheye draws what a pinhole camera would have at some places, by all eight coefficients."""
    radius = np.hypot(*places.T)
    angle = np.arctan(radius)
    ratio = np.divide(angle, radius, out=np.ones_like(radius), where=radius > 0.0)
    u, v = (places * ratio[:, None]).T
    square = angle**2
    radial = square * (lens.k1 + square * (lens.k2 + square * (lens.k3 + square * lens.k4)))
    across = u * radial + 2.0 * lens.p1 * u * v + lens.p2 * (square + 2.0 * u**2) + lens.sx1 * square
    down = v * radial + 2.0 * lens.p2 * u * v + lens.p1 * (square + 2.0 * v**2) + lens.sy1 * square
    return np.stack([u + across, v + down], axis=1)


def unfolded(distortion: Distortion, places: Array) -> Mask:
    """Whether from the axis to some places of a pinhole camera what the lens draws never turns back.

    Polynomials that were fitted within an image do, somewhere outside: what lies beyond is drawn a second time.
    """
    fine = np.ones(len(places), bool)
    for part in _PARTS:
        right, down = _derivatives(distortion, part * places)
        fine &= right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0] > 0.0
    return fine


def _derivatives(distortion: Distortion, places: Array) -> tuple[Array, Array]:
    """Of what a lens draws, along x and along y."""
    right, down = (
        (distorted(distortion, places + step) - distorted(distortion, places - step)) / (2 * _STEP)
        for step in _STEP * np.eye(2)
    )
    return right, down
