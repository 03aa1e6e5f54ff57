"""Simple meshes, and how they are turned, for the tests of scenes."""

from __future__ import annotations

import numpy as np
import trimesh

from persfs_cl.arrays import Array


def rotation(angle: float, axis: tuple[float, float, float]) -> Array:
    return np.asarray(trimesh.transformations.rotation_matrix(angle, axis))  # type: ignore[no-untyped-call]


def strip(*profile: tuple[float, float], half_height: float = 9.0) -> trimesh.Trimesh:
    """A profile in (x, z) pulled along y."""
    points = np.array([(x, y, z) for x, z in profile for y in (-half_height, half_height)])
    starts = range(0, len(points) - 2, 2)
    faces = [(at + one, at + other, at + 2) for at in starts for one, other in ((0, 1), (1, 3))]
    return trimesh.Trimesh(points, faces, process=False)


def plate(half_width: float, half_height: float, depth: float) -> trimesh.Trimesh:
    corners = [(x * half_width, y * half_height, depth) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False)
