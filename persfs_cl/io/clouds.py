"""PLY files: clouds of points, read by trimesh, and written with normals, which it leaves out; and triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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
    columns = (column for values in (points, normals, colours) for column in values.T)
    _write(path, _table(dict(zip(_PROPERTIES, columns, strict=True))))


def write_triangles(
    path: FilePath, vertices: Array, faces: NDArray[np.integer[Any]], colours: NDArray[np.uint8] | None
) -> None:
    """Write triangles, in the binary form, with coordinates in single precision.

    Parameters
    ----------
    path : path
    vertices : ndarray of float64, shape (vertices, 3)
    faces : ndarray of int, shape (faces, 3)
    colours : ndarray of uint8, shape (vertices, 3), or None

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    columns: dict[str, NDArray[Any]] = dict(zip("xyz", vertices.T, strict=True))
    if colours is not None:
        columns |= zip(("red", "green", "blue"), colours.T, strict=True)
    corners = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    corners["count"], corners["corners"] = 3, faces
    _write(path, _table(columns), corners)


def _table(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.void]:
    """What is said of each point, by the names of it."""
    count = len(next(iter(columns.values())))
    table = np.empty(count, [(name, f"<{_PROPERTIES[name]}") for name in columns])
    for name, column in columns.items():
        table[name] = column
    return table


def _write(path: FilePath, points: NDArray[np.void], faces: NDArray[np.void] | None = None) -> None:
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment camera axes: x right, y down, z forward",
        f"element vertex {len(points)}",
        *(f"property {_TYPES[_PROPERTIES[name]]} {name}" for name in points.dtype.names or ()),
    ]
    if faces is not None:
        header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    text = "".join(f"{line}\n" for line in [*header, "end_header"])
    with atomic_path(path) as temporary:
        _put(temporary, text, [table for table in (points, faces) if table is not None])


def _put(path: Path, text: str, tables: Sequence[NDArray[np.void]]) -> None:
    with path.open("wb") as file:
        file.write(text.encode("ascii"))
        for table in tables:
            file.write(table.data)
