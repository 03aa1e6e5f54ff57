"""The least energy with a guide: what the public keyword makes a prior of."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.bench.terrain import normals_of
from persfs_cl.guide.cells import Cells
from persfs_cl.shading.model import Light

SIZE, BLOCK = 96, 8


def guide_for(scene: ps.Scene, noise: float = 0.02) -> Array:
    blocks = scene.depth.reshape(SIZE // BLOCK, BLOCK, SIZE // BLOCK, BLOCK).mean(axis=(1, 3))
    return np.asarray(blocks + np.random.default_rng(1).normal(0.0, noise * np.ptp(blocks), blocks.shape))


def errors(depth: Array, scene: ps.Scene) -> tuple[float, float]:
    """Mean error as a share of the relief, and median angle of normals."""
    cosines = (normals_of(depth, scene.camera) * normals_of(scene.depth, scene.camera)).sum(axis=-1)
    angle = float(np.degrees(np.median(np.arccos(np.clip(cosines, -1.0, 1.0)))))
    return ps.compare(depth, scene.depth).mean / float(np.ptp(scene.depth)), angle


def interpolated(guide: Array) -> Array:
    cells = Cells.of_map(np.log(guide), np.ones((SIZE, SIZE), bool))
    return np.asarray(np.exp(cells.interpolated(cells.values)))


@pytest.mark.parametrize("light", [ps.ParallelLight(0.5, 0.2), ps.FlashLight()])
def test_a_guide_is_its_prior(light: Light) -> None:
    scene = ps.bump((SIZE, SIZE), light=light, bits=8, noise=0.01)
    guide = guide_for(scene)
    found = ps.reconstruct(scene.image, scene.camera, light=light, guide=guide, scheme="regularised", max_iterations=80)
    (depth, angle), (of_guide, angle_of_guide) = errors(found.depth, scene), errors(interpolated(guide), scene)
    assert depth < 0.7 * of_guide
    assert angle < 0.5 * angle_of_guide
    assert found.guide is not None
    assert (found.guide.cells, found.guide.spacing) == (guide.size, BLOCK)
    assert found.iterations == found.changes.size <= 80
    assert not np.isnan(found.guide.departure).any()


def test_it_tells_the_gain_too() -> None:
    scene = ps.bump((SIZE, SIZE), light=ps.FlashLight(gain=2.0))
    given: dict[str, Any] = {"guide": guide_for(scene, 0.01), "scheme": "regularised", "max_iterations": 40}
    found = ps.reconstruct(scene.image, scene.camera, light=ps.FlashLight(gain=None), **given)
    assert found.guide is not None
    assert found.guide.gain == pytest.approx(2.0, rel=0.03)


def test_noise_is_told_from_relief() -> None:
    """Far away, where the relief is a small share of the depth, and in any unit."""
    light = ps.ParallelLight(0.5, 0.2)
    scene = ps.bump((SIZE, SIZE), light=light, bits=8)
    guide = guide_for(scene, 0.03)
    noises = []
    for unit in (1.0, 1e3):
        found = ps.reconstruct(
            scene.image, scene.camera, light=light, guide=unit * guide, scheme="regularised", max_iterations=80
        )
        assert found.guide is not None
        noises.append(found.guide.noise)
    true = 0.03 * float(np.ptp(scene.depth) / np.median(scene.depth))
    assert 0.5 * true < noises[0] < 1.3 * true
    assert noises[1] == pytest.approx(noises[0], rel=0.02)


SCENES = {"bump": ps.bump, "bumps": ps.bumps, "hill": ps.hillside}


@pytest.mark.parametrize("name", SCENES)
def test_exact_points_do_no_harm_and_many_help_much(name: str) -> None:
    """Interpolated, they would pull all that lies between them away from where the photograph rightly has it."""
    flash = ps.FlashLight()
    scene = SCENES[name]((SIZE, SIZE), light=flash, noise=0.01)
    options: dict[str, Any] = {"light": flash, "scheme": "regularised"}
    alone, _ = errors(ps.reconstruct(scene.image, scene.camera, **options).depth, scene)
    for count, most in ((20, 1.05), (100, 0.9), (1000, 0.6)):
        rows, columns = np.divmod(np.random.default_rng(count).choice(SIZE**2, count, replace=False), SIZE)
        depths = scene.depth[rows, columns]
        known = np.full(scene.depth.shape, np.nan)
        known[rows, columns] = depths
        for given in ({"guide": ps.Points(columns, rows, depths)}, {"known_depth": known}):
            found = ps.reconstruct(scene.image, scene.camera, **options, **given)
            assert errors(found.depth, scene)[0] <= most * alone, (count, *given)


@pytest.mark.parametrize("name", SCENES)
def test_a_noisy_grid_does_little_harm_to_a_smooth_surface(name: str) -> None:
    """Under a light that tells the depth: each of its values is one measurement."""
    flash = ps.FlashLight()
    scene = SCENES[name]((SIZE, SIZE), light=flash, bits=8, noise=0.01)
    guide = guide_for(scene)
    options: dict[str, Any] = {"light": flash, "scheme": "regularised"}
    alone, _ = errors(ps.reconstruct(scene.image, scene.camera, **options).depth, scene)
    found, _ = errors(ps.reconstruct(scene.image, scene.camera, guide=guide, **options).depth, scene)
    swept, _ = errors(ps.reconstruct(scene.image, scene.camera, light=flash).depth, scene)
    assert found < 1.3 * alone
    assert found < 0.7 * min(swept, errors(interpolated(guide), scene)[0])


@pytest.mark.filterwarnings("ignore:guide has most depths")
def test_a_grid_holds_a_painted_surface_that_is_taken_for_plain() -> None:
    flash = ps.FlashLight()
    scene = ps.hillside((SIZE, SIZE), light=flash, bits=8)
    checker = np.where(np.indices((SIZE, SIZE)).sum(axis=0) // 12 % 2, 0.9, 0.5)
    found = ps.reconstruct(
        scene.image * checker, scene.camera, light=flash, guide=guide_for(scene), scheme="regularised"
    )
    alone = ps.reconstruct(scene.image * checker, scene.camera, light=flash, scheme="regularised")
    assert errors(found.depth, scene)[0] < 0.7 * errors(alone.depth, scene)[0]


def test_noisy_points_are_smoothed() -> None:
    flash = ps.FlashLight()
    scene = ps.hillside((SIZE, SIZE), light=flash, noise=0.01)
    rng = np.random.default_rng(0)
    rows, columns = np.divmod(rng.choice(SIZE**2, 300, replace=False), SIZE)
    depths = scene.depth[rows, columns] + rng.normal(0.0, 0.02 * np.ptp(scene.depth), rows.size)
    options: dict[str, Any] = {"light": flash, "scheme": "regularised"}
    alone = ps.reconstruct(scene.image, scene.camera, **options)
    found = ps.reconstruct(scene.image, scene.camera, guide=ps.Points(columns, rows, depths), **options)
    (depth, angle), (depth_alone, angle_alone) = errors(found.depth, scene), errors(alone.depth, scene)
    assert depth < 1.3 * depth_alone
    assert angle < 1.5 * angle_alone
    assert found.guide is not None
    assert 0.5 < found.guide.noise / (0.02 * np.ptp(scene.depth) / np.median(scene.depth)) < 1.5


def test_a_callback_sees_all_iterations_and_may_end_them() -> None:
    light = ps.ParallelLight(0.5, 0.2)
    scene = ps.bump((SIZE, SIZE), light=light)
    given: dict[str, Any] = {"light": light, "guide": guide_for(scene), "scheme": "regularised", "max_iterations": 60}
    seen: list[int] = []
    found = ps.reconstruct(scene.image, scene.camera, callback=lambda number, _: seen.append(number), **given)
    assert seen == list(range(1, found.iterations + 1))
    for last in (1, 45):

        def ends(number: int, _: float, last: int = last) -> bool:
            return number >= last

        ended = ps.reconstruct(scene.image, scene.camera, callback=ends, **given)
        assert (ended.status, ended.iterations) == (ps.Status.STOPPED, last)
        assert not np.isnan(ended.depth).any()
