"""The outline of an object, inflated, as its guide under a light far away: what it tells, and what shading adds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.bench.painted import PAINTED, WITHOUT, paints
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.terrain import ERROR, ERROR_UNIT, errors_of
from persfs_cl.errors import InputError
from persfs_cl.scenes.meshes import stanford_bunny
from persfs_cl.scenes.scene import Scene

BARE = "inflated outline"
_SIZE, _FOCAL_LENGTH = 180, 197.0
_TURNS = (0, 90, 180, 270)
_NOISE = 0.005
_TOLERANCE = 0.1
"""Of the outline, as a share of its own relief."""
_ITERATIONS = 120


def outline(plan: Plan) -> Iterator[list[Record]]:
    """The bunny from four sides, plain and painted: its outline alone, and with the photograph."""
    size = plan.size(_SIZE)
    try:
        mesh = stanford_bunny()
    except InputError as reason:
        yield [skip("outline", "bunny", ERROR, ERROR_UNIT, size, plan.precision, str(reason))]
        return
    for turn in _TURNS:
        focal_length = size * _FOCAL_LENGTH / _SIZE
        scene = ps.mesh_scene(
            mesh, (size, size), up="z", turn=turn, focal_length=focal_length, light=ps.ParallelLight()
        )
        for kind, paint in {"plain": np.ones((size, size)), **paints(size)}.items():
            yield _compared(plan, f"{turn}°, {kind}", scene, paint)


def _compared(plan: Plan, name: str, scene: Scene, paint: Array) -> list[Record]:
    there = np.asarray(scene.mask)
    noise = np.random.default_rng(0).normal(0.0, _NOISE, there.shape)
    levels = np.clip(np.round(255.0 * (np.where(there, scene.image * paint, 0.0) + noise)), 0.0, 255.0)
    image = ps.normalise_linear(levels / 255.0, mask=there)
    guide = inflated(there, scene.camera, float(np.median(scene.depth[there])))
    ways = {BARE: guide}
    for way, kind in {WITHOUT: "plain", PAINTED: "painted"}.items():
        ways[way] = ps.reconstruct(
            image,
            scene.camera,
            light=scene.light,
            mask=there,
            guide=guide,
            guide_tolerance=_TOLERANCE * float(np.ptp(np.log(guide[there]))),
            scheme="regularised",
            paint=kind,
            max_iterations=_ITERATIONS,
            device=plan.device,
            precision=plan.precision,
        ).depth
    return [
        record
        for way, depth in ways.items()
        for record in errors_of(plan, "outline", f"{name}: {way}", scene, there, _level(depth, scene, there))
    ]


def inflated(mask: Mask, camera: ps.Camera, middle: float) -> Array:
    """Depth of a body with a given outline: half the sphere of a disc.

    Its height h over the plane at the depth `middle` has h² / 2 = u, where the second differences of u are -2 inside
    and u is 0 outside.
    """
    from scipy.sparse import diags, eye, kron
    from scipy.sparse.linalg import spsolve

    height, width = mask.shape
    down, across = (diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(side, side)) for side in (height, width))
    inside = np.flatnonzero(mask)
    differences = (kron(down, eye(width)) + kron(eye(height), across)).tocsr()[inside][:, inside]
    found = np.full(mask.shape, np.nan)
    found[mask] = np.sqrt(2.0 * spsolve(differences.tocsc(), np.full(inside.size, 2.0)))
    return middle - found * middle / camera.fx


def _level(depth: Array, scene: Scene, there: Mask) -> Array:
    """A depth of which only forms count, moved to where the truth is."""
    return depth + float(np.nanmedian((scene.depth - depth)[there]))
