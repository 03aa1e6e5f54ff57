"""From a depth map to a triangle mesh: which pixels are joined, and the triangles between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.checks import as_array
from persfs_cl.errors import InputError
from persfs_cl.surface.geometry import Discontinuities, depth_array
from persfs_cl.surface.triangles import Triangles

if TYPE_CHECKING:
    import trimesh


def mesh(
    depth: ArrayLike, camera: Camera, colour: ArrayLike | None = None, discontinuities: Discontinuities | None = None
) -> trimesh.Trimesh:
    """Triangle mesh through the surface points of the finite pixels.

    Four finite pixels of a square make two triangles, three make one; no face spans a NaN pixel or a cut. A
    pixel with no such square (all of them in an image one pixel wide) is a vertex without a face.

    Parameters
    ----------
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    camera : Camera
    colour : array_like of uint8, shape (height, width, 3) or (height, width), optional
        RGB or grey colour of every pixel.
    discontinuities : Discontinuities, optional
        Where the surface is interrupted: no triangle has an edge across, neither along a row or column nor along a
        diagonal, whose ends must be joined by way of the triangle's third corner.

    Returns
    -------
    trimesh.Trimesh
        Vertices in camera axes (x right, y down, z forward) in the units of ``depth``, one per finite
        pixel in row-major order. Faces are wound so that their normals point to the camera.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map (see `depth_array`) or holds no finite pixel, or when
        ``colour`` is not a uint8 image of the same size, or the discontinuities are not for that size.
    """
    return mesh_triangles(depth, camera, colour, discontinuities).mesh()


def mesh_triangles(
    depth: ArrayLike, camera: Camera, colour: ArrayLike | None = None, discontinuities: Discontinuities | None = None
) -> Triangles:
    """What :func:`mesh` is made of."""
    z = depth_array(depth)
    finite = ~np.isnan(z)
    if not finite.any():
        raise InputError(f"depth of shape {finite.shape} is NaN everywhere: a mesh needs at least one finite pixel.")
    height, width = z.shape
    grid = camera.grid((height, width))
    vertices = np.empty((np.count_nonzero(finite), 3))
    vertices[:, 2] = z[finite]
    for axis, direction in enumerate((grid.x, grid.y)):
        np.multiply(vertices[:, 2], np.broadcast_to(direction, z.shape)[finite], out=vertices[:, axis])
    colours = None if colour is None else rgb(colour, finite.shape)[finite]
    return Triangles(vertices, _faces(finite, discontinuities), colours)


def _faces(finite: Mask, discontinuities: Discontinuities | None) -> NDArray[np.int64]:
    """Triangles of every 2x2 square with three joined pixels, as indices of the finite pixels."""
    along_rows, along_columns = joined(finite, discontinuities)
    found = []
    before = 0
    for rows in row_blocks(finite.shape):
        near = slice(rows.start, rows.stop + 1)
        present = finite[near]
        # Where there is no finite pixel this is the index of the one before, which no triangle takes.
        vertex = (np.cumsum(present, dtype=np.int32) + np.int32(before - 1)).reshape(present.shape)
        before += int(np.count_nonzero(finite[rows]))
        found.append(triangles(vertex, along_rows[near], along_columns[rows]))
    return np.concatenate(found, dtype=np.int64)


def joined(finite: Mask, discontinuities: Discontinuities | None) -> tuple[Mask, Mask]:
    """Where the surface goes on from a pixel to the next in its row, and to the next in its column.

    Parameters
    ----------
    finite : ndarray of bool, shape (height, width)
        Pixels of the surface.
    discontinuities : Discontinuities, optional

    Returns
    -------
    along_rows : ndarray of bool, shape (height, width - 1)
    along_columns : ndarray of bool, shape (height - 1, width)

    Raises
    ------
    InputError
        When the discontinuities are not for that size.
    """
    along_rows, along_columns = finite[:, :-1] & finite[:, 1:], finite[:-1] & finite[1:]
    if discontinuities is not None:
        discontinuities.check(finite.shape)
        along_rows &= ~discontinuities.right
        along_columns &= ~discontinuities.down
    return along_rows, along_columns


def triangle_count(along_rows: Mask, along_columns: Mask) -> int:
    """How many triangles :func:`triangles` makes of what is joined."""
    return sum(int(np.count_nonzero(wanted)) for wanted in _corners(along_rows, along_columns))


def triangles(
    vertex: NDArray[np.int32], along_rows: Mask, along_columns: Mask, squares: Mask | None = None
) -> NDArray[np.int32]:
    """Triangles of every 2x2 square with three joined pixels.

    Parameters
    ----------
    vertex : ndarray of int32, shape (height, width)
        Indices of the pixels, of which the triangles are made.
    along_rows, along_columns : ndarray of bool
        What is joined, see :func:`joined`.
    squares : ndarray of bool, shape (height - 1, width - 1), optional
        Which squares; all when not given.

    Returns
    -------
    ndarray of int32, shape (n, 3)
    """
    top_left, top_right = vertex[:-1, :-1], vertex[:-1, 1:]
    bottom_left, bottom_right = vertex[1:, :-1], vertex[1:, 1:]
    kinds = (
        (top_left, bottom_left, top_right),
        (top_right, bottom_left, bottom_right),
        (top_left, bottom_left, bottom_right),
        (top_left, bottom_right, top_right),
    )
    found = []
    for corners, there in zip(kinds, _corners(along_rows, along_columns), strict=True):
        wanted = there if squares is None else there & squares
        found.append(np.stack([corner[wanted] for corner in corners], axis=-1))
    return np.concatenate(found)


def _corners(along_rows: Mask, along_columns: Mask) -> tuple[Mask, Mask, Mask, Mask]:
    """Squares with a triangle at the corner top left, bottom right, bottom left, and top right."""
    top, bottom, left, right = along_rows[:-1], along_rows[1:], along_columns[:, :-1], along_columns[:, 1:]
    at_top_left, at_bottom_right = top & left, bottom & right
    # The last two use the other diagonal, so each stands alone where the others are missing.
    neither = ~(at_top_left | at_bottom_right)
    return at_top_left, at_bottom_right, bottom & left & neither, top & right & neither


def rgb(colour: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """Grey or RGB pixels as RGB."""
    pixels = as_array("colour", colour)
    if pixels.dtype != np.uint8 or pixels.shape not in (shape, (*shape, 3)):
        raise InputError(
            f"colour has shape {pixels.shape} and type {pixels.dtype}: "
            f"give uint8 pixels of shape {shape} or {(*shape, 3)}, the size of the depth."
        )
    return pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=-1)
