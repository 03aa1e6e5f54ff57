"""PLY files, as trimesh reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.visual.color import ColorVisuals

from persfs_cl.io.clouds import read_cloud, write_triangles

VERTICES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 2.5], [0.0, 1.0, 2.0], [1.0, 1.0, -3.0]])
FACES = np.array([[0, 2, 1], [1, 2, 3]], np.int32)
COLOURS = np.array([[255, 0, 1], [2, 3, 4], [5, 6, 7], [8, 9, 255]], np.uint8)


@pytest.mark.parametrize("colours", [COLOURS, None])
@pytest.mark.parametrize("faces", [FACES, FACES[:0], FACES.astype(np.int64)])
def test_triangles_are_what_was_written(faces: np.ndarray, colours: np.ndarray | None, tmp_path: Path) -> None:
    path = tmp_path / "mesh.ply"
    write_triangles(path, VERTICES, faces, colours)
    np.testing.assert_array_equal(read_cloud(path), VERTICES)
    if len(faces):
        mesh = trimesh.load_mesh(path, process=False)
        np.testing.assert_array_equal(mesh.faces, faces)
        if colours is not None:
            assert isinstance(mesh.visual, ColorVisuals)
            np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], colours)
