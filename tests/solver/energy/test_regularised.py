"""The scheme "regularised": what it finds, what it keeps to, and what it refuses."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.terrain import Terrain, prior_of_blocks
from persfs_cl.choices import Precision
from persfs_cl.errors import PersfsWarning
from persfs_cl.preparation.denoise import noise_of
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.minimise import Minimum, Stopping, estimated_distance
from persfs_cl.solver.energy.regularised import Sought, regularised

Array = NDArray[np.float64]

STEP = 8


def sought(shape: tuple[int, int] = (64, 96), noise: float = 0.01, **others: Any) -> tuple[Terrain, Sought]:
    """A piece of ground with the means of its blocks as a prior."""
    ground = Terrain.photographed(noise, shape)
    prior = prior_of_blocks(ground.depth, np.ones(shape, bool), STEP, tolerance=0.003)
    given: dict[str, Any] = {
        "image": ground.image,
        "grid": ground.camera.grid(shape),
        "light": ps.ParallelLight(1.0, 0.3),
        "reflectance": ps.Lambertian(),
        "solved": np.ones(shape, bool),
        "known": np.full(shape, np.nan),
        "prior": prior,
        **others,
    }
    return ground, Sought(**given)


def least(device: ps.Device, what: Sought, precision: Precision = "float32", **others: Any) -> Minimum:
    return regularised(device, what, Stopping(1e-6, "distance", 60, None), precision=precision, **others)


def depth(found: Minimum) -> Array:
    return np.asarray(np.exp(found.log_depth + found.level))


def test_terrain_is_better_than_its_prior(device: ps.Device) -> None:
    ground, what = sought()
    assert what.prior is not None
    coarse = ground.heights(np.exp(what.prior.log_depth))
    found = ground.heights(depth(least(device, what)))
    assert ground.error(found) < 0.6 * ground.error(coarse)
    assert ground.angle(found) < 0.3 * ground.angle(coarse)


@pytest.mark.parametrize("paint", ["plain", "painted", 0.1])
def test_the_energy_never_rises(device: ps.Device, precision: Precision, paint: str | float) -> None:
    energies = least(device, sought()[1], precision, paint=paint).energies
    assert len(energies) > 5
    assert all(after <= before for before, after in pairwise(energies))
    assert energies[-1] < 0.98 * energies[0]


def test_the_same_bits_again_and_nearly_the_same_in_double(device: ps.Device) -> None:
    _, what = sought()
    first, second = least(device, what), least(device, what)
    np.testing.assert_array_equal(first.log_depth, second.log_depth)
    assert first.changes == second.changes
    assert first.energies == second.energies
    if device.has_float64:
        double = least(device, what, "float64")
        # After so many iterations: rounding decides nothing.
        assert double.energies[3] == pytest.approx(first.energies[3], rel=1e-3)


def test_the_minimum_is_found_from_elsewhere(device: ps.Device) -> None:
    """The distance is that to the minimum, and no farther than the tolerance says."""
    scene = ps.bump((48, 48), light=ps.FlashLight(), noise=0.01)
    options: dict[str, Any] = {"light": scene.light, "scheme": "regularised", "device": device}
    found = ps.reconstruct(scene.image, scene.camera, **options, tolerance=1e-4)
    exact = ps.reconstruct(scene.image, scene.camera, **options, tolerance=1e-7, precision="float64")
    assert found.status is exact.status is ps.Status.CONVERGED
    assert found.distance <= 1e-4
    assert np.abs(found.log_depth - exact.log_depth).max() <= 3e-4


LIGHTS = {
    "flash": ps.FlashLight(),
    "lamp": ps.FlashLight(offset=(0.05, 0.0, 0.0)),
    "side": ps.ParallelLight(0.5, 0.2),
    "even flash": ps.FlashLight(falloff=False),
}


@pytest.mark.parametrize(
    ("light", "reflectance"),
    [
        *((light, ps.Lambertian()) for light in LIGHTS),
        ("flash", ps.OrenNayar(0.3)),
        pytest.param("flash", ps.Phong(), marks=pytest.mark.thorough),
        pytest.param("side", ps.Phong(0.8, 0.2, 8.0), marks=pytest.mark.thorough),
    ],
    ids=str,
)
def test_smooth_scenes_are_no_worse_than_by_the_sweeps(device: ps.Device, light: str, reflectance: Reflectance) -> None:
    scene = ps.bump((64, 64), light=LIGHTS[light], reflectance=reflectance)
    known = None if LIGHTS[light].determines_depth else scene.known_depth
    options: dict[str, Any] = {
        "light": scene.light,
        "reflectance": reflectance,
        "known_depth": known,
        "device": device,
    }
    swept = ps.reconstruct(scene.image, scene.camera, **options)
    # The image is exact: there is little to smooth.
    found = ps.reconstruct(scene.image, scene.camera, scheme="regularised", smoothing=0.5, **options)
    assert found.status is ps.Status.CONVERGED
    assert ps.compare(found.depth, scene.depth).mean <= 1.05 * ps.compare(swept.depth, scene.depth).mean


def test_noise_is_smoothed(device: ps.Device) -> None:
    scene = ps.bump((64, 64), light=ps.ParallelLight(0.5, 0.2), noise=0.02)
    options: dict[str, Any] = {"light": scene.light, "known_depth": scene.known_depth, "device": device}
    swept = ps.reconstruct(scene.image, scene.camera, **options)
    errors = [
        ps.compare(
            ps.reconstruct(scene.image, scene.camera, scheme="regularised", smoothing=over, **options).depth,
            scene.depth,
        ).mean
        for over in (0.2, 1.0)
    ]
    assert errors[0] < 0.7 * ps.compare(swept.depth, scene.depth).mean
    assert errors[1] < 0.7 * errors[0]


def test_known_depths_are_kept_and_bounds_held(device: ps.Device, precision: Precision) -> None:
    scene = ps.bump((40, 50), light=ps.FlashLight())
    known = np.full(scene.depth.shape, np.nan)
    known[10, 5:9] = scene.depth[10, 5:9] * 1.01
    near, far = np.quantile(scene.depth, [0.3, 0.8])
    known[(known < near) | (known > far)] = np.nan
    assert np.isfinite(known).any()
    found = ps.reconstruct(
        scene.image,
        scene.camera,
        light=scene.light,
        scheme="regularised",
        known_depth=known,
        depth_range=(near, far),
        device=device,
        precision=precision,
    )
    np.testing.assert_array_equal(found.depth[np.isfinite(known)], known[np.isfinite(known)])
    assert found.depth.min() == near
    assert found.depth.max() == far
    assert found.at_bound.any()
    np.testing.assert_array_equal(found.at_bound, (found.depth == near) | (found.depth == far))


def test_a_mask_and_walls(device: ps.Device) -> None:
    scene = ps.bump((40, 50), light=ps.FlashLight())
    mask = np.ones(scene.depth.shape, bool)
    mask[:6, :9] = mask[20:23, 30:] = False
    walls = np.zeros_like(mask)
    walls[10:, 15] = True
    image = np.where(mask, scene.image, np.nan)
    found = ps.reconstruct(
        image, scene.camera, light=scene.light, scheme="regularised", mask=mask, walls=walls, device=device
    )
    assert found.status is ps.Status.CONVERGED
    np.testing.assert_array_equal(found.solved, mask)
    assert np.isnan(found.depth[~mask]).all()
    assert ps.compare(found.depth, scene.depth, mask=mask).mean < 0.01 * np.ptp(scene.depth)


def until(last: int) -> Callable[[int, float], bool]:
    return lambda iteration, _change: iteration == last


def test_a_callback_hears_of_each_iteration_and_stops(device: ps.Device) -> None:
    scene = ps.bump((40, 50), light=ps.FlashLight(), noise=0.01)
    options: dict[str, Any] = {"light": scene.light, "scheme": "regularised", "device": device}
    heard: list[tuple[int, float]] = []
    found = ps.reconstruct(
        scene.image, scene.camera, callback=lambda iteration, change: heard.append((iteration, change)), **options
    )
    assert heard == list(enumerate(found.changes, start=1))
    for last in (1, found.iterations - 1):
        stopped = ps.reconstruct(scene.image, scene.camera, callback=until(last), **options)
        assert stopped.status is ps.Status.STOPPED
        assert stopped.iterations == last
        assert np.isfinite(stopped.depth).all()
    ended = ps.reconstruct(scene.image, scene.camera, max_iterations=3, **options)
    assert ended.status is ps.Status.MAX_ITERATIONS
    assert ended.iterations == 3
    assert np.isfinite(ended.depth).all()


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"scheme": "regularised", "ordering": "checkerboard"}, "ordering"),
    ({"scheme": "regularised", "accuracy_order": 2}, "accuracy_order"),
    ({"scheme": "regularised", "boundary": "wall"}, "boundary"),
    ({"scheme": "regularised", "acceleration": False}, "acceleration"),
    ({"scheme": "regularised", "max_slope": 3.0}, "max_slope"),
    ({"scheme": "regularised", "paint": "striped"}, "paint"),
    ({"scheme": "regularised", "paint": -0.1}, "paint"),
    ({"scheme": "regularised", "smoothing": 0.0}, "smoothing"),
    ({"paint": "painted"}, "paint"),
    ({"scheme": "lax-friedrichs", "smoothing": 2.0}, "smoothing"),
]


@pytest.mark.parametrize(("options", "name"), REFUSED, ids=str)
def test_what_means_nothing_is_refused(options: dict[str, Any], name: str) -> None:
    scene = ps.bump((20, 20), light=ps.FlashLight())
    with pytest.raises(ps.InputError) as error:
        ps.reconstruct(scene.image, scene.camera, light=scene.light, **options)
    assert error.value.argument == name


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.FlashLight(falloff=False)], ids=str)
def test_something_must_anchor_the_depth(light: ps.ParallelLight | ps.FlashLight) -> None:
    scene = ps.bump((20, 20), light=light)
    with pytest.raises(ps.InputError, match=r"anchors the depth|tells of slopes only"):
        ps.reconstruct(scene.image, scene.camera, light=light, scheme="regularised")


def test_it_is_chosen_by_name_only() -> None:
    scene = ps.bump((20, 20), light=ps.FlashLight())
    solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    assert solution.parameters["scheme"] == "upwind"
    named = ps.reconstruct(scene.image, scene.camera, light=scene.light, scheme="regularised")
    assert named.parameters["scheme"] == "regularised"
    assert not {"ordering", "boundary", "accuracy_order"} & named.parameters.keys()


def test_the_tolerance_bounds_what_it_is_said_to(device: ps.Device) -> None:
    what = sought()[1]

    def run(stopping: Stopping) -> Minimum:
        found = regularised(device, what, stopping, precision="float32")
        assert found.status is ps.Status.CONVERGED
        return found

    by_gain = run(Stopping(1e-3, "gain", 2000, None))
    by_change = run(Stopping(1e-5, "change", 2000, None))
    by_distance = run(Stopping(1e-5, "distance", 2000, None))
    gained = [(before - after) / after for before, after in zip(by_gain.energies, by_gain.energies[5:], strict=False)]
    assert gained[-1] <= 1e-3 < min(gained[:-1])
    assert by_change.changes[-1] <= 1e-5 < by_change.changes[-2]
    assert by_distance.distance <= 1e-5
    assert not by_gain.distance <= 1e-5
    # What more iterations bring is less than the noise of a pixel: they are for who wants the minimum itself.
    assert by_distance.energies[-1] <= by_gain.energies[-1] <= 1.02 * by_distance.energies[-1]


def test_the_tolerance_that_is_not_given_goes_by_scheme_and_stopping(device: ps.Device) -> None:
    scene = ps.bump((32, 40), light=ps.FlashLight(), noise=0.01)

    def ended(**options: Any) -> tuple[str, float]:
        found = ps.reconstruct(scene.image, scene.camera, light=scene.light, device=device, **options)
        assert found.status is ps.Status.CONVERGED
        return found.parameters["stopping"], found.parameters["tolerance"]

    assert ended(scheme="regularised") == ("distance", 2e-3)
    assert ended(scheme="regularised", tolerance=1e-3) == ("distance", 1e-3)
    assert ended(scheme="regularised", stopping="gain") == ("gain", 1e-3)
    assert ended(scheme="regularised", stopping="gain", tolerance=1e-2) == ("gain", 1e-2)
    assert ended() == ("distance", 1e-5)
    with pytest.raises(ps.InputError, match="has an energy to gain") as error:
        ended(stopping="gain")
    assert error.value.argument == "stopping"
    with pytest.raises(ps.ConvergenceError, match=r"Not converged after 2 iterations\. The iterations ran out"):
        ended(scheme="regularised", stopping="gain", max_iterations=2, throw=True)


SCENES: dict[str, Callable[[], tuple[ps.Scene, dict[str, Any]]]] = {
    "flash": lambda: (ps.bump((48, 48), light=ps.FlashLight(), noise=0.01), {}),
    "flash, exact": lambda: (ps.bumps((48, 64), light=ps.FlashLight()), {}),
    "lamp": lambda: (ps.hillside((40, 56), light=LIGHTS["lamp"], noise=0.01), {}),
    "gloss": lambda: (ps.bump((48, 48), light=ps.FlashLight(), reflectance=ps.Phong()), {"reflectance": ps.Phong()}),
    "frame": lambda: with_frame(ps.bumps((48, 48), light=LIGHTS["side"], noise=0.01)),
    "frame, exact": lambda: with_frame(ps.hillside((48, 48), light=LIGHTS["side"])),
    "painted": lambda: (ps.bump((48, 48), light=ps.FlashLight(), noise=0.01), {"paint": 0.1}),
}


def with_frame(scene: ps.Scene) -> tuple[ps.Scene, dict[str, Any]]:
    return scene, {"known_depth": scene.known_depth}


# The lower one in double precision, where each light and material is a program of its own.
@pytest.mark.quick_where(holds=lambda given: (given["tolerance"] == 1e-5) == (given["name"] in ("flash", "painted")))
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("name", SCENES)
def test_it_has_converged_where_the_distance_is_within_the_tolerance(
    device: ps.Device, name: str, tolerance: float
) -> None:
    """And then it is within three times the tolerance of where the run leads, if it is not ended."""
    scene, options = SCENES[name]()
    precision = "float64" if device.has_float64 and tolerance < 1e-4 else "float32"
    options |= {"light": scene.light, "scheme": "regularised", "device": device, "precision": precision}
    found = ps.reconstruct(scene.image, scene.camera, tolerance=tolerance, **options)
    assert found.status is ps.Status.CONVERGED
    assert found.distance <= tolerance
    led_to = ps.reconstruct(scene.image, scene.camera, tolerance=0.01 * tolerance, max_iterations=600, **options)
    assert np.nanmax(np.abs(found.log_depth - led_to.log_depth)) <= 3.0 * tolerance


def test_changes_that_shrink_unevenly_do_not_look_nearer_than_they_are() -> None:
    even = [0.5**place for place in range(20)]
    assert estimated_distance(even, 1e-9) == pytest.approx(even[-10])
    uneven = [*even[:-1], 1e-3 * even[-1]]
    assert estimated_distance(uneven, 1e-9) >= even[-1]
    # A patch that begins to move late: nothing can be told as long as the changes grow.
    assert np.isnan(estimated_distance([*even, *even[::-1]], 1e-9))
    assert np.isnan(estimated_distance([], 1e-9))


@pytest.mark.parametrize("noise", [0.01, 0.05])
def test_the_noise_is_found(noise: float) -> None:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:80, :90]
    image = 0.5 + 0.3 * np.sin(x / 9.0) * np.cos(y / 11.0) + rng.normal(0.0, noise, x.shape)
    image[20:22, 30:60] = 5.0
    there = np.ones(image.shape, bool)
    assert noise_of(image, there) == pytest.approx(noise, rel=0.1)
    there[:30] = False
    image[:30] = np.nan
    assert noise_of(image, there) == pytest.approx(noise, rel=0.1)
    assert noise_of(image[:2], there[:2]) == 0.0


def test_a_surface_that_runs_away_is_told_of() -> None:
    """Two depths do not hold a shiny surface in an oblique light."""
    light = ps.ParallelLight(0.4, 0.3)
    scene = ps.bump((30, 40), light=light, reflectance=ps.Phong(), focal_length=40.0)
    known = np.full(scene.image.shape, np.nan)
    known[[4, 25], [9, 30]] = scene.depth[[4, 25], [9, 30]]
    given: dict[str, Any] = {"light": light, "reflectance": scene.reflectance, "scheme": "regularised"}
    with pytest.warns(PersfsWarning, match="has run away.*known_depth"):
        ps.reconstruct(scene.image, scene.camera, known_depth=known, max_iterations=40, **given)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ps.reconstruct(scene.image, scene.camera, known_depth=scene.known_depth, max_iterations=40, **given)
