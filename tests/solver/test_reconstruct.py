"""Reconstruction as a user calls it: exact scenes, invariances, boundary modes, masks, options, bad input."""

from __future__ import annotations

import inspect
import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.choices import Boundary
from persfs_cl.io.export import write_grey
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver import reconstruct as reconstruct_room
from persfs_cl.solver.given import Given, check
from persfs_cl.solver.problem import Problem

ORDERINGS = ("wavefront", "checkerboard", "lexicographic")


def solve(scene: Scene, **keywords: Any) -> ps.Solution:
    """By the paper's scheme unless told otherwise."""
    given = {"light": scene.light, "known_depth": scene.known_depth, "surface": scene.surface}
    return ps.reconstruct(scene.image, scene.camera, **{**given, "scheme": "lax-friedrichs", **keywords})


def error_of(scene: Scene, **keywords: Any) -> float:
    solution = solve(scene, tolerance=1e-8, precision="float64", ordering="checkerboard", **keywords)
    assert solution.status is ps.Status.CONVERGED
    return ps.compare(solution.depth, scene.depth).mean


@pytest.mark.parametrize("ordering", ORDERINGS)
def test_vase_is_at_least_as_good_as_the_paper_says(device: ps.Device, precision: str, ordering: str) -> None:
    scene = ps.vase()
    keywords: dict[str, Any] = {"max_iterations": 30, "tolerance": 0.0, "acceleration": False}
    solution = solve(scene, ordering=ordering, device=device, precision=precision, **keywords)
    errors = ps.compare(solution.depth - 1.0, scene.depth - 1.0, align="range")
    assert errors.mean <= 0.019, "the paper has 0.0272"
    assert errors.root_mean_square <= 0.037, "the paper has 0.0559"
    assert solution.iterations == 30


def test_vase_with_an_open_frame_is_closed_by_eq_12() -> None:
    scene = ps.vase(known="background")
    solution = solve(scene, ordering="checkerboard", max_iterations=30, tolerance=0.0)
    errors = ps.compare(solution.depth - 1.0, scene.depth - 1.0, align="range")
    assert errors.mean <= 0.019
    assert errors.root_mean_square <= 0.040, "the paper has 0.0559"
    assert solution.depth.max() < scene.depth.max(), "no dark pixel on the edge may run away"


@pytest.mark.parametrize(
    ("make", "light"),
    [
        (ps.bump, ps.ParallelLight()),
        (ps.bump, ps.ParallelLight(0.15, -0.1)),
        (ps.bumps, ps.ParallelLight()),
        (ps.sphere_cap, ps.ParallelLight()),
    ],
    ids=["bump", "bump, oblique", "bumps", "sphere cap"],
)
# The kernels have the sign of the surface as a number.
@pytest.mark.quick_where(
    holds=lambda given: (given["surface"] == "toward") == (given["make"] is ps.bumps or given["light"].norm > 1.0)
)
@pytest.mark.parametrize("surface", ["away", "toward"])
def test_error_falls_with_the_grid(make: Any, surface: str, light: ps.ParallelLight) -> None:
    """The scheme is first order, but only about of order one half as long as singular points dominate the error."""
    coarse, fine = (
        error_of(make(shape=(size, size), light=light, surface=surface, orientation=20.0)) for size in (40, 120)
    )
    assert fine < 0.75 * coarse
    assert fine < 0.012


def test_a_bump_grows_from_its_singular_point() -> None:
    errors = [error_of(ps.bump(shape=(size, size)).seeded(), boundary="outflow") for size in (24, 72)]
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize(
    "turn",
    [np.fliplr, np.flipud, np.transpose],
    ids=["mirror", "upside down", "transpose"],
)
def test_turning_the_photograph_turns_the_surface(turn: Any) -> None:
    scene = ps.bump(shape=(37, 50))
    solution = solve(scene, tolerance=0.0, precision="float64")
    camera = ps.Camera(focal_length=50.0)
    turned = ps.reconstruct(
        turn(scene.image),
        camera,
        known_depth=turn(scene.known_depth),
        scheme="lax-friedrichs",
        tolerance=0.0,
        precision="float64",
    )
    np.testing.assert_allclose(turned.depth, turn(solution.depth), rtol=1e-11)


@pytest.mark.parametrize("scale", [1e-3, 550.0])
def test_depth_scales_with_the_known_values(scale: float) -> None:
    scene = ps.bump(shape=(41, 41))
    one, other = solve(scene), solve(scene, known_depth=scale * scene.known_depth)
    np.testing.assert_allclose(other.depth, scale * one.depth, rtol=1e-6)
    np.testing.assert_array_equal(one.changes, other.changes)


def test_toward_is_the_reverse_of_away_for_the_same_shading() -> None:
    away, toward = (ps.bump(shape=(64, 64), surface=surface) for surface in ("away", "toward"))
    assert error_of(toward) < 0.02
    assert error_of(away) < 0.02
    wrong = solve(toward, surface="away")
    assert wrong.depth.max() > 1.05, "the concave and the convex reading of one photograph"


def test_known_depths_are_kept_exactly() -> None:
    scene = ps.bump(shape=(30, 30))
    known = scene.known_depth * np.pi
    solution = ps.reconstruct(scene.image, scene.camera, known_depth=known)
    given = np.isfinite(known)
    np.testing.assert_array_equal(solution.depth[given], known[given])


def test_without_known_depths_the_edge_is_at_one() -> None:
    scene = ps.bump(shape=(30, 40))
    np.testing.assert_allclose(scene.known_depth[[0, -1]], 1.0, atol=1e-3)
    solution = ps.reconstruct(scene.image, scene.camera, scheme="lax-friedrichs")
    assert (solution.depth[[0, -1]] == 1.0).all()
    assert (solution.depth[:, [0, -1]] == 1.0).all()
    np.testing.assert_allclose(solution.depth, solve(scene).depth, atol=3e-3)


def disc(size: int, radius: float, centre: tuple[float, float] = (0.5, 0.5)) -> np.ndarray[Any, Any]:
    rows, columns = np.indices((size, size)) / (size - 1)
    return np.asarray((rows - centre[0]) ** 2 + (columns - centre[1]) ** 2 < radius**2)


@pytest.mark.parametrize("boundary", ["outflow", "wall", "fixed"])
def test_a_round_mask_with_its_rim_known_gives_the_surface_inside(boundary: str) -> None:
    scene = ps.bump(shape=(64, 64))
    mask = disc(64, 0.3)
    ring = disc(64, 0.33) & ~mask
    solution = solve(scene, mask=mask, known_depth=np.where(ring, scene.depth, np.nan), boundary=boundary)
    assert np.isnan(solution.depth[~mask & ~ring]).all()
    assert (solution.solved == (mask | ring)).all()
    errors = ps.compare(solution.depth, scene.depth, mask=mask)
    assert errors.mean < 0.012
    assert errors.count == mask.sum()


def test_pieces_are_solved_each_from_its_own_values_and_lost_ones_reported() -> None:
    scene = ps.bump(shape=(64, 64))
    pieces = [disc(64, 0.15, centre) for centre in ((0.2, 0.2), (0.2, 0.8), (0.75, 0.5))]
    known = np.full((64, 64), np.nan)
    for piece in pieces[:2]:
        rim = piece & ~np.roll(piece, 1, 0)
        known[rim] = scene.depth[rim]
    solution = solve(scene, mask=np.any(pieces, axis=0), known_depth=known)
    assert solution.solved[pieces[0] | pieces[1]].all()
    assert not solution.solved[pieces[2]].any()
    assert np.isnan(solution.depth[pieces[2]]).all()
    np.testing.assert_array_equal(solution.unreached, pieces[2])
    alone = solve(scene, mask=pieces[0], known_depth=np.where(pieces[0], known, np.nan))
    np.testing.assert_allclose(solution.depth[pieces[0]], alone.depth[pieces[0]], rtol=1e-5)


def test_nothing_crosses_a_wall() -> None:
    scene = ps.bump(shape=(40, 40))
    walls = np.zeros((40, 40), bool)
    walls[:, 25] = True
    lower = np.where(np.arange(40) > 25, 0.5, 1.0) * scene.known_depth
    one = solve(scene, walls=walls, tolerance=1e-8)
    other = solve(scene, walls=walls, known_depth=lower, tolerance=1e-8)
    np.testing.assert_allclose(one.depth[:, :25], other.depth[:, :25], rtol=2e-6)
    assert (other.depth[:, 26:] < one.depth[:, 26:]).all()
    # The wall itself belongs to one of its sides.
    assert one.solved.all()
    assert (other.discontinuities.right[:, 24:26].sum(axis=1) == 1).all()  # type: ignore[union-attr] # walls were given


@pytest.mark.parametrize("boundary", ["outflow", "wall", "extrapolate"])
def test_open_edges_let_the_surface_flow_out(boundary: Boundary) -> None:
    """A surface that grows from one line: what lies outside the image must not matter."""
    size = 48
    columns = np.indices((size, size))[1]
    camera = ps.Camera(focal_length=float(size))
    log_depth = 0.3 * np.abs(columns - size // 2) / size
    image = ps.render(np.exp(log_depth), camera)
    known = np.where(columns == size // 2, 1.0, np.nan)
    image[:, size // 2] = image[:, size // 2 + 1]
    solution = ps.reconstruct(image, camera, known_depth=known, boundary=boundary, tolerance=1e-7)
    np.testing.assert_allclose(solution.log_depth, log_depth, atol=0.02)


@pytest.mark.parametrize("shape", [(1, 60), (60, 1), (2, 60)])
def test_a_row_of_pixels_is_a_profile(shape: tuple[int, int]) -> None:
    along = np.arange(60)
    log_depth = 0.4 * np.minimum(along, 59 - along) / 60
    x = (along - 29.5) / 60
    slope = np.where(along < 29.5, 0.4, -0.4)
    brightness = (1 + x * slope) / np.sqrt(slope**2 + (1 + x * slope) ** 2)
    known = np.full(60, np.nan)
    known[[0, -1]] = 1.0
    turn = np.transpose if shape[1] == 1 else np.asarray
    image, given = (turn(np.tile(values, (min(shape), 1))) for values in (brightness, known))
    solution = ps.reconstruct(image, ps.Camera(60.0), known_depth=given, tolerance=1e-9, precision="float64")
    expected = turn(np.tile(log_depth, (min(shape), 1)))
    assert np.abs(solution.log_depth - expected).mean() < 0.02


def test_dark_pixels_are_counted_and_never_run_away() -> None:
    scene = ps.bump(shape=(50, 50), surface="toward")
    image = scene.image.copy()
    image[20:30, 38:44] = 0.0
    solution = ps.reconstruct(image, scene.camera, known_depth=scene.known_depth, max_slope=20.0)
    assert solution.clamped[20:30, 38:44].all()
    assert solution.clamped.sum() == 60
    climbs = np.diff(solution.log_depth, axis=1)
    assert np.abs(climbs).max() <= 20.0 / 50 * (1 + 1e-5)
    assert solution.log_depth.max() < 3.0


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.FlashLight(falloff=False)], ids=str)
def test_a_black_pixel_is_solved_as_a_nearly_black_one(
    device: ps.Device, precision: str, light: ps.ParallelLight | ps.FlashLight
) -> None:
    """On the optical axis, where the viscosity of either light is proportional to the brightness."""
    scene = ps.bump((25, 25), light=light)
    frame = np.pad(np.full((23, 23), np.nan), 1, constant_values=1.0)
    black, nearly = scene.image.copy(), scene.image.copy()
    black[12, 12], nearly[12, 12] = 0.0, 1e-9
    keywords: dict[str, Any] = {"known_depth": frame, "device": device, "precision": precision}
    one, other = (solve(replace(scene, image=image), **keywords) for image in (black, nearly))
    assert one.solved.all()
    np.testing.assert_allclose(one.log_depth, other.log_depth, atol=1e-6)


def test_callback_sees_every_iteration_and_may_stop() -> None:
    seen: list[tuple[int, float]] = []

    def watch(iteration: int, change: float) -> bool:
        seen.append((iteration, change))
        return iteration == 3

    solution = solve(ps.bump(shape=(40, 40)), callback=watch)
    assert solution.status is ps.Status.STOPPED
    assert [iteration for iteration, _ in seen] == [1, 2, 3]
    np.testing.assert_array_equal([change for _, change in seen], solution.changes)
    assert np.isfinite(solution.depth).all()


def test_status_and_throw() -> None:
    scene = ps.bump(shape=(40, 40))
    assert solve(scene).status is ps.Status.CONVERGED
    assert solve(scene).changes[-1] <= 1e-5
    assert solve(scene, max_iterations=2).status is ps.Status.MAX_ITERATIONS
    with pytest.raises(ps.ConvergenceError, match="allow more of them") as caught:
        solve(scene, max_iterations=2, throw=True)
    assert caught.value.solution.iterations == 2
    assert solve(scene, throw=True).status is ps.Status.CONVERGED


def test_time_is_accounted_for() -> None:
    elapsed = solve(ps.bump(shape=(40, 40))).elapsed
    assert 0 < elapsed.kernels < elapsed.total
    assert 0 < elapsed.build < elapsed.total


def test_batch_gives_the_numbers_of_one_by_one() -> None:
    scenes = [ps.bump(shape=(30, 30)), ps.bump(shape=(20, 33), relief=0.1), ps.sphere_cap(shape=(30, 30))]
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        known_depth=[scenes[0].known_depth, None, scenes[2].known_depth],
        mask=[None, disc(33, 0.5)[:20], None],
        scheme="lax-friedrichs",
    )
    for number, (scene, solution) in enumerate(zip(scenes, together, strict=True)):
        known = None if number == 1 else scene.known_depth
        alone = solve(scene, known_depth=known, mask=disc(33, 0.5)[:20] if number == 1 else None)
        np.testing.assert_array_equal(alone.depth, solution.depth)
    with pytest.raises(ps.InputError, match="mask has 1 entries for 2 images"):
        ps.reconstruct_batch([scenes[0].image] * 2, scenes[0].camera, mask=[None])
    mask: Any = disc(30, 0.5)
    with pytest.raises(ps.InputError, match=r"mask is one array of shape \(30, 30\): give a list"):
        ps.reconstruct_batch([scenes[0].image] * 2, scenes[0].camera, mask=mask)
    with pytest.raises(ps.InputError, match=r"images='photo\.jpg' is no list: give a list of arrays"):
        ps.reconstruct_batch("photo.jpg", scenes[0].camera)


def test_float64_on_a_device_without_it_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    device = ps.devices()[0]
    monkeypatch.setattr(device, "has_float64", False)
    with pytest.raises(ps.DeviceError, match="no double precision"):
        solve(ps.bump(shape=(20, 20)), device=device, precision="float64")


IMAGE = np.random.default_rng(0).uniform(0.3, 1.0, (20, 24))


def with_values(values: float, *, where: Any = (10, 10)) -> np.ndarray[Any, Any]:
    changed = IMAGE.copy()
    changed[where] = values
    return changed


def depths(value: float) -> np.ndarray[Any, Any]:
    known = np.full(IMAGE.shape, np.nan)
    known[5, 5] = value
    return known


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"image": with_values(np.nan)}, "1 NaN or infinite"),
        ({"image": with_values(np.inf, where=slice(3, 5))}, "44 NaN or infinite"),
        ({"image": np.zeros((20, 24))}, "all black"),
        ({"image": np.full((20, 24), 0.7)}, "constant"),
        ({"image": IMAGE * 255}, "E must lie in"),
        ({"image": -IMAGE}, "E must lie in"),
        ({"image": (IMAGE * 255).astype(np.uint8)}, "divide by 255"),
        ({"image": IMAGE + 0j}, "complex128"),
        ({"image": np.dstack([IMAGE] * 3)}, "made grey first"),
        ({"image": np.ones((0, 4))}, "at least 2 pixels"),
        ({"image": "photo.png"}, "image='photo.png' is no array: give read_image"),
        ({"image": Path("photo.png")}, "image='photo.png' is no array: give read_image"),
        ({"image": ps.bump((20, 24))}, "image is a Scene, no array: give its .image"),
        ({"mask": "mask.png"}, r"give read_mask\(path, shape\) if"),
        ({"known_depth": "depth.npy"}, r"give read_depth\(path, shape\) if"),
        ({"mask": np.ones((4, 4), bool)}, "image's shape"),
        ({"mask": np.ones(IMAGE.shape)}, "bool"),
        ({"mask": np.zeros(IMAGE.shape, bool)}, "nothing to solve"),
        ({"walls": np.ones(IMAGE.shape, bool)}, "nothing to solve"),
        ({"known_depth": depths(0.0)}, "down to 0"),
        ({"known_depth": depths(-2.0)}, "down to -2"),
        ({"known_depth": depths(np.inf)}, "1 infinite"),
        ({"known_depth": depths(np.nan)}, "holds no value"),
        ({"known_depth": np.ones((3, 3))}, "image's shape"),
        ({"known_depth": np.ones(IMAGE.shape, int)}, "float array"),
        ({"known_depth": np.ones(IMAGE.shape)}, "nothing to solve"),
        ({"known_depth": depths(1.0), "mask": np.arange(24) + np.zeros((20, 1)) > 15}, "can reach"),
        ({"known_depth": depths(1.0), "boundary": "fixed"}, "needs a known depth on every edge pixel"),
        ({"surface": "up"}, r"choose .away. or .toward."),
        ({"boundary": "periodic"}, "outflow"),
        ({"scheme": "magic"}, "lax-friedrichs"),
        ({"ordering": "random"}, "checkerboard"),
        ({"precision": "float16"}, "float64"),
        ({"accuracy_order": 2, "scheme": "lax-friedrichs"}, "only the upwind scheme"),
        ({"max_iterations": 0}, "max_iterations=0"),
        ({"max_iterations": 2.5}, "whole number"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"max_slope": 0.0}, "above 0"),
        ({"max_slope": 1e30}, r"at most 1e\+06"),
        ({"light": "lamp"}, "ParallelLight"),
        ({"reflectance": None}, "Lambertian"),
        ({"camera": 590.0}, "no Camera"),
    ],
)
def test_bad_input_is_refused_with_its_reason(keywords: dict[str, Any], message: str) -> None:
    call = {"image": IMAGE, "camera": ps.Camera(30.0), **keywords}
    with pytest.raises(ps.InputError, match=message):
        ps.reconstruct(call.pop("image"), call.pop("camera"), **call)


def test_a_photo_that_is_no_array_says_which_of_its_arrays_to_give(tmp_path: Path) -> None:
    write_grey(tmp_path / "photo.png", IMAGE)
    photo, camera = ps.read_photo(tmp_path / "photo.png"), ps.Camera(30.0)
    prepared = ps.prepare_photo(photo, camera)
    cases: dict[str, Any] = {"a Photo, no array: give its .image": photo, "a PreparedPhoto, .* its .light": prepared}
    for message, given in cases.items():
        with pytest.raises(ps.InputError, match=message):
            ps.reconstruct(given, camera)


@pytest.mark.parametrize(
    ("slip", "told"), [("ligth", "did you mean light"), ("maks", "did you mean mask"), ("focus", "give some of mask, ")]
)
def test_a_keyword_that_there_is_not_is_told_with_the_one_that_is_meant(slip: str, told: str) -> None:
    slips: Any = {slip: None}
    with pytest.raises(TypeError, match=f"no keyword argument '{slip}': {told}"):
        ps.reconstruct(IMAGE, ps.Camera(30.0), **slips)
    with pytest.raises(TypeError, match=f"no keyword argument '{slip}'"):
        ps.batch("photos", **slips)


def with_background(share: float, brightness: float) -> NDArray[np.float64]:
    """A photograph by a flash, 1 at its brightest, dark in a share of its rows."""
    image: NDArray[np.float64] = ps.bump((40, 40), light=ps.FlashLight()).image
    image /= image.max()
    image[: round(40 * share)] = brightness
    return image


def test_a_dark_background_under_a_flash_is_named() -> None:
    camera, light = ps.Camera(40.0), ps.FlashLight()
    image = with_background(0.25, 0.001)
    with pytest.warns(UserWarning, match="25 % of the pixels to solve are darker than 0.5 % of the brightest"):
        ps.reconstruct(image, camera, light=light)
    ps.reconstruct(image, camera, light=light, mask=image > 0.01)  # which would fail at a warning
    ps.reconstruct(with_background(0.025, 0.001), camera, light=light)
    ps.reconstruct(with_background(0.25, 0.01), camera, light=light)
    ps.reconstruct(image, camera)


def test_values_outside_the_mask_may_be_anything() -> None:
    mask = np.ones(IMAGE.shape, bool)
    mask[10, 10] = False
    with pytest.warns(UserWarning, match="the outline of the mask is taken for flat ground"):
        solution = ps.reconstruct(with_values(np.nan), ps.Camera(30.0), mask=mask)
    assert solution.status is ps.Status.CONVERGED
    assert np.isnan(solution.depth[10, 10])


def test_principal_point_far_outside_is_refused() -> None:
    with pytest.raises(ps.CameraError, match="principal"):
        ps.reconstruct(IMAGE, ps.Camera(30.0, (500.0, 10.0)))


def test_a_principal_point_outside_is_solved_with_a_warning_at_the_call() -> None:
    """A part of a photograph has the solution of the whole, with known values around."""
    scene = ps.bump(shape=(24, 24))
    whole = ps.reconstruct(scene.image, scene.camera, known_depth=scene.known_depth, tolerance=1e-7)
    part = np.s_[2:10, 1:9]
    known = np.full((8, 8), np.nan)
    known[[0, -1]], known[:, [0, -1]] = whole.depth[part][[0, -1]], whole.depth[part][:, [0, -1]]
    centre = scene.camera.centre((24, 24))
    camera = ps.Camera(scene.camera.focal_length, (centre[0] - 1, centre[1] - 2))
    with pytest.warns(UserWarning, match="lies outside the image of shape") as caught:
        cut = ps.reconstruct(scene.image[part], camera, known_depth=known, tolerance=1e-7)
    assert caught[0].filename == __file__
    np.testing.assert_allclose(cut.depth, whole.depth[part], atol=1e-5)


def test_each_image_is_prepared_once_however_many_launches_it_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    checked, ready = [], []

    def counted(image: NDArray[np.float64], *rest: Any, **keywords: Any) -> Given:
        checked.append(image.shape)
        return check(image, *rest, **keywords)

    class Counted(Problem):
        @classmethod
        def of(cls, given: Given) -> Problem:
            ready.append(given.image.shape)
            return Problem.of(given)

    monkeypatch.setattr(reconstruct_room, "check", counted)
    monkeypatch.setattr(reconstruct_room, "Problem", Counted)
    monkeypatch.setattr(reconstruct_room, "pieces", lambda shapes, *_: [[place] for place in range(len(shapes))])
    images = [IMAGE, IMAGE[:-1], IMAGE[1:]]
    apart = ps.reconstruct_batch(images, ps.Camera(30.0))
    assert checked == [image.shape for image in images]
    assert sorted(ready) == sorted(checked)
    for image, one in zip(images, apart, strict=True):
        np.testing.assert_array_equal(one.depth, ps.reconstruct(image, ps.Camera(30.0)).depth)


def test_nothing_is_solved_when_the_last_image_is_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("persfs_cl.solver.pieces.attempt", lambda *_: pytest.fail("solved"))
    monkeypatch.setattr("persfs_cl.solver.pieces.solve", lambda *_: pytest.fail("solved"))
    with pytest.raises(ps.InputError, match=r"images\[2\].*all black"):
        ps.reconstruct_batch([IMAGE, IMAGE[:-1], 0.0 * IMAGE], ps.Camera(30.0))


def test_stopping_a_batch_stops_the_images_that_have_not_begun() -> None:
    scenes = [ps.bump(shape=(30, 30)), ps.bump(shape=(20, 33))]
    seen: list[int] = []

    def stop_at_two(iteration: int, _change: float) -> bool:
        seen.append(iteration)
        return iteration == 2

    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        scheme="lax-friedrichs",
        callback=stop_at_two,
    )
    assert seen == [1, 2], "images of another size come in other launches"
    assert [solution.status for solution in together] == [ps.Status.STOPPED] * 2
    assert [solution.iterations for solution in together] == [2, 1]


def labyrinth(size: int) -> np.ndarray[Any, Any]:
    """One long way through an image: walls with a gap at alternating ends."""
    mask = np.ones((size, size), bool)
    mask[1::4, : size - 1] = False
    mask[3::4, 1:] = False
    return mask


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.ParallelLight(0.8, 0.0)], ids=["frontal", "oblique"])
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
def test_what_no_known_value_has_reached_yet_gets_no_depth(ordering: str, light: ps.ParallelLight) -> None:
    size = 41
    image = np.random.default_rng(1).uniform(0.75, 0.95, (size, size))
    known = np.full((size, size), np.nan)
    known[0, 0] = 2.0
    keywords: dict[str, Any] = {
        "light": light,
        "mask": labyrinth(size),
        "known_depth": known,
        "ordering": ordering,
        "max_slope": 2.0,
    }
    camera = ps.Camera(float(size))
    full = ps.reconstruct(image, camera, tolerance=1e-7, **keywords)
    assert full.status is ps.Status.CONVERGED
    assert not full.unreached.any()
    early = ps.reconstruct(image, camera, max_iterations=1, **keywords)
    assert early.unreached.any()
    np.testing.assert_array_equal(early.solved | early.unreached, full.solved)
    assert not (early.solved & early.unreached).any()
    assert (early.log_depth[early.solved] < np.log(2.0) + 2.0 / size * size**2).all()
    assert (np.exp(np.nanmax(early.log_depth)) <= np.exp(np.log(2.0) + 2.0 / size * size * size / 2)).all()


def test_errors_in_a_batch_name_the_image() -> None:
    bad = [IMAGE, IMAGE * 0.0]
    with pytest.raises(ps.InputError, match=r"images\[1\]: image is all black"):
        ps.reconstruct_batch(bad, ps.Camera(30.0))
    with pytest.raises(ps.CameraError, match=r"images\[1\]: .*principal"):
        ps.reconstruct_batch([IMAGE, IMAGE], [ps.Camera(30.0), ps.Camera(30.0, (900.0, 0.0))])
    assert ps.reconstruct_batch([], ps.Camera(30.0)) == []
    images = (image for image in (IMAGE, IMAGE))
    assert len(ps.reconstruct_batch(images, ps.Camera(30.0))) == 2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ps.reconstruct([[1.0], [1.0, 2.0]], ps.Camera(9.0)), "no array"),
        (lambda: ps.reconstruct(IMAGE, ps.Camera(30.0), callback=cast("Any", 5)), "callback=5"),
        (lambda: ps.reconstruct_batch([IMAGE], cast("Any", None)), "cameras=None"),
        (lambda: ps.ParallelLight(1e200), "light slope"),
        (lambda: ps.reconstruct(IMAGE[:1], ps.Camera(30.0)), "give known_depth"),
    ],
)
def test_nonsense_is_an_input_error(call: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        call()


def test_a_known_depth_that_nothing_sees_costs_no_precision() -> None:
    scene = ps.bump(shape=(30, 30))
    mask = np.zeros((30, 40), bool)
    mask[:, :30] = True
    image, known = np.ones((30, 40)), np.full((30, 40), np.nan)
    image[:, :30], known[:, :30] = scene.image, scene.known_depth
    camera = ps.Camera(30.0, (14.5, 14.5))
    one = ps.reconstruct(image, camera, mask=mask, known_depth=known)
    known[15, 38] = 1e-30
    other = ps.reconstruct(image, camera, mask=mask, known_depth=known)
    np.testing.assert_array_equal(one.depth[:, :30], other.depth[:, :30])
    assert other.depth[15, 38] == 1e-30


def ball(size: int, light: ps.ParallelLight = ps.ParallelLight()) -> tuple[np.ndarray[Any, Any], Any]:
    """A ball from far away, and its mask."""
    rows, columns = np.indices((size, size)) * (2.1 / (size - 1)) - 1.05
    mask = rows**2 + columns**2 < 1.0
    height = np.sqrt(np.maximum(1.0 - rows**2 - columns**2, 0.0))
    return np.clip(np.where(mask, height - light.p0 * columns - light.q0 * rows, 0.0) / light.norm, 0.0, 1.0), mask


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.ParallelLight(0.5, 0.3), ps.ParallelLight(-1.0)])
def test_the_outline_of_a_round_object_is_no_flat_ground(light: ps.ParallelLight) -> None:
    image, mask = ball(40, light)
    camera = ps.Camera(400.0)
    keywords: dict[str, Any] = {"light": light, "max_iterations": 2}
    with pytest.warns(UserWarning, match="flat sheet, or than the outline inflated.*: give known_depth") as caught:
        ps.reconstruct(image, camera, mask=mask, **keywords)
    assert [warning.filename for warning in caught] == [__file__]
    # Neither where depth is known, nor where all that is dark lies on the frame of the image.
    known = np.where(mask & ~disc(40, 0.2), 2.0, np.nan)
    ps.reconstruct(image, camera, mask=mask, known_depth=known, **keywords)
    ps.reconstruct(image[5:35, 5:35], camera, **keywords)


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.ParallelLight(0.5, 0.3)])
def test_a_relief_on_flat_ground_has_a_flat_outline(light: ps.ParallelLight) -> None:
    scene = ps.bump(shape=(40, 40), light=light)
    wide = np.full((70, 70), 1.0 / light.norm)
    wide[15:55, 15:55] = scene.image
    for material in (ps.Lambertian(), ps.OrenNayar(0.3), ps.Phong()):
        frontal = float(material.shade(1 / light.norm, 1.0, 1 / light.norm)) * light.norm
        image = np.minimum(wide * frontal, 0.99)
        ps.reconstruct(image, ps.Camera(100.0), mask=disc(70, 0.2), light=light, reflectance=material, max_iterations=1)


@pytest.mark.parametrize("value", [1e308, 5e-324, 1.1e30, 0.9e-30, np.longdouble("1e300")])
def test_depths_that_no_unit_needs_are_refused_with_their_value(value: Any) -> None:
    known = np.full(IMAGE.shape, np.nan, np.result_type(value))
    known[3, 4] = value
    words = f"known_depth holds {float(value):g}: give depths from 1e-30 to 1e+30"
    with pytest.raises(ps.InputError, match=re.escape(words)):
        ps.reconstruct(IMAGE, ps.Camera(30.0), known_depth=known)
    known[3, 5] = 2e9
    known[3, 4] = 1.0
    with pytest.raises(ps.InputError, match=r"from 1 to 2e\+09 next to .* at most 1e\+09 times the nearest"):
        ps.reconstruct(IMAGE, ps.Camera(30.0), known_depth=known)


@pytest.mark.parametrize("unit", [1e-26, 1e-9, 1e26])
def test_the_unit_of_depth_does_not_matter(unit: float) -> None:
    known = np.full(IMAGE.shape, np.nan)
    known[10, 12] = 1.0
    one, other = (ps.reconstruct(IMAGE, ps.Camera(30.0), known_depth=scale * known) for scale in (1.0, unit))
    np.testing.assert_allclose(other.depth, unit * one.depth, rtol=1e-5)
    flash = ps.FlashLight(gain=unit**2)
    near, far = (ps.reconstruct(IMAGE, ps.Camera(30.0), light=light) for light in (ps.FlashLight(), flash))
    np.testing.assert_allclose(far.depth, unit * near.depth, rtol=1e-5)
    np.testing.assert_allclose(far.render(), near.render(), rtol=1e-5)


@pytest.mark.parametrize("scale", [1e-95, 1e95])
@pytest.mark.parametrize("falloff", [True, False])
def test_the_scale_of_the_brightness_does_not_matter(scale: float, falloff: bool) -> None:
    known = None if falloff else np.where(np.arange(24) == 3, 1.0, np.full(IMAGE.shape, np.nan))
    one, other = (
        ps.reconstruct(
            IMAGE * gain, ps.Camera(30.0), known_depth=known, light=ps.FlashLight(falloff=falloff, gain=gain)
        )
        for gain in (1.0, scale)
    )
    np.testing.assert_allclose(other.depth, one.depth, rtol=1e-5)
    np.testing.assert_allclose(other.render(), scale * one.render(), rtol=1e-5)


@pytest.mark.parametrize(
    ("light", "image", "message"),
    [
        (ps.FlashLight(gain=1e300), IMAGE, r"gain=1e\+300.* at a depth of 1e\+150"),
        (ps.FlashLight(gain=1e-300), IMAGE, r"gain=1e-300.* at a depth of 1e-150"),
        (ps.FlashLight(), IMAGE * 1e-200, "image goes up to .*e-201"),
        (ps.FlashLight(), IMAGE * 1e200, r"image goes up to .*e\+199"),
        (ps.FlashLight(offset=(-6e8, 0.0, 1e8)), IMAGE, r"is 6.*e\+08 away from the camera, but .* at most 1\.0"),
    ],
)
def test_a_flash_beyond_the_precision_is_refused_with_its_numbers(
    light: ps.FlashLight, image: np.ndarray[Any, Any], message: str
) -> None:
    with pytest.raises(ps.InputError, match=message):
        ps.reconstruct(image, ps.Camera(30.0), light=light)


def test_what_runs_away_has_no_depth_and_is_told_of() -> None:
    image = np.where(np.arange(24) > 12, 1e-30, IMAGE)
    known, walls = np.full(IMAGE.shape, np.nan), np.zeros(IMAGE.shape, bool)
    known[10, 2] = 1.0
    walls[:, 20] = True
    with pytest.warns(UserWarning, match=r"pixels come out nearer than 1e-30 or farther than 1e\+30.*max_slope=500"):
        solution = ps.reconstruct(image, ps.Camera(30.0), walls=walls, known_depth=known, max_slope=500.0)
    assert 0 < np.count_nonzero(solution.unreached) < solution.depth.size
    for values in (solution.depth, solution.log_depth, solution.render(), solution.normals()[..., 0]):
        np.testing.assert_array_equal(np.isfinite(values), solution.solved)
    assert not (solution.solved & solution.unreached).any()


def test_anything_for_any_argument_gives_a_result_or_an_error_of_ours() -> None:
    """And no warning of NumPy's, at which tests fail."""
    random = np.random.default_rng(7)
    image = IMAGE[:5, :6]
    odd: list[Any] = [
        *(None, "", "wall", b"x", 10**400, -1, 0, -0.0, 1.5, np.nan, np.inf, True, 1j, np.complex128(1), np.float16(1)),
        *([], [[]], {}, [1, [2, 3]], ["a"], [None], object(), np.array(1.0), np.array([]), np.zeros((0, 3)), [image]),
        *(image > 0.5, image.T, image[0], image[..., None], image.astype(complex), image.astype(object), -image),
        *(image * 1e300, image * 1e-300, image.astype(np.longdouble) * np.longdouble("1e4000"), image.tolist()),
        *(np.full((5, 6), np.nan), np.ma.masked_array(image, image > 0.8), np.broadcast_to(0.5, (10**5, 10**6))),
        *((255 * image).astype(np.uint8), ps.Camera(20.0), ps.FlashLight(), ps.Phong(), iter([1, 2]), "\u00b2"),
    ]
    names = [name for name in inspect.signature(ps.reconstruct).parameters if name not in ("device", "precision")]
    results = 0
    for _ in range(300):
        keywords: dict[str, Any] = {"image": image, "camera": ps.Camera(30.0), "max_iterations": 2}
        for name in random.choice(names, random.integers(1, 3), replace=False):
            keywords[str(name)] = odd[random.integers(len(odd))]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # ours, as of dark pixels
            try:
                solution = ps.reconstruct(**keywords)
            except ps.PersfsError as error:
                assert len(str(error)) < 700  # noqa: PT017  # some are solved
                continue
        results += 1
        np.testing.assert_array_equal(np.isfinite(solution.depth), solution.solved)
    assert 0 < results < 300
