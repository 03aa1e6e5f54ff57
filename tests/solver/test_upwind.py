"""The upwind scheme under a parallel light, as a user calls it: exact scenes, and images that are hard on a scheme."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.choices import Precision, Surface
from persfs_cl.masks import steps_from
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.complete import complete
from persfs_cl.solver.options import Options

FRONTAL, OBLIQUE = ps.ParallelLight(), ps.ParallelLight(0.15, -0.1)
MAX_SLOPE = 5.0

each_light = pytest.mark.parametrize("light", [FRONTAL, OBLIQUE], ids=["frontal", "oblique"])
both_ways = pytest.mark.parametrize("surface", ["away", "toward"])
each_turn = pytest.mark.parametrize(
    "turn", [np.fliplr, np.flipud, np.transpose], ids=["mirror", "upside down", "transpose"]
)


def solve(scene: Scene, **keywords: Any) -> ps.Solution:
    given = {"light": scene.light, "known_depth": scene.known_depth, "surface": scene.surface, "scheme": "upwind"}
    return ps.reconstruct(scene.image, scene.camera, **{**given, **keywords})


@pytest.mark.parametrize("make", [ps.bump, ps.bumps, ps.sphere_cap])
@both_ways
def test_error_is_several_times_less_than_by_lax_friedrichs(make: Any, surface: str) -> None:
    scene = make((80, 80), surface=surface, orientation=20.0)
    upwind, smeared = (
        ps.compare(solve(scene, scheme=scheme).depth, scene.depth).mean for scheme in ("upwind", "lax-friedrichs")
    )
    assert upwind < 0.3 * smeared


def test_a_bump_grows_from_its_singular_point() -> None:
    scene = ps.bump((101, 101)).seeded()
    solution = solve(scene)
    assert solution.iterations <= 6
    assert ps.compare(solution.depth, scene.depth).mean < 0.005


@each_turn
def test_turning_the_photograph_turns_the_surface(turn: Any) -> None:
    scene = ps.bump((37, 50), surface="toward")
    camera = ps.Camera(50.0)
    known = scene.known_depth
    one = ps.reconstruct(scene.image, camera, known_depth=known, scheme="upwind", tolerance=0.0, precision="float64")
    other = ps.reconstruct(
        turn(scene.image), camera, known_depth=turn(known), scheme="upwind", tolerance=0.0, precision="float64"
    )
    np.testing.assert_allclose(other.depth, turn(one.depth), rtol=1e-12)


def bound(known: np.ndarray, mask: np.ndarray, camera: ps.Camera, sign: float) -> np.ndarray:
    """The largest ±Z that can be reached from the known depths along pixels, uphill by at most the largest slope."""
    grid = camera.grid(known.shape)
    given = np.isfinite(known)
    steps = steps_from(given, mask | given)
    return np.asarray((sign * np.log(known[given])).max() + steps * MAX_SLOPE * max(grid.dx, grid.dy))


def uniform(low: float, high: float, shape: tuple[int, int], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(low, high, shape)


def with_region(image: np.ndarray, brightness: float) -> np.ndarray:
    """The middle of the image replaced."""
    changed = image.copy()
    rows, columns = (slice(length // 4, length - length // 4) for length in image.shape)
    changed[rows, columns] = brightness
    return changed


BUMP = ps.bump((31, 33)).image
HARD = {
    "flat": with_region(BUMP, 1.0),
    "dark": with_region(BUMP, 1e-6),
    "black": with_region(BUMP, 0.0),
    "dark noise": uniform(0.0, 0.1, (31, 33)),
    "noise": uniform(0.0, 1.0, (31, 33)),
    "bright or black": np.round(uniform(0.0, 1.0, (31, 33))),
    "row": uniform(0.1, 1.0, (1, 40)),
    "column": uniform(0.1, 1.0, (40, 1)),
    "two pixels": np.array([[0.9, 1.0]]),
}


@pytest.mark.parametrize("name", HARD)
@pytest.mark.parametrize("known", ["frame", "pixel"])
@both_ways
@each_light
def test_every_pixel_gets_a_depth_that_its_neighbours_allow(
    device: ps.Device, precision: str, name: str, known: str, surface: str, light: ps.ParallelLight
) -> None:
    image = HARD[name]
    depths = np.full(image.shape, np.nan)
    if known == "frame" and min(image.shape) > 1:
        depths[[0, -1]] = depths[:, [0, -1]] = 2.0
    depths[tuple(length // 3 for length in image.shape)] = 2.0
    camera = ps.Camera(40.0)
    keywords: dict[str, Any] = {"device": device, "precision": precision, "surface": surface, "light": light}
    solution = ps.reconstruct(
        image, camera, known_depth=depths, scheme="upwind", max_slope=MAX_SLOPE, tolerance=1e-4, **keywords
    )
    assert solution.status is ps.Status.CONVERGED
    assert solution.solved.all()
    assert np.isfinite(solution.depth).all()
    # A plane that faces the light is always bright enough: over it the surface rises from the lowest known value on.
    sign, grid = 1.0 if surface == "away" else -1.0, camera.grid(image.shape)
    facing = np.log(1.0 + light.p0 * grid.x + light.q0 * grid.y)
    climbed = sign * (solution.log_depth + facing)
    known_values = depths * np.exp(facing)
    assert (climbed <= bound(known_values, np.ones(image.shape, bool), camera, sign) + 1e-4).all()
    assert (climbed >= np.nanmin(sign * np.log(known_values)) - 1e-4).all()


@both_ways
def test_masks_with_lost_pixels_and_walls(device: ps.Device, precision: Precision, surface: Surface) -> None:
    shape, random = (37, 41), np.random.default_rng(3)
    camera, image = ps.Camera(50.0), uniform(0.2, 1.0, shape)
    mask, walls = random.uniform(size=shape) > 0.4, random.uniform(size=shape) > 0.9
    known = np.full(shape, np.nan)
    known[18, 20] = 1.5
    solution = ps.reconstruct(
        image,
        camera,
        mask=mask,
        walls=walls,
        known_depth=known,
        surface=surface,
        scheme="upwind",
        max_slope=MAX_SLOPE,
        device=device,
        precision=precision,
    )
    assert solution.unreached.any()
    assert not (solution.unreached & solution.solved).any()
    assert (solution.solved == np.isfinite(solution.depth)).all()
    wanted = mask | np.isfinite(known)
    np.testing.assert_array_equal((solution.solved | solution.unreached) & ~walls, wanted & ~walls)
    assert not solution.solved[walls & ~wanted].any()
    sign = 1.0 if surface == "away" else -1.0
    highest = bound(known, mask & ~walls, camera, sign)
    assert (sign * solution.log_depth <= highest + 1e-4)[solution.solved & ~walls].all()


def test_a_round_mask_with_its_rim_known_gives_the_surface_inside() -> None:
    scene = ps.bump((64, 64))
    rows, columns = np.indices((64, 64)) / 63 - 0.5
    inside, rim = rows**2 + columns**2 < 0.09, rows**2 + columns**2 < 0.11
    solution = solve(scene, mask=inside, known_depth=np.where(rim & ~inside, scene.depth, np.nan))
    assert ps.compare(solution.depth, scene.depth, mask=inside).mean < 0.003


def test_batch_gives_the_numbers_of_one_by_one() -> None:
    scenes = [ps.bump((30, 30)), ps.bump((20, 33), relief=0.1), ps.sphere_cap((30, 30))]
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        known_depth=[scene.known_depth for scene in scenes],
        scheme="upwind",
    )
    for scene, solution in zip(scenes, together, strict=True):
        np.testing.assert_array_equal(solve(scene).depth, solution.depth)


@pytest.mark.parametrize("boundary", ["outflow", "extrapolate"])
def test_the_boundaries_of_lax_friedrichs_are_refused(boundary: str) -> None:
    with pytest.raises(ps.InputError, match=rf"boundary='{boundary}' with scheme='upwind'.*boundary='wall'"):
        solve(ps.bump((20, 20)), boundary=boundary)


def test_a_light_that_some_pixels_look_into_is_refused() -> None:
    with pytest.raises(ps.InputError, match="look into the light"):
        ps.reconstruct(BUMP, ps.Camera(33.0), light=ps.ParallelLight(2.5, 0.0), scheme="upwind")


def test_auto_is_upwind_wherever_there_is_one() -> None:
    """With its own boundary; else the paper's scheme, with which eq. (12) goes under a parallel light."""
    cases: list[tuple[dict[str, Any], tuple[str, str]]] = [
        ({}, ("upwind", "wall")),
        ({"boundary": "fixed"}, ("upwind", "fixed")),
        ({"light": ps.ParallelLight(0.3, 0.1)}, ("upwind", "wall")),
        ({"light": ps.FlashLight()}, ("upwind", "wall")),
        ({"light": ps.FlashLight(), "reflectance": ps.OrenNayar(0.9)}, ("lax-friedrichs", "wall")),
        ({"reflectance": ps.Phong()}, ("lax-friedrichs", "outflow")),
        ({"reflectance": ps.OrenNayar(0.3)}, ("lax-friedrichs", "outflow")),
        ({"boundary": "outflow"}, ("lax-friedrichs", "outflow")),
        ({"boundary": "extrapolate"}, ("lax-friedrichs", "extrapolate")),
        ({"scheme": "lax-friedrichs"}, ("lax-friedrichs", "outflow")),
    ]
    for given, expected in cases:
        options = complete(cast("Options", given))
        assert (options["scheme"], options["boundary"]) == expected
