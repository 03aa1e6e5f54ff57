"""Depth with its camera, as programs for reconstruction from many photographs read it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from persfs_cl.io.export import write_levels
from persfs_cl.io.files import atomic_path, json_text
from persfs_cl.surface.formats.format import Format, Source

_LEVELS = 2**16 - 1


def _colmap_depth(target: Path, source: Source) -> None:
    with atomic_path(target) as temporary:
        height, width = source.shape
        # 0 is no depth there.
        depths = np.nan_to_num(source.solution.depth, nan=0.0).astype("<f4")
        temporary.write_bytes(f"{width}&{height}&1&".encode("ascii") + depths.tobytes())


def _colmap_camera(target: Path, source: Source) -> None:
    (height, width), camera = source.shape, source.solution.camera
    column, row = camera.centre(source.shape)
    # There, the centre of the first pixel is at one half.
    numbers = (camera.fx, camera.fy, column + 0.5, row + 0.5)
    with atomic_path(target) as temporary:
        temporary.write_text(
            "# Camera list with one line of data per camera:\n"
            "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
            "# Number of cameras: 1\n"
            f"1 PINHOLE {width} {height} {' '.join(map(repr, numbers))}\n",
            encoding="ascii",
        )


def _open3d_scale(source: Source) -> float:
    """Levels for a unit of depth: the farthest has the last."""
    farthest = source.derived.depths["max"]
    return 1.0 if farthest is None else _LEVELS / farthest


def _open3d_depth(target: Path, source: Source) -> None:
    scale = _open3d_scale(source)
    levels = np.nan_to_num(np.rint(source.solution.depth * scale), nan=0.0).astype(np.uint16)
    write_levels(target, levels, {"Description": "depth = level / depth_scale", "depth_scale": repr(scale)})


def _open3d_camera(target: Path, source: Source) -> None:
    (height, width), camera = source.shape, source.solution.camera
    column, row = camera.centre(source.shape)
    # Column after column. What it does not know, such as the scale, Open3D passes over.
    says = {
        "width": width,
        "height": height,
        "intrinsic_matrix": [camera.fx, 0.0, 0.0, 0.0, camera.fy, 0.0, column, row, 1.0],
        "depth_scale": _open3d_scale(source),
    }
    with atomic_path(target) as temporary:
        temporary.write_text(json_text(says) + "\n", encoding="ascii")


EXCHANGE = (
    Format("depth.geometric.bin", _colmap_depth, ("colmap",)),
    Format("cameras.txt", _colmap_camera, ("colmap",)),
    Format(
        "open3d-depth.png",
        _open3d_depth,
        ("open3d",),
        about=lambda source: {"depth_scale": _open3d_scale(source)},
    ),
    Format("open3d-camera.json", _open3d_camera, ("open3d",)),
)
