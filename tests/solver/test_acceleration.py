"""Mixtures of iterations: the same limit sooner, whatever they lead to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.anderson import DEPTH, Mixer, Products
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.acceleration import Acceleration
from persfs_cl.solver.multigrid import Hierarchy

_LIGHT = ps.ParallelLight(0.3, 0.2)
SCENES: dict[str, ps.Scene] = {
    "bump": ps.bump((110, 130)),
    "oblique light, toward": ps.bump((120, 101), light=_LIGHT, surface="toward"),
    "rough": ps.bump((64, 64), reflectance=ps.OrenNayar(0.4)),
}


@pytest.fixture(autouse=True)
def _no_grids(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mixtures are for what multigrid is not, and these scenes are for it."""
    monkeypatch.setattr(Hierarchy, "of", lambda _: None)


def solve(scene: ps.Scene, **keywords: Any) -> ps.Solution:
    given = {"light": scene.light, "reflectance": scene.reflectance, "mask": scene.mask, "surface": scene.surface}
    given |= {"known_depth": scene.known_depth, "scheme": "lax-friedrichs"}
    return ps.reconstruct(scene.image, scene.camera, **{**given, **keywords})


def apart(one: ps.Solution, other: ps.Solution) -> float:
    return float(np.nanmax(np.abs(one.log_depth - other.log_depth)))


@pytest.mark.quick_where(holds=lambda given: given["name"] != "rough" or given["ordering"] == "wavefront")
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
@pytest.mark.parametrize("name", SCENES)
def test_the_limit_is_that_of_the_scheme_and_takes_fewer_iterations(name: str, ordering: str) -> None:
    plain, accelerated = (
        solve(SCENES[name], ordering=ordering, acceleration=acceleration) for acceleration in (False, True)
    )
    assert plain.status is accelerated.status is ps.Status.CONVERGED
    assert apart(plain, accelerated) <= 2e-5
    # A small rough surface takes nearly all of them until it has taken shape.
    assert name == "rough" or accelerated.iterations <= 0.6 * plain.iterations


@pytest.mark.parametrize(
    ("material", "light", "surface"),
    [
        (ps.Phong(), ps.ParallelLight(0.15, -0.1), "away"),
        pytest.param(ps.Phong(), ps.ParallelLight(), "toward", marks=pytest.mark.thorough),
        pytest.param(ps.OrenNayar(0.3), ps.ParallelLight(0.15, -0.1), "away", marks=pytest.mark.thorough),
    ],
    ids=str,
)
def test_other_materials_have_the_limit_of_the_plain_iteration(
    material: Reflectance, light: ps.ParallelLight, surface: Any
) -> None:
    """Steep slopes on the way can make values that are assigned rise for ever."""
    scene = ps.hillside((201, 201), light=light, reflectance=material, surface=surface, relief=0.05, focal_length=603.0)
    plain, accelerated = (solve(scene, acceleration=acceleration) for acceleration in (False, True))
    assert plain.status is accelerated.status is ps.Status.CONVERGED
    assert apart(plain, accelerated) <= 2e-5
    assert accelerated.iterations < plain.iterations


def test_what_goes_astray_begins_again_from_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, begun = ps.bump((48, 48)), []
    usual, weigh = Mixer.begin_again, Acceleration.weights

    def begin_again(self: Mixer, image: int) -> None:
        usual(self, image)
        begun.append(image)

    def rising(self: Acceleration, found: Products) -> Any:
        """All that the last iterations took away, and a thousand times as much."""
        weights = weigh(self, found)
        return weights if len(weights) < 2 else np.full(len(weights), 1e3)

    monkeypatch.setattr(Mixer, "begin_again", begin_again)
    monkeypatch.setattr(Acceleration, "weights", rising)
    solution = solve(scene)
    monkeypatch.undo()
    assert begun == [0]
    assert solution.status is ps.Status.CONVERGED
    assert apart(solution, solve(scene, acceleration=False)) <= 2e-5


@pytest.mark.quick_where(holds=lambda given: (given["precision"] == "float64") == (given["name"] == "bump"))
@pytest.mark.quick_where(holds=lambda given: given["name"] != "rough")
@pytest.mark.parametrize("name", SCENES)
def test_wavefront_has_the_bits_of_lexicographic(name: str, device: ps.Device, precision: str) -> None:
    one, other = (
        solve(SCENES[name], ordering=ordering, device=device, precision=precision)
        for ordering in ("wavefront", "lexicographic")
    )
    np.testing.assert_array_equal(one.log_depth, other.log_depth)
    np.testing.assert_array_equal(one.changes, other.changes)
    assert one.distance == other.distance


def test_images_of_a_batch_end_as_they_do_alone() -> None:
    """Also beside those that cannot be accelerated, since not all of their edge is known."""
    scenes = [SCENES["bump"], ps.bump((60, 90)), ps.bumps((64, 64)), ps.bump((50, 50)).seeded()]
    keywords: dict[str, Any] = {"scheme": "lax-friedrichs", "max_iterations": 400}
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        known_depth=[scene.known_depth for scene in scenes],
        **keywords,
    )
    for scene, solution in zip(scenes, together, strict=True):
        alone = ps.reconstruct(scene.image, scene.camera, known_depth=scene.known_depth, **keywords)
        np.testing.assert_array_equal(solution.log_depth, alone.log_depth)
        np.testing.assert_array_equal(solution.changes, alone.changes)
        assert solution.status is alone.status
        assert solution.distance == alone.distance or np.isnan(solution.distance + alone.distance)


def test_nothing_is_accelerated_whose_limit_depends_on_the_way() -> None:
    """By eq. (12) the boundary only falls, and under a flash the first values are bounds."""
    for scene, light in (
        (ps.bump((40, 40)).seeded(), None),
        (ps.bump((40, 40), light=ps.FlashLight()), ps.FlashLight()),
    ):
        given = {"known_depth": scene.known_depth} if light is None else {"light": light}
        one, other = (
            ps.reconstruct(scene.image, scene.camera, scheme="lax-friedrichs", acceleration=acceleration, **given)
            for acceleration in (True, False)
        )
        np.testing.assert_array_equal(one.changes, other.changes)
        np.testing.assert_array_equal(one.log_depth, other.log_depth)


def test_materials_at_walls_keep_the_limit_that_is_reached_by_falling() -> None:
    """There argmin H is an estimate, and mixtures end at another limit, 3e-4 away."""
    light, material = ps.ParallelLight(0.15, -0.1), ps.OrenNayar(1.0)
    scene = ps.bump((24, 24), light=light, reflectance=material, relief=0.02, noise=0.05)
    scene = replace(scene, image=np.minimum(0.85 * scene.image, 0.74))
    row, column = np.indices(scene.image.shape)
    mask = (column // 7 % 2 == 0) | (row // 9 % 3 == 0)
    known = np.where(mask, scene.known_depth, np.nan)
    plain, usual = (
        solve(scene, mask=mask, known_depth=known, boundary="wall", max_slope=2.0, acceleration=acceleration)
        for acceleration in (False, True)
    )
    assert plain.status is usual.status is ps.Status.CONVERGED
    assert apart(plain, usual) <= 2e-5


@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_what_mixtures_cannot_improve_comes_to_rest_by_falling(precision: str) -> None:
    """At a tolerance below what rounding leaves: the end is that of the plain iteration, where nothing changes."""
    scene = ps.bump((48, 48))
    accelerated, plain = (
        solve(scene, tolerance=0.0, precision=precision, acceleration=acceleration) for acceleration in (True, False)
    )
    assert accelerated.status is plain.status is ps.Status.CONVERGED
    assert accelerated.changes[-1] == 0.0
    assert apart(accelerated, plain) <= 40.0 * float(np.finfo(precision).eps)


def test_mixtures_that_lead_astray_do_no_harm(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is taken back, or in the end the values are put above the limit, from where they only fall."""
    scene = ps.bump((48, 48))
    usual = Acceleration.weights

    def astray(self: Acceleration, found: Products) -> Any:
        weights = usual(self, found)
        return weights if len(weights) < 2 else 40.0 * np.ones(len(weights))

    monkeypatch.setattr(Acceleration, "weights", astray)
    solution = solve(scene)
    monkeypatch.undo()
    assert solution.status is ps.Status.CONVERGED
    assert apart(solution, solve(scene, acceleration=False)) <= 3e-5


@pytest.mark.parametrize("most", [3, 30, 61])
def test_iterations_are_limited_all_the_same(most: int) -> None:
    solution = solve(SCENES["oblique light, toward"], max_iterations=most)
    assert (solution.status, solution.iterations) == (ps.Status.MAX_ITERATIONS, most)


def test_a_callback_is_told_every_iteration_and_stops_it() -> None:
    told: list[int] = []

    def callback(iteration: int, _change: float) -> bool:
        told.append(iteration)
        return iteration == 42

    solution = solve(SCENES["bump"], callback=callback)
    assert told == list(range(1, 43))
    assert (solution.status, solution.iterations) == (ps.Status.STOPPED, 42)


def products(size: float, rise: float = 0.0) -> Products:
    return Products(np.ones(DEPTH), np.ones(DEPTH), size**2, 1.0, 0.0, size, rise)


def test_a_mixture_after_which_more_is_left_is_taken_back_and_others_wait() -> None:
    image = Acceleration(1e-7, 0.01)
    assert not image.is_due(1.0)
    for size in (1.0, 1.0, 0.9):
        assert image.is_due(1e-3)
        image.weights(products(size))
    np.testing.assert_array_equal(image.weights(products(3.0)), [1.0])
    waits = [image.is_due(1e-3) for _ in range(3)]
    assert waits == [False, False, True]


@pytest.mark.parametrize(("size", "rise"), [(1.0, 0.011), (1.0, np.inf), (np.nan, 0.0)])
def test_values_that_rise_above_what_only_fell_begin_again_from_there(size: float, rise: float) -> None:
    image = Acceleration(1e-7, 0.01)
    image.weights(products(1.0, 0.0))
    image.weights(products(1.0, 0.009))
    assert not image.is_astray
    image.weights(products(size, rise))
    assert (image.is_astray, image.gives_up, image.distance) == (True, True, 0.0)


def test_fronts_on_their_way_are_not_mixed() -> None:
    assert not Acceleration(1e-7, 0.01).is_due(0.004)
    assert Acceleration(1e-7, 0.01).is_due(0.002)
    assert not Acceleration(1e-7, 0.001).is_due(0.002)


def test_it_gives_up_where_nothing_is_gained() -> None:
    image = Acceleration(1e-7, 0.01)
    launches = 0
    while not image.gives_up:
        image.weights(products(1.0))
        launches += 1
    assert 10 < launches < 30
    assert not image.is_due(1e-3)


def test_without_an_estimate_of_the_distance_it_goes_back_to_where_it_began() -> None:
    """Differences that do not shrink from one launch to the next."""
    image = Acceleration(1e-7, 0.01)
    while not image.gives_up:
        image.weights(replace(products(1.0), value_squares=4.0, across=1.0))
    assert (image.is_astray, image.distance) == (True, 0.0)


def test_what_only_rounding_moves_is_at_its_limit() -> None:
    image = Acceleration(1e-7, 0.01)
    for size in (1.0, 0.5, 0.3, 0.2, 0.1, 0.06, 0.03, 0.02, 3e-7):
        image.weights(products(size))
    assert not image.is_rounding
    for _ in range(6):
        image.weights(products(3e-7))
    assert image.is_rounding
    assert 0.0 < image.distance < 1e-5


def test_iteration_knows_no_mixtures_by_the_papers_criterion(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Sweeper, "mixer", lambda _: pytest.fail("there are mixtures"))
    solve(SCENES["bump"], stopping="change")
    solve(SCENES["bump"], acceleration=False)
