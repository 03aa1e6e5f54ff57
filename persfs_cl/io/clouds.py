"""Clouds of points in PLY files: read by trimesh, and written with normals, which it leaves out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, atomic_path, opened
from persfs_cl.io.remarks import decoding

_TYPES = {"f4": "float", "u1": "uchar"}
_PROPERTIES = {
    **dict.fromkeys(("x", "y", "z", "nx", "ny", "nz"), "f4"),
    **dict.fromkeys(("red", "green", "blue"), "u1"),
}
"""Of each point, by the names that all readers know."""


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


def write_cloud(path: FilePath, points: Array, normals: Array, colours: NDArray[np.uint8]) -> None:
    """Write points with normals and colours, in the binary form, with numbers in single precision.

    Parameters
    ----------
    path : path
    points, normals : ndarray of float64, shape (points, 3)
    colours : ndarray of uint8, shape (points, 3)

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    table = np.empty(len(points), [(name, f"<{kind}") for name, kind in _PROPERTIES.items()])
    columns = (column for values in (points, normals, colours) for column in values.T)
    for name, column in zip(_PROPERTIES, columns, strict=True):
        table[name] = column
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment camera axes: x right, y down, z forward",
        f"element vertex {len(table)}",
        *(f"property {_TYPES[kind]} {name}" for name, kind in _PROPERTIES.items()),
        "end_header",
    ]
    with atomic_path(path) as temporary:
        temporary.write_bytes("".join(f"{line}\n" for line in header).encode("ascii") + table.tobytes())
