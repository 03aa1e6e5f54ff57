"""Depths between bounds: what a range leaves alone, what it changes, and what cannot be one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.choices import Boundary, Surface
from persfs_cl.masks import rim
from persfs_cl.shading.model import Light
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import prepare
from persfs_cl.solver.reference import Reference

FLASH, OBLIQUE, EVEN = ps.FlashLight(), ps.ParallelLight(0.2, -0.1), ps.FlashLight(falloff=False)
SIZE = (18, 21)
IN_DOUBLE_PRECISION = ("toward", "lamp")
QUICK_BY_LAX_FRIEDRICHS = ("away", "even")
"""Of which the kernels are quickly compiled; the others prove the same by the upwind scheme."""
SCENES = {
    "flash": ps.bump(SIZE, light=FLASH),
    "lamp": ps.bump(SIZE, light=ps.FlashLight(offset=(0.05, 0.02, 0.0))),
    "away": ps.bump(SIZE, light=OBLIQUE, surface="away"),
    "toward": ps.bump(SIZE, light=OBLIQUE, surface="toward"),
    "even": ps.bump(SIZE, light=EVEN, surface="toward"),
}


def solved(name: str, *, known: bool | None = None, **keywords: Any) -> ps.Solution:
    """A scene with its known depths, if it needs any, and further keywords."""
    scene = SCENES[name]
    # Nothing is accelerated between bounds, which is to be compared with what has none. By the order whose kernels are
    # compiled most quickly; the others are compared with it.
    given: dict[str, Any] = {"light": scene.light, "tolerance": 0.0, "acceleration": False}
    given |= {"ordering": "lexicographic", **keywords}
    if not scene.light.determines_depth:
        given = {"surface": scene.surface, "known_depth": scene.known_depth, **given}
    if known is False:
        given["known_depth"] = None
    return ps.reconstruct(scene.image, scene.camera, **given)


def in_turn(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters is a quick one."""
    wanted = "float64" if parameters["name"] in IN_DOUBLE_PRECISION else "float32"
    quick = parameters["scheme"] == "upwind" or parameters["name"] in QUICK_BY_LAX_FRIEDRICHS
    return bool(parameters["precision"] == wanted and quick)


def errors(name: str, solution: ps.Solution) -> Array:
    return np.asarray(np.abs(np.log(solution.depth / SCENES[name].depth)))


@pytest.mark.quick_where(holds=lambda given: (given["scheme"] == "upwind") == (given["name"] in ("flash", "away")))
@pytest.mark.quick_where(holds=lambda given: given["name"] != "lamp")
@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("name", SCENES)
def test_a_range_that_holds_the_surface_changes_nothing(name: str, scheme: str) -> None:
    free = solved(name, scheme=scheme)
    within = solved(name, scheme=scheme, depth_range=(0.9 * free.depth, 1.1 * free.depth))
    np.testing.assert_allclose(within.depth, free.depth, rtol=2e-6)
    assert free.at_bound.dtype == bool
    assert free.at_bound.shape == SIZE
    assert not free.at_bound.any()
    assert within.at_bound.sum() == 0
    alone = solved(name, scheme=scheme, depth_range=(np.nan, 5.0 * float(free.depth.max())))
    np.testing.assert_allclose(alone.depth, free.depth, rtol=2e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_at_second_order_too(order: int) -> None:
    free = solved("toward", scheme="upwind", accuracy_order=order)
    within = solved("toward", scheme="upwind", accuracy_order=order, depth_range=(0.5 * free.depth, 2.0 * free.depth))
    np.testing.assert_allclose(within.depth, free.depth, rtol=2e-6)
    assert not within.at_bound.any()
    below = np.where(SCENES["toward"].depth < 0.9, free.depth + 0.01, np.nan)
    below[~np.isnan(SCENES["toward"].known_depth)] = np.nan
    bounded = solved("toward", scheme="upwind", accuracy_order=order, depth_range=(below, free.depth + 0.02))
    assert not ((bounded.depth < below) | (bounded.depth > free.depth + 0.02)).any()
    assert bounded.at_bound.any()


@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("name", ["away", "toward", "flash", "even"])
def test_known_depths_are_ranges_of_no_width(name: str, scheme: str) -> None:
    known = SCENES[name].known_depth.copy()
    known[8, 9] = 1.1 * SCENES[name].depth[8, 9]
    by_depth = solved(name, scheme=scheme, known_depth=known)
    by_range = solved(name, scheme=scheme, known=False, depth_range=(known, known))
    np.testing.assert_array_equal(by_range.depth, by_depth.depth)
    np.testing.assert_array_equal(by_range.changes, by_depth.changes)
    np.testing.assert_array_equal(by_range.at_bound, ~np.isnan(known))
    # And what is nearly known: bounds as near to each other as numbers of the device can be told apart.
    nearly = solved(name, scheme=scheme, known=False, depth_range=(known, np.nextafter(known, np.inf)))
    there = ~np.isnan(known)
    np.testing.assert_allclose(nearly.depth[there], known[there], rtol=1e-15)
    np.testing.assert_allclose(nearly.depth, by_depth.depth, rtol=1e-5 if scheme == "upwind" else 1e-3)


def across(name: str) -> tuple[Array, Array]:
    """Bounds that the surface would cross."""
    truth = SCENES[name].depth
    known = SCENES[name].known_depth if not SCENES[name].light.determines_depth else np.full(SIZE, np.nan)
    near, far = np.full(SIZE, np.nan), np.full(SIZE, np.nan)
    near[6:12, 5:14] = float(np.quantile(truth, 0.7))
    far[6:15, 12:17] = float(np.quantile(truth, 0.8))
    near[~np.isnan(known)] = far[~np.isnan(known)] = np.nan
    return near, far


@pytest.mark.quick_where(holds=in_turn)
@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("name", ["flash", "away", "toward", "even", "lamp"])
def test_bounds_across_the_surface_are_kept_to(name: str, scheme: str, precision: str) -> None:
    near, far = across(name)
    free = solved(name, scheme=scheme, precision=precision)
    solution = solved(name, scheme=scheme, precision=precision, depth_range=(near, far))
    assert not ((solution.depth < near) | (solution.depth > far)).any()
    np.testing.assert_array_equal(solution.at_bound, (solution.depth == near) | (solution.depth == far))
    np.testing.assert_allclose(solution.log_depth, np.log(solution.depth), rtol=0, atol=1e-6)
    assert 5 < solution.at_bound.sum() < near.size
    assert np.abs(solution.depth - free.depth).max() > 1e-3
    # It goes on from a bound: others than those on it are moved.
    assert (np.abs(solution.depth - free.depth) > 1e-4)[~solution.at_bound].any()


def every_order_in_turn(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters is a quick one: of each scheme one light.

    What keeps values between bounds is the orderings' own, and the same for all lights.
    """
    name, scheme = parameters["name"], parameters["scheme"]
    return parameters["precision"] == "float32" and (name, scheme) in (("flash", "upwind"), ("away", "lax-friedrichs"))


@pytest.mark.quick_where(holds=every_order_in_turn)
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("name", ["flash", "away", "toward", "even", "lamp"])
def test_bounds_across_the_surface_are_kept_to_in_every_order(
    name: str, scheme: str, precision: str, ordering: str
) -> None:
    solution, other = (
        solved(name, scheme=scheme, precision=precision, ordering=order, depth_range=across(name))
        for order in ("lexicographic", ordering)
    )
    assert solution.at_bound.any()
    if ordering == "wavefront":
        np.testing.assert_array_equal(other.depth, solution.depth)
        np.testing.assert_array_equal(other.at_bound, solution.at_bound)
    elif not (name == "lamp" and scheme == "lax-friedrichs"):
        np.testing.assert_allclose(other.depth, solution.depth, rtol=1e-5)


# Under a parallel light the kernels' own tests compare iterations, between bounds too.
@pytest.mark.quick_where(holds=lambda given: given["surface"] == "toward" and given["light"] == FLASH)
@pytest.mark.parametrize("surface", ["away", "toward"])
@pytest.mark.parametrize("light", [FLASH, OBLIQUE])
def test_the_surface_is_that_of_the_reference(light: Light, surface: Surface) -> None:
    """The obstacle problem, by the paper's scheme in plain NumPy."""
    scene = ps.bump((7, 9), light=light, surface=surface)
    chosen: Surface = "away" if light.determines_depth else surface
    options = complete({"light": light, "scheme": "lax-friedrichs", "surface": chosen, "boundary": "wall"})
    known = np.where(np.arange(9) < 1, scene.depth, np.nan)
    middle = float(np.median(scene.depth))
    bounds = np.array([[np.nan] * 5 + [middle] * 3 + [np.nan], [np.nan] * 4 + [1.1 * middle] * 5])
    near, far = (np.broadcast_to(bound, (7, 9)) for bound in bounds)
    problem = prepare(scene.image, scene.camera, None, None, known, None, (near, far), options=options)
    reference = Reference.of(problem)
    while reference.iterate() > 1e-9:
        pass
    _, depth = problem.depth(reference.log_depth, converged=True)
    solution = ps.reconstruct(
        scene.image,
        scene.camera,
        light=light,
        scheme="lax-friedrichs",
        surface=chosen,
        boundary="wall",
        known_depth=known,
        depth_range=(near, far),
        tolerance=0.0,
        precision="float64",
        ordering="lexicographic",
    )
    np.testing.assert_allclose(solution.depth, depth, rtol=1e-5)
    assert solution.at_bound.any()
    assert not solution.at_bound.all()


@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("name", ["away", "toward", "even"])
def test_a_bound_is_enough_to_hang_from(name: str, scheme: str) -> None:
    """In place of known depths: far ones for a surface that goes away, near ones for one that comes towards."""
    scene = SCENES[name]
    bounds = (np.nan, scene.known_depth) if scene.surface == "away" else (scene.known_depth, np.nan)
    hung = solved(name, scheme=scheme, boundary="wall", known=False, depth_range=bounds)
    known = solved(name, scheme=scheme, boundary="wall")
    assert hung.solved.all()
    assert not hung.unreached.any()
    assert errors(name, hung).mean() < 1.2 * errors(name, known).mean() + 1e-3
    np.testing.assert_allclose(hung.depth[1:-1, 1:-1], known.depth[1:-1, 1:-1], rtol=0.02)


@pytest.mark.parametrize("boundary", ["outflow", "extrapolate", "wall"])
def test_a_single_bound_in_a_corner_is_heard(boundary: Boundary) -> None:
    """As a known depth there is, which no inner cell would look at."""
    corner = np.full(SIZE, np.nan)
    corner[0, 0] = 1.0
    given: dict[str, Any] = {"scheme": "lax-friedrichs", "boundary": boundary}
    hung = solved("away", known=False, depth_range=(None, corner), **given)
    np.testing.assert_array_equal(hung.depth, solved("away", known_depth=corner, **given).depth)
    assert np.argwhere(hung.at_bound).tolist() == [[0, 0]]


def test_nothing_is_assumed_on_the_edge_where_a_range_is_given() -> None:
    scene = SCENES["away"]
    assumed = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    assert (assumed.depth[rim(np.ones(SIZE, bool))] == 1.0).all()
    ranged = ps.reconstruct(scene.image, scene.camera, light=scene.light, depth_range=(np.nan, 3.0))
    assert (ranged.depth == 3.0).any()
    assert (ranged.depth <= 3.0).all()
    assert (ranged.depth != 1.0).all()


def test_every_pixel_with_a_bound_to_hang_from_is_reached() -> None:
    """A part that no known depth can reach, and those that a run which ended early has not come to."""
    scene = SCENES["toward"]
    mask = np.ones(SIZE, bool)
    mask[:, 9:11] = False
    known = np.where(np.arange(SIZE[1]) == 0, scene.depth, np.nan)
    given: dict[str, Any] = {"light": scene.light, "surface": "toward", "mask": mask, "known_depth": known}
    free = ps.reconstruct(scene.image, scene.camera, **given)
    assert free.unreached[:, 11:].all()
    near = np.where(np.arange(SIZE[1]) < 14, np.nan, 0.7) + np.zeros(SIZE)
    held = ps.reconstruct(scene.image, scene.camera, **given, depth_range=(near, None))
    assert held.solved[mask].all()
    np.testing.assert_allclose(held.depth[:, :9], free.depth[:, :9], rtol=1e-6)
    early = ps.reconstruct(
        scene.image, scene.camera, **given, depth_range=(near, 1.5), scheme="lax-friedrichs", max_iterations=1
    )
    assert early.status is ps.Status.MAX_ITERATIONS
    assert early.solved[~np.isnan(near)].all()


def test_images_of_a_batch_have_ranges_of_their_own() -> None:
    scene = SCENES["flash"]
    middle = float(np.median(scene.depth))
    ranges: list[Any] = [None, (middle, np.nan), (np.full(SIZE, np.nan), middle), (None, None)]
    together = ps.reconstruct_batch([scene.image] * 4, scene.camera, light=FLASH, depth_range=ranges)
    for each, given in zip(together, ranges, strict=True):
        alone = ps.reconstruct(scene.image, scene.camera, light=FLASH, depth_range=given)
        np.testing.assert_array_equal(each.depth, alone.depth)
        np.testing.assert_array_equal(each.at_bound, alone.at_bound)
    np.testing.assert_array_equal(together[3].depth, together[0].depth)
    assert [bool(each.at_bound.any()) for each in together] == [False, True, True, False]


def test_depths_continued_onto_walls_keep_to_the_range() -> None:
    scene = SCENES["flash"]
    walls = np.zeros(SIZE, bool)
    walls[4:14, 8] = True
    far = np.full(SIZE, np.nan)
    far[walls] = 0.9 * scene.depth[walls]
    solution = ps.reconstruct(scene.image, scene.camera, light=FLASH, walls=walls, depth_range=(np.nan, far))
    np.testing.assert_array_equal(solution.depth[walls], far[walls])
    assert solution.at_bound[walls].all()
    assert not solution.at_bound[~walls].any()


def test_report_and_confidence_tell_of_bounds() -> None:
    scene = SCENES["flash"]
    solution = ps.reconstruct(
        scene.image, scene.camera, light=FLASH, depth_range=(float(np.median(scene.depth)), np.nan)
    )
    count = int(solution.at_bound.sum())
    assert count > 40
    report = solution.report()
    assert report["pixels"]["at_bound"] == count
    assert report["confidence"]["doubtful_pixels"]["at a bound"] == count
    np.testing.assert_array_equal(solution.confidence().unreliable["at a bound"], solution.at_bound)
    free = ps.reconstruct(scene.image, scene.camera, light=FLASH)
    assert free.report()["pixels"]["at_bound"] == 0
    assert "at a bound" not in free.confidence().unreliable


def mostly(value: float) -> NDArray[np.float64]:
    """NaN, and a value at one pixel."""
    depths = np.full(SIZE, np.nan)
    depths[3, 4] = value
    return depths


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ((2.0, 1.0), "near=2.0 beyond far=1.0 at pixel [0, 0] (378 such pixels)"),
        ((mostly(1.5), 1.0), "near=1.5 beyond far=1.0 at pixel [3, 4] (1 such pixels)"),
        ((0.0, 1.0), "near of depth_range holds 0"),
        ((np.nan, -1.0), "far of depth_range holds -1"),
        ((mostly(-2.0), np.nan), "near of depth_range holds -2"),
        ((np.nan, np.inf), "far of depth_range holds inf"),
        ((1e-31, np.nan), "from 1e-30 to 1e+30"),
        ((np.ones((3, 4)), np.nan), "near of depth_range is float64 of shape (3, 4)"),
        ((np.nan, np.ones(SIZE, bool)), "far of depth_range is bool"),
        (("near.npy", 1.0), "read_depth"),
        ("range.npy", "give a pair (near, far)"),
        (1.0, "give a pair (near, far)"),
        ((1.0, 2.0, 3.0), "give a pair (near, far)"),
        ((1.0, [[1.0], [2.0, 3.0]]), "is no array"),
    ],
)
def test_what_is_no_range_is_refused(given: Any, words: str) -> None:
    scene = SCENES["flash"]
    with pytest.raises(ps.InputError) as caught:
        ps.reconstruct(scene.image, scene.camera, light=FLASH, depth_range=given)
    assert words in str(caught.value)
    assert caught.value.argument in ("depth_range", "far")


def test_known_depths_must_lie_in_the_range() -> None:
    scene = SCENES["away"]
    known = scene.known_depth.copy()
    known[0, 5] = 2.5
    given: dict[str, Any] = {"light": scene.light, "known_depth": known}
    with pytest.raises(ps.InputError, match=r"known_depth=2.5 at pixel \[0, 5\] lies outside depth_range") as caught:
        ps.reconstruct(scene.image, scene.camera, **given, depth_range=(0.1, 2.0))
    assert caught.value.argument == "depth_range"
    with pytest.raises(ps.InputError, match=r"images\[1\]: .*outside depth_range"):
        ps.reconstruct_batch(
            [scene.image] * 2, scene.camera, light=scene.light, known_depth=[known] * 2, depth_range=[None, (3.0, None)]
        )


@pytest.mark.parametrize(("name", "given"), [("away", (0.5, None)), ("toward", (None, 2.0)), ("even", (None, None))])
def test_without_fall_off_something_must_hold_the_surface(name: str, given: Any) -> None:
    with pytest.raises(ps.InputError, match="No depth is known"):
        solved(name, known=False, depth_range=given)
