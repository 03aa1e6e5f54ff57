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
from persfs_cl.lens import fisheye
from persfs_cl.lens.distortion import (
    Distortion,
    as_distortion,
    distorted,
    distortion_of,
    is_opencvs,
    told,
    undistorted,
    unfolded,
)
from persfs_cl.lens.field_of_view import FieldOfView
from persfs_cl.lens.fisheye import Fisheye
from persfs_cl.lens.models import MODELS
from persfs_cl.lens.rad_tan_fisheye import RadTanFisheye

LENSES: list[Distortion] = [
    (-0.3, 0.1, 0.001, -0.002),
    (-0.3, 0.1, 0.001, -0.002, 0.01),
    (0.2, -0.05, 0.002, 0.001, 0.01, 0.3, 0.02, 0.005),
    (-0.2, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, -0.001, 0.002, 0.001),
    (-0.2, 0.05, 0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02, -0.01),
    Fisheye(0.02, -0.004, 0.001, 0.0003),
    Fisheye(),
]
OTHERS: list[Distortion] = [
    Fisheye(0.02, -0.004, 0.001, 0.0003, 0.002, -0.003, 0.004, 0.001),
    FieldOfView(0.9),
    FieldOfView(-0.9),
    FieldOfView(1e-7),
    FieldOfView(),
    RadTanFisheye(0.02, -0.01, 0.005, -0.002, 0.001, -0.0005, 0.002, -0.003, 0.004, 0.001, -0.002, 0.003),
    RadTanFisheye(),
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
    np.testing.assert_allclose(fisheye.draw(lens, given), distorted(lens, given), rtol=0, atol=1e-12)


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


def test_the_fisheye_of_most_numbers_as_colmap_has_it() -> None:
    lens = RadTanFisheye(0.02, -0.01, 0.005, -0.002, 0.001, -0.0005, 0.002, -0.003, 0.004, 0.001, -0.002, 0.003)
    # By hand, of the ray (0.6, 0.8, 1), at 45° to the axis.
    theta = np.pi / 4
    r = theta + 0.02 * theta**3 - 0.01 * theta**5 + 0.005 * theta**7
    r += -0.002 * theta**9 + 0.001 * theta**11 - 0.0005 * theta**13
    u, v = 0.6 * r, 0.8 * r
    x = u + 2 * -0.003 * u * v + 0.002 * (r**2 + 2 * u**2) + 0.004 * r**2 + 0.001 * r**4
    y = v + 2 * 0.002 * u * v - 0.003 * (r**2 + 2 * v**2) - 0.002 * r**2 + 0.003 * r**4
    np.testing.assert_allclose(distorted(lens, np.array([[0.6, 0.8]])), [[x, y]], rtol=1e-12)
    # Without tangential numbers and prisms it is OpenCV's.
    plain, four = RadTanFisheye(0.02, -0.004, 0.001, 0.0003), Fisheye(0.02, -0.004, 0.001, 0.0003)
    np.testing.assert_allclose(distorted(plain, _some_places()), distorted(four, _some_places()), rtol=0, atol=1e-12)


def test_the_model_of_one_number_as_colmap_has_it() -> None:
    # By hand, of the ray (0.6, 0.8, 1).
    expected = np.arctan(2 * np.tan(0.45)) / 0.9
    found = distorted(FieldOfView(0.9), np.array([[0.6, 0.8], [0.0, 0.0]]))
    np.testing.assert_allclose(found, [[0.6 * expected, 0.8 * expected], [0.0, 0.0]], rtol=1e-12)
    # A fisheye of 2 tan(ω / 2) = 1 is equidistant but for its scale.
    wide = 2 * np.arctan(0.5)
    given = _some_places()
    np.testing.assert_allclose(distorted(FieldOfView(wide), given) * wide, distorted(Fisheye(), given), atol=1e-12)
    np.testing.assert_array_equal(distorted(FieldOfView(), given), given)
    # A ray at a right angle to the axis is drawn at π / 2 / ω.
    assert np.isfinite(undistorted(FieldOfView(0.9), np.array([[1.7, 0.0]]))).all()
    assert np.isnan(undistorted(FieldOfView(0.9), np.array([[1.8, 0.0]]))).all()


@pytest.mark.parametrize("lens", OTHERS, ids=str)
def test_what_other_lenses_draw_leads_back(lens: Distortion) -> None:
    given = np.concatenate([_some_places(), [[0.0, 0.0], [2.0, 1.0]]])
    np.testing.assert_allclose(undistorted(lens, distorted(lens, given)), given, rtol=0, atol=1e-8)
    assert not is_opencvs(lens)


@pytest.mark.parametrize("lens", [*LENSES, *OTHERS], ids=str)
def test_a_lens_is_told_by_its_model_and_its_numbers(lens: Distortion) -> None:
    assert distortion_of(*told(lens)) == lens
    assert distortion_of("opencv", ()) is None


@pytest.mark.parametrize(
    ("model", "numbers", "said"),
    [
        ("fisheye", (0.1,) * 5, r"fisheye: give k1, k2, k3 and k4, or p1, p2, sx1 and sy1 too"),
        ("fov", (0.1, 0.2), "fov: give the one number ω"),
        ("fov", (), "fov: give the one number ω"),
        ("rad_tan_thin_prism_fisheye", (0.1,) * 11, "give k0 to k5, p0, p1 and s0 to s3"),
        ("mirror", (), "'mirror' is no model of a lens: give one of fisheye, fov,"),
    ],
)
def test_other_numbers_than_those_of_the_model_are_refused(model: str, numbers: tuple[float, ...], said: str) -> None:
    with pytest.raises(CameraError, match=said):
        distortion_of(model, numbers)


@pytest.mark.parametrize("omega", [np.pi, -4.0, np.nan, "0.9", None])
def test_an_angle_that_no_lens_has_is_refused(omega: Any) -> None:
    with pytest.raises(CameraError, match="is impossible"):
        FieldOfView(omega)


def test_formulas_of_our_own_need_no_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    camera = Camera(100.0, distortion=FieldOfView(0.9))
    np.testing.assert_allclose(camera.places(camera.pixels(np.array([[0.3, 0.2]]), (10, 10)), (10, 10)), [[0.3, 0.2]])
    assert set(MODELS) == {"fisheye", "fov", "rad_tan_thin_prism_fisheye"}


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
