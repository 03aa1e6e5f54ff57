"""Painted objects under a flash: the paint found along with the surface, by a coarse prior."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.bench.accuracy import FLASH, scanned
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.terrain import ERROR, ERROR_UNIT, PRIOR, errors_of, prior_of_blocks
from persfs_cl.errors import InputError
from persfs_cl.scenes.meshes import stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.energy.albedo import fit_albedo
from persfs_cl.solver.energy.minimise import Minimum, Stopping
from persfs_cl.solver.energy.regularised import Sought, regularised
from persfs_cl.solver.schemes.regularised import Regularised

WITHOUT, PAINTED, FITTED = "taken for plain", "painted", "paint found"

_SIZE, _STEP, _GUIDE_NOISE = 180, 9, 0.02
_CELL = 15
"""Pixels of a checker's edge."""
_DARK, _LIGHT = 0.3, 0.9
_NOISE = 0.005
_STOPPING = Stopping(Regularised.tolerance, "distance", max_iterations=100, callback=None)


def painted(plan: Plan) -> Iterator[list[Record]]:
    """A checker and a gradient of albedo, 0.3 to 0.9, with the means of nine by nine pixels as a prior."""
    size = plan.size(_SIZE)
    scenes = {
        "bump": partial(ps.bump, (size, size), light=FLASH),
        "hill": partial(ps.hillside, (size, size), light=FLASH),
    }
    try:
        scenes["bunny"] = partial(scanned, stanford_bunny(), size)
    except InputError as reason:
        yield [skip("painted", "bunny", ERROR, ERROR_UNIT, size, plan.precision, str(reason))]
    for name, make in scenes.items():
        scene = make()
        for kind, paint in paints(size).items():
            yield _painted(plan, f"{name}, {kind}", scene, paint)


def paints(size: int) -> dict[str, Array]:
    """Albedo of square images, by its name."""
    row, column = np.mgrid[:size, :size]
    return {
        "checker": np.where((column // _CELL + row // _CELL) % 2, _LIGHT, _DARK),
        "gradient": _DARK + (_LIGHT - _DARK) * column / (size - 1.0),
    }


def _painted(plan: Plan, name: str, scene: Scene, paint: Array) -> list[Record]:
    there = np.isfinite(scene.depth) if scene.mask is None else scene.mask
    brightest = float(scene.image[there].max())
    noise = np.random.default_rng(1).normal(0.0, _NOISE, there.shape)
    levels = np.clip(np.round(255.0 * (scene.image * paint / brightest + noise)), 1.0, 255.0)
    prior = prior_of_blocks(scene.depth, there, _STEP, tolerance=_GUIDE_NOISE, rng=np.random.default_rng(5))
    sought = Sought(
        image=np.where(there, levels / 255.0 * brightest, 0.0),
        grid=scene.camera.grid(there.shape),
        light=scene.light,
        reflectance=ps.Lambertian(),
        solved=there,
        known=np.full(there.shape, np.nan),
        prior=prior,
    )
    solve = partial(regularised, plan.device, stopping=_STOPPING, precision=plan.precision)
    ways: dict[str, Array] = {
        PRIOR: np.exp(prior.log_depth),
        WITHOUT: _depth(solve(sought)),
        PAINTED: _depth(solve(sought, paint="painted")),
        FITTED: _depth(fit_albedo(plan.device, sought, _STOPPING, precision=plan.precision)[0]),
        "true paint": _depth(solve(replace(sought, image=sought.image / paint))),
    }
    return [
        record
        for way, depth in ways.items()
        for record in errors_of(plan, "painted", f"{name}: {way}", scene, there, depth)
    ]


def _depth(found: Minimum) -> Array:
    return np.asarray(np.exp(found.log_depth + found.level))
