"""Clouds of points in PLY files, read by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import opened
from persfs_cl.io.remarks import decoding


def read_cloud(path: Path) -> Array:
    """The points, or the vertices, of a PLY file.

    Returns
    -------
    ndarray of float64, shape (points, 3)

    Raises
    ------
    InputError
        When it cannot be read, or has no point.
    """
    import trimesh  # slow

    with opened(path) as file, decoding(path):
        loaded = trimesh.load(file, file_type="ply", process=False)
        points = np.asarray(getattr(loaded, "vertices", np.empty((0, 3))), np.float64)
    if points.ndim != 2 or points.shape[0] == 0 or points.shape[1] != 3:
        raise InputError(f"{path} holds no point: give a PLY file with vertices x, y, z.")
    return points
