"""Lenses: OpenCV's own projection and back, and what is refused."""

from __future__ import annotations

import sys
from typing import Any

import cv2
import numpy as np
import pytest

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.errors import CameraError
from persfs_cl.lens import Distortion, Fisheye, _by_prisms, as_distortion, distorted, undistorted, unfolded

LENSES: list[Distortion] = [
    (-0.3, 0.1, 0.001, -0.002),
    (-0.3, 0.1, 0.001, -0.002, 0.01),
    (0.2, -0.05, 0.002, 0.001, 0.01, 0.3, 0.02, 0.005),
    (-0.2, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, -0.001, 0.002, 0.001),
    (-0.2, 0.05, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01),
    Fisheye(0.02, -0.004, 0.001, 0.0003),
    Fisheye(),
]


def _some_places() -> Array:
    return np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))


@pytest.mark.parametrize("lens", LENSES, ids=str)
def test_pixels_are_those_of_opencv_and_places_lead_back(lens: Distortion) -> None:
    camera, given = Camera((410.0, 400.0), (150.0, 90.0), lens), _some_places()
    matrix = np.array([[410.0, 0.0, 150.0], [0.0, 400.0, 90.0], [0.0, 0.0, 1.0]])
    points = np.concatenate([given, np.ones((len(given), 1))], axis=1)[:, None] * 2.5
    if isinstance(lens, Fisheye):
        expected, _ = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(lens.coefficients))
    else:
        expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(lens))
    pixels = camera.pixels(given, (200, 300))
    np.testing.assert_allclose(pixels, np.reshape(expected, (-1, 2)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(camera.places(pixels, (200, 300)), given, rtol=0, atol=1e-9)


def test_the_lens_that_opencv_does_not_know_is_its_own_without_prisms() -> None:
    given, lens = _some_places(), Fisheye(0.02, -0.004, 0.001, 0.0003)
    np.testing.assert_allclose(_by_prisms(lens, given), distorted(lens, given), rtol=0, atol=1e-12)


def test_thin_prisms_as_colmap_has_them() -> None:
    lens = Fisheye(0.02, -0.004, 0.001, 0.0003, 0.002, -0.003, 0.004, 0.001)
    # By hand, of the ray (0.6, 0.8, 1), at 45° to the axis.
    theta = np.pi / 4
    u, v = 0.6 * theta, 0.8 * theta
    radial = 0.02 * theta**2 - 0.004 * theta**4 + 0.001 * theta**6 + 0.0003 * theta**8
    x = u + u * radial + 2 * 0.002 * u * v - 0.003 * (theta**2 + 2 * u**2) + 0.004 * theta**2
    y = v + v * radial - 2 * 0.003 * u * v + 0.002 * (theta**2 + 2 * v**2) + 0.001 * theta**2
    np.testing.assert_allclose(distorted(lens, np.array([[0.6, 0.8]])), [[x, y]], rtol=1e-12)
    given = _some_places()
    np.testing.assert_allclose(undistorted(lens, distorted(lens, given)), given, rtol=0, atol=1e-9)
    assert "sx1=0.004" in repr(lens)


def test_what_a_lens_never_draws_has_no_place() -> None:
    # An equidistant fisheye draws a ray at a right angle to the axis at π / 2.
    found = undistorted(Fisheye(), np.array([[0.5, 0.0], [1.6, 0.0]]))
    np.testing.assert_allclose(found[0], [np.tan(0.5), 0.0], rtol=1e-12)
    assert np.isnan(found[1]).all()


def test_places_behind_a_fold_are_told() -> None:
    # r (1 - r² / 3) turns back at r = 1.
    lens = (-1 / 3, 0.0, 0.0, 0.0)
    np.testing.assert_array_equal(unfolded(lens, np.array([[0.9, 0.0], [1.1, 0.0], [0.8, 0.8]])), [True, False, False])
    drawn = distorted(lens, np.array([[0.6, 0.0], [1.4, 0.0]]))
    found = undistorted(lens, drawn)
    assert found[0, 0] == pytest.approx(0.6, rel=1e-9)
    assert np.isnan(found[1]).all() or found[1, 0] < 1.0


@pytest.mark.parametrize("given", [(0.1,), (0.1,) * 3, (0.1,) * 6, "0.1", (np.nan, 0, 0, 0), (1e9, 0, 0, 0), True])
def test_impossible_coefficients_are_refused(given: Any) -> None:
    with pytest.raises(CameraError, match=r"distortion.* is impossible"):
        Camera(100.0, distortion=given)


@pytest.mark.parametrize("shape", [(1, 5), (5, 1), (5,)])
def test_coefficients_as_opencv_returns_them(shape: tuple[int, ...]) -> None:
    given: Any = np.full(shape, 0.1)
    assert Camera(100.0, distortion=given).distortion == (0.1,) * 5


def test_no_distortion_at_all_is_a_pinhole() -> None:
    assert Camera(100.0, distortion=(0.0,) * 5) == Camera(100.0)
    assert as_distortion([0, 0, 0, 0]) is None
    assert Camera(100.0, distortion=Fisheye()) != Camera(100.0)


def test_a_grid_wants_straight_lines() -> None:
    with pytest.raises(CameraError, match=r"give what persfs_cl\.undistort makes"):
        Camera(100.0, distortion=(0.1, 0.0, 0.0, 0.0)).grid((10, 10))


def test_without_opencv_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(CameraError, match=r"pip install 'persfs-cl\[lens\]'"):
        Camera(100.0, distortion=(0.1, 0.0, 0.0, 0.0)).pixels(np.zeros((1, 2)), (10, 10))
