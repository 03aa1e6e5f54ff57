"""Scanned objects as ground truth: a triangle mesh as a pinhole camera sees it, and the photograph of it."""

from __future__ import annotations

import importlib.metadata
import io
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.checks import check_choice, check_finite, check_positive
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, read_bytes
from persfs_cl.scenes.analytic import Photograph, Scene, square_camera
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance

if TYPE_CHECKING:
    import trimesh

Indices = NDArray[np.intp]
Up = Literal["y", "z"]

# Rows are the camera's axes (x right, y down, z forward) in those of the mesh.
_FRONT_VIEW = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
_CANDIDATES = 1 << 18
"""Pairs of triangle and pixel that are looked at together: some 100 MB."""
_ROUNDING = 1e-9
_LEAST_JUMP = 2.0


@dataclass(frozen=True, eq=False)
class MeshView:
    """What one camera sees of a mesh.

    Attributes
    ----------
    depth : ndarray of float64, shape (height, width)
        Depth along the optical axis of the nearest triangle on the ray through each pixel centre; NaN where there is
        none.
    jump_right : ndarray of bool, shape (height, width - 1)
        True where the surface is interrupted between a pixel and the next one to the right: an outline of one part
        of the object hides what lies behind.
    jump_down : ndarray of bool, shape (height - 1, width)
        Likewise for the next pixel below.
    """

    depth: Array
    jump_right: Mask
    jump_down: Mask

    @property
    def walls(self) -> Mask:
        """The nearer pixel of every two with a jump between them, shape (height, width)."""
        walls = np.zeros(self.depth.shape, dtype=bool)
        # Transposed views, so that what is marked there is marked here.
        for depth, jump, marked in (
            (self.depth, self.jump_right, walls),
            (self.depth.T, self.jump_down.T, walls.T),
        ):
            before, after = depth[:, :-1], depth[:, 1:]
            marked[:, :-1] |= jump & (before < after)
            marked[:, 1:] |= jump & (after < before)
        return walls

    def differences(self, values: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Backward and forward difference of `values` along x and along y, NaN across a jump or the outline."""
        along_x = _differences(values, self.jump_right)
        backward, forward = _differences(values.T, self.jump_down.T)
        return along_x, (backward.T, forward.T)


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
    and beside jumps. No part casts a shadow on another, which is exact for a flash at the optical centre.

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
        As for :func:`persfs_cl.scenes.analytic.vase`. Noise stays on the object: the background is 0.

    Returns
    -------
    Scene
        ``mask`` is True on the object, but for pixels that are alone along x or y, whose depth tells no slope; depth
        and slopes are NaN beside it. ``walls`` holds the jumps of the depth inside the mask. ``known_depth`` is given
        where no neighbour that the pixel is joined to is nearer: on the peaks, and where an outline cuts a slope. The
        surface goes away from there. Under an oblique parallel light nearer means along its rays.

    Raises
    ------
    InputError
        When an argument is out of its range, the file cannot be read, or there is no mesh to see.
    CameraError
        When the focal length is impossible.
    """
    import trimesh

    photograph = Photograph(light, reflectance, bits, noise, seed)
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
    _require_mesh(mesh)
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
    image[mask] = photograph.taken(view.depth[mask], (p[mask], q[mask]), on_object)

    p0, q0 = photograph.tilt
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


def mesh_view(mesh: trimesh.Trimesh, camera: Camera, shape: tuple[int, int]) -> MeshView:
    """Depth of a mesh at the pixel centres, exact but for rounding, and where it jumps.

    1 / z is linear in the image over a triangle, so each is filled from its corners. Between two neighbouring pixels
    the depth jumps when it is impossible to go from either to the other over adjacent triangles along the line between
    them: the line leaves the mesh, or comes to an edge where the surface folds back behind itself, or ends on another
    layer of the surface than the one that is seen. A step of less than two pixel widths never counts: at this image
    size it is not to be told from a slope.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        In camera axes (x right, y down, z forward), all of it in front of the camera. Which way its faces are wound
        does not matter.
    camera : Camera
    shape : tuple of int
        (height, width) in pixels.

    Returns
    -------
    MeshView

    Raises
    ------
    InputError
        When it is no mesh, or a vertex is not in front of the camera.
    CameraError
        When the camera does not fit an image of this shape.
    """
    grid = camera.grid(shape)
    _require_mesh(mesh)
    right, down, forward = np.asarray(mesh.vertices, np.float64).T
    if forward.min() <= 0:
        raise InputError(
            f"The mesh has vertices at depths from {forward.min():.3g} to {forward.max():.3g}: move it in front of the"
            " camera, to depths above 0."
        )
    columns = (right / forward - grid.x[0]) / grid.dx
    rows = (down / forward - grid.y[0, 0]) / grid.dy
    faces = np.asarray(mesh.faces)
    triangles = np.stack([columns, rows, 1 / forward], axis=-1)[faces]
    edge_on = _sides(triangles, triangles[:, 0, :2]).sum(axis=-1) == 0
    triangles, faces = triangles[~edge_on], faces[~edge_on]
    inverse, hit = _fill(triangles, shape)
    depth = np.divide(1.0, inverse, out=np.full(shape, np.nan), where=hit >= 0)

    adjacent = _adjacent(faces)
    pixels = np.arange(depth.size).reshape(shape)
    jumps = []
    for before, after, spacing in ((pixels[:, :-1], pixels[:, 1:], grid.dx), (pixels[:-1], pixels[1:], grid.dy)):
        near = np.fmin(depth.flat[before], depth.flat[after])
        jump = np.abs(depth.flat[before] - depth.flat[after]) > _LEAST_JUMP * spacing * near
        one, other = before[jump], after[jump]
        there = _reaches(triangles, adjacent, inverse, hit, one, other)
        back = _reaches(triangles, adjacent, inverse, hit, other, one)
        jump[jump] = ~(there | back)
        jumps.append(jump)
    return MeshView(depth, *jumps)


def _load(path: FilePath) -> trimesh.Trimesh:
    import trimesh

    data = read_bytes(path)
    try:
        return trimesh.load_mesh(io.BytesIO(data), file_type=Path(path).suffix[1:])
    except Exception as error:  # whatever a loader raises at broken data
        raise InputError(f"{path} cannot be read as a triangle mesh ({error}): give a PLY, STL or OBJ file.") from error


def _require_mesh(mesh: object) -> None:
    import trimesh

    if not isinstance(mesh, trimesh.Trimesh):
        raise InputError(f"mesh={type(mesh).__name__} is no mesh: give a trimesh.Trimesh, or the path of a file.")
    if not (len(mesh.faces) and np.isfinite(mesh.vertices).all()):
        raise InputError(
            f"The mesh has {len(mesh.faces)} faces and {int((~np.isfinite(mesh.vertices)).sum())} coordinates that are"
            " not finite: give a triangle mesh with at least one face and finite vertices."
        )


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


def _fill(triangles: Array, shape: tuple[int, int]) -> tuple[Array, Indices]:
    """1 / z of the nearest triangle at every pixel and which one it is; 0 and -1 where there is none.

    `triangles` has shape (n, 3, 3): column, row and 1 / z, corner by corner.
    """
    inverse, hit = np.zeros(shape), np.full(shape, -1, dtype=np.intp)
    limits = np.array([shape[1], shape[0]]) - 1
    low = np.ceil(np.maximum(triangles[..., :2].min(axis=1) - _ROUNDING, 0)).astype(np.intp)
    high = np.floor(np.minimum(triangles[..., :2].max(axis=1) + _ROUNDING, limits)).astype(np.intp)
    width, height = np.maximum(high - low + 1, 0).T
    ends = np.cumsum(width * height)
    total = int(ends[-1]) if ends.size else 0
    for first in range(0, total, _CANDIDATES):
        candidate = np.arange(first, min(first + _CANDIDATES, total))
        which = np.searchsorted(ends, candidate, side="right")
        place = candidate - ends[which] + (width * height)[which]
        at = low[which] + np.stack([place % width[which], place // width[which]], axis=-1)
        weights = _weights(triangles[which], at)
        inside = weights.min(axis=-1) >= -_ROUNDING
        which, (columns, rows) = which[inside], at[inside].T
        value = (weights[inside] * triangles[which, :, 2]).sum(axis=-1)
        # Of several values for one pixel the last one stays: the nearest.
        order = np.argsort(value)
        order = order[value[order] > inverse[rows[order], columns[order]]]
        inverse[rows[order], columns[order]] = value[order]
        hit[rows[order], columns[order]] = which[order]
    return inverse, hit


def _reaches(triangles: Array, adjacent: Indices, inverse: Array, hit: Indices, start: Indices, end: Indices) -> Mask:
    """Whether a straight walk over the surface leads from what is seen at pixels to what is seen at others.

    `start` and `end` are flat indices.
    """
    current, seen = hit.flat[start], inverse.flat[end]
    start, end = (np.stack([at % hit.shape[1], at // hit.shape[1]], axis=-1) for at in (start, end))
    # Along a line a little to the side on which the triangle lies, so as not to come to a triangle's very corner.
    aside = 1e-6 * (triangles[current, :, :2].mean(axis=1) - start) * (start == end)
    reaches = np.zeros(len(start), dtype=bool)
    walking, travelled = np.arange(len(start)), np.full(len(start), -np.inf)
    while walking.size:
        here = triangles[current]
        winding = np.sign(_sides(here, start[walking]).sum(axis=-1, keepdims=True))
        of_start, of_end = (winding * _sides(here, (at + aside)[walking]) for at in (start, end))
        leaving = of_end < of_start
        share = np.divide(of_start, of_start - of_end, out=np.full_like(of_start, np.inf), where=leaving)
        edge, reached = share.argmin(axis=-1), share.min(axis=-1)
        arrived = reached >= 1
        at_end = walking[arrived]
        # The walk may have ended on a layer that another one hides.
        reaches[at_end] = np.isclose(_inverse_depth(here[arrived], end[at_end]), seen[at_end], rtol=1e-6, atol=0.0)
        following = adjacent[current, edge]
        # A triangle that folds back lies behind the edge on which it is entered.
        onward = ~arrived & (following >= 0) & (reached > travelled[walking])
        travelled[walking] = reached
        walking, current = walking[onward], following[onward]
    return reaches


def _adjacent(faces: Indices) -> Indices:
    """For every triangle the one across the edge opposite to each corner, -1 where there is none; shape (n, 3)."""
    edges = np.sort(faces[:, [[1, 2], [2, 0], [0, 1]]], axis=-1).reshape(-1, 2)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=-1)
    one, other = order[:-1][same], order[1:][same]
    adjacent = np.full(len(edges), -1, dtype=np.intp)
    adjacent[one], adjacent[other] = other // 3, one // 3
    return adjacent.reshape(-1, 3)


def _sides(triangles: Array, at: Array | Indices) -> Array:
    """Twice the signed area between a point and the edge opposite to each corner, shape (n, 3)."""
    away = triangles[..., :2] - at[:, None]
    x, y = np.moveaxis(away[:, [1, 2, 0]], -1, 0)
    next_x, next_y = np.moveaxis(away[:, [2, 0, 1]], -1, 0)
    return np.asarray(x * next_y - y * next_x)


def _weights(triangles: Array, at: Indices) -> Array:
    """Barycentric coordinates, shape (n, 3)."""
    sides = _sides(triangles, at)
    return np.asarray(sides / sides.sum(axis=-1, keepdims=True))


def _inverse_depth(triangles: Array, at: Indices) -> Array:
    """1 / z of the planes of triangles, one pixel for each."""
    return np.asarray((_weights(triangles, at) * triangles[..., 2]).sum(axis=-1))


def _differences(values: Array, jump: Mask) -> tuple[Array, Array]:
    """Backward and forward difference along rows."""
    steps = np.diff(values, prepend=np.nan, append=np.nan)
    steps[:, 1:-1][jump] = np.nan
    return steps[:, :-1], steps[:, 1:]


def _mean(backward: Array, forward: Array) -> Array:
    """Mean of the two differences, or whichever exists; NaN where neither does."""
    existing = np.isfinite(backward).astype(np.float64) + np.isfinite(forward)
    total = np.nan_to_num(backward) + np.nan_to_num(forward)
    return np.asarray(np.divide(total, existing, out=np.full(total.shape, np.nan), where=existing > 0))
