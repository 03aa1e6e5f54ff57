"""The estimated distance from the limit, by which a run ends, against the limit itself."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.device import Device
from persfs_cl._cl.registers import lanes
from persfs_cl.solver.distance import distance_to_limit

_UNFORESEEN = 2e-6
"""A fifth of the tolerance. Where an iteration halves the distance ten times over, changes do not tell the next one."""
_ROUNDING = 4e-6
"""What single precision leaves of some hundred iterations, each of which rounds."""
_FLASH = ps.FlashLight()
_OBLIQUE = ps.ParallelLight(0.3, 0.2)
SCENES: dict[str, ps.Scene] = {
    "vase": ps.vase((48, 48)),
    "bump": ps.bump((48, 48)),
    "bumps": ps.bumps((48, 48)),
    "hillside": ps.hillside((48, 48)),
    "sphere cap": ps.sphere_cap((48, 48)),
    "oblique light": ps.bump((48, 48), light=_OBLIQUE),
    "toward": ps.bump((48, 48), surface="toward"),
    "rough": ps.bump((48, 48), reflectance=ps.OrenNayar(0.4)),
    "noise": ps.bump((48, 48), noise=0.05),
    "top alone known": ps.bump((48, 48)).seeded(),
    "flash": ps.bump((48, 48), light=_FLASH),
    "flash and noise": ps.bumps((48, 48), light=_FLASH, noise=0.02),
    "shiny under a flash": ps.bump((48, 48), light=_FLASH, reflectance=ps.Phong(0.6, 0.3, 5.0)),
}
QUICK = ("vase", "bump", "toward", "noise", "flash and noise")


def solve(scene: ps.Scene, **keywords: Any) -> ps.Solution:
    known = {} if scene.light.determines_depth else {"known_depth": scene.known_depth, "surface": scene.surface}
    given = {"light": scene.light, "reflectance": scene.reflectance, "mask": scene.mask, **known}
    return ps.reconstruct(scene.image, scene.camera, **{**given, **keywords})


def limit(scene: ps.Scene, **keywords: Any) -> ps.Solution:
    solution = solve(scene, **keywords, tolerance=0.0, stopping="change", max_iterations=4000)
    assert solution.changes[-1] <= 1e-15
    return solution


def apart(one: ps.Solution, other: ps.Solution) -> float:
    return float(np.nanmax(np.abs(one.log_depth - other.log_depth)))


def test_a_geometric_series_is_summed() -> None:
    for rate in (0.1, 0.5, 0.99):
        changes = [rate**k for k in range(40)]
        assert distance_to_limit(changes, 1e-7) == pytest.approx(rate**40 / (1.0 - rate))


def test_what_does_not_shrink_is_at_no_known_distance() -> None:
    assert math.isnan(distance_to_limit([], 1e-7))
    assert math.isnan(distance_to_limit([0.1], 1e-7))
    assert math.isnan(distance_to_limit([0.1] * 30, 1e-7))
    assert math.isnan(distance_to_limit([0.1, 0.01, 0.02], 1e-7))


def test_what_is_at_rest_lies_within_what_rounding_leaves() -> None:
    assert distance_to_limit([0.0], 1e-7) == 0.0
    assert distance_to_limit([300.0, 0.0], 1e-7) == 0.0
    assert distance_to_limit([*(0.9**k for k in range(100)), 0.0], 1e-7) == pytest.approx(0.5e-7 * 9.0)


@pytest.mark.quick_where(holds=lambda parameters: parameters["name"] in QUICK and parameters["boundary"] == "auto")
# Under a flash one ordering, whose kernels other tests take too.
@pytest.mark.quick_where(
    holds=lambda parameters: parameters["name"] != "flash and noise" or parameters["ordering"] == "wavefront"
)
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
@pytest.mark.parametrize("boundary", ["auto", "wall"])
@pytest.mark.parametrize("name", SCENES)
def test_lax_friedrichs_ends_within_the_tolerance(name: str, boundary: str, ordering: str) -> None:
    if (name, boundary) == ("top alone known", "wall"):
        pytest.skip("sublinear: its limit is thousands of iterations away")
    keywords = {"scheme": "lax-friedrichs", "boundary": boundary, "ordering": ordering, "precision": "float64"}
    exact = limit(SCENES[name], **keywords)
    for tolerance, acceleration in product((1e-3, 1e-5, 1e-8), (False, True)):
        solution = solve(SCENES[name], **keywords, tolerance=tolerance, acceleration=acceleration)
        assert solution.status is ps.Status.CONVERGED
        assert solution.distance <= tolerance
        # Mixtures of what converges fast are better than is known of them.
        assert 0.5 <= solution.distance / apart(solution, exact) <= (math.inf if acceleration else 2.0)


@pytest.mark.quick_where(holds=lambda parameters: parameters["name"] in QUICK)
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
@pytest.mark.parametrize("name", [name for name in SCENES if name != "rough"])
def test_upwind_ends_within_the_tolerance(name: str, ordering: str) -> None:
    """Its convergence is faster than linear, so that what is left is soon less than what rounding leaves."""
    keywords = {"scheme": "upwind", "ordering": ordering}
    solution, exact = solve(SCENES[name], **keywords), limit(SCENES[name], **keywords)
    true = apart(solution, exact)
    assert max(solution.distance, true) <= 1e-5
    assert solution.distance <= 2.0 * true + _UNFORESEEN
    assert true <= 2.0 * solution.distance + _UNFORESEEN
    assert solution.iterations <= exact.iterations


@pytest.mark.quick_where(holds=lambda parameters: parameters["name"] in QUICK)
@pytest.mark.parametrize("name", [name for name in SCENES if name != "rough"])
def test_blocks_that_rest_early_leave_the_result_within_the_distance(name: str) -> None:
    keywords = {"scheme": "upwind", "ordering": "wavefront", "precision": "float64"}
    exact = limit(SCENES[name], **keywords)
    for resting in (1e-4, 1e-6):
        solution = solve(SCENES[name], **keywords, tolerance=10 * resting, resting=resting)
        assert solution.status is ps.Status.CONVERGED
        assert solution.parameters["resting"] <= solution.distance <= 10 * resting
        assert apart(solution, exact) <= solution.distance


def test_a_solution_says_whether_blocks_rested_early(device: Device) -> None:
    keywords = {"scheme": "upwind", "tolerance": 1e-3, "device": device}
    without = solve(SCENES["bump"], **keywords)
    asked = solve(SCENES["bump"], **keywords, resting=1e-4)
    vectors = lanes(device, "float32") > 1
    assert without.parameters["resting"] == 0.0
    assert asked.parameters["resting"] == (1e-4 if vectors else 0.0)
    assert asked.distance >= asked.parameters["resting"]


def test_blocks_rest_for_small_changes_where_the_distance_is_bounded_alone() -> None:
    with pytest.raises(ps.InputError, match=r"resting=1e-06 with scheme='lax-friedrichs': it creeps .*'upwind'"):
        solve(SCENES["bump"], scheme="lax-friedrichs", resting=1e-6)
    for ordering in ("lexicographic", "checkerboard"):
        with pytest.raises(ps.InputError, match=rf"resting=1e-06 with ordering='{ordering}': only in the wavefront's"):
            solve(SCENES["bump"], scheme="upwind", ordering=ordering, resting=1e-6)
    with pytest.raises(ps.InputError, match=r"resting=1e-06 with accuracy_order=2: it would correct"):
        solve(SCENES["bump"], scheme="upwind", accuracy_order=2, resting=1e-6)
    with pytest.raises(ps.InputError, match=r"resting=2e-06 with tolerance=1e-05: .* a tenth of the tolerance, 1e-06"):
        solve(SCENES["bump"], scheme="upwind", resting=2e-6)
    with pytest.raises(ps.InputError, match=r"resting=1e-06 with tolerance=0"):
        solve(SCENES["bump"], scheme="upwind", resting=1e-6, tolerance=0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("scheme", ["lax-friedrichs", "upwind"])
@pytest.mark.parametrize("name", ["bump", "sphere cap", "oblique light", "flash"])
def test_large_images_in_single_precision(name: str, scheme: str) -> None:
    scenes = {
        "bump": ps.bump((192, 192)),
        "sphere cap": ps.sphere_cap((160, 160)),
        "oblique light": ps.bump((192, 192), light=_OBLIQUE),
        "flash": ps.bump((192, 192), light=_FLASH),
    }
    exact = limit(scenes[name], scheme=scheme, precision="float64")
    for acceleration in (False, True):
        solution = solve(scenes[name], scheme=scheme, acceleration=acceleration)
        true = apart(solution, exact)
        assert solution.status is ps.Status.CONVERGED
        assert true <= 2.0 * solution.distance + _ROUNDING
        # Mixtures of what converges fast are better than is known of them.
        assert acceleration or solution.distance <= 2.0 * true + _UNFORESEEN


def test_the_papers_criterion_is_the_change_of_an_iteration() -> None:
    scene = SCENES["bump"]
    by_change = solve(scene, scheme="lax-friedrichs", stopping="change")
    by_distance = solve(scene, scheme="lax-friedrichs", acceleration=False)
    assert by_change.status is by_distance.status is ps.Status.CONVERGED
    assert by_change.changes[-1] <= 1e-5 < by_change.changes[-2]
    assert by_change.distance > 1e-5 >= by_distance.distance
    assert by_distance.iterations > by_change.iterations
    np.testing.assert_array_equal(by_distance.changes[: by_change.iterations], by_change.changes)


@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard", "lexicographic"])
@pytest.mark.parametrize("boundary", ["auto", "wall"])
def test_images_of_a_batch_end_as_they_do_alone(ordering: str, boundary: str) -> None:
    """Each goes on at thresholds of its own, whatever the others do, and after a rest."""
    scenes = [ps.bump((24, 24), relief=relief) for relief in (0.05, 0.2, 0.4)] + [ps.bumps((24, 24))]
    keywords: dict[str, Any] = {"scheme": "lax-friedrichs", "ordering": ordering, "boundary": boundary}
    if boundary == "wall":
        # So that some have converged when others run out of iterations.
        keywords["max_iterations"] = 45
    alone = [ps.reconstruct(one.image, one.camera, known_depth=one.known_depth, **keywords) for one in scenes]
    together = ps.reconstruct_batch(
        [one.image for one in scenes],
        [one.camera for one in scenes],
        known_depth=[one.known_depth for one in scenes],
        **keywords,
    )
    assert len({solution.iterations for solution in alone}) > 2
    for one, other in zip(alone, together, strict=True):
        assert (one.status, one.distance) == (other.status, other.distance)
        np.testing.assert_array_equal(one.changes, other.changes)
        np.testing.assert_array_equal(one.log_depth, other.log_depth)


def test_a_callback_changes_nothing_and_sees_every_iteration() -> None:
    scene, seen = SCENES["bump"], []
    silent = solve(scene, scheme="lax-friedrichs")
    watched = solve(scene, scheme="lax-friedrichs", callback=lambda *one: seen.append(one))
    assert seen == list(enumerate(silent.changes, 1))
    np.testing.assert_array_equal(silent.log_depth, watched.log_depth)
    assert silent.distance == watched.distance


def test_the_report_says_the_distance(tmp_path: Any) -> None:
    solution = solve(SCENES["bump"], scheme="lax-friedrichs")
    assert solution.report()["distance"] == solution.distance
    assert solution.report()["parameters"]["stopping"] == "distance"
    solution.save(tmp_path / "convergence", save="convergence.png")
    early = solve(SCENES["bump"], scheme="lax-friedrichs", max_iterations=1)
    assert math.isnan(early.distance)
    assert early.report()["distance"] is None


def test_an_error_says_how_far_the_limit_is() -> None:
    with pytest.raises(ps.ConvergenceError, match=r"still about [0-9.e-]+ from its limit, above the tolerance 1e-05"):
        solve(SCENES["bump"], scheme="lax-friedrichs", acceleration=False, max_iterations=55, throw=True)
