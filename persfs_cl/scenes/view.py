"""What a pinhole camera sees of a triangle mesh: the exact depth at each pixel, and where it jumps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError

if TYPE_CHECKING:
    import trimesh

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

    Examples
    --------
    >>> import trimesh
    >>> import persfs_cl as ps
    >>> from persfs_cl.scenes import mesh_view
    >>> ball = trimesh.creation.icosphere(subdivisions=2, radius=0.25)
    >>> ball.apply_translation((0.0, 0.0, 1.0))
    <trimesh.Trimesh(vertices.shape=(162, 3), faces.shape=(320, 3))>
    >>> view = mesh_view(ball, ps.Camera(focal_length=20.0), (20, 20))
    >>> view.depth.shape, bool(view.jump_right.any())
    ((20, 20), False)
    """

    depth: Array
    jump_right: Mask
    jump_down: Mask

    def __repr__(self) -> str:
        height, width = self.depth.shape
        seen = np.count_nonzero(np.isfinite(self.depth))
        jumps = np.count_nonzero(self.jump_right) + np.count_nonzero(self.jump_down)
        return f"<MeshView, {seen} of {width} x {height} pixels, {jumps} jumps>"

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
        """Backward and forward difference of `values` along x and along y, NaN across a jump or the outline.

        Examples
        --------
        >>> import numpy as np
        >>> from persfs_cl.scenes import MeshView
        >>> depth = np.array([[1.0, 1.5, 4.0], [1.0, 1.5, 4.0]])
        >>> jump_right = np.array([[False, True], [False, True]])
        >>> view = MeshView(depth, jump_right, np.zeros((1, 3), bool))
        >>> (left, right), (above, below) = view.differences(depth)
        >>> right
        array([[0.5, nan, nan],
               [0.5, nan, nan]])
        """
        along_x = _differences(values, self.jump_right)
        backward, forward = _differences(values.T, self.jump_down.T)
        return along_x, (backward.T, forward.T)


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

    Examples
    --------
    A square at depth 2, which fills the middle of the image:

    >>> import trimesh
    >>> import persfs_cl as ps
    >>> from persfs_cl.scenes import mesh_view
    >>> corners = [[-1.0, -1.0, 2.0], [1.0, -1.0, 2.0], [1.0, 1.0, 2.0], [-1.0, 1.0, 2.0]]
    >>> square = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
    >>> mesh_view(square, ps.Camera(focal_length=2.0), (2, 4)).depth.round(9)
    array([[nan,  2.,  2., nan],
           [nan,  2.,  2., nan]])
    """
    grid = camera.grid(shape)
    require_mesh(mesh)
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


def require_mesh(mesh: object) -> None:
    """Refuse what is no triangle mesh, or has no face or a vertex that is nowhere."""
    import trimesh

    if not isinstance(mesh, trimesh.Trimesh):
        raise InputError(f"mesh={type(mesh).__name__} is no mesh: give a trimesh.Trimesh, or the path of a file.")
    if not (len(mesh.faces) and np.isfinite(mesh.vertices).all()):
        raise InputError(
            f"The mesh has {len(mesh.faces)} faces and {int((~np.isfinite(mesh.vertices)).sum())} coordinates that are"
            " not finite: give a triangle mesh with at least one face and finite vertices."
        )


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
