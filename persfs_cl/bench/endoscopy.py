"""An endoscope's frame from a folder that the user has: the photograph alone, and with a tenth of its known points."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.errors import InputError
from persfs_cl.io.files import read_bytes
from persfs_cl.io.points import at_points, compare_points, read_points

EXPERIMENT = "endoscopy"
ERROR, ERROR_UNIT = "mean error at the points", "% of the depth"
CONSTANT, FADING = "a constant depth", "1 / sqrt(brightness)"
ALONE, GUIDED = "alone", "with a tenth of the points"
FRAME, MASK, POINTS = "frame.jpg", "mask.png", "points.json"
"""Files of the folder."""

FOLDS = 10
_LEAST = 2 * FOLDS
"""Points, of which each fold has two at least."""
_SEED = 0
_CAMERA = ("fx", "fy", "cx", "cy", "width", "height")


@dataclass(frozen=True, eq=False)
class Frame:
    """What the folder holds.

    Attributes
    ----------
    light : ndarray of float64, shape (height, width)
        Linear, its highlights filled.
    mask : ndarray of bool, shape (height, width)
    camera : Camera
    points : ndarray of float64, shape (points, 3)
        Column, row and depth, in any unit.
    """

    light: Array
    mask: Mask
    camera: ps.Camera
    points: Array


def endoscopy(plan: Plan) -> Iterator[list[Record]]:
    """Errors at known points after one scale; of those with a guide over the other points, the mean over the folds."""
    if plan.endoscopy is None:
        why = f"the frame comes with no package: give the folder of {FRAME}, {MASK} and {POINTS} by --endoscopy."
        yield [skip(EXPERIMENT, ALONE, ERROR, ERROR_UNIT, 0, plan.precision, why)]
        return
    frame = read_frame(plan.endoscopy)
    solve = partial(
        ps.reconstruct, frame.light, frame.camera, mask=frame.mask, device=plan.device, precision=plan.precision
    )
    points = frame.points
    alone = at_points(solve(light=ps.FlashLight()).depth, points)
    brightness = at_points(np.where(frame.mask, frame.light, np.nan), points)
    estimates = {CONSTANT: np.ones_like(alone), FADING: 1.0 / np.sqrt(np.maximum(brightness, 1e-9)), ALONE: alone}
    for way, estimate in estimates.items():
        yield [_record(plan, way, _error(estimate, points), f"{len(points)} points")]
    fold_of = np.random.default_rng(_SEED).permutation(len(points)) % FOLDS
    errors = []
    for fold in range(FOLDS):
        guide, rest = points[fold_of == fold], points[fold_of != fold]
        solution = solve(light=ps.FlashLight(gain=None), guide=ps.Points(*guide.T))
        errors.append(_error(at_points(solution.depth, rest), rest))
    yield [_record(plan, GUIDED, float(np.mean(errors)), f"the other points, mean of {FOLDS} folds")]


def read_frame(folder: Path) -> Frame:
    """Read the folder.

    Raises
    ------
    InputError
        When a file is missing or is not what it should be; names it.
    """
    camera, (height, width) = _camera(folder / POINTS)
    points = read_points(folder / POINTS)
    if len(points) < _LEAST:
        raise InputError(f"{folder / POINTS} has {len(points)} points: give {_LEAST} at least, two for each fold.")
    # Blood darkens red least.
    photo = ps.read_photo(folder / FRAME, channel="red")
    if photo.image.shape != (height, width):
        raise InputError(
            f"{folder / FRAME} has shape {photo.image.shape}, and the camera of {folder / POINTS} {(height, width)} "
            "(height, width): give the frame that the camera took."
        )
    mask = ps.read_mask(folder / MASK, (height, width))
    prepared = ps.prepare_photo(photo, camera, ps.Preparation(highlights="fill"), mask=mask)
    return Frame(prepared.light, mask, camera, points)


def _camera(path: Path) -> tuple[ps.Camera, tuple[int, int]]:
    """The camera, and the height and width of its frames."""
    data = read_bytes(path)
    try:
        given = json.loads(data)["camera"]
        fx, fy, column, row, width, height = (given[name] for name in _CAMERA)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path} has no "camera" with {", ".join(_CAMERA)}: add it, in pixels.') from error
    return ps.Camera((fx, fy), (column, row)), (height, width)


def _error(estimate: Array, points: Array) -> float:
    return 100.0 * compare_points(estimate, points[:, 2]).mean_relative


def _record(plan: Plan, way: str, error: float, detail: str) -> Record:
    common: dict[str, Any] = {"experiment": EXPERIMENT, "quantity": ERROR, "unit": ERROR_UNIT, "size": 0, "images": 1}
    return Record.of([error], workload=way, precision=plan.precision, detail=detail, **common)
