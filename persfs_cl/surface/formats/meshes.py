"""Files of triangles and points: meshes, solids to be printed, and a cloud."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.clouds import write_cloud, write_triangles
from persfs_cl.io.files import atomic_path
from persfs_cl.surface.formats.format import Format, Source

if TYPE_CHECKING:
    import trimesh

    from persfs_cl.surface.triangles import Triangles

_Mesh = TypeVar("_Mesh", "Triangles", "trimesh.Trimesh")
_OF_ARRAYS, _MEMORY, _OF_TEXTS = 500, 750, 1300


def _ply(target: Path, source: Source) -> None:
    mesh = _with_faces(source.triangles)
    write_triangles(target, mesh.vertices, mesh.faces, mesh.colours)


def _mesh(target: Path, source: Source) -> None:
    mesh = _with_faces(source.mesh)
    with atomic_path(target) as temporary:
        mesh.export(temporary)


def _with_faces(mesh: _Mesh) -> _Mesh:
    """A mesh that has a triangle: what opens files of meshes shows nothing of others.

    Raises
    ------
    InputError
        When it has none.
    """
    if not len(mesh.faces):
        raise InputError(
            "no three neighbouring pixels have a depth, so that there is no triangle: give a mask that is wider than a "
            "pixel, or take points.ply, which needs none."
        )
    return mesh


def _solid(target: Path, source: Source) -> None:
    with atomic_path(target) as temporary:
        source.solid.export(temporary)


def _scene(target: Path, source: Source) -> None:
    """As glTF has it: y up, z toward the viewer, and the photograph as a texture."""
    import trimesh
    from PIL import Image

    mesh, visual = _with_faces(source.mesh), cast("Any", trimesh.visual)  # typed in part
    with atomic_path(target) as temporary:
        material = visual.material.PBRMaterial(
            baseColorTexture=Image.fromarray(source.rgb), metallicFactor=0.0, roughnessFactor=1.0
        )
        places = _texture_places(np.asarray(mesh.vertices), source)
        trimesh.Trimesh(
            mesh.vertices * (1.0, -1.0, -1.0),
            mesh.faces,
            visual=visual.TextureVisuals(uv=places, material=material),
            process=False,
        ).export(temporary)


def _texture_places(vertices: NDArray[np.float64], source: Source) -> NDArray[np.float64]:
    """Where the photograph shows points: from 0 to 1 over its pixels' outer edges, to the right and up."""
    (height, width), camera = source.shape, source.solution.camera
    column, row = camera.centre(source.shape)
    x, y, z = vertices.T
    across = (camera.fx * x / z + column + 0.5) / width
    down = (camera.fy * y / z + row + 0.5) / height
    return np.stack([across, 1.0 - down], axis=-1)


def _cloud(target: Path, source: Source) -> None:
    surface = source.solution
    there = surface.solved
    write_cloud(target, surface.points()[there], source.derived.normals[there], source.rgb[there])


def _of_block(source: Source) -> dict[str, float | str]:
    return {"width": source.block.width, "base": source.block.base, "unit": "mm"}


CLOUDS = (Format("points.ply", _cloud, ("points",)),)
MESHES = (
    Format("mesh.ply", _ply, ("mesh",), "mesh", alone=True, memory=_OF_ARRAYS),
    Format("mesh.obj", _mesh, (), "mesh", alone=True, memory=_OF_TEXTS),
    Format("mesh.stl", _mesh, (), "mesh", alone=True, memory=_MEMORY),
    Format("mesh.glb", _scene, (), "mesh", alone=True, memory=_MEMORY),
    Format("solid.stl", _solid, ("solid",), "solid", about=_of_block, memory=_OF_TEXTS),
    Format(
        "solid.3mf",
        _solid,
        (),
        "solid",
        alone=True,
        about=_of_block,
        memory=2 * _OF_TEXTS,
        # What trimesh writes the file with.
        packages=("lxml", "networkx"),
        extra="print",
    ),
)
