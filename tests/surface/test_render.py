"""The forward model: kernel against the analytic image, and against its NumPy formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.choices import Precision
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface.geometry import log_depth_gradient

OBLIQUE = ps.ParallelLight(0.2, -0.1)
FLASH = ps.FlashLight(gain=3.0)

each_model = pytest.mark.parametrize(
    ("light", "reflectance"),
    [
        (ps.ParallelLight(), ps.Lambertian()),
        (OBLIQUE, ps.Lambertian()),
        *[(FLASH, material) for material in (ps.Lambertian(), ps.OrenNayar(0.4), ps.OrenNayar(0.9), ps.Phong())],
    ],
    ids=[
        "frontal",
        "oblique",
        "flash",
        "flash on a rough surface",
        "flash on a very rough one",
        "flash on a shiny one",
    ],
)


@each_model
def test_kernel_equals_the_formula(
    device: ps.Device, precision: Precision, light: Light, reflectance: Reflectance
) -> None:
    scene = ps.bumps(shape=(37, 53))
    depth = 7.0 * scene.depth
    depth[5:9, 11:20] = np.nan
    depth[20, :] = np.nan
    p, q = log_depth_gradient(depth, scene.camera)
    grid = scene.camera.grid((37, 53))
    expected = light.brightness(np.log(depth), p, q, grid.x, grid.y, reflectance)
    assert np.isnan(expected).sum() == np.isnan(depth).sum()
    image = ps.render(depth, scene.camera, light=light, reflectance=reflectance, device=device, precision=precision)
    largest = np.nanmax(expected)
    np.testing.assert_allclose(image, expected, atol=largest * (1e-4 if precision == "float32" else 1e-12))


@each_model
def test_rendering_approaches_the_analytic_image_to_second_order(light: Light, reflectance: Reflectance) -> None:
    errors = []
    for size in (40, 80):
        scene = ps.hillside(shape=(size, size), light=light, reflectance=reflectance)
        image = ps.render(scene.depth, scene.camera, light=light, reflectance=reflectance, precision="float64")
        errors.append(float(np.abs(image - scene.image)[1:-1, 1:-1].max()))
    assert errors[1] < 0.3 * errors[0]


def test_twice_the_distance_has_a_quarter_of_the_light() -> None:
    scene = ps.hillside(shape=(20, 30))
    near, far = (ps.render(scale * scene.depth, scene.camera, light=FLASH) for scale in (1.0, 2.0))
    np.testing.assert_allclose(near, 4.0 * far, rtol=1e-5)


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
        (np.zeros((3, 3)), {}, r"depth\[0, 0\]=0.0 is not a distance"),
        (np.full((3, 3), np.nan), {}, "no finite value"),
        (np.ones((3, 3)), {"mask": np.ones((2, 2), bool)}, "mask"),
        (np.ones((3, 3)), {"light": 3}, "no known light"),
        (np.ones((3, 3)), {"light": "flash"}, r"only the name of one: give persfs_cl\.FlashLight\(\)"),
    ],
)
def test_bad_input_is_refused(depth: Any, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        ps.render(depth, ps.Camera(10.0), **keywords)


def test_wrong_kinds_of_input_are_refused() -> None:
    with pytest.raises(ps.InputError, match="is no array"):
        ps.render("depth.npy", ps.Camera(10.0))
    with pytest.raises(ps.InputError, match="no Camera"):
        ps.render(np.ones((3, 3)), None)  # type: ignore[arg-type]
    with pytest.raises(ps.InputError, match="precision"):
        ps.render(np.ones((3, 3)), ps.Camera(10.0), precision="x")  # type: ignore[arg-type]
    with pytest.raises(ps.InputError, match=r"depth\[0, 0\]=inf"):
        ps.render(np.full((3, 3), np.inf), ps.Camera(10.0))
