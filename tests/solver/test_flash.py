"""Photographs by the camera's own light, from image to surface: exact scenes, and images that are hard on a scheme."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.choices import Precision
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.reflectance import Reflectance

FLASH = ps.FlashLight()
MATERIALS = [ps.Lambertian(), ps.OrenNayar(0.4), ps.Phong()]

each_material = pytest.mark.parametrize("material", MATERIALS, ids=lambda material: type(material).__name__)
both_schemes = pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
each_turn = pytest.mark.parametrize(
    "turn", [np.fliplr, np.flipud, np.transpose], ids=["mirror", "upside down", "transpose"]
)


def hill(size: int, material: Reflectance = MATERIALS[0], **keywords: Any) -> Scene:
    return ps.hillside((size, size), surface="toward", light=FLASH, reflectance=material, **keywords)


def order(material: Reflectance) -> dict[str, Any]:
    """The default for matt surfaces; for others the same bits by kernels that are compiled in half the time."""
    return {} if material == ps.Lambertian() else {"ordering": "lexicographic"}


def solve(scene: Scene, **keywords: Any) -> ps.Solution:
    given = {"light": scene.light, "reflectance": scene.reflectance, **order(scene.reflectance)}
    return ps.reconstruct(scene.image, scene.camera, **{**given, **keywords})


def share_of_relief(scene: Scene, **keywords: Any) -> float:
    """Mean error of depth, from the image alone unless told otherwise."""
    solution = solve(scene, **keywords)
    assert solution.status is ps.Status.CONVERGED
    return ps.compare(solution.depth, scene.depth, mask=keywords.get("mask")).mean / float(np.ptp(scene.depth))


@pytest.mark.parametrize(("material", "most"), [(ps.OrenNayar(0.4), 0.0010), (ps.Phong(), 0.0025)], ids=repr)
def test_hill_is_found_to_first_order_from_the_image_alone(material: Reflectance, most: float) -> None:
    sizes = (51, 101, 201)
    errors = [share_of_relief(hill(size, material), max_iterations=6) for size in sizes]
    assert errors[-1] <= most
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] >= 0.9


def test_a_highlight_that_ends_with_a_bend_is_no_obstacle() -> None:
    """Of the exponent 1: the brightness falls steadily until the highlight is over, and then hardly any more."""
    assert share_of_relief(hill(101, ps.Phong(0.2, 0.8, 1.0))) <= 0.0055


@pytest.mark.parametrize("material", [*MATERIALS, ps.OrenNayar(0.9)], ids=repr)
def test_lax_friedrichs_finds_it_too(material: Reflectance) -> None:
    coarse, fine = (share_of_relief(hill(size, material), scheme="lax-friedrichs") for size in (40, 80))
    assert fine < 0.02
    assert fine < 0.7 * coarse


def test_a_material_that_is_not_brightest_face_on_goes_by_lax_friedrichs() -> None:
    scene = hill(31, ps.OrenNayar(0.9))
    solution = solve(scene)
    assert solution.parameters["scheme"] == "lax-friedrichs"
    assert solve(hill(31, ps.OrenNayar(0.4))).parameters["scheme"] == "upwind"
    with pytest.raises(ps.InputError, match=r"scheme='upwind'.*OrenNayar.*lax-friedrichs"):
        solve(scene, scheme="upwind")


@both_schemes
def test_the_gain_holds_the_unit_of_depth(scheme: str) -> None:
    scene = hill(41)
    one, other = (solve(scene, light=ps.FlashLight(gain=gain), scheme=scheme) for gain in (1.0, 100.0))
    np.testing.assert_allclose(other.depth, 10.0 * one.depth, rtol=2e-5)
    brighter = solve(replace(scene, image=100.0 * scene.image), scheme=scheme)
    np.testing.assert_allclose(brighter.depth, one.depth / 10.0, rtol=2e-5)


def disc(size: int, radius: float, centre: tuple[float, float]) -> np.ndarray:
    rows, columns = np.indices((size, size)) / (size - 1) - 0.5
    return np.asarray((rows - centre[0]) ** 2 + (columns - centre[1]) ** 2 < radius**2)


@both_schemes
def test_a_part_of_the_photograph_suffices(scheme: str) -> None:
    """From the edge of the mask, as from that of the image, the surface moves away."""
    scene, mask = hill(101), disc(101, 0.3, (-0.1, 0.15))
    solution = solve(scene, mask=mask, scheme=scheme)
    np.testing.assert_array_equal(solution.solved, mask)
    assert share_of_relief(scene, mask=mask, scheme=scheme) < 0.02


def test_pieces_of_a_mask_do_not_know_of_each_other() -> None:
    scene = hill(61)
    pieces = [disc(61, 0.15, centre) for centre in ((-0.2, -0.2), (0.2, 0.25))]
    together = solve(scene, mask=pieces[0] | pieces[1], tolerance=0.0)
    for piece in pieces:
        alone = solve(scene, mask=piece, tolerance=0.0)
        np.testing.assert_allclose(together.depth[piece], alone.depth[piece], rtol=1e-5)


def test_known_depths_are_kept_and_pull_the_surface_down() -> None:
    scene = hill(41)
    free = solve(scene)
    known = np.full(scene.depth.shape, np.nan)
    known[20, 20] = 0.9 * free.depth[20, 20]
    held = solve(scene, known_depth=known)
    assert held.depth[20, 20] == known[20, 20]
    assert (held.depth <= free.depth * (1.0 + 1e-6)).all()
    assert held.depth[20, 21] < 0.95 * free.depth[20, 21]


# By one material: which way a photograph lies is nothing to them.
@pytest.mark.quick_where(holds=lambda given: given["material"] == ps.Lambertian())
@each_turn
@each_material
def test_turning_the_photograph_turns_the_surface(turn: Any, material: Reflectance) -> None:
    scene = ps.hillside((21, 30), light=FLASH, reflectance=material, surface="toward")
    camera = ps.Camera(30.0)
    keywords: dict[str, Any] = {"light": FLASH, "reflectance": material, "tolerance": 0.0, "precision": "float64"}
    # What the wavefront gives too, and compiles fastest.
    keywords["ordering"] = "lexicographic"
    one = ps.reconstruct(scene.image, camera, **keywords)
    other = ps.reconstruct(turn(scene.image), camera, **keywords)
    np.testing.assert_allclose(other.depth, turn(one.depth), rtol=1e-12)


@pytest.mark.parametrize(
    ("material", "scheme"), [*[(material, "upwind") for material in MATERIALS], (ps.Phong(), "lax-friedrichs")]
)
def test_batch_gives_the_numbers_of_one_by_one(material: Reflectance, scheme: str) -> None:
    scenes = [
        ps.hillside(shape, light=FLASH, reflectance=material, surface="toward", relief=relief)
        for shape, relief in (((30, 30), 0.1), ((20, 33), 0.1), ((30, 30), 0.2))
    ]
    masks = [disc(30, 0.4, (0.0, 0.0)), None, None]
    keywords: dict[str, Any] = {"light": FLASH, "reflectance": material, "scheme": scheme, **order(material)}
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes], [scene.camera for scene in scenes], mask=masks, **keywords
    )
    for scene, mask, solution in zip(scenes, masks, together, strict=True):
        alone = solve(scene, mask=mask, scheme=scheme)
        np.testing.assert_array_equal(alone.depth, solution.depth)
        np.testing.assert_array_equal(alone.changes, solution.changes)


def uniform(low: float, high: float, shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(0).uniform(low, high, shape)


def with_region(image: np.ndarray, brightness: float) -> np.ndarray:
    """The middle of the image replaced."""
    changed = image.copy()
    rows, columns = (slice(length // 4, length - length // 4) for length in image.shape)
    changed[rows, columns] = brightness
    return changed


HARD = {
    "flat": np.ones((17, 19)),
    "flat region": with_region(uniform(0.2, 1.0, (17, 19)), 0.7),
    "dark region": with_region(uniform(0.2, 1.0, (17, 19)), 1e-5),
    "black region": with_region(uniform(0.2, 1.0, (17, 19)), 0.0),
    "glaring region": with_region(uniform(0.2, 1.0, (17, 19)), 1e6),
    "noise": uniform(0.0, 1.0, (17, 19)),
    "dark noise": uniform(0.0, 1e-3, (17, 19)),
    "bright or black": np.round(uniform(0.0, 1.0, (17, 19))),
    "row": uniform(0.1, 1.0, (1, 25)),
    "column": uniform(0.1, 1.0, (25, 1)),
    "two pixels": np.array([[0.9, 1.0]]),
}


@pytest.mark.filterwarnings("ignore:.* of the pixels to solve are darker")
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32" or given["material"] == MATERIALS[0])
@pytest.mark.parametrize("name", HARD)
@each_material
def test_every_pixel_gets_a_depth_at_which_it_may_be_as_bright(
    device: ps.Device, precision: Precision, name: str, material: Reflectance
) -> None:
    """No pixel is farther than if it faced the camera, nor climbs steeper than allowed from any neighbour."""
    image, camera, max_slope = HARD[name], ps.Camera(25.0), 20.0
    random = np.random.default_rng(1)
    mask = random.uniform(size=image.shape) > 0.3
    walls = random.uniform(size=image.shape) > 0.95
    mask.flat[0], walls.flat[0] = True, False
    for region, barriers in ((None, None), (mask, walls)):
        solution = ps.reconstruct(
            image,
            camera,
            light=FLASH,
            reflectance=material,
            mask=region,
            walls=barriers,
            max_slope=max_slope,
            device=device,
            precision=precision,
            **order(material),
        )
        assert solution.status is ps.Status.CONVERGED
        inside = np.ones(image.shape, bool) if region is None else mask & ~walls
        swept = solution.solved if solution.walls is None else solution.solved & ~solution.walls
        np.testing.assert_array_equal(swept, inside)
        assert np.isfinite(solution.depth[inside]).all()
        grid = camera.grid((image.shape[0], image.shape[1]))
        lit = np.maximum(image, 1e-6 * image[inside].max())
        facing = 0.5 * np.log(material.brightest / (lit * (1.0 + grid.x**2 + grid.y**2)))
        assert (solution.log_depth <= facing + 1e-5)[inside].all()
        climbs = [np.abs(np.diff(np.where(inside, solution.log_depth, np.nan), axis=axis)) for axis in (0, 1)]
        for climb, spacing in zip(climbs, (grid.dy, grid.dx), strict=True):
            assert (climb[np.isfinite(climb)] <= max_slope * spacing + 1e-4).all()


def test_a_pixel_without_neighbours_faces_the_camera() -> None:
    image, mask = np.full((9, 9), 0.25), np.zeros((9, 9), bool)
    mask[4, 6] = True
    camera = ps.Camera(20.0)
    solution = ps.reconstruct(image, camera, light=FLASH, mask=mask, precision="float64")
    assert solution.depth[4, 6] == pytest.approx(2.0 / np.sqrt(1.0 + (2.0 / 20.0) ** 2))


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"surface": "toward"}, "surface='toward' under a flash"),
        ({"boundary": "extrapolate"}, "boundary='extrapolate'"),
        ({"boundary": "extrapolate", "scheme": "lax-friedrichs"}, "boundary='extrapolate' under a flash"),
        ({"boundary": "outflow", "scheme": "upwind"}, "boundary='outflow' with scheme='upwind'"),
    ],
)
def test_what_makes_no_sense_is_refused(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        solve(hill(20), **keywords)
