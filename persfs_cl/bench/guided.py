"""What coarse depths from elsewhere are worth: alone, the photograph alone, and both together."""

from __future__ import annotations

import importlib.metadata
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.bench.accuracy import SURFACES
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.errors import InputError
from persfs_cl.guide.cells import Cells
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.surface.geometry import normals

if TYPE_CHECKING:
    import trimesh

EXPERIMENT = "guided"
ALONE, GUIDE, GUIDED, WORST = "alone", "guide", "guided", "worst view"
RATIO = "worst ratio"
"""Of guided to the better of the two others, over the views."""
WHAT = {"": "%", ", normals": "°"}
"""Endings of names, and units: mean error of the depth, as a share of the relief, and median angle of normals."""
QUANTITIES = {
    **{f"{way}{what}": unit for what, unit in WHAT.items() for way in (ALONE, GUIDE, GUIDED, WORST)},
    RATIO: "",
}

TURNS = tuple(range(0, 360, 45))
"""Degrees by which an object is turned, a view each."""
_SIZE, _FOCAL_LENGTH = 270, 295.0
_WHOLE_BLOCKS = 45
"""Pixels: sizes are multiples of it, so that both kinds of blocks fill them."""
_BITS, _NOISE = 8, 0.005
_NINTH, _FIFTEENTH = 9, 15
_GUIDE_NOISE = 0.02
_POINTS, _POINT_NOISE = 200, 0.01
"""Noise is a share of the relief."""
_BRIGHTER = 1.7
_OUTLIERS, _OUTLYING = 0.05, 0.2
_SCALED = 1.05
_BLURRED, _DISTORTED, _DISTORTION = 15 / 270, 50 / 270, 0.05
"""Blur and extent of the distortions of a network's depth, in widths of the image, and the largest distortion."""
_FACTOR, _OFFSET = 3.7, 0.4
_SEED = 7

Depths = Array | ps.Points
Make = Callable[[Scene, np.random.Generator], Depths]


@dataclass(frozen=True)
class Case:
    """A guide, and what is told of it.

    Attributes
    ----------
    depths : callable
        Of a scene, and of what draws random numbers: what the guide takes the depth for.
    relative : bool
        Whether numbers that go with the inverse depth are given for it.
    brighter : float
        By how much the photograph is brighter than a gain of 1 makes it.
    keywords : mapping
        For :func:`persfs_cl.reconstruct`.
    """

    depths: Make
    relative: bool = False
    brighter: float = 1.0
    keywords: Mapping[str, Any] = field(default_factory=dict)


def blocks(depth: Array, edge: int) -> Array:
    """Median depth of each block of so many pixels by so many; NaN where there is none."""
    rows, columns = (length // edge for length in depth.shape)
    parts = depth[: rows * edge, : columns * edge].reshape(rows, edge, columns, edge).swapaxes(1, 2)
    found = np.full((rows, columns), np.nan)
    known = np.isfinite(parts).any(axis=(2, 3))
    found[known] = np.nanmedian(parts[known], axis=(1, 2))
    return found


def _coarse(scene: Scene, draw: np.random.Generator, *, edge: int = _NINTH) -> Array:
    guide = blocks(scene.depth, edge)
    return np.asarray(guide + _GUIDE_NOISE * _relief(scene) * draw.normal(size=guide.shape))


def _points(scene: Scene, draw: np.random.Generator) -> ps.Points:
    seen = np.argwhere(scene.mask)
    rows, columns = seen[draw.choice(len(seen), min(_POINTS, len(seen)), replace=False)].T
    depths = scene.depth[rows, columns]
    return ps.Points(columns, rows, depths + _POINT_NOISE * _relief(scene) * draw.normal(size=depths.size))


def _with_outliers(scene: Scene, draw: np.random.Generator) -> Array:
    guide = _coarse(scene, draw)
    wrong = draw.random(guide.shape) < _OUTLIERS
    return np.asarray(guide * np.where(wrong, 1.0 + _OUTLYING * draw.choice([-1, 1], guide.shape), 1.0))


def _scaled(scene: Scene, draw: np.random.Generator) -> Array:
    return _SCALED * _coarse(scene, draw)


def _like_a_networks(scene: Scene, draw: np.random.Generator) -> Array:
    """Blurred across jumps, though not across the outline, and smoothly distorted."""
    from scipy.ndimage import gaussian_filter  # slow to import

    width = scene.depth.shape[1]
    weight, sums = (gaussian_filter(np.where(scene.mask, each, 0.0), _BLURRED * width) for each in (1.0, scene.depth))
    blurred = np.divide(sums, weight, out=np.full(sums.shape, np.nan), where=scene.mask)
    distortion = gaussian_filter(draw.normal(size=sums.shape), _DISTORTED * width, mode="wrap")
    return blocks(blurred * (1.0 + _DISTORTION * distortion / np.abs(distortion).max()), _NINTH)


def _as_relative(depth: Any) -> Array:
    """Numbers that go with the inverse depth, as networks give them."""
    return np.asarray(_FACTOR / depth + _OFFSET)


CASES: dict[str, Case] = {
    "1/9, 2 % noise": Case(_coarse),
    "1/15, 2 % noise": Case(partial(_coarse, edge=_FIFTEENTH)),
    "200 points, 1 % noise": Case(_points),
    "1/9, gain unknown": Case(_coarse, brighter=_BRIGHTER, keywords={"light": ps.FlashLight(gain=None)}),
    "1/9, 5 % outliers": Case(_with_outliers),
    "1/9, scaled": Case(_scaled, keywords={"guide_scale": "fit"}),
    "like a network's": Case(_like_a_networks, keywords={"guide_scale": "fit"}),
    "like a network's, inverse": Case(
        _like_a_networks, relative=True, keywords={"guide_kind": "inverse", "guide_scale": "affine"}
    ),
}
"""By what a table calls them."""


def head() -> Any:
    """A modelled head, in a package of which nothing but this file is read."""
    return _of_package("tvb_data/obj/face_surface.obj")


def brain() -> trimesh.Trimesh:
    """A brain, from magnetic resonance images, in the same package."""
    import trimesh

    with zipfile.ZipFile(_of_package("tvb_data/surfaceData/cortex_16384.zip")) as archive:
        vertices, faces = (
            np.loadtxt(archive.open(f"{name}.txt"), dtype=kind)
            for name, kind in (("vertices", np.float64), ("triangles", np.int64))
        )
    return trimesh.Trimesh(vertices, faces)


def _of_package(path: str) -> Any:
    try:
        package = importlib.metadata.distribution("tvb-data")
    except importlib.metadata.PackageNotFoundError as error:
        raise InputError("It comes in the package tvb-data, which is missing: pip install tvb-data, 52 MB.") from error
    return package.locate_file(path)


TUNED_ON = "bunny"
OBJECTS: dict[str, Callable[[], Any]] = {TUNED_ON: stanford_bunny, "head": head, "brain": brain}
"""Those besides the first played no part in how the method came to be, and have its first guide alone."""

OTHER_LIGHTS: dict[str, Light] = {
    "parallel, oblique": ps.ParallelLight(0.15, -0.1),
    "flash without fall-off": ps.FlashLight(falloff=False),
}
SCENES: dict[str, Callable[..., Scene]] = {"bump": ps.bump, "bumps": ps.bumps, "hillside": ps.hillside}


def guided(plan: Plan) -> Iterator[list[Record]]:
    """Errors of depth and normals: objects under a flash, and smooth scenes under lights that tell no distance."""
    size = max(_WHOLE_BLOCKS, plan.size(_SIZE) // _WHOLE_BLOCKS * _WHOLE_BLOCKS)
    for name, found in OBJECTS.items():
        cases = list(CASES) if name == TUNED_ON else list(CASES)[:1]
        try:
            mesh = found()
        except InputError as reason:
            yield [skip(EXPERIMENT, f"{name}: {case}", ALONE, "%", size, plan.precision, str(reason)) for case in cases]
            continue
        views = [_view(mesh, size, turn) for turn in TURNS]
        for case in cases:
            yield _compared(plan, f"{name}: {case}", views, CASES[case])
    yield from other_lights(plan, size)


def other_lights(plan: Plan, size: int) -> Iterator[list[Record]]:
    """The part under lights that tell no distance: nothing is known but the guide, no frame either."""
    for (name, make), (light_name, light), surface in product(SCENES.items(), OTHER_LIGHTS.items(), SURFACES):
        taken = make((size, size), light=light, surface=surface, bits=_BITS, noise=_NOISE)
        # Noise makes some pixels brighter than anything is under such a light.
        scene = replace(taken, image=np.minimum(taken.image, 1.0))
        yield _compared(plan, f"{name}, {surface}: {light_name}", [scene], Case(_coarse))


def _view(mesh: Any, size: int, turn: int) -> Scene:
    return mesh_scene(
        mesh,
        (size, size),
        up="z",
        turn=turn,
        focal_length=_FOCAL_LENGTH * size / _SIZE,
        light=ps.FlashLight(),
        bits=_BITS,
        noise=_NOISE,
        seed=turn,
    )


def _compared(plan: Plan, workload: str, views: Sequence[Scene], case: Case) -> list[Record]:
    """The errors by each way, and how they compare."""
    guides = [case.depths(view, np.random.default_rng(_SEED)) for view in views]
    given = [_as_relative(guide) if case.relative else guide for guide in guides]
    solve = partial(
        ps.reconstruct_batch,
        [case.brighter * view.image for view in views],
        views[0].camera,
        mask=[view.mask for view in views],
        surface=views[0].surface,
        device=plan.device,
        precision=plan.precision,
    )
    light: dict[str, Any] = {"light": views[0].light}
    depths = {
        GUIDE: [_interpolated(guide, view.mask) for guide, view in zip(guides, views, strict=True)],
        GUIDED: [each.depth for each in solve(guide=given, **light | dict(case.keywords))],
    }
    if views[0].light.determines_depth:
        depths[ALONE] = [each.depth for each in solve(**light)]
    errors = {
        way: np.array([_errors(depth, view) for depth, view in zip(found, views, strict=True)])
        for way, found in depths.items()
    }
    better = np.min([found[:, 0] for way, found in errors.items() if way != GUIDED], axis=0)
    values = {
        **{f"{way}{what}": found[:, place].mean() for way, found in errors.items() for place, what in enumerate(WHAT)},
        RATIO: (errors[GUIDED][:, 0] / better).max(),
    }
    if len(views) > 1:
        values |= {f"{WORST}{what}": errors[GUIDED][:, place].max() for place, what in enumerate(WHAT)}
    return [
        Record.of(
            [float(values[quantity])],
            experiment=EXPERIMENT,
            workload=workload,
            quantity=quantity,
            unit=unit,
            size=views[0].mask.shape[0],
            images=len(views),
            precision=plan.precision,
            detail="nothing else known",
        )
        for quantity, unit in QUANTITIES.items()
        if quantity in values
    ]


def _interpolated(guide: Depths, mask: Mask) -> Array:
    """What the guide says by itself."""
    if isinstance(guide, ps.Points):
        cells = Cells.of_points(guide.columns, guide.rows, guide.depths, mask)
    else:
        cells = Cells.of_map(guide, mask)
    return np.where(mask, cells.interpolated(cells.values), np.nan)


def _errors(depth: Array, view: Scene) -> tuple[float, float]:
    """Mean error of the depth, as a share of the relief, and median angle between normals."""
    error = ps.compare(depth, view.depth, mask=view.mask).mean
    true, found = (normals(np.where(view.mask, each, np.nan), view.camera) for each in (view.depth, depth))
    cosine = np.clip((true * found).sum(axis=2), -1.0, 1.0)
    return 100.0 * error / _relief(view), float(np.degrees(np.nanmedian(np.arccos(cosine))))


def _relief(scene: Scene) -> float:
    return float(np.ptp(scene.depth[scene.mask]))
