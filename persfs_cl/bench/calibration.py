"""How exactly light, tone and lens are found from photographs whose depth is known at some points, or everywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.errors import InputError
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.shading.model import Light

GAIN, EXPONENT, LAMP, DIRECTION = "gain", "exponent", "lamp", "direction"
BEFORE, AFTER = "depth before, one scale", "depth after"
QUANTITIES = {GAIN: "%", EXPONENT: "", LAMP: "depths", DIRECTION: "degrees", BEFORE: "%", AFTER: "%"}
EXPERIMENT = "calibration"

_SIZE = 144
_POINTS, _POINT_NOISE = 100, 0.01
_TONE = 1.2
_SHARE_OF_LIGHT = 0.8
"""Of a parallel light: what E = 1 is in the photograph."""
_LAMP = (0.1, -0.05, 0.0)

Surface = tuple[Array, ps.Camera]
"""A depth map, NaN where there is none, and what sees it."""


def _bump(size: int) -> list[Surface]:
    scene = ps.bump((size, size), surface="toward", relief=0.4)
    return [(scene.depth, scene.camera)]


def _bump_and_hill(size: int) -> list[Surface]:
    """The hill farther away: together they tell of gain and tone what one of them does not."""
    hill = ps.hillside((size, size), surface="toward", relief=0.3)
    return [*_bump(size), (1.6 * hill.depth, hill.camera)]


def _bunny(size: int) -> list[Surface]:
    scene = mesh_scene(stanford_bunny(), (size, size), up="z", focal_length=size * 590 / 540)
    return [(np.where(scene.mask, scene.depth, np.nan), scene.camera)]


@dataclass(frozen=True)
class Case:
    """What is sought of which photographs.

    Attributes
    ----------
    surfaces : callable
        Of a size.
    light : Light
        The true one, but for its gain.
    fit : str
    exponent : float
        The true one.
    dense : bool
        Whether the whole depth is known, and exactly; else 100 points, off by 1 %, of all photographs together.
    """

    surfaces: Callable[[int], list[Surface]]
    light: Light
    fit: str
    exponent: float = _TONE
    dense: bool = False


CASES: dict[str, Case] = {
    "bump, points": Case(_bump, ps.FlashLight(), "gain", 1.0),
    "bump, points: tone": Case(_bump, ps.FlashLight(), "gain,exponent"),
    "bump and hill, points: tone, lamp": Case(_bump_and_hill, ps.FlashLight(offset=_LAMP), "gain,exponent,lamp"),
    "bunny, points: tone, lamp": Case(_bunny, ps.FlashLight(offset=_LAMP), "gain,exponent,lamp"),
    "bump, map: tone, lamp": Case(_bump, ps.FlashLight(offset=_LAMP), "gain,exponent,lamp", dense=True),
    "bump and hill, maps: sun, tone": Case(
        _bump_and_hill, ps.ParallelLight(0.3, -0.2), "direction,white,exponent", dense=True
    ),
}
"""By what a table calls them."""


def calibration(plan: Plan) -> Iterator[list[Record]]:
    """Errors of what is fitted, and of the depth without it and with it, over several draws of points."""
    size = plan.size(_SIZE)
    for name, case in CASES.items():
        try:
            surfaces = case.surfaces(size)
        except InputError as reason:
            yield [skip(EXPERIMENT, name, GAIN, "%", size, plan.precision, str(reason))]
            continue
        # From a map that is exact there is one result.
        draws = [_drawn(plan, case, surfaces, seed) for seed in range(1 if case.dense else plan.repeats)]
        yield [
            Record.of(
                [draw[quantity] for draw in draws],
                experiment=EXPERIMENT,
                workload=name,
                quantity=quantity,
                unit=unit,
                size=size,
                images=len(surfaces),
                precision=plan.precision,
                detail=f"{case.fit} from {'a dense truth' if case.dense else f'{_POINTS} points'}",
            )
            for quantity, unit in QUANTITIES.items()
            if quantity in draws[0]
        ]


def _drawn(plan: Plan, case: Case, surfaces: Sequence[Surface], seed: int) -> dict[str, float]:
    """The errors of one draw."""
    images = [ps.render(depth, camera, light=case.light) for depth, camera in surfaces]
    white = 1.0 / _SHARE_OF_LIGHT if case.light.normalised else max(float(np.nanmax(image)) for image in images)
    draw = np.random.default_rng(seed)
    photos = [_taken(image / white, case.exponent) for image in images]
    truths = [depth if case.dense else _points(depth, _POINTS // len(surfaces), draw) for depth, _ in surfaces]
    cameras = [camera for _, camera in surfaces]
    found = ps.calibrate(
        list(zip(photos, truths, strict=True)), cameras, fit=case.fit, light=type(case.light)(), device=plan.device
    )
    errors: dict[str, float] = {}
    if isinstance(found.light, ps.ParallelLight) and isinstance(case.light, ps.ParallelLight):
        errors[DIRECTION] = _angle(found.light, case.light)
    elif isinstance(found.light, ps.FlashLight) and isinstance(case.light, ps.FlashLight):
        errors[GAIN] = 100.0 * abs(found.values["gain"] * white - 1.0)
        if "lamp" in case.fit:
            apart = float(np.linalg.norm(np.subtract(found.light.offset, case.light.offset)))
            errors[LAMP] = apart / float(np.nanmedian(surfaces[0][0]))
        (depth, camera), photo = surfaces[0], photos[0]
        solve = partial(ps.reconstruct, mask=np.isfinite(photo), device=plan.device, precision=plan.precision)
        filled = np.nan_to_num(photo)
        before = solve(filled, camera, light=ps.FlashLight())
        after = solve(filled**found.exponent, camera, light=found.light)
        errors[BEFORE] = 100.0 * _relative(before.depth, depth, scaled=True)
        errors[AFTER] = 100.0 * _relative(after.depth, depth, scaled=False)
    if "exponent" in case.fit:
        errors[EXPONENT] = abs(found.exponent - case.exponent)
    return errors


def _taken(share: Array, exponent: float) -> Array:
    """A photograph in 8 bits, by a camera with a tone curve."""
    return np.asarray(np.round(255.0 * np.clip(share, 0.0, 1.0) ** (1.0 / exponent)) / 255.0)


def _points(depth: Array, count: int, draw: np.random.Generator) -> Array:
    """Column, row and depth of so many pixels, with noise."""
    rows, columns = np.nonzero(np.isfinite(depth))
    kept = draw.choice(rows.size, min(count, rows.size), replace=False)
    noise = 1.0 + _POINT_NOISE * draw.normal(size=kept.size)
    return np.stack([columns[kept], rows[kept], depth[rows[kept], columns[kept]] * noise], axis=1)


def _angle(one: ps.ParallelLight, other: ps.ParallelLight) -> float:
    """Between two lights, in degrees."""
    first, second = (np.array([light.p0, light.q0, 1.0]) / light.norm for light in (one, other))
    return float(np.degrees(2.0 * np.arcsin(0.5 * np.linalg.norm(first - second))))


def _relative(found: Array, true: Array, *, scaled: bool) -> float:
    """Mean of |z - z'| / z', after one scale or as it is."""
    share = found / true
    return float(np.nanmean(np.abs(share / (np.nanmedian(share) if scaled else 1.0) - 1.0)))
