"""What a lens does to places, and back: by OpenCV's coefficients, or a model with formulas of its own."""

from __future__ import annotations

from typing import Any

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.errors import CameraError
from persfs_cl.lens.fisheye import Fisheye
from persfs_cl.lens.models import OPENCV, lens_of, model_of
from persfs_cl.lens.numbers import MOST, Lens, finite
from persfs_cl.lens.opencv import opencv

_COUNTS = (4, 5, 8, 12, 14)
"""Of OpenCV's coefficients."""
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

Distortion = tuple[float, ...] | Lens
"""OpenCV's coefficients k1, k2, p1, p2, k3, ..., or a lens of another model."""


def as_distortion(given: Any) -> Distortion | None:
    """What a user gave for the distortion of a camera; None for no distortion at all.

    Raises
    ------
    CameraError
        When it is neither OpenCV's coefficients nor a lens.
    """
    if given is None or isinstance(given, Lens):
        return given
    found = finite(given)
    if found is None or len(found) not in _COUNTS:
        raise CameraError.about(
            "distortion",
            given,
            f"is impossible: give 4, 5, 8, 12 or 14 numbers up to {MOST:,.0f}, k1, k2, p1, p2, k3, ..., or a Fisheye, "
            "as OpenCV's calibration does.",
        )
    return found if any(found) else None


def distortion_of(model: str, coefficients: tuple[float, ...]) -> Distortion | None:
    """The distortion by the numbers of a model, as files have them; none of OpenCV's is no distortion.

    Raises
    ------
    CameraError
        When there is no such model, or it has other numbers.
    """
    if model == OPENCV:
        return as_distortion(coefficients or None)
    return lens_of(model, coefficients)


def told(distortion: Distortion) -> tuple[str, tuple[float, ...]]:
    """The model and its numbers, of which :func:`distortion_of` makes the same again."""
    if isinstance(distortion, Lens):
        return model_of(distortion).name, distortion.coefficients
    return OPENCV, distortion


def is_opencvs(distortion: Distortion) -> bool:
    """Whether OpenCV knows the lens."""
    return not isinstance(distortion, Lens) or (isinstance(distortion, Fisheye) and distortion.is_opencvs)


def distorted(distortion: Distortion, places: Array) -> Array:
    """Where a lens draws what a pinhole camera would have at some places.

    Parameters
    ----------
    distortion : tuple of float or Lens
    places : ndarray of float64, shape (n, 2)

    Returns
    -------
    ndarray of float64, shape (n, 2)
    """
    if isinstance(distortion, Lens) and not is_opencvs(distortion):
        return model_of(distortion).draw(distortion, places)
    cv2 = opencv()
    found = np.empty_like(places)
    straight, nothing = np.eye(3), np.zeros(3)
    # The derivatives, which come with it, take far more memory than the places.
    for begin in range(0, len(places), _AT_A_TIME):
        some = places[begin : begin + _AT_A_TIME, None, :]
        if isinstance(distortion, Fisheye):
            drawn = cv2.fisheye.distortPoints(some, straight, np.array(distortion.coefficients))
        else:
            rays = np.concatenate([some, np.ones_like(some[..., :1])], axis=2)
            drawn, _ = cv2.projectPoints(rays, nothing, nothing, straight, np.array(distortion))
        found[begin : begin + _AT_A_TIME] = np.reshape(drawn, (-1, 2))
    return found


def undistorted(distortion: Distortion, places: Array) -> Array:
    """Where a pinhole camera has what a lens draws at some places; NaN where that cannot be told.

    Parameters
    ----------
    distortion : tuple of float or Lens
    places : ndarray of float64, shape (n, 2)

    Returns
    -------
    ndarray of float64, shape (n, 2)
    """
    if isinstance(distortion, Lens):
        found = model_of(distortion).straighten(distortion, places)
    else:
        first = opencv().undistortPoints(places[:, None, :], np.eye(3), np.array(distortion))
        found = np.reshape(first, (-1, 2)).astype(np.float64)
    with np.errstate(all="ignore"):
        # OpenCV ends its rounds early, and other first values are but near.
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
