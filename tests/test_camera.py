"""The camera refuses the impossible, and every way to state it gives the same geometry."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

from persfs_cl.camera import Camera
from persfs_cl.errors import CameraError, InputError


def test_grid_places_the_pixel_centres_on_integers() -> None:
    grid = Camera((100.0, 50.0), (2.0, 1.0)).grid((3, 4))
    np.testing.assert_allclose(grid.x, [-0.02, -0.01, 0.0, 0.01], rtol=1e-15, atol=1e-17)
    np.testing.assert_allclose(grid.y, [[-0.02], [0.0], [0.02]], rtol=1e-15, atol=1e-17)
    assert (grid.dx, grid.dy) == (1 / 100, 1 / 50)
    assert grid.x.dtype == grid.y.dtype == np.float64


@pytest.mark.parametrize("shape", [(4, 6), (5, 7), (1, 1), (1, 9)])
def test_the_principal_point_is_the_middle_when_left_out(shape: tuple[int, int]) -> None:
    grid = Camera(80.0).grid(shape)
    np.testing.assert_array_equal(grid.x, -grid.x[::-1])
    np.testing.assert_array_equal(grid.y, -grid.y[::-1])


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        (590, 590.0),
        (np.float32(2.5), 2.5),
        ((3, 4), (3.0, 4.0)),
        ([3.0, 4.0], (3.0, 4.0)),
        (np.array([3.0, 4.0]), (3.0, 4.0)),
    ],
)
def test_focal_lengths_of_any_numeric_kind_compare_and_hash_alike(given: Any, kept: Any) -> None:
    camera = Camera(given, (1, 2))
    assert camera == Camera(kept, (1.0, 2.0))
    assert hash(camera) == hash(Camera(kept, (1.0, 2.0)))
    assert (camera.fx, camera.fy) == (kept if isinstance(kept, tuple) else (kept, kept))


@pytest.mark.parametrize(
    "focal_length",
    [
        0,
        -1.0,
        math.nan,
        math.inf,
        "590",
        None,
        True,
        (),
        (1.0,) * 3,
        (100.0, 0.0),
        (1.0, math.nan),
        [[1, 2]],
        ([1], 2),
    ],
)
def test_an_impossible_focal_length_is_refused_with_its_value(focal_length: Any) -> None:
    with pytest.raises(CameraError, match=r"focal_length=.*give one number of pixels between 0.001 and 1e9") as caught:
        Camera(focal_length)
    assert repr(focal_length) in str(caught.value)


@pytest.mark.parametrize("point", [(math.nan, 1.0), (1.0, math.inf), (1.0,), (1.0, 2.0, 3.0), 5.0, "ab", (None, 1)])
def test_an_impossible_principal_point_is_refused_with_its_value(point: Any) -> None:
    with pytest.raises(CameraError, match=r"principal_point=.*give two finite numbers") as caught:
        Camera(100.0, point)
    assert repr(point) in str(caught.value)


def test_a_crop_keeps_the_axis_of_its_photograph() -> None:
    whole = Camera(2000.0).grid((1448, 1448))
    cut = Camera(2000.0, (723.5, 723.5)).grid((256, 256))
    np.testing.assert_array_equal(cut.x, whole.x[:256])
    np.testing.assert_array_equal(cut.y, whole.y[:256])


@pytest.mark.parametrize(
    ("length", "point", "degrees"),
    [
        (100.0, (-1139.0, 1.0), "85"),
        (100.0, (1.0, 1147.0), "85"),
        (0.1, None, "88.0"),
        ((1e9, 0.2), (0.0, 0.0), "86"),
        (1e-3, (1e308, 0.0), "90"),
    ],
)
def test_rays_that_no_lens_draws_are_refused_with_all_numbers(length: Any, point: Any, degrees: str) -> None:
    with pytest.raises(CameraError, match=r"focal_length=\(.*principal_point=\(.*\(4, 6\)") as caught:
        Camera(length, point).grid((4, 6))
    assert f" {degrees}" in str(caught.value)


@pytest.mark.parametrize("point", [(-1138.0, 1.0), (1143.0, 1.0), (1.0, -1138.0), (-800.0, -800.0)])
def test_rays_within_85_degrees_of_the_axis_are_taken(point: tuple[float, float]) -> None:
    grid = Camera(100.0, point).grid((4, 6))
    assert (grid.x[0], grid.y[0, 0]) == (-point[0] / 100, -point[1] / 100)


@pytest.mark.parametrize(("point", "outside"), [((-0.5, 3.5), False), ((-0.6, 3), True), ((5, 3.6), True)])
def test_a_principal_point_outside_may_be_a_slip(point: tuple[float, float], outside: bool) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Camera(100.0, point).warn_if_off_image((4, 6))
    assert [str(warning.message).partition(":")[0] for warning in caught] == outside * [
        f"principal_point=({point[0]:g}, {point[1]:g}) lies outside the image of shape (4, 6)"
    ]
    assert all(warning.filename == __file__ for warning in caught)


@pytest.mark.parametrize("shape", [(4, 6, 3), (0, 5), (4,), (-1, 2), (2.5, 3), "ab", 7])
def test_a_shape_that_is_no_image_is_refused(shape: Any) -> None:
    with pytest.raises(InputError, match=r"Image shape .* give \(height, width\)"):
        Camera(100.0).grid(shape)
    with pytest.raises(InputError, match="Image shape"):
        Camera.from_fov(60.0, shape)


@pytest.mark.parametrize("angle", [1.0, 60.0, 90.0, 165.0])
def test_from_fov_spans_the_angle_between_the_outer_edges(angle: float) -> None:
    camera = Camera.from_fov(angle, (30, 40))
    grid = camera.grid((30, 40))
    left = math.atan(grid.x[0] - grid.dx / 2)
    right = math.atan(grid.x[-1] + grid.dx / 2)
    assert math.degrees(right - left) == pytest.approx(angle, rel=1e-12)
    assert camera.fx == camera.fy


@pytest.mark.parametrize("angle", [5e-324, 1e-10])
def test_a_view_without_width_is_no_camera(angle: float) -> None:
    with pytest.raises(CameraError, match=r"focal_length=.* is impossible"):
        Camera.from_fov(angle, (30, 40))


def test_from_fov_keeps_the_principal_point() -> None:
    assert Camera.from_fov(60.0, (30, 40), (3.0, 4.0)).principal_point == (3.0, 4.0)


@pytest.mark.parametrize("angle", [0, -10.0, 180.0, 200.0, math.nan, math.inf, "60", None, (60.0, 40.0)])
def test_an_impossible_field_of_view_is_refused(angle: Any) -> None:
    with pytest.raises(CameraError, match=r"field of view of .* between 0 and 180"):
        Camera.from_fov(angle, (30, 40))


def test_from_matrix_reads_the_four_parameters() -> None:
    matrix = np.array([[590, 0, 270.5], [0, 600, 260], [0, 0, 1]])
    assert Camera.from_matrix(matrix) == Camera((590.0, 600.0), (270.5, 260.0))


@pytest.mark.parametrize(
    ("matrix", "reason"),
    [
        (np.eye(4), "3×3"),
        (np.ones(9), "3×3"),
        ([[1, 0], [0]], "3×3"),
        ([["a", 0, 0], [0, 1, 0], [0, 0, 1]], "3×3"),
        ([[math.nan, 0, 0], [0, 1, 0], [0, 0, 1]], "3×3 finite"),
        ([[100, 0.1, 0], [0, 100, 0], [0, 0, 1]], "skew"),
        ([[100, 0, 0], [5, 100, 0], [0, 0, 1]], "skew"),
        ([[200, 0, 0], [0, 200, 0], [0, 0, 2]], r"divide it by K\[2, 2\]"),
        ([[-100, 0, 0], [0, 100, 0], [0, 0, 1]], "focal_length"),
        ([[100, 0, 0], [0, 0, 0], [0, 0, 1]], "focal_length"),
    ],
)
def test_an_impossible_matrix_is_refused(matrix: Any, reason: str) -> None:
    with pytest.raises(CameraError, match=reason):
        Camera.from_matrix(matrix)


def test_a_skew_within_rounding_is_taken() -> None:
    assert Camera.from_matrix(np.array([[1e3, 1e-5, 5], [0, 1e3, 5], [0, 0, 1]])).fx == 1e3
