"""The least energy with a coarse prior: on real terrain in slanting light, and under a flash."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.bench.accuracy import FLASH, scanned
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import TIME, TIME_UNIT, time_record, timed
from persfs_cl.errors import InputError
from persfs_cl.preparation.inpaint import harmonic
from persfs_cl.scenes.meshes import stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.solver.energy.minimise import Minimum, Stopping
from persfs_cl.solver.energy.prior import Prior
from persfs_cl.solver.energy.regularised import Sought, regularised
from persfs_cl.solver.schemes.regularised import Regularised

ERROR, ERROR_UNIT = "error", "% of the relief"
ANGLE, ANGLE_UNIT = "angle of normals", "°"
COUNT, COUNT_UNIT = "iterations", ""
DISTANCE, DISTANCE_UNIT = "estimated distance", "ln z"
FLAT, PRIOR, ENERGY = "flat sheet", "prior", "regularised"

NOISES = (0.0, 0.01, 0.03)
STEPS = (16, 32)
SWEPT: dict[str, dict[str, Any]] = {"upwind": {"scheme": "upwind"}, "Lax-Friedrichs": {"scheme": "lax-friedrichs"}}

_SHAPE = (320, 400)
_METRES = 25.0
"""A pixel's edge."""
_BLUR = 0.7
_FOCAL_LENGTH = 8000.0
_LIGHT = ps.ParallelLight(1.0, 0.3)
_PRIOR_NOISE = 0.003
"""Of the relief: what the tolerance of block means has besides their spacing."""

_GUIDED_SIZE, _GUIDED_STEP, _GUIDE_NOISE = 270, 9, 0.02
_ITERATIONS = 300
_SIZES = (512, 1024)
ENDINGS = {
    f"distance {tolerance:g}": Stopping(tolerance, "distance", _ITERATIONS, None)
    for tolerance in (Regularised.tolerance, Regularised.tolerance / 2)
}
_BY_DEFAULT, _ = ENDINGS.values()


@dataclass(frozen=True)
class Terrain:
    """A piece of ground from above, and its photograph.

    Attributes
    ----------
    height : ndarray of float64, shape (rows, columns)
        Towards the camera, in pixels.
    image : ndarray of float64, shape (rows, columns)
    """

    height: Array
    image: Array

    @classmethod
    def photographed(cls, noise: float, shape: tuple[int, int] = _SHAPE) -> Terrain:
        """The elevation model that Matplotlib ships, one pixel taken for 25 m, in 8 bits."""
        from matplotlib.cbook import get_sample_data

        with np.load(str(get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))) as model:
            elevation = np.asarray(model["elevation"][: _SHAPE[0], : _SHAPE[1]], np.float64)
        height = _blurred(elevation / _METRES, _BLUR)
        height = height - height.mean()
        image = _in_8_bits(_shaded(height) + np.random.default_rng(0).normal(0.0, noise, height.shape))
        rows, columns = shape
        return cls(height[:rows, :columns], image[:rows, :columns])

    def repeated(self, size: int) -> Terrain:
        """A square of the ground and its mirror images, which the light makes another ground of."""
        height = np.block([[self.height, self.height[:, ::-1]], [self.height[::-1], self.height[::-1, ::-1]]])
        times = [-(-size // edge) for edge in height.shape]
        square = np.tile(height, times)[:size, :size]
        noise = np.random.default_rng(0).normal(0.0, 0.01, square.shape)
        return Terrain(square, _in_8_bits(_shaded(square) + noise))

    @property
    def camera(self) -> ps.Camera:
        """So far away that the view is nearly parallel."""
        return ps.Camera(focal_length=_FOCAL_LENGTH)

    @property
    def depth(self) -> Array:
        """1 at height 0; a pixel's edge is 1 / focal length there."""
        return 1.0 - self.height / _FOCAL_LENGTH

    def heights(self, depth: Array) -> Array:
        """The height of a depth."""
        return (1.0 - depth) * _FOCAL_LENGTH

    def error(self, height: Array) -> float:
        """Mean error after one offset, in percent of the relief."""
        apart = height - self.height
        return 100.0 * float(np.mean(np.abs(apart - np.median(apart)))) / float(np.ptp(self.height))

    def angle(self, height: Array) -> float:
        """Median angle between normals, in degrees."""
        return _median_angle(_normals(height), _normals(self.height))


def terrain(plan: Plan) -> Iterator[list[Record]]:
    """Real ground in slanting light, with the means of coarse blocks as a prior; beside it the sweeps.

    The sweeps are given the true depth of the frame, or nothing.
    """
    for noise in NOISES:
        for step in STEPS:
            shape = tuple(min(plan.size(edge), edge) // step * step for edge in _SHAPE)
            if 0 in shape:
                name = workload(noise, step, ENERGY)
                yield [skip("terrain", name, ERROR, ERROR_UNIT, 0, plan.precision, "the image is smaller than a block")]
                continue
            yield _terrain(plan, noise, step, Terrain.photographed(noise, (shape[0], shape[1])))


def _terrain(plan: Plan, noise: float, step: int, ground: Terrain) -> list[Record]:
    prior = prior_of_blocks(ground.depth, np.ones(ground.depth.shape, bool), step, tolerance=_PRIOR_NOISE)
    found = {
        FLAT: np.zeros_like(ground.height),
        PRIOR: ground.heights(np.exp(prior.log_depth)),
        ENERGY: ground.heights(_depth(_least(plan, ground.image, ground.camera, _LIGHT, None, prior))),
    }
    if step == STEPS[0]:
        frame = np.full(ground.depth.shape, np.nan)
        for edge in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
            frame[edge] = ground.depth[edge]
        for name, options in SWEPT.items():
            for given, known in (("true frame", frame), ("no frame", None)):
                solution = ps.reconstruct(
                    ground.image,
                    ground.camera,
                    light=_LIGHT,
                    known_depth=known,
                    surface="toward",
                    device=plan.device,
                    precision=plan.precision,
                    **options,
                )
                found[f"{name}, {given}"] = ground.heights(solution.depth)
    return [
        _record(plan, "terrain", workload(noise, step, name), ground.height.shape[0], *quantity)
        for name, height in found.items()
        for quantity in ((ERROR, ERROR_UNIT, ground.error(height)), (ANGLE, ANGLE_UNIT, ground.angle(height)))
    ]


def priors(plan: Plan) -> Iterator[list[Record]]:
    """Objects under a flash, with the depth of blocks of nine by nine pixels as a prior, off by 2 % of the relief."""
    size = plan.size(_GUIDED_SIZE)
    scenes: dict[str, Callable[[], Scene]] = {
        "bump": partial(ps.bump, (size, size), light=FLASH, bits=8, noise=0.005),
        "hill": partial(ps.hillside, (size, size), light=FLASH, bits=8, noise=0.005),
    }
    try:
        scenes["bunny"] = partial(scanned, stanford_bunny(), size, bits=8, noise=0.005)
    except InputError as reason:
        yield [skip("priors", "bunny", ERROR, ERROR_UNIT, size, plan.precision, str(reason))]
    for name, make in scenes.items():
        yield _with_prior(plan, name, make())


def energy(plan: Plan) -> Iterator[list[Record]]:
    """How long it takes: the ground repeated in mirrors, 1 % noise, the means of 16 by 16 pixels as a prior."""
    step = STEPS[0]
    for size in plan.edges_up_to(_SIZES, _SIZES[-1]):
        if size < 2 * step:
            yield [
                skip("energy", name, TIME, TIME_UNIT, size, plan.precision, "the image is smaller than a block")
                for name in ENDINGS
            ]
            continue
        ground = Terrain.photographed(0.01).repeated(size // step * step)
        prior = prior_of_blocks(ground.depth, np.ones(ground.depth.shape, bool), step, tolerance=_PRIOR_NOISE)
        found: dict[str, Minimum] = {}

        def solve(name: str, ground: Terrain = ground, prior: Prior = prior, found: dict[str, Minimum] = found) -> None:
            found[name] = _least(plan, ground.image, ground.camera, _LIGHT, None, prior, ENDINGS[name])

        for name in ENDINGS:
            solve(name)
        timings = timed(plan, {name: partial(solve, name) for name in ENDINGS}, repeats=min(3, plan.repeats))
        for name, least in found.items():
            height, count = ground.heights(_depth(least)), len(least.changes)
            common = {"experiment": "energy", "workload": name, "size": size}
            yield [
                time_record(timings[name], images=1, precision=plan.precision, iteration=count, **common),
                _record(plan, "energy", name, size, COUNT, COUNT_UNIT, count),
                skip("energy", name, DISTANCE, DISTANCE_UNIT, size, plan.precision, "not known")
                if math.isnan(least.distance)
                else _record(plan, "energy", name, size, DISTANCE, DISTANCE_UNIT, least.distance),
                _record(plan, "energy", name, size, ERROR, ERROR_UNIT, ground.error(height)),
                _record(plan, "energy", name, size, ANGLE, ANGLE_UNIT, ground.angle(height)),
            ]


def _with_prior(plan: Plan, name: str, scene: Scene) -> list[Record]:
    there = np.isfinite(scene.depth) if scene.mask is None else scene.mask
    rng = np.random.default_rng(5)
    prior = prior_of_blocks(scene.depth, there, _GUIDED_STEP, tolerance=_GUIDE_NOISE, rng=rng)
    alone = ps.reconstruct(
        scene.image, scene.camera, light=scene.light, mask=scene.mask, device=plan.device, precision=plan.precision
    )
    found = {
        "alone": alone.depth,
        PRIOR: np.exp(prior.log_depth),
        ENERGY: _depth(_least(plan, scene.image, scene.camera, scene.light, scene.mask, prior)),
    }
    return [
        record
        for way, depth in found.items()
        for record in errors_of(plan, "priors", f"{name}: {way}", scene, there, depth)
    ]


def errors_of(plan: Plan, experiment: str, name: str, scene: Scene, there: Mask, depth: Array) -> list[Record]:
    """Mean error of depth, and median angle of normals."""
    apart = np.abs(depth - scene.depth)[there]
    error = 100.0 * float(np.nanmean(apart)) / float(np.ptp(scene.depth[there]))
    normals = normals_of(np.where(there, depth, np.nan), scene.camera)
    angle = _median_angle(normals, normals_of(scene.depth, scene.camera))
    size = scene.image.shape[0]
    return [
        _record(plan, experiment, name, size, ERROR, ERROR_UNIT, error),
        _record(plan, experiment, name, size, ANGLE, ANGLE_UNIT, angle),
    ]


def prior_of_blocks(
    depth: Array, there: Mask, step: int, *, tolerance: float, rng: np.random.Generator | None = None
) -> Prior:
    """The means of square blocks, interpolated.

    Parameters
    ----------
    depth : ndarray of float64, shape (height, width)
    there : ndarray of bool, shape (height, width)
        Pixels that count.
    step : int
        Pixels of a block's edge.
    tolerance : float
        Share of the relief by which a mean may err.
    rng : Generator, optional
        Makes them err so.
    """
    height, width = depth.shape
    rows, columns = -(-height // step), -(-width // step)
    padded = np.full((rows * step, columns * step), np.nan)
    padded[:height, :width] = np.where(there, depth, np.nan)
    noise = tolerance * float(np.ptp(depth[there]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        means = np.nanmean(padded.reshape(rows, step, columns, step), axis=(1, 3))
    if rng is not None:
        means = means + rng.normal(0.0, noise, means.shape)
    missing = np.isnan(means)
    if missing.any():
        means[missing] = harmonic(means, missing, ~missing)
    smooth = _between(_between(means, step, 0), step, 1)[:height, :width]
    down, across = np.gradient(smooth)
    apart = np.sqrt(noise**2 + (down**2 + across**2) * step**2 / 12.0)
    return Prior(np.where(there, np.log(smooth), np.nan), np.where(there, apart / smooth, np.nan), float(step))


def _least(
    plan: Plan,
    image: Array,
    camera: ps.Camera,
    light: Light,
    mask: Mask | None,
    prior: Prior,
    stopping: Stopping = _BY_DEFAULT,
) -> Minimum:
    """The least energy."""
    sought = Sought(
        image=image,
        grid=camera.grid(image.shape),
        light=light,
        reflectance=ps.Lambertian(),
        solved=np.ones(image.shape, bool) if mask is None else mask,
        known=np.full(image.shape, np.nan),
        prior=prior,
    )
    return regularised(plan.device, sought, stopping, precision=plan.precision)


def _depth(found: Minimum) -> Array:
    return np.asarray(np.exp(found.log_depth + found.level))


def workload(noise: float, step: int, way: str) -> str:
    """What the records of a photograph and a way to solve it are of."""
    return f"{100 * noise:g} % noise, {step} × {step}: {way}"


def _record(plan: Plan, experiment: str, workload: str, size: int, quantity: str, unit: str, value: float) -> Record:
    return Record.of(
        [value],
        experiment=experiment,
        workload=workload,
        quantity=quantity,
        unit=unit,
        size=size,
        images=1,
        precision=plan.precision,
    )


def _shaded(height: Array) -> Array:
    """Brightness of a height in the slanting light, seen from far above."""
    q, p = (-slope for slope in np.gradient(height))
    return np.clip(_LIGHT.brightness(0.0, p, q, 0.0, 0.0, ps.Lambertian()), 0.0, 1.0)


def _in_8_bits(brightness: Array) -> Array:
    return np.asarray(np.clip(np.round(255.0 * brightness), 0.0, 255.0) / 255.0)


def _between(values: Array, step: int, axis: int) -> Array:
    """Linear between the middles of blocks, level beyond the outermost."""
    places = (np.arange(values.shape[axis] * step) + 0.5) / step - 0.5
    knots = np.arange(values.shape[axis])
    return np.apply_along_axis(lambda line: np.interp(places, knots, line), axis, values)


def _blurred(values: Array, width: float) -> Array:
    """By a Gaussian of that standard deviation."""
    reach = int(4.0 * width + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    for axis in (0, 1):
        padded = np.pad(values, [(reach * (axis == other),) * 2 for other in (0, 1)], mode="symmetric")
        values = np.apply_along_axis(np.convolve, axis, padded, weights / weights.sum(), mode="valid")
    return values


def _normals(height: Array) -> Array:
    """Unit normals of heights, shape (..., 3)."""
    down, across = np.gradient(height)
    return _unit(np.stack([-across, -down, np.ones_like(height)], axis=-1))


def normals_of(depth: Array, camera: ps.Camera) -> Array:
    """Unit normals of a depth map by central differences, shape (height, width, 3)."""
    grid = camera.grid(depth.shape)
    points = np.stack([grid.x * depth, grid.y * depth, depth], axis=-1)
    return _unit(np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0)))


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _median_angle(one: Array, other: Array) -> float:
    return float(np.degrees(np.nanmedian(np.arccos(np.clip((one * other).sum(axis=-1), -1.0, 1.0)))))
