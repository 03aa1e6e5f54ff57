"""Paint and surface found by turns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.terrain import normals_of, prior_of_blocks
from persfs_cl.errors import PersfsWarning
from persfs_cl.solver.energy.albedo import fit_albedo, piecewise_smooth
from persfs_cl.solver.energy.minimise import Stopping
from persfs_cl.solver.energy.regularised import Sought, regularised

Array = NDArray[np.float64]

SIZE = 120


def paint_of(kind: str) -> Array:
    y, x = np.mgrid[:SIZE, :SIZE]
    if kind == "checker":
        return np.where((x // 15 + y // 15) % 2, 0.9, 0.3)
    return np.asarray(0.3 + 0.6 * x / (SIZE - 1.0))


def angle(depth: Array, scene: ps.Scene) -> float:
    cosines = (normals_of(depth, scene.camera) * normals_of(scene.depth, scene.camera)).sum(axis=-1)
    return float(np.degrees(np.median(np.arccos(np.clip(cosines, -1.0, 1.0)))))


@pytest.mark.quick_where(holds=lambda given: given["kind"] == "checker" and given["make"] is ps.bump)
@pytest.mark.parametrize("kind", ["checker", "gradient"])
@pytest.mark.parametrize("make", [ps.bump, ps.hillside])
def test_painted_scenes_with_a_coarse_prior(device: ps.Device, make: type, kind: str) -> None:
    scene = make((SIZE, SIZE), light=ps.FlashLight())
    rng = np.random.default_rng(1)
    paint, there = paint_of(kind), np.ones((SIZE, SIZE), bool)
    prior = prior_of_blocks(scene.depth, there, 9, tolerance=0.02, rng=rng)
    sought = Sought(
        image=np.maximum(scene.image * paint + rng.normal(0.0, 0.005, there.shape), 0.0),
        grid=scene.camera.grid(there.shape),
        light=scene.light,
        reflectance=ps.Lambertian(),
        solved=there,
        known=np.full(there.shape, np.nan),
        prior=prior,
    )
    stopping = Stopping(1e-5, "distance", max_iterations=60, callback=None)
    without = regularised(device, sought, stopping)
    found, albedo = fit_albedo(device, sought, stopping)
    errors = [
        ps.compare(np.exp(log_depth), scene.depth).mean
        for log_depth in (without.log_depth + without.level, found.log_depth + found.level, prior.log_depth)
    ]
    assert errors[1] <= 0.5 * errors[0]
    assert errors[1] <= errors[2]
    assert angle(np.exp(found.log_depth + found.level), scene) <= 0.65 * angle(np.exp(prior.log_depth), scene)
    off = np.log(albedo / paint)
    assert np.median(np.abs(off - np.median(off))) < 0.05


def test_a_guide_tells_paint_from_shape(device: ps.Device) -> None:
    scene, paint = ps.bump((SIZE, SIZE), light=ps.FlashLight()), paint_of("checker")
    blocks = scene.depth.reshape(SIZE // 8, 8, SIZE // 8, 8).mean(axis=(1, 3))
    guide = blocks + np.random.default_rng(0).normal(0.0, 0.02 * np.ptp(blocks), blocks.shape)
    given: dict[str, Any] = {"light": scene.light, "guide": guide, "scheme": "regularised", "device": device}
    image = paint * scene.image
    found = ps.reconstruct(image, scene.camera, albedo="fit", max_iterations=60, **given)
    with pytest.warns(PersfsWarning, match="guide has most depths"):
        without = ps.reconstruct(image, scene.camera, max_iterations=60, **given)
    errors = [ps.compare(solution.depth, scene.depth).mean for solution in (found, without)]
    assert errors[0] < 0.5 * errors[1]
    assert found.albedo is not None
    assert 0.0 < found.albedo.min() < found.albedo.max() <= 1.0
    assert np.median(np.abs(np.log(found.albedo / paint))) < 0.1
    # It is what the surface is painted with.
    np.testing.assert_allclose(np.median(found.render() / image), 1.0, rtol=0.05)


def test_a_guide_need_not_reach_every_pixel() -> None:
    scene = ps.bump((24, 24), light=ps.FlashLight())
    guide = np.where(np.arange(24) < 12, scene.depth, np.nan)
    found = ps.reconstruct(
        scene.image, scene.camera, light=scene.light, guide=guide, albedo="fit", scheme="regularised"
    )
    assert found.status is ps.Status.CONVERGED
    assert ps.compare(found.depth, scene.depth).mean < 0.01


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"scheme": "regularised"}, "albedo='fit' without guide.*paint from shape"),
        ({"guide": np.ones((3, 3))}, "albedo='fit' with scheme='upwind'.*scheme='regularised'"),
        (
            {"scheme": "regularised", "guide": np.ones((3, 3)), "paint": 0.3},
            "paint=0.3 with albedo='fit'.*Leave paint out",
        ),
        ({"albedo": "paint.png"}, "albedo='paint.png' is no array"),
    ],
)
def test_it_wants_a_guide_and_the_scheme(keywords: dict[str, Any], message: str) -> None:
    scene = ps.bump((20, 20), light=ps.FlashLight())
    with pytest.raises(ps.InputError, match=message):
        ps.reconstruct(scene.image, scene.camera, light=scene.light, **{"albedo": "fit", **keywords})


def test_smoothing_counts_when_the_paint_is_found_too(device: ps.Device) -> None:
    scene = ps.bump((48, 48), light=ps.FlashLight(), noise=0.02)
    guide = scene.depth.reshape(6, 8, 6, 8).mean(axis=(1, 3))
    given: dict[str, Any] = {"light": scene.light, "scheme": "regularised", "albedo": "fit", "device": device}
    rough, smooth = (
        ps.reconstruct(scene.image, scene.camera, guide=guide, smoothing=over, max_iterations=20, **given).log_depth
        for over in (0.5, 8.0)
    )
    assert np.abs(np.diff(smooth, 2, axis=1)).mean() < 0.5 * np.abs(np.diff(rough, 2, axis=1)).mean()


def test_smoothing_stops_at_edges() -> None:
    rng = np.random.default_rng(0)
    step = np.where(np.arange(60) < 25, 0.0, 1.0) + np.zeros((50, 1))
    there = np.ones(step.shape, bool)
    there[10:20, 20:30] = False
    smooth = piecewise_smooth(np.where(there, step + rng.normal(0.0, 0.05, step.shape), 7.0), there)
    assert np.abs(smooth - step)[there].max() < 0.05
    assert not smooth[~there].any()
