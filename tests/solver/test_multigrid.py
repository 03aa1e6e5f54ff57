"""Multigrid: the limit of the scheme after a few iterations, or what there is without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.multigrid import Multigrid
from persfs_cl.masks import Neighbours
from persfs_cl.solver import multigrid
from persfs_cl.solver.complete import complete
from persfs_cl.solver.multigrid import Cycles, Hierarchy
from persfs_cl.solver.problem import prepare
from persfs_cl.solver.reference import Reference

LIGHT = ps.ParallelLight(0.3, 0.2)


@pytest.fixture(autouse=True)
def _of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small images take less time without, but tests less with these."""
    monkeypatch.setattr(multigrid, "_LEAST_PIXELS", 0)


def object_of_known_outline(shape: tuple[int, int]) -> ps.Scene:
    """It does not fill the image, and one of its pixels inside is known."""
    scene = ps.bump(shape, light=LIGHT)
    row, column = np.indices(shape)
    mask = np.hypot((row - 0.5 * shape[0]) / shape[0], (column - 0.45 * shape[1]) / shape[1]) < 0.4
    known = np.where(mask & ~Neighbours.of(mask).all, scene.depth, np.nan)
    known[shape[0] // 2, shape[1] // 2] = scene.depth[shape[0] // 2, shape[1] // 2]
    return replace(scene, mask=mask, known_depth=known)


SCENES: dict[str, Callable[[], ps.Scene]] = {
    "bump": lambda: ps.bump((110, 131)),
    "oblique light, toward": lambda: ps.bump((120, 101), light=LIGHT, surface="toward"),
    "bumps": lambda: ps.bumps((96, 96)),
    "vase": lambda: ps.vase((128, 128), bits=8),
    "outline": lambda: object_of_known_outline((100, 140)),
    "noisy": lambda: ps.bump((64, 128), bits=8, noise=0.02, light=LIGHT),
}


def solve(scene: ps.Scene, **keywords: Any) -> ps.Solution:
    given = {"light": scene.light, "mask": scene.mask, "surface": scene.surface, "known_depth": scene.known_depth}
    return ps.reconstruct(scene.image, scene.camera, **{**given, "scheme": "lax-friedrichs", **keywords})


def apart(one: ps.Solution, other: ps.Solution) -> float:
    return float(np.nanmax(np.abs(one.log_depth - other.log_depth)))


@cache
def limit_of(name: str) -> ps.Solution:
    """Where nothing changes any more."""
    solution = solve(SCENES[name](), acceleration=False, tolerance=0.0, precision="float64")
    assert solution.status is ps.Status.CONVERGED
    return solution


@pytest.mark.quick_where(holds=lambda given: (given["precision"] == "float64") == (given["name"] == "bump"))
@pytest.mark.parametrize("name", SCENES)
def test_the_limit_is_that_of_the_plain_iteration_after_few_iterations(
    name: str, device: ps.Device, precision: str
) -> None:
    solution = solve(SCENES[name](), device=device, precision=precision)
    assert solution.status is ps.Status.CONVERGED
    assert solution.iterations == len(solution.changes) <= 16
    assert apart(limit_of(name), solution) <= solution.distance <= 1e-5


@pytest.mark.parametrize("shape", [(17, 20), pytest.param((22, 17), marks=pytest.mark.thorough)])
def test_the_limit_is_that_of_the_reference(shape: tuple[int, int]) -> None:
    scene = ps.bump(shape, light=LIGHT)
    options = complete({"light": LIGHT, "scheme": "lax-friedrichs"})
    problem = prepare(scene.image, scene.camera, None, None, scene.known_depth, options=options)
    reference = Reference.of(problem)
    while reference.iterate() > 1e-7:
        pass
    found = problem.depth(reference.log_depth, converged=True)[0]
    solution = solve(scene, precision="float64", tolerance=1e-8)
    assert solution.iterations <= 24
    np.testing.assert_allclose(solution.log_depth, found, rtol=0.0, atol=1e-6)


def test_iterations_do_not_grow_with_the_image() -> None:
    for size in (48, 96, 192):
        assert solve(ps.bump((size, size), light=LIGHT)).iterations <= 12


@pytest.mark.parametrize("name", ["oblique light, toward", "outline"])
def test_wavefront_has_the_bits_of_lexicographic(name: str, device: ps.Device, precision: str) -> None:
    one, other = (
        solve(SCENES[name](), ordering=ordering, device=device, precision=precision)
        for ordering in ("wavefront", "lexicographic")
    )
    np.testing.assert_array_equal(one.log_depth, other.log_depth)
    np.testing.assert_array_equal(one.changes, other.changes)
    assert one.distance == other.distance


def test_images_of_a_batch_end_as_they_do_alone() -> None:
    """Also beside those that mixtures accelerate, or nothing."""
    scenes = [ps.bump((90, 70)), ps.bump((80, 80)).seeded(), ps.bumps((80, 80)), ps.bump((14, 80))]
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        known_depth=[scene.known_depth for scene in scenes],
        scheme="lax-friedrichs",
    )
    for scene, solution in zip(scenes, together, strict=True):
        alone = ps.reconstruct(scene.image, scene.camera, known_depth=scene.known_depth, scheme="lax-friedrichs")
        np.testing.assert_array_equal(solution.log_depth, alone.log_depth)
        np.testing.assert_array_equal(solution.changes, alone.changes)
        assert solution.status is alone.status
        assert solution.distance == alone.distance


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_at_no_tolerance_the_end_is_where_nothing_changes(precision: str) -> None:
    scene = ps.bump((48, 48))
    one, plain = (
        solve(scene, tolerance=0.0, precision=precision, acceleration=acceleration) for acceleration in (True, False)
    )
    assert one.status is plain.status is ps.Status.CONVERGED
    assert one.changes[-1] == 0.0
    assert apart(one, plain) <= 40.0 * float(np.finfo(precision).eps)


def test_a_tolerance_below_rounding_is_met_where_only_rounding_is_left() -> None:
    solution = solve(ps.bump((64, 64)), tolerance=1e-9)
    assert solution.status is ps.Status.CONVERGED
    assert 1e-9 < solution.distance < 1e-5
    assert solution.iterations <= 24


@pytest.mark.parametrize("factor", [np.inf, np.nan, 1e40, 1.0])
def test_cycles_that_lead_nowhere_are_given_up_and_mixtures_begin_anew(
    factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, usual = ps.bump((64, 64)), Multigrid.correct
    with monkeypatch.context() as patch:
        patch.setattr(Hierarchy, "of", lambda _: None)
        mixed = solve(scene)
    monkeypatch.setattr(Multigrid, "correct", lambda self: (usual(self)[0], factor))
    solution = solve(scene)
    assert solution.status is ps.Status.CONVERGED
    np.testing.assert_array_equal(solution.log_depth, mixed.log_depth)
    # What was in vain counts too.
    begun = solution.iterations - mixed.iterations
    assert 2 <= begun <= 6
    np.testing.assert_array_equal(solution.changes[begun:], mixed.changes)
    assert solution.distance == mixed.distance


def test_wrong_values_are_found_out_by_the_ordering(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, usual = ps.bump((64, 64)), Multigrid.log_depth
    plain = solve(scene, acceleration=False)
    monkeypatch.setattr(Multigrid, "log_depth", lambda self: usual(self) + np.indices((64, 64))[0] % 2 * 1e-2)
    solution = solve(scene)
    assert solution.status is ps.Status.CONVERGED
    assert solution.iterations > 20
    assert apart(solution, plain) <= 2e-5


@pytest.mark.parametrize("most", [1, 2, 3, 6])
def test_iterations_are_limited_all_the_same(most: int) -> None:
    solution = solve(SCENES["oblique light, toward"](), max_iterations=most)
    assert (solution.status, solution.iterations) == (ps.Status.MAX_ITERATIONS, most)
    assert np.isfinite(solution.depth).all()


@pytest.mark.parametrize("most", [3, 30])
def test_iterations_are_limited_where_cycles_were_in_vain(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Multigrid, "correct", lambda _: (1.0, np.inf))
    solution = solve(ps.bump((64, 64)), max_iterations=most)
    assert (solution.status, solution.iterations) == (ps.Status.MAX_ITERATIONS, most)


@pytest.mark.parametrize("last", [1, 2, 5])
def test_a_callback_is_told_every_iteration_and_stops_it(last: int) -> None:
    told: list[int] = []

    def callback(iteration: int, _change: float) -> bool:
        told.append(iteration)
        return iteration == last

    solution = solve(SCENES["bump"](), callback=callback)
    assert told == list(range(1, last + 1))
    assert (solution.status, solution.iterations) == (ps.Status.STOPPED, last)


def test_a_callback_is_told_what_the_solution_says() -> None:
    told: list[float] = []
    solution = solve(SCENES["bump"](), callback=lambda _, change: told.append(change))
    assert solution.status is ps.Status.CONVERGED
    assert told == list(solution.changes)


@pytest.mark.parametrize(
    "keywords",
    [
        {"acceleration": False},
        {"stopping": "change"},
        {"boundary": "wall", "known_depth": np.where(np.eye(24) > 0, 1.0, np.nan)},
        {"reflectance": ps.OrenNayar(0.4)},
    ],
    ids=lambda given: next(iter(given)),
)
def test_it_is_not_for(keywords: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Multigrid, "start", lambda _: pytest.fail("there are grids"))
    scene = ps.bump((24, 24), reflectance=keywords.get("reflectance", ps.Lambertian()))
    solve(scene, max_iterations=12, **keywords)


def test_small_images_take_less_time_without(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    monkeypatch.setattr(Multigrid, "start", lambda _: pytest.fail("there are grids"))
    solve(ps.bump((64, 64)), max_iterations=12)


def noted(*changes: float, tolerance: float = 1e-5) -> Cycles:
    cycles = Cycles(1e-7, tolerance)
    for change in changes:
        assert not cycles.ended
        cycles.note(change)
    return cycles


def test_the_distance_is_what_the_slower_of_the_last_two_rates_leaves() -> None:
    assert np.isnan(noted(1e-2).distance)
    cycles = noted(1e-2, 4e-3, 1e-3)
    assert cycles.distance == pytest.approx(1e-3 * 0.4 / 0.6)
    assert not cycles.ended
    cycles.note(2e-5)
    assert (cycles.ended, cycles.failed, cycles.converged) == (True, False, True)
    assert cycles.distance == pytest.approx(2e-5 * 0.25 / 0.75)


def test_no_cycle_is_taken_to_shrink_what_is_left_to_less_than_a_fifth() -> None:
    cycles = noted(1e-2, 1e-3, 5e-5)
    assert cycles.distance == pytest.approx(5e-5 * 0.2 / 0.8)
    assert not cycles.ended


def test_one_rate_alone_decides_nothing() -> None:
    assert not noted(1e-3, 1e-6).ended


@pytest.mark.parametrize("changes", [(1e-3, np.inf), (np.nan,), (1e-2, 8e-3, 7e-3), (1e-2, 2e-2, 3e-2)])
def test_cycles_that_do_not_shrink_have_failed(changes: tuple[float, ...]) -> None:
    cycles = noted(*changes)
    assert (cycles.ended, cycles.failed, cycles.converged) == (True, True, False)


def test_a_single_cycle_that_shrinks_little_is_forgiven() -> None:
    assert not noted(1e-2, 9e-3, 1e-3).ended


def test_what_only_rounding_moves_has_arrived() -> None:
    cycles = noted(1e-4, 1e-5, 1e-6, 9e-7, tolerance=1e-8)
    assert (cycles.ended, cycles.converged) == (True, True)
    assert cycles.distance == pytest.approx(4.5e-6)
    at_rest = noted(1e-4, 1e-5, 1e-6, 9e-7, tolerance=0.0)
    assert (at_rest.ended, at_rest.failed, at_rest.converged) == (True, False, False)


def test_where_a_cycle_changes_nothing_more_it_is_over() -> None:
    for tolerance in (1e-8, 0.0):
        cycles = noted(1e-4, 1e-5, 1e-6, 9e-8, tolerance=tolerance)
        assert (cycles.ended, cycles.failed) == (True, False)
        assert cycles.distance == pytest.approx(5e-7)
    assert noted(1e-2, 0.0).distance == pytest.approx(5e-7)


def test_a_small_change_that_shrinks_slowly_is_not_taken_for_rounding() -> None:
    cycles = noted(3.1e-6, 2.5e-6)
    assert not cycles.ended, "one rate alone decides nothing"
    cycles.note(2.1e-6)
    assert (cycles.ended, cycles.failed) == (True, True), "more may be left than is wanted"
    assert noted(1e-6, 8e-7, 7e-7).converged


def test_without_a_distance_nothing_is_put_above_the_limit() -> None:
    cycles = Cycles(1e-7, 0.0)
    while not cycles.ended:
        cycles.note(2.0 if len(cycles._changes) % 2 else 1.0)
    assert cycles.failed


def steep_frame() -> Callable[..., ps.Solution]:
    """A frame much steeper than the image says, of which the coarse grids make no surface."""
    shape = (120, 137)
    image = np.clip(1.0 + np.random.default_rng(0).normal(0.0, 0.03, shape), 0.0, 1.0)
    y, x = np.indices(shape)
    depth = np.exp(0.2 * np.sin(3.0 * np.pi * (x / shape[1] + y / shape[0])))
    depth[2:-2, 2:-2] = np.nan

    def solve(**keywords: Any) -> ps.Solution:
        return ps.reconstruct(image, ps.Camera(137.0), known_depth=depth, scheme="lax-friedrichs", **keywords)

    return solve


@pytest.mark.parametrize("most", [1, 2, 20, 1000])
def test_values_that_stray_are_neither_used_nor_told_of(most: int) -> None:
    solve = steep_frame()
    plain, told = solve(max_iterations=most, acceleration=False), list[float]()

    def tell(_: int, change: float) -> bool:
        told.append(change)
        return False

    solution = solve(max_iterations=most, callback=tell)
    np.testing.assert_array_equal(np.isnan(solution.depth), np.isnan(plain.depth))
    assert solution.iterations == len(told) == len(solution.changes) <= most
    assert max(told) == solution.changes.max() < 1e5


def test_few_iterations_are_the_schemes_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Multigrid, "start", lambda _: pytest.fail("there are grids"))
    scene = ps.bump((90, 90))
    few, plain = (solve(scene, max_iterations=15, acceleration=on) for on in (True, False))
    np.testing.assert_array_equal(few.depth, plain.depth)


def test_a_cycle_that_grows_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Multigrid, "correct", lambda _: (7.0, 7.0))
    monkeypatch.setattr(Multigrid, "smooth", lambda grids: grids.grown())
    changes = iter([1e-3, 1e-2])
    monkeypatch.setattr(Multigrid, "grown", lambda _: next(changes), raising=False)
    scene = ps.bump((90, 90))
    stopped = solve(scene, callback=lambda done, _: done == 2)
    assert (stopped.iterations, stopped.status) == (2, ps.Status.STOPPED)
    changes = iter([1e-3, 1e-2])
    found = solve(scene)
    np.testing.assert_allclose(found.log_depth, solve(scene, acceleration=False).log_depth, atol=3e-5)
    assert list(found.changes[:2]) == [1e-3, 7.0]
    assert 1e-2 not in found.changes
