"""Fast marching, and the paper's baseline made of it: exact distances, exact scenes, and another implementation."""

from __future__ import annotations

import math
import sys
from itertools import islice
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.choices import Surface
from persfs_cl.errors import UnavailableError
from persfs_cl.paper import fast_marching
from persfs_cl.paper.tankus import Iterate, iterations
from persfs_cl.scenes.scene import Scene

both_ways = pytest.mark.parametrize("surface", ["away", "toward"])

SLIGHTLY_OBLIQUE = ps.ParallelLight(0.15, -0.1)


def marched(
    known: np.ndarray,
    a: Any = 1.0,
    b: Any = 1.0,
    force: Any = 1.0,
    *,
    dx: float = 1.0,
    dy: float = 1.0,
    mask: Any = True,
) -> np.ndarray:
    """W from a p² + b q² = F and known values, infinite where they do not reach."""
    weights = (
        np.array(np.broadcast_to(number, known.shape), float, order="C") for number in (a / dx**2, b / dy**2, force)
    )
    solved = np.array(np.broadcast_to(mask, known.shape))
    # One layout of arrays, since each kind is compiled for itself.
    return fast_marching.compiled()(np.ascontiguousarray(known), solved, *weights)


def at_middle(shape: tuple[int, int]) -> np.ndarray:
    known = np.full(shape, np.nan)
    known[shape[0] // 2, shape[1] // 2] = 0.0
    return known


def solve(scene: Scene, count: int, **keywords: Any) -> Iterate:
    given = {"light": scene.light, "known_depth": scene.known_depth, "surface": scene.surface, "mask": scene.mask}
    return last(iterations(scene.image, scene.camera, **{**given, **keywords}), count)


def last(iterates: Any, count: int) -> Iterate:
    taken: list[Iterate] = list(islice(iterates, count))
    return taken[-1]


def test_marching_gives_the_travel_times_of_scikit_fmm() -> None:
    skfmm = pytest.importorskip("skfmm")
    random = np.random.default_rng(0)
    speed = random.uniform(0.2, 2.0, (47, 61))
    known = np.where(random.uniform(size=speed.shape) > 0.995, 0.0, np.nan)
    dx, dy = 0.3, 0.2
    expected = skfmm.travel_time(np.where(np.isnan(known), 1.0, 0.0), speed, dx=[dy, dx], order=1)
    np.testing.assert_allclose(marched(known, force=speed**-2, dx=dx, dy=dy), expected, rtol=1e-12)


@pytest.mark.parametrize(("a", "b", "pixel_ratio"), [(1.0, 1.0, 1.0), (2.0, 0.5, 1.0), (0.3, 1.5, 2.5)])
def test_distances_are_found_to_first_order(a: float, b: float, pixel_ratio: float) -> None:
    sizes, errors = (51, 101, 201, 401), []
    for size in sizes:
        dx, dy = 2.0 / (size - 1), 2.0 / (size - 1) / pixel_ratio
        x, y = np.meshgrid(dx * (np.arange(size) - size // 2), dy * (np.arange(size) - size // 2))
        exact = np.sqrt(x**2 / a + y**2 / b)
        # From a disc, since a single pixel would add the error of its corner, which falls more slowly.
        found = marched(np.where(exact < 0.2, exact, np.nan), a, b, dx=dx, dy=dy)
        errors.append(np.abs(found - exact).mean())
    assert errors[-1] < 0.005
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] >= 0.9


def test_every_marched_pixel_fulfils_its_equation() -> None:
    random, shape = np.random.default_rng(1), (31, 43)
    known = np.where(random.uniform(size=shape) > 0.98, random.uniform(0.0, 9.0, shape), np.nan)
    a, b, force = (random.uniform(0.1, 3.0, shape) for _ in range(3))
    mask = random.uniform(size=shape) > 0.3
    found = marched(known, a, b, force, dx=0.7, dy=0.4, mask=mask)
    around = np.pad(np.where(mask | np.isfinite(known), found, np.inf), 1, constant_values=np.inf)
    beside = np.minimum(around[1:-1, :-2], around[1:-1, 2:])
    above = np.minimum(around[:-2, 1:-1], around[2:, 1:-1])
    reached = mask & np.isnan(known) & np.isfinite(found)
    assert reached.sum() > 500
    here = np.where(reached, found, 0.0)
    left_hand_side = a * (np.maximum(here - beside, 0.0) / 0.7) ** 2 + b * (np.maximum(here - above, 0.0) / 0.4) ** 2
    np.testing.assert_allclose(left_hand_side[reached], force[reached], rtol=1e-9)


def test_marching_does_not_depend_on_which_way_the_image_lies() -> None:
    random, known = np.random.default_rng(2), at_middle((20, 27))
    a, b, force = (random.uniform(0.1, 3.0, known.shape) for _ in range(3))
    found = marched(known, a, b, force)
    np.testing.assert_array_equal(
        marched(known[::-1, ::-1], a[::-1, ::-1], b[::-1, ::-1], force[::-1, ::-1])[::-1, ::-1], found
    )
    np.testing.assert_allclose(marched(known.T, b.T, a.T, force.T).T, found, rtol=1e-13)


def test_nothing_is_marched_to_where_no_known_value_reaches() -> None:
    known, mask = at_middle((9, 9)), np.ones((9, 9), bool)
    mask[:, 6] = False
    found = marched(known, mask=mask)
    assert np.isfinite(found[:, :6]).all()
    assert np.isinf(found[:, 6:]).all()


@both_ways
@pytest.mark.parametrize("light", [ps.ParallelLight(), SLIGHTLY_OBLIQUE], ids=["frontal", "oblique"])
def test_a_bump_is_found_to_first_order(surface: Any, light: ps.ParallelLight) -> None:
    sizes, errors = (51, 101, 201), []
    for size in sizes:
        scene = ps.bump((size, size), light=light, surface=surface)
        found = solve(scene, 10)
        assert found.clamped == 0
        errors.append(ps.compare(found.depth, scene.depth).mean)
    assert errors[-1] < 0.0006
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] >= 0.9


@both_ways
@pytest.mark.parametrize("make", [ps.bump, ps.bumps, ps.sphere_cap])
def test_it_converges_to_the_surface_of_the_upwind_scheme(make: Any, surface: Surface) -> None:
    scene = make((61, 73), surface=surface, focal_length=(60.0, 50.0))
    found = solve(scene, 20)
    assert found.change < 1e-8
    upwind = ps.reconstruct(
        scene.image, scene.camera, known_depth=scene.known_depth, surface=surface, scheme="upwind", tolerance=1e-6
    )
    assert ps.compare(found.depth, upwind.depth).mean < 2e-5
    assert ps.compare(solve(scene, 1).depth, upwind.depth).mean > 2e-4


def test_a_light_from_one_side_mirrors_one_from_the_other() -> None:
    scene = ps.bump((41, 51), light=ps.ParallelLight(0.1, 0.05))
    mirrored = ps.bump((41, 51), light=ps.ParallelLight(-0.1, 0.05))
    np.testing.assert_allclose(solve(mirrored, 5).depth, solve(scene, 5).depth[:, ::-1], rtol=1e-9)


def test_a_bump_grows_from_its_singular_point() -> None:
    scene = ps.bump((101, 101)).seeded()
    assert ps.compare(solve(scene, 15).depth, scene.depth).mean < 0.005


def test_without_its_singular_point_a_bump_comes_out_the_wrong_way() -> None:
    scene = ps.bump((61, 61)).seeded()
    assert scene.depth.max() > 1.15
    assert solve(scene, 10).depth.max() > 1.15
    assert solve(scene, 10, known_depth=None).depth.max() == 1.0


def test_without_known_depths_the_edge_has_depth_1() -> None:
    scene = ps.bump((40, 50))
    edge = np.ones(scene.depth.shape, bool)
    edge[1:-1, 1:-1] = False
    found = solve(scene, 10, known_depth=None)
    np.testing.assert_array_equal(found.depth[edge], 1.0)
    np.testing.assert_array_equal(found.depth, solve(scene, 10, known_depth=np.where(edge, 1.0, np.nan)).depth)


def test_the_vase_is_finite_through_30_iterations() -> None:
    scene = ps.vase()
    known = np.isfinite(scene.known_depth)
    iterates = iterations(scene.image, scene.camera, mask=scene.mask, known_depth=scene.known_depth)
    for number, found in enumerate(islice(iterates, 30), 1):
        assert found.number == number
        assert np.isfinite(found.depth[scene.mask]).all()
        np.testing.assert_array_equal(found.depth[known], scene.known_depth[known])
        np.testing.assert_allclose(np.log(found.depth), found.log_depth, rtol=0, atol=1e-14)
        # Its silhouette is darker than the equation allows for there.
        assert found.clamped > 0
        # Away from the background, and nowhere steeper than 5 on the way of 30 pixels at most to the axis.
        assert found.depth.min() == 1.0
        assert found.depth.max() < math.exp(5.0 * 0.30)
    assert ps.compare(found.depth, scene.depth, align="range").mean < 0.1


def test_the_first_iterate_is_orthographic() -> None:
    scene = ps.bump((50, 60))
    grid = scene.camera.grid((50, 60))
    expected = marched(np.log(scene.known_depth), force=1.0 / scene.image**2 - 1.0, dx=grid.dx, dy=grid.dy)
    found = solve(scene, 1)
    np.testing.assert_allclose(found.log_depth, expected, atol=1e-9)
    assert found.change == np.inf


def test_change_is_the_largest_to_the_iterate_before() -> None:
    scene = ps.bump((40, 40), light=SLIGHTLY_OBLIQUE)
    _, second, third = islice(iterations(scene.image, scene.camera, light=SLIGHTLY_OBLIQUE), 3)
    assert third.change == pytest.approx(np.abs(third.log_depth - second.log_depth).max(), rel=1e-9)


def test_pixels_outside_the_mask_and_out_of_reach_have_no_depth_and_may_hold_anything() -> None:
    scene = ps.bump((40, 40))
    mask = np.ones((40, 40), bool)
    mask[:, 30] = False
    known = np.full((40, 40), np.nan)
    known[20, 10] = 2.5
    image = np.where(mask, scene.image, np.nan)
    found = last(iterations(image, scene.camera, mask=mask, known_depth=known), 3)
    assert np.isfinite(found.depth[:, :30]).all()
    assert np.isnan(found.depth[:, 30:]).all()
    assert found.depth[20, 10] == 2.5
    doubled = last(iterations(image, scene.camera, mask=mask, known_depth=2.0 * known), 3)
    np.testing.assert_allclose(doubled.depth, 2.0 * found.depth, rtol=1e-12)


@pytest.mark.parametrize("shape", [(1, 40), (40, 1)])
def test_a_single_row_or_column_is_a_profile(shape: tuple[int, int]) -> None:
    image = np.linspace(0.8, 1.0, 40).reshape(shape)
    known = np.full(shape, np.nan)
    known.flat[-1] = 1.0
    found = last(iterations(image, ps.Camera(200.0, principal_point=(0.0, 0.0)), known_depth=known), 30)
    depth, brightness = found.log_depth.ravel(), image.ravel()
    # Along a line the equation is quadratic in the slope alone: E² (p² + (1 + x p)²) = (1 + x p)².
    slopes = np.diff(depth) * 200.0
    x = np.arange(40)[:-1] / 200.0
    np.testing.assert_allclose(
        brightness[:-1] * np.hypot(slopes, 1.0 + x * slopes), np.abs(1.0 + x * slopes), rtol=1e-6
    )


def test_black_pixels_stay_within_the_largest_slope() -> None:
    image = np.random.default_rng(4).choice([0.0, 1.0], (30, 30))
    iterates = iterations(image, ps.Camera(100.0), known_depth=at_middle((30, 30)) + 1.0, max_slope=2.0)
    for found in islice(iterates, 5):
        for axis in (0, 1):
            assert (np.diff(found.log_depth, axis=axis) * 100.0 <= 2.0 + 1e-9).all()
        assert found.log_depth.min() == 0.0
        assert found.clamped > 0


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"light": ps.FlashLight()}, "no parallel light"),
        ({"light": ps.ParallelLight(2.5, 0.0)}, "look into the light"),
        ({"surface": "up"}, "surface='up'"),
        ({"max_slope": 0.0}, "max_slope=0.0"),
        ({"known_depth": np.zeros((20, 20))}, "known_depth"),
        ({"mask": np.zeros((20, 20), bool)}, "nothing to solve"),
    ],
)
def test_what_cannot_be_used_is_refused_before_the_first_iterate(keywords: dict[str, Any], message: str) -> None:
    scene = ps.bump((20, 20))
    with pytest.raises(ps.InputError, match=message):
        iterations(scene.image, scene.camera, **keywords)


def test_without_numba_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    scene = ps.bump((20, 20))
    fast_marching.compiled.cache_clear()
    with pytest.raises(UnavailableError, match=r"numba cannot be imported.*pip install .persfs-cl\[paper\]"):
        iterations(scene.image, scene.camera)
