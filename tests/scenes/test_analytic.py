from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import CameraError, InputError
from persfs_cl.scenes.analytic import hillside, sphere_cap, vase
from persfs_cl.scenes.framed import bump, bumps
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.forward import reflectance_map
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.phong import Phong
from persfs_cl.shading.reflectance import Reflectance

MakeScene = Callable[..., Scene]

FRONTAL = ParallelLight()
OBLIQUE = ParallelLight(0.05, -0.03)
FLASH = FlashLight(gain=3.0)
BESIDE = FlashLight(gain=3.0, offset=(0.1, -0.05, -0.02))

every_surface = pytest.mark.parametrize("surface", ["away", "toward"])
every_light = pytest.mark.parametrize("light", [FRONTAL, OBLIQUE], ids=["frontal", "oblique"])
every_flash = pytest.mark.parametrize("light", [FLASH, BESIDE], ids=["coaxial", "beside"])
every_material = pytest.mark.parametrize(
    "reflectance", [Lambertian(), OrenNayar(0.4), Phong()], ids=["lambertian", "oren-nayar", "phong"]
)
every_scene = pytest.mark.parametrize("make", [vase, bump, bumps, hillside, sphere_cap])
every_free_scene = pytest.mark.parametrize("make", [bump, bumps, hillside, sphere_cap])


def interior(values: Array) -> Array:
    return values[1:-1, 1:-1]


def smooth(scene: Scene) -> NDArray[np.bool_]:
    """Pixels at which differences do not reach across a silhouette or crease."""
    least_relief = {"vase": 0.1, "sphere cap": 0.02}.get(scene.name, -1.0)
    return interior(np.abs(scene.depth - 1)) > least_relief


def central_differences(values: Array, scene: Scene) -> tuple[Array, Array]:
    grid = scene.camera.grid((scene.depth.shape[0], scene.depth.shape[1]))
    along_x = (values[1:-1, 2:] - values[1:-1, :-2]) / (2 * grid.dx)
    along_y = (values[2:, 1:-1] - values[:-2, 1:-1]) / (2 * grid.dy)
    return along_x, along_y


def root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def order(errors: list[float]) -> float:
    return float(np.log2(errors[-2] / errors[-1]))


@pytest.mark.parametrize("known", ["background and frame", "background"])
@every_surface
def test_vase_is_equation_13(surface: Any, known: Any) -> None:
    sign = 1 if surface == "away" else -1

    def squared_height(u: Any, v: Any) -> Any:
        return (0.15 - 0.1 * v * (6 * v + 1) ** 2 * (v - 1) ** 2 * (3 * v - 2)) ** 2 - u**2

    def log_depth(u: Any, v: Any) -> Any:
        return np.log(1 + sign * np.sqrt(squared_height(u, v)))

    depth, image = np.ones((100, 100)), np.ones((100, 100))
    for row in range(100):
        for column in range(100):
            u, v = (column + 0.5) / 100 - 0.5, 1 - (row + 0.5) / 100
            if squared_height(u, v) > 0:
                # A complex step differentiates to rounding error.
                p = log_depth(u + 1e-30j, v).imag / 1e-30
                q = -log_depth(u, v + 1e-30j).imag / 1e-30
                depth[row, column] = np.exp(log_depth(u, v))
                w = 1 + u * p + (0.5 - v) * q
                image[row, column] = round(max(w / np.sqrt(p**2 + q**2 + w**2), 0.0) * 255) / 255

    scene = vase(surface=surface, known=known)
    np.testing.assert_allclose(scene.depth, depth, rtol=1e-12)
    np.testing.assert_allclose(scene.image, image, atol=1e-12)
    np.testing.assert_array_equal(scene.mask, depth != 1)
    grid = scene.camera.grid((100, 100))
    np.testing.assert_allclose(grid.x, (np.arange(100) + 0.5) / 100 - 0.5, atol=1e-15)
    np.testing.assert_allclose(grid.y[:, 0], (np.arange(100) + 0.5) / 100 - 0.5, atol=1e-15)

    expected_known = depth == 1
    if known == "background and frame":
        expected_known[[0, -1], :] = expected_known[:, [0, -1]] = True
    np.testing.assert_array_equal(~np.isnan(scene.known_depth), expected_known)
    np.testing.assert_array_equal(scene.known_depth[expected_known], scene.depth[expected_known])


def test_vase_is_a_hollow_with_self_shadow_and_cut_by_the_frame() -> None:
    scene = vase(bits=None)
    grid = scene.camera.grid((100, 100))
    unclipped = reflectance_map(*scene.log_depth_gradient, grid.x, grid.y, FRONTAL, Lambertian())
    assert unclipped.min() < 0
    np.testing.assert_array_equal(scene.image, np.maximum(unclipped, 0))
    assert scene.mask[0].any()
    assert scene.mask[-1].any()


@every_scene
@every_surface
def test_slopes_and_image_are_those_of_the_surface(make: MakeScene, surface: Any) -> None:
    """Differences of ln depth, and of the points in space, tend to the analytic values with order 2."""
    keywords: dict[str, Any] = {"light": OBLIQUE, "surface": surface, "bits": None}
    if make is not vase:
        keywords["orientation"] = 25.0
    slope_errors, image_errors = [], []
    for size in (80, 160, 320):
        scene = make((size, size * 5 // 4), **keywords)
        compared = smooth(scene)
        p, q = central_differences(np.log(scene.depth), scene)
        errors = [
            (estimate - interior(exact))[compared]
            for estimate, exact in zip((p, q), scene.log_depth_gradient, strict=True)
        ]
        slope_errors.append(root_mean_square(np.concatenate(errors)))

        grid = scene.camera.grid(scene.image.shape)
        points = (scene.depth * grid.x, scene.depth * grid.y, scene.depth)
        tangents = [central_differences(coordinate, scene) for coordinate in points]
        along_x, along_y = np.moveaxis(np.array(tangents), 0, -1)
        normal = np.cross(along_y, along_x)
        to_light = np.array([-OBLIQUE.p0, -OBLIQUE.q0, -1.0]) / OBLIQUE.norm
        cosine = (normal @ to_light) / np.linalg.norm(normal, axis=-1)
        image_errors.append(root_mean_square((np.maximum(cosine, 0) - interior(scene.image))[compared]))
    assert slope_errors[-1] < 2e-3
    assert order(slope_errors) == pytest.approx(2, abs=0.15)
    assert order(image_errors) == pytest.approx(2, abs=0.15)


@every_scene
@every_surface
@every_light
def test_image_is_the_quantised_reflectance_map(make: MakeScene, surface: Any, light: ParallelLight) -> None:
    exact = make((40, 50), surface=surface, light=light, bits=None)
    grid = exact.camera.grid((40, 50))
    reflectance = reflectance_map(*exact.log_depth_gradient, grid.x, grid.y, light, Lambertian())
    np.testing.assert_array_equal(exact.image, np.clip(reflectance, 0, 1))
    levels = make((40, 50), surface=surface, light=light, bits=3).image * 7
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-12)
    assert np.abs(levels / 7 - exact.image).max() <= 0.5 / 7 + 1e-12


@every_free_scene
@every_surface
@every_light
def test_equation_determines_every_pixel(make: MakeScene, surface: Any, light: ParallelLight) -> None:
    """{P : H(P) <= 0} is an ellipse: for a frontal light, E > r / sqrt(1 + r²)."""
    scene = make((60, 80), surface=surface, light=light, orientation=30)
    grid = scene.camera.grid((60, 80))
    x, y = np.broadcast_arrays(grid.x, grid.y)
    brightness = light.norm * scene.image
    off_x, off_y = x - light.p0, y - light.q0
    determinant = (brightness**2 * (1 + x**2) - off_x**2) * (brightness**2 * (1 + y**2) - off_y**2)
    determinant -= (brightness**2 * x * y - off_x * off_y) ** 2
    assert determinant.min() > 0
    assert (brightness**2 * (1 + x**2) - off_x**2).min() > 0
    if light == FRONTAL:
        radius = np.hypot(x, y)
        assert (scene.image > radius / np.sqrt(1 + radius**2)).all()


def unknown_dips(scene: Scene) -> int:
    """How many unknown pixels have only higher neighbours, as seen from the plane that faces the light."""
    grid = scene.camera.grid((scene.depth.shape[0], scene.depth.shape[1]))
    assert isinstance(scene.light, ParallelLight)
    height = np.log(scene.depth) + np.log(1 + grid.x * scene.light.p0 + grid.y * scene.light.q0)
    if scene.surface == "toward":
        height = -height
    padded = np.pad(height, 1, constant_values=np.inf)
    rows, columns = height.shape
    neighbours = [
        padded[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]
        for down in (-1, 0, 1)
        for right in (-1, 0, 1)
        if (down, right) != (0, 0)
    ]
    # The flat plane around a sphere cap has equal neighbours.
    return int((np.isnan(scene.known_depth) & (np.min(neighbours, axis=0) > height + 1e-12)).sum())


@every_free_scene
@every_surface
@every_light
@pytest.mark.parametrize("shape", [(40, 40), (41, 41), (30, 47)])
def test_known_values_reach_every_pixel(
    make: MakeScene, surface: Any, light: ParallelLight, shape: tuple[int, int]
) -> None:
    assert unknown_dips(make(shape, surface=surface, light=light, orientation=10)) == 0


@pytest.mark.parametrize("make", [bump, sphere_cap])
@every_surface
@pytest.mark.parametrize("shape", [(40, 40), (41, 41), (30, 47)])
def test_one_singular_point_reaches_every_pixel(make: MakeScene, surface: Any, shape: tuple[int, int]) -> None:
    scene = make(shape, surface=surface, orientation=10)
    seeded = scene.seeded()
    assert seeded.surface != scene.surface
    assert unknown_dips(seeded) == 0
    known = ~np.isnan(seeded.known_depth)
    assert 1 <= known.sum() <= 4
    np.testing.assert_array_equal(seeded.known_depth[known], scene.depth[known])
    extreme = scene.depth.max() if surface == "away" else scene.depth.min()
    assert extreme in seeded.known_depth[known]


def test_singular_point_on_a_pixel_is_one_pixel() -> None:
    assert (~np.isnan(bump((41, 41)).seeded().known_depth)).sum() == 1
    assert (~np.isnan(sphere_cap((41, 41), centre=(0.0, 0.0), orientation=33).seeded().known_depth)).sum() == 1
    assert bump((41, 41)).image[20, 20] == 1


@every_surface
def test_dip_of_bumps_is_known_and_bright_and_needed(surface: Any) -> None:
    scene = bumps((41, 41), surface=surface)
    inside = interior(scene.known_depth)
    assert np.argwhere(~np.isnan(inside)).tolist() == [[19, 19]]
    assert scene.image[20, 20] == pytest.approx(1, abs=1e-12)
    assert scene.singular_point is None
    inside[:] = np.nan
    assert unknown_dips(scene) == 1


@every_free_scene
@every_surface
@every_light
def test_a_quarter_turn_is_rot90(make: MakeScene, surface: Any, light: ParallelLight) -> None:
    keywords: dict[str, Any] = {"focal_length": 60.0, "surface": surface}
    scene = make((40, 50), light=light, orientation=20, **keywords)
    turned = make((50, 40), light=ParallelLight(light.q0, -light.p0), orientation=110, **keywords)
    np.testing.assert_allclose(turned.depth, np.rot90(scene.depth), atol=1e-13)
    np.testing.assert_allclose(turned.image, np.rot90(scene.image), atol=1e-12)
    np.testing.assert_allclose(turned.known_depth, np.rot90(scene.known_depth), atol=1e-13)
    p, q = scene.log_depth_gradient
    np.testing.assert_allclose(turned.log_depth_gradient[0], np.rot90(q), atol=1e-12)
    np.testing.assert_allclose(turned.log_depth_gradient[1], -np.rot90(p), atol=1e-12)
    if scene.singular_point is not None and turned.singular_point is not None:
        row, column = scene.singular_point
        np.testing.assert_allclose(turned.singular_point, (49 - column, row), atol=1e-8)


@pytest.mark.parametrize(("make", "axis"), [(vase, 1), (bump, 0), (bump, 1), (bumps, 1), (sphere_cap, 0)])
@every_surface
def test_mirror_symmetry(make: MakeScene, axis: int, surface: Any) -> None:
    sign = np.where(np.arange(2) == axis, -1, 1)
    scene = make((36, 45), surface=surface, light=ParallelLight(0.05, 0.03), bits=None)
    mirrored = make((36, 45), surface=surface, light=ParallelLight(0.05 * sign[1], 0.03 * sign[0]), bits=None)
    np.testing.assert_allclose(np.flip(scene.depth, axis), mirrored.depth, atol=1e-13)
    np.testing.assert_allclose(np.flip(scene.image, axis), mirrored.image, atol=1e-11)
    np.testing.assert_allclose(np.flip(scene.known_depth, axis), mirrored.known_depth, atol=1e-13)


@pytest.mark.parametrize("make", [vase, bump, bumps])
def test_away_and_toward_mirror_each_other_in_depth(make: MakeScene) -> None:
    away, toward = make((36, 45), surface="away"), make((36, 45), surface="toward")
    np.testing.assert_allclose(away.depth + toward.depth, 2, rtol=1e-14)
    for one, other in zip(away.log_depth_gradient, toward.log_depth_gradient, strict=True):
        np.testing.assert_allclose(one * away.depth, -other * toward.depth, atol=1e-12)
    assert away.depth.min() >= 1 >= toward.depth.max()


@every_surface
def test_bump_is_the_documented_formula(surface: Any) -> None:
    scene = bump((31, 45), surface=surface, relief=0.3, orientation=40)
    for row, column in ((15, 22), (4, 30), (0, 0), (29, 11)):
        right, down = column - 22, row - 15
        across, up = right / 15.5, -down / 15.5
        angle = np.radians(40)
        turned = across * np.cos(angle) + up * np.sin(angle), up * np.cos(angle) - across * np.sin(angle)
        window = (1 - (right / 22.5) ** 2) * (1 - (down / 15.5) ** 2)
        height = 0.3 * window * np.exp(-(turned[0] ** 2) - 3 * turned[1] ** 2)
        expected = 1 + height if surface == "away" else 1 - height
        assert scene.depth[row, column] == pytest.approx(expected, abs=1e-14)


@every_surface
def test_hillside_is_a_plane_and_the_documented_bump(surface: Any) -> None:
    scene = hillside((31, 45), surface=surface, relief=0.2, focal_length=40.0, orientation=30)
    grid = scene.camera.grid((31, 45))
    x, y = np.broadcast_arrays(grid.x, grid.y)
    unit, angle = 15.5 / 40, np.radians(30)
    right, down = (x * np.cos(angle) - y * np.sin(angle)) / unit, (x * np.sin(angle) + y * np.cos(angle)) / unit
    value = 0.2 * np.exp(-4 * ((right - 0.3) ** 2 + (down + 0.2) ** 2))
    plane = scene.depth / (1 + value if surface == "away" else 1 - value)
    # The plane through (0, 0, 1) whose normal is the viewing ray at X = (-0.4, 0.25).
    across = unit * (-0.4 * np.cos(angle) + 0.25 * np.sin(angle))
    along = unit * (0.4 * np.sin(angle) + 0.25 * np.cos(angle))
    np.testing.assert_allclose(plane * (x * across + y * along + 1), 1, rtol=1e-13)


@every_surface
@pytest.mark.parametrize("focal_length", [None, 300.0])
@pytest.mark.parametrize("orientation", [0.0, 30.0, 200.0])
def test_flash_determines_the_hillside_without_boundary_values(
    surface: Any, focal_length: float | None, orientation: float
) -> None:
    """At every edge the solution's characteristics leave the image: -∂H/∂P = -(A P + b) points inwards."""
    scene = hillside((40, 50), surface=surface, focal_length=focal_length, orientation=orientation)
    grid = scene.camera.grid((40, 50))
    p, q = scene.log_depth_gradient
    w = 1 + grid.x * p + grid.y * q
    rightwards, downwards = p + grid.x * w, q + grid.y * w
    least = min((-rightwards[:, 0]).min(), rightwards[:, -1].min(), (-downwards[0]).min(), downwards[-1].min())
    assert (least > 0) == (surface == "toward" or focal_length is None)


@every_surface
def test_sphere_cap_lies_on_a_sphere_and_a_plane(surface: Any) -> None:
    scene = sphere_cap((61, 61), surface=surface, relief=0.12, radius=0.5, centre=(0.3, -0.1))
    grid = scene.camera.grid((61, 61))
    sign = 1 if surface == "away" else -1
    x, y = scene.depth * grid.x, scene.depth * grid.y
    # Half the image is ½ wide at depth 1; a cap of base radius a and height h has radius (a² + h²) / 2h.
    middle, base = (0.15, -0.05), 0.25
    radius = (base**2 + 0.12**2) / 0.24
    distance = np.sqrt((x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (scene.depth - 1 - sign * (0.12 - radius)) ** 2)
    cap = scene.depth != 1
    np.testing.assert_allclose(distance[cap], radius, rtol=1e-13)
    np.testing.assert_array_equal(cap, np.hypot(grid.x - middle[0], grid.y - middle[1]) < base)
    assert np.abs(scene.depth - 1).max() == pytest.approx(0.12, abs=1e-3)
    assert (scene.image[~cap] == 1).all()
    assert scene.singular_point is not None
    row, column = scene.singular_point
    top = 1 + sign * 0.12
    assert column == pytest.approx(middle[0] / top * 61 + 30)
    assert row == pytest.approx(middle[1] / top * 61 + 30)


@every_scene
def test_same_surface_at_every_image_size(make: MakeScene) -> None:
    coarse, fine = make((20, 30), light=OBLIQUE, bits=None), make((60, 90), light=OBLIQUE, bits=None)
    np.testing.assert_allclose(fine.depth[1::3, 1::3], coarse.depth, rtol=1e-13)
    np.testing.assert_allclose(fine.image[1::3, 1::3], coarse.image, atol=1e-11)


@pytest.mark.parametrize("make", [bump, bumps, sphere_cap])
def test_scenes_fill_the_view_of_any_focal_length(make: MakeScene) -> None:
    scene = make((40, 50), focal_length=(200.0, 150.0), relief=0.01)
    assert (np.abs(scene.depth - 1) > 0.005).any()
    assert interior(np.isnan(scene.known_depth)).any()
    assert not np.isnan(scene.known_depth[[0, -1], :]).any()
    assert not np.isnan(scene.known_depth[:, [0, -1]]).any()
    assert np.abs(scene.depth[[0, -1], :] - 1).max() < 0.001
    assert scene.mask.all()


@every_scene
@every_surface
@every_flash
@every_material
def test_flash_image_is_that_of_the_surface_in_space(
    make: MakeScene, surface: Any, light: FlashLight, reflectance: Reflectance
) -> None:
    """From points and normals in space, the normals from differences, which tend to the true ones with order 2."""
    errors = []
    for size in (80, 160):
        scene = make((size, size), light=light, reflectance=reflectance, surface=surface, bits=None)
        grid = scene.camera.grid(scene.image.shape)
        points = np.stack(np.broadcast_arrays(scene.depth * grid.x, scene.depth * grid.y, scene.depth))
        tangents = [central_differences(coordinate, scene) for coordinate in points]
        along_x, along_y = np.moveaxis(np.array(tangents), 0, -1)
        normal = np.cross(along_y, along_x)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        at = np.moveaxis(points, 0, -1)[1:-1, 1:-1]
        to_lamp = np.array(light.offset) - at
        distance = np.linalg.norm(to_lamp, axis=-1)
        to_lamp /= distance[..., None]
        to_camera = -at / np.linalg.norm(at, axis=-1, keepdims=True)
        lit, seen, between = (
            (one * other).sum(-1) for one, other in ((normal, to_lamp), (normal, to_camera), (to_lamp, to_camera))
        )
        expected = light.gain * np.maximum(reflectance.shade(lit, seen, between), 0) / distance**2
        errors.append(root_mean_square((expected - interior(scene.image))[smooth(scene)]))
    assert errors[-1] < 0.02
    assert order(errors) == pytest.approx(2, abs=0.25)


def test_flash_on_a_plane_that_faces_the_camera() -> None:
    """At depth d the lamp at the camera is d R away and stands at cos θ = 1 / R."""
    x, y = np.linspace(-0.6, 0.5, 7), np.linspace(-0.3, 0.4, 5)[:, None]
    ray = np.sqrt(1 + x**2 + y**2)
    log_depth = np.full((5, 7), np.log(2.5))
    image = FlashLight(gain=8.0).brightness(log_depth, 0.0, 0.0, x, y, Lambertian())
    np.testing.assert_allclose(image, 8.0 / ray / (2.5 * ray) ** 2, rtol=1e-14)
    unfading = FlashLight(falloff=False, gain=8.0).brightness(log_depth, 0.0, 0.0, x, y, Lambertian())
    np.testing.assert_allclose(np.broadcast_to(unfading, (5, 7)), 8.0 / ray, rtol=1e-14)
    # The same plane lit from (0.3, -0.2, 1), in the plane z = 1, which is 1.5 from it.
    beside = FlashLight(gain=8.0, offset=(0.3, -0.2, 1.0)).brightness(log_depth, 0.0, 0.0, x, y, Lambertian())
    squared = 1.5**2 + (2.5 * x - 0.3) ** 2 + (2.5 * y + 0.2) ** 2
    np.testing.assert_allclose(beside, 8.0 * 1.5 / squared**1.5, rtol=1e-14)


def hillside_under(light: Light, reflectance: Reflectance, enlarged: float = 1.0) -> Array:
    scene = hillside((9, 12))
    grid, (p, q) = scene.camera.grid((9, 12)), scene.log_depth_gradient
    return light.brightness(np.log(enlarged * scene.depth), p, q, grid.x, grid.y, reflectance)


@every_material
@pytest.mark.parametrize("falloff", [True, False])
def test_a_lamp_near_the_camera_tends_to_one_at_the_camera(reflectance: Reflectance, falloff: bool) -> None:
    at_camera = hillside_under(FlashLight(falloff=falloff), reflectance)
    errors = []
    for near in (1e-3, 1e-6):
        beside = FlashLight(falloff=falloff, offset=(near, -near, 0.5 * near))
        errors.append(np.abs(hillside_under(beside, reflectance) - at_camera).max())
    assert 0 < errors[0] < 0.02
    assert errors[1] < 1.01e-3 * errors[0]


@every_material
@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.1, -0.2, -0.05)])
def test_gain_sets_the_unit_of_depth(reflectance: Reflectance, offset: tuple[float, float, float]) -> None:
    right, down, forward = offset
    image = hillside_under(FlashLight(gain=2.0, offset=offset), reflectance)
    light = FlashLight(gain=2.0 * 49.0, offset=(7 * right, 7 * down, 7 * forward))
    np.testing.assert_allclose(hillside_under(light, reflectance, enlarged=7.0), image, rtol=1e-12)


@every_material
def test_a_distant_lamp_tends_to_a_parallel_light(reflectance: Reflectance) -> None:
    light = ParallelLight(0.3, -0.1)
    far = FlashLight(gain=light.norm**2 * 1e12, offset=(-0.3e6, 0.1e6, -1e6))
    np.testing.assert_allclose(hillside_under(far, reflectance), hillside_under(light, reflectance), rtol=2e-5)


@every_scene
@every_material
def test_parallel_light_on_any_material(make: MakeScene, reflectance: Reflectance) -> None:
    scene = make((40, 50), light=OBLIQUE, reflectance=reflectance, bits=None)
    grid = scene.camera.grid((40, 50))
    expected = reflectance_map(*scene.log_depth_gradient, grid.x, grid.y, OBLIQUE, reflectance)
    np.testing.assert_array_equal(scene.image, np.clip(expected, 0, 1))
    assert scene.reflectance == reflectance


@every_scene
@every_flash
def test_flash_leaves_the_scene_as_it_is(make: MakeScene, light: Light) -> None:
    frontal, flash = make((40, 50), bits=None), make((40, 50), light=light, bits=None)
    np.testing.assert_array_equal(flash.depth, frontal.depth)
    np.testing.assert_array_equal(flash.known_depth, frontal.known_depth)
    np.testing.assert_array_equal(flash.mask, frontal.mask)
    assert flash.light == light
    assert flash.image.max() > 1
    assert flash.singular_point is None


def test_only_a_lambertian_singular_point_has_full_brightness() -> None:
    assert bump(reflectance=Phong()).singular_point is None
    assert sphere_cap(reflectance=OrenNayar(0.3)).singular_point is None


@every_scene
@every_flash
def test_flash_image_is_quantised_by_its_brightest_value(make: MakeScene, light: Light) -> None:
    exact = make((40, 50), light=light, bits=None).image
    for noise in (0.0, 0.02):
        image = make((40, 50), light=light, bits=5, noise=noise).image
        levels = image / image.max() * 31
        np.testing.assert_allclose(levels, np.round(levels), atol=1e-9)
        if not noise:
            assert image.max() == exact.max()
            assert np.abs(image - exact).max() <= 0.5 / 31 * exact.max() * (1 + 1e-12)


@pytest.mark.parametrize("light", [FRONTAL, FLASH], ids=["frontal", "flash"])
def test_noise_is_that_of_its_seed_and_of_its_strength(light: Light) -> None:
    def image(noise: float, seed: int = 0) -> Array:
        return hillside((200, 200), light=light, noise=noise, seed=seed).image

    exact, noisy = image(0.0), image(0.02, seed=5)
    np.testing.assert_array_equal(noisy, image(0.02, seed=5))
    assert (noisy != image(0.02, seed=6)).mean() > 0.5
    white = 1.0 if light == FRONTAL else exact.max()
    away_from_the_ends = exact < 0.9 * white
    difference = (noisy - exact)[away_from_the_ends] / white
    # Five standard errors of the mean and of the standard deviation.
    count = difference.size
    assert abs(difference.mean()) < 5 * 0.02 / np.sqrt(count)
    assert difference.std() == pytest.approx(0.02, rel=5 / np.sqrt(2 * count))


def test_noise_stays_in_the_range_of_its_light() -> None:
    under_parallel_light = vase(noise=0.5, bits=None).image
    assert under_parallel_light.min() == 0
    assert under_parallel_light.max() == 1
    under_flash = vase(noise=0.5, bits=None, light=FLASH).image
    assert under_flash.min() == 0
    assert under_flash.max() > vase(bits=None, light=FLASH).image.max()


def test_vase_offset_moves_the_background() -> None:
    assert vase(offset=3.0).depth.min() == 3
    np.testing.assert_allclose(vase(offset=3.0).depth - 3, vase().depth - 1, atol=1e-14)


@pytest.mark.parametrize("scene", [vase(), bumps(), bump(light=OBLIQUE)], ids=["vase", "bumps", "oblique"])
def test_only_a_single_singular_point_seeds(scene: Scene) -> None:
    with pytest.raises(InputError, match="no single singular point"):
        scene.seeded()


@pytest.mark.parametrize(
    ("make", "keywords", "message"),
    [
        (vase, {"shape": (2, 50)}, r"shape=\(2, 50\)"),
        (bump, {"shape": (20.0, 20)}, r"shape=\(20.0, 20\)"),
        (bump, {"shape": 20}, "shape=20"),
        (vase, {"known": "frame"}, "known='frame'.*choose"),
        (vase, {"offset": 0.0}, "offset=0.0"),
        (vase, {"offset": 0.2, "surface": "toward"}, r"offset=0.2.*more than 0.28"),
        (vase, {"bits": 0}, "bits=0"),
        (bump, {"bits": 8.0}, "bits=8.0"),
        (vase, {"surface": "up"}, 'surface=\'up\'.*"away" or "toward"'),
        (bump, {"surface": "up"}, "surface='up'"),
        (sphere_cap, {"surface": "up"}, "surface='up'"),
        (bump, {"light": None}, "light=None"),
        (sphere_cap, {"light": None}, "light=None"),
        (bump, {"light": FlashLight(offset=(0.0, 0.0, 9.0))}, "lights nothing"),
        (bumps, {"reflectance": None}, "reflectance=None"),
        (vase, {"noise": -0.1}, "noise=-0.1"),
        (vase, {"noise": np.nan}, "noise=nan"),
        (hillside, {"seed": 0.5}, "seed=0.5"),
        (hillside, {"seed": -1}, "seed=-1"),
        (hillside, {"focal_length": 10.0}, "focal_length=10.0.*past the slope"),
        (hillside, {"relief": 1.1, "surface": "toward"}, "relief=1.1.*less"),
        (hillside, {"surface": "up"}, "surface='up'"),
        (bump, {"relief": -0.1}, "relief=-0.1"),
        (bump, {"relief": 1.5, "surface": "toward"}, "relief=1.5.*less"),
        (bumps, {"orientation": np.inf}, "orientation=inf"),
        (bumps, {"relief": np.nan}, "relief=nan"),
        (sphere_cap, {"radius": 0.0}, "radius=0.0"),
        (sphere_cap, {"radius": 0.9}, "radius=0.9.*below 1"),
        (sphere_cap, {"relief": 0.29}, "relief=0.29 inclines.*less than 0.203"),
        (sphere_cap, {"centre": (np.nan, 0.0)}, "centre"),
    ],
)
def test_wrong_keywords_are_named(make: MakeScene, keywords: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**keywords)


def test_impossible_camera_is_refused() -> None:
    with pytest.raises(CameraError):
        bump(focal_length=-5.0)
