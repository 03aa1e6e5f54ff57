"""The forward model: kernel against the analytic image, and against its NumPy formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.reference import reflectance_map
from persfs_cl.surface import log_depth_gradient

OBLIQUE = ps.ParallelLight(0.2, -0.1)


@pytest.mark.parametrize("light", [ps.ParallelLight(), OBLIQUE], ids=["frontal", "oblique"])
def test_kernel_equals_the_formula(device: ps.Device, precision: str, light: ps.ParallelLight) -> None:
    scene = ps.bumps(shape=(37, 53), light=light)
    depth = 7.0 * scene.depth
    depth[5:9, 11:20] = np.nan
    depth[20, :] = np.nan
    p, q = log_depth_gradient(depth, scene.camera)
    grid = scene.camera.grid((37, 53))
    expected = np.where(np.isfinite(depth), reflectance_map(p, q, grid.x, grid.y, light), np.nan)
    image = ps.render(depth, scene.camera, light=light, device=device, precision=precision)
    np.testing.assert_allclose(image, expected, atol=5e-5 if precision == "float32" else 1e-12)


@pytest.mark.parametrize("light", [ps.ParallelLight(), OBLIQUE], ids=["frontal", "oblique"])
def test_rendering_approaches_the_analytic_image_to_second_order(light: ps.ParallelLight) -> None:
    errors = []
    for size in (40, 80):
        scene = ps.bump(shape=(size, size), light=light)
        image = ps.render(scene.depth, scene.camera, light=light, precision="float64")
        errors.append(float(np.abs(image - scene.image)[1:-1, 1:-1].max()))
    assert errors[1] < 0.3 * errors[0]


def test_a_plane_facing_the_camera_is_fully_lit() -> None:
    np.testing.assert_allclose(ps.render(np.full((5, 6), 3.0), ps.Camera(10.0)), 1.0)


def test_mask_hides_pixels_and_cuts_derivatives() -> None:
    depth = np.ones((4, 8))
    depth[:, 4:] = 9.0
    mask = np.zeros((4, 8), bool)
    mask[:, :4] = True
    image = ps.render(depth, ps.Camera(10.0), mask=mask)
    np.testing.assert_allclose(image[:, :4], 1.0)
    assert np.isnan(image[:, 4:]).all()


@pytest.mark.parametrize(
    ("depth", "keywords", "message"),
    [
        (np.ones(4), {}, "height, width"),
        (np.zeros((3, 3)), {}, "down to 0"),
        (np.full((3, 3), np.nan), {}, "no finite value"),
        (np.ones((3, 3)), {"mask": np.ones((2, 2), bool)}, "mask"),
        (np.ones((3, 3)), {"light": 3}, "no known light"),
    ],
)
def test_bad_input_is_refused(depth: Any, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        ps.render(depth, ps.Camera(10.0), **keywords)


def test_wrong_kinds_of_input_are_refused() -> None:
    with pytest.raises(ps.InputError, match="no array of numbers"):
        ps.render("depth.npy", ps.Camera(10.0))
    with pytest.raises(ps.InputError, match="no Camera"):
        ps.render(np.ones((3, 3)), None)  # type: ignore[arg-type]
    with pytest.raises(ps.InputError, match="precision"):
        ps.render(np.ones((3, 3)), ps.Camera(10.0), precision="x")
    with pytest.raises(ps.InputError, match="infinite"):
        ps.render(np.full((3, 3), np.inf), ps.Camera(10.0))
