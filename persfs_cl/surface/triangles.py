"""A mesh as plain arrays: all that a file of triangles takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Triangles:
    """Points in space, the triangles between them, and perhaps their colours.

    Attributes
    ----------
    vertices : ndarray of float64, shape (n, 3)
    faces : ndarray of int, shape (m, 3)
        Indices of vertices.
    colours : ndarray of uint8, shape (n, 3), or None
        Red, green and blue of each vertex.
    """

    vertices: Array
    faces: NDArray[np.integer[Any]]
    colours: NDArray[np.uint8] | None

    def mesh(self) -> trimesh.Trimesh:
        """The same as trimesh has it, whose import takes longer than the mesh of most photographs."""
        import trimesh

        return trimesh.Trimesh(
            self.vertices, self.faces.astype(np.int64, copy=False), vertex_colors=self.colours, process=False
        )
