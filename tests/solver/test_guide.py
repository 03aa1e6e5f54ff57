"""Surfaces that a guide helps to find: what it mends, what it tells of the light, and what cannot be one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.errors import PersfsWarning
from persfs_cl.guide.cells import Cells
from persfs_cl.scenes.meshes import mesh_scene
from persfs_cl.scenes.scene import Scene
from persfs_cl.surface.geometry import normals

BLOCK = 6
SIZE = (120, 120)


def blocks(depth: Array, block: int = BLOCK) -> Array:
    """Median depth of each block, NaN where there is none."""
    height, width = (length // block for length in depth.shape)
    parts = depth[: height * block, : width * block].reshape(height, block, width, block).transpose(0, 2, 1, 3)
    with np.errstate(invalid="ignore"):
        known = ~np.isnan(parts).all(axis=(2, 3))
    found = np.full((height, width), np.nan)
    found[known] = np.nanmedian(parts[known], axis=(1, 2))
    return found


def noisy(guide: Array, share: float = 0.02, seed: int = 3) -> Array:
    """With noise of a share of the relief."""
    return guide + np.random.default_rng(seed).normal(
        0.0, share * np.nanmax(guide) - share * np.nanmin(guide), guide.shape
    )


def two_balls(light: ps.FlashLight) -> Scene:
    """One ball half hides another one: behind the jump the photograph alone cannot tell how far away that is."""
    near, far = (trimesh.creation.icosphere(4, radius) for radius in (0.5, 0.8))
    near.apply_translation((-0.3, 0.0, 1.2))
    far.apply_translation((0.5, 0.0, -0.6))
    mesh = trimesh.util.concatenate([near, far])
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh_scene(mesh, SIZE, focal_length=130.0, light=light, bits=8)


BALLS = two_balls(ps.FlashLight())
GUIDE = noisy(blocks(BALLS.depth))


def solved(scene: Scene, **keywords: Any) -> ps.Solution:
    given: dict[str, Any] = {"light": scene.light, "mask": scene.mask, **keywords}
    return ps.reconstruct(scene.image, scene.camera, **given)


def error(solution: ps.Solution, scene: Scene) -> float:
    """Mean error of the depth, as a share of the relief."""
    found = ps.compare(solution.depth, scene.depth, mask=scene.mask)
    return float(found.mean / np.ptp(scene.depth[scene.mask]))


def of_guide(guide: Array, scene: Scene) -> float:
    """The same of a guide alone, interpolated."""
    cells = Cells.of_map(np.log(guide), scene.mask)
    found = ps.compare(np.exp(cells.interpolated(cells.values)), scene.depth, mask=scene.mask)
    return float(found.mean / np.ptp(scene.depth[scene.mask]))


def test_a_guide_mends_what_lies_behind_a_jump() -> None:
    alone, guided = solved(BALLS), solved(BALLS, guide=GUIDE)
    assert error(guided, BALLS) < 0.25 * error(alone, BALLS)
    assert error(guided, BALLS) < 0.85 * of_guide(GUIDE, BALLS)
    assert guided.status is ps.Status.CONVERGED
    assert guided.iterations == guided.changes.size > alone.iterations
    assert guided.at_bound.any()
    assert guided.at_bound.mean() < 0.5
    fit = guided.guide
    assert fit is not None
    assert alone.guide is None
    assert fit.used <= fit.cells == np.count_nonzero(~np.isnan(GUIDE))
    assert fit.spacing == BLOCK
    assert (fit.factor, fit.offset, fit.gain, fit.drifts) == (1.0, 0.0, None, False)
    np.testing.assert_array_equal(np.isnan(fit.departure), ~guided.solved)


@pytest.mark.parametrize("count", [60, 5, 1])
def test_points_are_a_guide(count: int) -> None:
    random = np.random.default_rng(2)
    places = np.argwhere(BALLS.mask)[random.permutation(np.count_nonzero(BALLS.mask))[:count]]
    depths = BALLS.depth[tuple(places.T)] * random.normal(1.0, 0.003, count)
    points = ps.Points(places[:, 1] + random.uniform(-0.4, 0.4, count), places[:, 0], depths)
    alone, guided = solved(BALLS), solved(BALLS, guide=points)
    assert guided.guide is not None
    assert guided.guide.cells == count
    assert error(guided, BALLS) < (0.7 if count == 60 else 1.05) * error(alone, BALLS)


@pytest.mark.parametrize(
    ("given", "keywords"),
    [
        (1.0 / GUIDE, {"guide_kind": "inverse"}),
        (1000.0 * GUIDE, {"guide_scale": "fit"}),
        (17.0 / GUIDE, {"guide_kind": "inverse", "guide_scale": "fit"}),
        (np.kron(GUIDE, np.ones((12, 12))), {}),
    ],
)
def test_whatever_its_numbers_are(given: Array, keywords: dict[str, Any]) -> None:
    found, plain = solved(BALLS, guide=given, **keywords), solved(BALLS, guide=GUIDE)
    assert error(found, BALLS) < 1.5 * error(plain, BALLS)
    fit = found.guide
    assert fit is not None
    known = given * fit.factor + fit.offset
    depths = 1.0 / known if keywords.get("guide_kind") == "inverse" else known
    expected = np.kron(GUIDE, np.ones((12, 12))) if given.shape != GUIDE.shape else GUIDE
    np.testing.assert_allclose(depths, expected, rtol=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("make", [ps.bump, ps.bumps, ps.hillside])
def test_noisy_guides_are_no_worse_than_the_better_of_both(make: Callable[..., ps.Scene], noise: float) -> None:
    flash, size, cell, count = ps.FlashLight(), 90, 9, 100
    scene = make((size, size), light=flash, bits=8, noise=noise)
    relief, random = np.ptp(scene.depth), np.random.default_rng(0)
    blocks = scene.depth.reshape(size // cell, cell, size // cell, cell).mean(axis=(1, 3))
    guide = blocks + random.normal(0.0, 0.02 * relief, blocks.shape)
    rows, columns = np.divmod(random.choice(size * size, count, replace=False), size)
    points = ps.Points(columns, rows, scene.depth[rows, columns] + random.normal(0.0, 0.01 * relief, count))
    everywhere = np.ones((size, size), bool)
    cells = Cells.of_map(np.log(guide), everywhere)
    lone = Cells.of_points(points.columns, points.rows, np.log(points.depths), everywhere)
    by_themselves = [np.exp(each.interpolated(each.values)) for each in (cells, lone)]
    solutions = ps.reconstruct_batch([scene.image] * 3, scene.camera, light=flash, guide=[None, guide, points])
    alone, *guided = (ps.compare(solution.depth, scene.depth).mean for solution in solutions)
    for by_itself, found in zip(by_themselves, guided, strict=True):
        assert found <= 1.05 * min(ps.compare(by_itself, scene.depth).mean, alone)


def test_the_tolerance_is_narrow_only_where_guide_and_photograph_differ() -> None:
    scene = ps.bump(SIZE, light=ps.FlashLight(), bits=8)
    alike, differing = solved(scene, guide=noisy(blocks(scene.depth))).guide, solved(BALLS, guide=GUIDE).guide
    assert alike is not None
    assert differing is not None
    assert alike.tolerance > 0.8 * alike.noise
    assert differing.tolerance == pytest.approx(0.25 * differing.noise)


@pytest.mark.parametrize("kind", ["depth", "inverse"])
def test_numbers_that_lack_scale_and_zero_are_fitted(kind: str) -> None:
    scene = ps.bumps(SIZE, light=ps.FlashLight(), bits=8)
    guide = noisy(blocks(scene.depth), 0.01)
    given = 3.0 - 0.2 * guide if kind == "depth" else 5.0 / guide - 1.0
    found = solved(scene, guide=given, guide_scale="affine", guide_kind=kind)
    fit = found.guide
    assert fit is not None
    numbers = fit.factor * given + fit.offset
    np.testing.assert_allclose(numbers if kind == "depth" else 1.0 / numbers, guide, rtol=0.02)
    assert error(found, scene) < 1.05 * error(solved(scene), scene)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), pytest.param((0.1, 0.02, 0.0), marks=pytest.mark.thorough)])
def test_a_guide_tells_the_gain(offset: tuple[float, float, float]) -> None:
    scene = two_balls(ps.FlashLight(gain=3.0, offset=offset))
    guided = solved(scene, light=ps.FlashLight(gain=None, offset=offset), guide=GUIDE)
    assert guided.guide is not None
    assert isinstance(guided.light, ps.FlashLight)
    assert guided.guide.gain == guided.light.gain == pytest.approx(3.0, rel=0.03)
    assert error(guided, scene) < 1.05 * of_guide(GUIDE, scene)
    assert error(guided, scene) < 0.35 * error(solved(scene), scene)
    assert guided.report()["guide"]["gain"] == guided.guide.gain


def test_outliers_are_left_out() -> None:
    wrong = GUIDE.copy()
    known = np.argwhere(~np.isnan(wrong))
    for row, column in known[:: len(known) // 8]:
        wrong[row, column] *= 1.3
    found = solved(BALLS, guide=wrong)
    assert found.guide is not None
    assert found.guide.used < found.guide.cells
    assert error(found, BALLS) < 0.7 * of_guide(wrong, BALLS)


def test_a_contradiction_is_told() -> None:
    with pytest.warns(PersfsWarning, match=r"1\.\d+ times as large as light=.*guide_scale='fit'.*gain=None"):
        found = solved(BALLS, guide=1.3 * GUIDE)
    # It is believed nevertheless.
    assert np.nanmedian(found.depth / BALLS.depth) > 1.1


def test_another_view_is_told() -> None:
    with pytest.warns(PersfsWarning, match="guide has 20 x 15 cells for an image of 120 x 120.*uncropped"):
        solved(BALLS, guide=GUIDE[2:17])


# Each two of the light, the side and the scheme meet.
@pytest.mark.quick_where(
    holds=lambda given: (
        isinstance(given["light"], ps.FlashLight) ^ (given["surface"] == "away") ^ (given["scheme"] == "upwind")
    )
)
@pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
@pytest.mark.parametrize("surface", ["away", "toward"])
@pytest.mark.parametrize("light", [ps.ParallelLight(0.3, -0.1), ps.FlashLight(falloff=False)])
def test_under_other_lights_it_tells_the_level(light: Any, surface: str, scheme: str) -> None:
    scene = ps.bump(SIZE, light=light)
    guide = noisy(blocks(scene.depth), 0.02)
    found = solved(scene, guide=guide, surface=surface, scheme=scheme)
    whole = np.ones(SIZE, bool)
    assert error(found, scene) < 0.95 * of_guide(guide, scene)
    truth = normals(scene.depth, scene.camera)
    coarse = Cells.of_map(np.log(guide), whole)
    angle, of_coarse = (
        float(np.median(np.degrees(np.arccos(np.clip((normals(depth, scene.camera) * truth).sum(-1), -1, 1)))))
        for depth in (found.depth, np.exp(coarse.interpolated(coarse.values)))
    )
    assert angle < 0.65 * of_coarse


def test_known_depths_and_ranges_are_kept() -> None:
    known = np.full(SIZE, np.nan)
    known[50:54, 40:44] = BALLS.depth[50:54, 40:44] * 1.01
    near = np.where(BALLS.mask, 0.97 * BALLS.depth, np.nan)
    found = solved(BALLS, guide=GUIDE, known_depth=known, depth_range=(near, 1.03 * BALLS.depth))
    np.testing.assert_array_equal(found.depth[50:54, 40:44], known[50:54, 40:44])
    assert not ((found.depth < near) | (found.depth > 1.03 * BALLS.depth)).any()


def test_a_batch_has_the_same_numbers() -> None:
    scenes = [BALLS, ps.bump((40, 50), light=ps.FlashLight()), BALLS]
    guides = [GUIDE, blocks(scenes[1].depth, 5), None]
    given: dict[str, Any] = {"light": ps.FlashLight()}
    together = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        [scene.camera for scene in scenes],
        mask=[scene.mask for scene in scenes],
        guide=guides,
        **given,
    )
    for scene, guide, found in zip(scenes, guides, together, strict=True):
        alone = solved(scene, guide=guide)
        np.testing.assert_array_equal(found.depth, alone.depth)
        np.testing.assert_array_equal(found.at_bound, alone.at_bound)
        assert (found.guide is None) == (guide is None)


# The smoothing in double precision has tests of its own.
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")
def test_wavefront_and_lexicographic_have_the_same_bits(device: ps.Device, precision: str) -> None:
    found = [
        solved(BALLS, guide=GUIDE, device=device, precision=precision, ordering=ordering)
        for ordering in ("wavefront", "lexicographic")
    ]
    np.testing.assert_array_equal(found[0].depth, found[1].depth)


def test_a_callback_sees_all_rounds_and_may_end_them() -> None:
    seen: list[int] = []
    solution = solved(BALLS, guide=GUIDE, callback=lambda iteration, _: seen.append(iteration))
    assert seen == list(range(1, solution.iterations + 1))
    alone = solved(BALLS).iterations
    ended = solved(BALLS, guide=GUIDE, callback=lambda iteration, _: iteration >= alone)
    assert ended.status is ps.Status.STOPPED
    early = solved(BALLS, guide=GUIDE, callback=lambda *_: True)
    assert (early.status, early.guide, early.iterations) == (ps.Status.STOPPED, None, 1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("depth.npy", "guide='depth.npy' is no array"),
        (np.zeros((3, 3, 3)), r"guide.*shape \(3, 3, 3\): give numbers of shape"),
        (np.array([["a"]]), "guide.*give numbers"),
        (np.full((4, 4), np.inf), "guide.*infinite.*NaN"),
        (np.full((4, 4), -1.0), "guide.*holds -1.*depths.*guide_scale='affine'"),
        (np.full((4, 4), np.nan), "guide.*says nothing of the"),
        (ps.Points([500.0], [2.0], [1.0]), "guide.*says nothing of the"),
    ],
)
def test_what_is_no_guide_is_refused(given: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message) as caught:
        solved(BALLS, guide=given)
    assert caught.value.argument == "guide"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([1.0], [2.0], [3.0, 4.0]), "1 columns, 1 rows and 2 depths"),
        (([[1.0]], [2.0], [3.0]), r"columns.*shape \(1, 1\)"),
        (([], [], []), "columns.*one point at least"),
        (([math.nan], [2.0], [3.0]), "columns.*no place"),
        (([1.0], ["a"], [3.0]), "rows"),
    ],
)
def test_points_that_are_none(arguments: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        ps.Points(*arguments)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"light": ps.FlashLight(gain=None)}, "light=.*unknown gain.*guide of fixed scale"),
        ({"light": ps.FlashLight(gain=None), "guide": GUIDE, "guide_scale": "fit"}, "only one of the two"),
        ({"light": ps.ParallelLight(), "guide": GUIDE, "guide_scale": "affine"}, "guide_scale='affine'.*known_depth"),
        ({"guide_scale": "fit"}, "guide_scale='fit' is without guide"),
        ({"guide_kind": "inverse"}, "guide_kind='inverse' is without guide"),
        ({"guide_tolerance": 0.01}, "guide_tolerance=0.01 is without guide"),
        ({"guide": GUIDE, "guide_kind": "disparity"}, "guide_kind='disparity'"),
        ({"guide": GUIDE, "guide_scale": "unknown"}, "guide_scale='unknown'"),
        ({"guide": GUIDE, "guide_tolerance": 0.0}, "guide_tolerance=0.0"),
        ({"guide": GUIDE, "guide_tolerance": 2}, "guide_tolerance=2 "),
        ({"guide": np.full((4, 4), 2.0), "guide_scale": "affine"}, "1 different values"),
    ],
)
def test_what_does_not_go_together_is_refused(keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        solved(BALLS, **keywords)


@pytest.mark.parametrize("scheme", ["auto", "regularised"])
def test_what_is_found_of_a_guide_while_solving_names_the_image(scheme: str) -> None:
    alike = np.full((4, 4), 2.0)
    with pytest.raises(ps.InputError, match=r"^images\[1\]: guide has 1 different values"):
        ps.reconstruct_batch(
            [BALLS.image] * 2,
            BALLS.camera,
            mask=[BALLS.mask] * 2,
            guide=[GUIDE, alike],
            light=BALLS.light,
            guide_scale="affine",
            scheme=scheme,
        )


def test_iterations_go_on_over_rounds_of_a_lamp_and_of_guides() -> None:
    lamp = ps.FlashLight(offset=(0.1, 0.0, 0.0))
    scenes = [ps.bump((40, 40), light=lamp, surface="toward", relief=relief) for relief in (0.05, 0.4)]
    guides = [None, scenes[1].depth[4::8, 4::8]]
    seen: list[int] = []
    found = ps.reconstruct_batch(
        [scene.image for scene in scenes],
        scenes[0].camera,
        light=lamp,
        guide=guides,
        scheme="lax-friedrichs",
        callback=lambda iteration, _: seen.append(iteration),
    )
    assert seen == list(range(1, len(seen) + 1))
    assert len(seen) >= max(each.iterations for each in found)
    assert (found[1].parameters["lamp_rounds"] or 0) > 4


def test_without_a_gain_nothing_is_rendered() -> None:
    with pytest.raises(ps.InputError, match="unknown gain"):
        ps.render(BALLS.depth, BALLS.camera, light=ps.FlashLight(gain=None), mask=BALLS.mask)


def test_a_guide_is_not_taken_for_distorted_where_the_photograph_alone_errs_in_large_parts() -> None:
    """A wall that faces the light nowhere, behind a bump: nothing but the guide tells how far away it is."""
    height, width, light = 72, 108, ps.FlashLight()
    camera, (y, x) = ps.Camera(width), np.mgrid[:height, :width]
    bump = 1.0 + 0.3 * ((x - 27) ** 2 + (y - 36) ** 2) / width**2
    depth = np.where(x < 45, bump, 1.3 + 2.0 * (width - x) / width)
    image = ps.render(depth, camera, light=light)
    blocks = np.median(depth.reshape(8, 9, 12, 9).swapaxes(1, 2).reshape(8, 12, 81), axis=2)
    guide = blocks + 0.02 * np.ptp(depth) * np.random.default_rng(0).normal(size=blocks.shape)
    alone = ps.reconstruct(image, camera, light=light)
    for known in (light, ps.FlashLight(gain=None)):
        found = ps.reconstruct(image, camera, light=known, guide=guide)
        assert found.guide is not None
        assert (found.guide.distortion, found.guide.drifts) == (0.0, False)
        assert ps.compare(found.depth, depth).mean < 0.2 * ps.compare(alone.depth, depth).mean
