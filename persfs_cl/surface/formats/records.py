"""What a later reader needs of a run: a report for people and programs, and the arrays that `persfs_cl.load` reads.

The report says in words and numbers what was done. What is as large as the image, and what JSON has no number for, is
in the arrays.
"""

from __future__ import annotations

import math
import platform
import zlib
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.io.export import write_arrays, write_json
from persfs_cl.lens.distortion import told
from persfs_cl.shading.stated import stated
from persfs_cl.surface.formats.format import Format, Source
from persfs_cl.surface.outcome import Outcome
from persfs_cl.surface.solved import Derived

ARRAYS, REPORT, CAMERA = "solution.npz", "report.json", "camera.json"

MASKS = ("unreached", "clamped", "at_bound")
"""Those of a surface that its depth does not tell."""


def report_of(solution: Outcome, derived: Derived) -> dict[str, Any]:
    """The report of :meth:`persfs_cl.Solution.report` from what is at hand of the surface."""
    grey, confidence = derived.prepared_residual, derived.confidence
    height, width = solution.depth.shape
    return {
        "status": solution.status.name,
        "meaning": solution.status.value,
        "iterations": solution.iterations,
        "changes": solution.changes.tolist(),
        "distance": None if math.isnan(solution.distance) else solution.distance,
        "pixels": {
            "all": solution.depth.size,
            "solved": int(np.count_nonzero(solution.solved)),
            "unreached": int(np.count_nonzero(solution.unreached)),
            "clamped": int(np.count_nonzero(solution.clamped)),
            "at_bound": int(np.count_nonzero(solution.at_bound)),
            "walls": 0 if solution.walls is None else int(np.count_nonzero(solution.walls)),
            "walls_solved": 0 if solution.walls is None else int(np.count_nonzero(solution.walls & solution.solved)),
        },
        "guide": None if solution.guide is None else solution.guide.report(),
        "depth": derived.depths,
        "grey_levels": {
            "compared_with": "the prepared image",
            "mean_error": grey.mean,
            "root_mean_square": grey.root_mean_square,
        },
        "confidence": confidence.report(),
        "seconds": asdict(solution.elapsed),
        "parameters": {
            "camera": _stated(solution.camera),
            "focal_length": [solution.camera.fx, solution.camera.fy],
            "principal_point": list(solution.camera.centre((height, width))),
            "taken_by": None
            if (taken := solution.taken_by) is None
            else {"camera": _stated(taken.camera), "shape": list(taken.shape), "outlined": taken.outlined},
            "light": stated(solution.light),
            "reflectance": stated(solution.reflectance),
            **solution.parameters,
        },
        "device": {
            "name": solution.device.name,
            "platform": solution.device.platform,
            "platform_version": solution.device.platform_version,
            "driver_version": solution.device.driver_version,
        },
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("persfs-cl", "pyopencl", "numpy")},
        },
    }


def _stated(camera: Camera) -> dict[str, Any]:
    """What a report says of a camera, of which :func:`persfs_cl.load` makes the same again."""
    lens = camera.distortion
    return {
        "focal_length": camera.focal_length,
        "principal_point": camera.principal_point,
        "distortion": None if lens is None else dict(zip(("model", "coefficients"), told(lens), strict=True)),
    }


def fingerprint(depth: Array) -> int:
    """Of a depth map, by which files of one surface are told from those of another."""
    return zlib.crc32(np.ascontiguousarray(depth).data)


def _arrays(solution: Outcome) -> dict[str, NDArray[Any]]:
    """All of a solution that depth and report do not tell."""
    maps = {"image": solution.image, "albedo": solution.albedo}
    bits = {name: getattr(solution, name) for name in MASKS} | {"walls": solution.walls}
    if solution.discontinuities is not None:
        bits |= {"cut_right": solution.discontinuities.right, "cut_down": solution.discontinuities.down}
    if solution.guide is not None:
        maps["departure"] = solution.guide.departure
    return {
        "fingerprint": np.array(fingerprint(solution.depth)),
        "changes": solution.changes,
        "distance": np.array(solution.distance),
        # Which no other run takes: the report of another is told by it.
        "seconds": np.array(solution.elapsed.total),
        **{name: _single(values) for name, values in maps.items() if values is not None},
        **{name: np.packbits(pixels) for name, pixels in bits.items() if pixels is not None},
    }


def _single(values: Array) -> NDArray[Any]:
    """In single precision, far finer than any photograph, if it has such numbers."""
    narrow = np.empty(values.shape, np.float32)
    with np.errstate(over="ignore", under="ignore"):
        for rows in row_blocks((values.shape[0], values.shape[1])):
            wide = values[rows]
            narrow[rows] = wide
            if (np.abs(narrow[rows] - wide) > 1e-6 * np.abs(wide)).any():
                return values
    return narrow


def _write_report(target: Path, source: Source) -> None:
    write_json(target, report_of(source.solution, source.derived), source.report())


def _write_camera(target: Path, source: Source) -> None:
    taken = source.solution.taken_by
    own = _calibration(source.solution.camera, source.shape)
    photo = {} if taken is None else {"photo": _calibration(taken.camera, taken.shape)}
    write_json(target, {**own, "axes": "x to the right, y down, z forward; pixels are centred on integers"}, photo)


def _calibration(camera: Camera, shape: tuple[int, int]) -> dict[str, Any]:
    """What a file says of the camera of an image of shape (height, width), as :meth:`Camera.from_file` reads it."""
    column, row = camera.centre(shape)
    model, coefficients = ("none", ()) if camera.distortion is None else told(camera.distortion)
    return {
        "image_width": shape[1],
        "image_height": shape[0],
        "camera_matrix": [[camera.fx, 0.0, column], [0.0, camera.fy, row], [0.0, 0.0, 1.0]],
        "distortion_model": model,
        "distortion_coefficients": list(coefficients),
    }


RECORDS = (
    Format(CAMERA, _write_camera, ("depth",)),
    Format(ARRAYS, lambda target, source: write_arrays(target, _arrays(source.solution)), ("solution",)),
    Format(REPORT, _write_report, ("report", "solution"), alone=True),
)
