"""Scanned objects as ground truth: a triangle mesh as a pinhole camera sees it, and the photograph of it."""

from __future__ import annotations

import importlib.metadata
import io
import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.checks import check_choice, check_finite, check_positive
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.io.files import FilePath, read_bytes
from persfs_cl.scenes.exposure import Exposure, square_camera
from persfs_cl.scenes.scene import Scene
from persfs_cl.scenes.view import MeshView, mesh_view, require_mesh
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z"]
# Rows are the camera's axes (x right, y down, z forward) in those of the mesh.
_FRONT_VIEW = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}


def stanford_bunny() -> Path:
    """Where the Stanford bunny lies, 99 785 triangles with the z axis up, in the package pymeshfix.

    Made from range scans by the Stanford Computer Graphics Laboratory, https://graphics.stanford.edu/data/3Dscanrep,
    which allows use for research, free redistribution, and pictures in scholarly works with credit to the laboratory,
    and reserves commercial use. Only the file is read: none of the package's code (GPL) runs.

    Returns
    -------
    Path
        A PLY file for :func:`mesh_scene`, with ``up="z"``.

    Raises
    ------
    InputError
        When the package is not installed.

    Examples
    --------
    >>> from persfs_cl.scenes import stanford_bunny
    >>> stanford_bunny().name
    'StanfordBunny.ply'
    """
    try:
        package = importlib.metadata.distribution("pymeshfix")
    except importlib.metadata.PackageNotFoundError as error:
        raise InputError("The Stanford bunny comes in the package pymeshfix, which is missing: install it.") from error
    return Path(str(package.locate_file("pymeshfix/examples/StanfordBunny.ply")))


def mesh_scene(
    mesh: trimesh.Trimesh | FilePath,
    shape: tuple[int, int] = (540, 540),
    *,
    up: Up = "y",
    turn: float = 0.0,
    focal_length: float | tuple[float, float] | None = None,
    distance: float = 1.0,
    margin: float = 0.05,
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    bits: int | None = None,
    noise: float = 0.0,
    seed: int = 0,
) -> Scene:
    """Photograph of an object that is given as a triangle mesh, in front of nothing.

    The object stands upright, the middle of its bounding box on the optical axis, as large as the view allows. Depth
    is exact at the pixel centres: :func:`mesh_view`. The image is that of the depth map and not of the facets, whose
    edges no depth map shows: its slopes are central differences of ln z within the object, one-sided at its outline
    and next to jumps. No part casts a shadow on another, which is exact for a flash at the optical centre.

    Parameters
    ----------
    mesh : trimesh.Trimesh or path
        Faces that meet must share their vertices. A file is one that trimesh reads: PLY, STL, OBJ, OFF, glTF.
    shape : tuple of int
        (height, width) in pixels, at least 3 × 3.
    up : {"y", "z"}
        Axis of the mesh that points up. ``turn=0`` shows the side to which +z points, or -y when z is up.
    turn : float
        Turns the object about its vertical axis, in degrees, counter-clockwise as seen from above.
    focal_length : float, tuple of float or None
        In pixels, f or (fx, fy); None = the image width, a view of 53°.
    distance : float
        Depth of the middle of the object. It sets the unit of depth and nothing else: the object is scaled to fit.
    margin : float
        Share of the image that stays free on every side, at least 0 and below 0.5.
    light, reflectance, bits, noise, seed
        As for :func:`persfs_cl.vase`. Noise stays on the object: the background is 0.

    Returns
    -------
    Scene
        ``mask`` is True on the object, but for pixels that are alone along x or y, whose depth tells no slope; depth
        and slopes are NaN elsewhere. ``walls`` holds the jumps of the depth inside the mask. ``known_depth`` is given
        where no neighbour that the pixel is joined to is nearer: on the peaks, and where an outline cuts a slope. The
        surface goes away from there. Under an oblique parallel light nearer means along its rays.

    Raises
    ------
    InputError
        When an argument is out of its range, the file cannot be read, or there is no mesh to see.
    CameraError
        When the focal length is impossible.

    Examples
    --------
    >>> import trimesh
    >>> import persfs_cl as ps
    >>> scene = ps.mesh_scene(trimesh.creation.icosphere(subdivisions=2), (20, 20), light=ps.FlashLight())
    >>> scene.image.shape, bool(scene.mask[10, 10]), bool(scene.mask[0, 0])
    ((20, 20), True, False)
    """
    import trimesh

    exposure = Exposure(light, reflectance, bits, noise, seed)
    check_choice("up", up, Up)
    check_finite("turn", turn)
    check_finite("margin", margin)
    if not 0 <= margin < 0.5:
        raise InputError.about("margin", margin, "leaves no image: give at least 0 and less than 0.5.")
    check_positive("distance", distance)
    camera = square_camera(shape, focal_length)
    grid = camera.grid(shape)

    name = "mesh"
    if isinstance(mesh, (str, os.PathLike)):
        name, mesh = Path(mesh).stem, _load(mesh)
    angle = np.radians(turn)
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]]) @ _FRONT_VIEW[up]
    reach = (0.5 - margin) * np.array([shape[1] * grid.dx, shape[0] * grid.dy])
    require_mesh(mesh)
    vertices = _fitted(np.asarray(mesh.vertices) @ turned.T, reach) * distance

    view = _trimmed(mesh_view(trimesh.Trimesh(vertices, mesh.faces, process=False), camera, shape))
    mask = np.isfinite(view.depth)
    if not mask.any():
        raise InputError.about("shape", shape, f"is too small to show the mesh {name!r}: give more pixels.")
    (left, right), (above, below) = view.differences(np.log(view.depth))
    p, q = _mean(left, right) / grid.dx, _mean(above, below) / grid.dy
    x, y = np.broadcast_arrays(grid.x, grid.y)
    image = np.zeros(shape)
    on_object = PixelGrid(x[mask], y[mask], grid.dx, grid.dy)
    image[mask] = exposure.of(view.depth[mask], (p[mask], q[mask]), on_object)

    p0, q0 = exposure.tilt
    (left, right), (above, below) = view.differences(view.depth * (1 + grid.x * p0 + grid.y * q0))
    # A difference that does not exist is NaN, and neither above nor below 0.
    nearest = ~(left > 0) & ~(right < 0) & ~(above > 0) & ~(below < 0)
    return Scene(
        depth=view.depth,
        image=image,
        camera=camera,
        mask=mask,
        known_depth=np.where(nearest, view.depth, np.nan),
        log_depth_gradient=(p, q),
        light=light,
        reflectance=reflectance,
        surface="away",
        name=name,
        walls=view.walls,
    )


def _load(path: FilePath) -> trimesh.Trimesh:
    import trimesh

    data = read_bytes(path)
    try:
        return trimesh.load_mesh(io.BytesIO(data), file_type=Path(path).suffix[1:])
    except Exception as error:  # whatever a loader raises at broken data
        raise InputError(f"{path} cannot be read as a triangle mesh ({error}): give a PLY, STL or OBJ file.") from error


def _fitted(vertices: Array, reach: Array) -> Array:
    """The object scaled about its middle, which comes to depth 1, until it touches |x| = reach or |y| = reach."""
    centred = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    # Scaled by s a vertex is seen at s X / (1 + s Z), which is the reach at s = reach / (X - Z reach).
    inverse_scale = (np.abs(centred[:, :2]) / reach - centred[:, 2:]).max()
    if not 0 < inverse_scale < np.inf:
        raise InputError(f"The mesh spans {np.ptp(vertices, axis=0)}: give one that has a finite extent.")
    return np.asarray(centred / inverse_scale + (0.0, 0.0, 1.0))


def _trimmed(view: MeshView) -> MeshView:
    """The view less the pixels that are alone along one of the axes, whose depth tells no slope there."""
    depth = view.depth.copy()
    while True:
        (left, right), (above, below) = view.differences(depth)
        alone = (np.isnan(left) & np.isnan(right)) | (np.isnan(above) & np.isnan(below))
        if np.isnan(depth[alone]).all():
            return replace(view, depth=depth)
        depth[alone] = np.nan


def _mean(backward: Array, forward: Array) -> Array:
    """Mean of the two differences, or whichever exists; NaN where neither does."""
    existing = np.isfinite(backward).astype(np.float64) + np.isfinite(forward)
    total = np.nan_to_num(backward) + np.nan_to_num(forward)
    return np.asarray(np.divide(total, existing, out=np.full(total.shape, np.nan), where=existing > 0))
