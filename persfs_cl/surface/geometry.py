"""From a depth map to the surface it describes: points, normals and a triangle mesh.

Everything is in camera axes, x right, y down, z forward, in the units of the depth. Pixels where the
depth is NaN are not part of the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.checks import as_array
from persfs_cl.errors import InputError
from persfs_cl.maps import as_depth
from persfs_cl.surface.triangles import Triangles

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Discontinuities:
    """Where a surface is interrupted between neighbouring pixels, as by a jump of the depth.

    Attributes
    ----------
    right : ndarray of bool, shape (height, width - 1)
        True between a pixel and the next one to the right.
    down : ndarray of bool, shape (height - 1, width)
        True between a pixel and the next one below.

    Examples
    --------
    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> walls = np.zeros(scene.image.shape, bool)
    >>> walls[10, 5:15] = True
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light, walls=walls)
    >>> solution.discontinuities.right.shape, solution.discontinuities.down.shape
    ((20, 19), (19, 20))
    """

    right: NDArray[np.bool_]
    down: NDArray[np.bool_]

    def __repr__(self) -> str:
        height, width = len(self.right), self.down.shape[-1]
        right, down = np.count_nonzero(self.right), np.count_nonzero(self.down)
        return f"<Discontinuities, {width} x {height} pixels, {right} to the right, {down} below>"

    @classmethod
    def none(cls, shape: tuple[int, ...]) -> Discontinuities:
        """No cut yet in an image of a shape (height, width).

        Examples
        --------
        >>> from persfs_cl.surface.geometry import Discontinuities
        >>> Discontinuities.none((20, 30))
        <Discontinuities, 30 x 20 pixels, 0 to the right, 0 below>
        """
        height, width = shape
        return cls(np.zeros((height, width - 1), dtype=bool), np.zeros((height - 1, width), dtype=bool))

    def check(self, shape: tuple[int, ...]) -> None:
        """Raise InputError when these are none of an image of a shape (height, width).

        Examples
        --------
        >>> from persfs_cl.surface.geometry import Discontinuities
        >>> Discontinuities.none((20, 30)).check((20, 30))
        """
        height, width = shape
        for name, cut, size in (("right", self.right, (height, width - 1)), ("down", self.down, (height - 1, width))):
            if cut.dtype != bool or cut.shape != size:
                raise InputError(
                    f"discontinuities.{name} is {cut.dtype} of shape {cut.shape}: give bool of shape {size}, for a "
                    f"depth of shape {(height, width)}."
                )


def depth_array(depth: ArrayLike) -> Array:
    """Depth map as a float64 array, checked.

    Parameters
    ----------
    depth : array_like, shape (height, width)
        Depth along the optical axis, from 1e-30 to 1e30; NaN where there is no surface.

    Returns
    -------
    ndarray of float64, shape (height, width)

    Raises
    ------
    InputError
        When the array is not two-dimensional, has no pixels, or holds a depth out of that range.
    """
    return as_depth("depth", depth)


def points(depth: ArrayLike, camera: Camera) -> Array:
    """Surface point of every pixel, z (x, y, 1).

    Parameters
    ----------
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    camera : Camera

    Returns
    -------
    ndarray of float64, shape (height, width, 3)
        Camera axes (x right, y down, z forward) in the units of ``depth``; NaN where ``depth`` is NaN.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map, see `depth_array`.
    """
    z = depth_array(depth)
    grid = _grid(z, camera)
    found = np.empty((*z.shape, 3))
    np.multiply(z, grid.x, out=found[..., 0])
    np.multiply(z, grid.y, out=found[..., 1])
    found[..., 2] = z
    return found


def log_depth_gradient(
    depth: ArrayLike, camera: Camera, discontinuities: Discontinuities | None = None
) -> tuple[Array, Array]:
    """Slopes p = dZ/dx and q = dZ/dy of the log depth Z = ln z in normalised image coordinates.

    Central differences; one-sided where one neighbour is NaN, outside the image or beyond a cut; 0 along an axis on
    which a pixel has no neighbour.

    Parameters
    ----------
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    camera : Camera
    discontinuities : Discontinuities, optional
        Where the surface is interrupted; nowhere but at NaN when not given.

    Returns
    -------
    p, q : ndarray of float64, shape (height, width)
        NaN where ``depth`` is NaN.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map, see `depth_array`, or the discontinuities have another shape.
    """
    z = depth_array(depth)
    p, q = np.empty_like(z), np.empty_like(z)
    for rows, *slopes in _slopes(z, _grid(z, camera), discontinuities):
        p[rows], q[rows] = slopes
    return p, q


def _grid(z: Array, camera: Camera) -> PixelGrid:
    height, width = z.shape
    return camera.grid((height, width))


def _slopes(z: Array, grid: PixelGrid, discontinuities: Discontinuities | None) -> Iterator[tuple[slice, Array, Array]]:
    """Some rows at a time, and the slopes along x and y there."""
    if discontinuities is not None:
        discontinuities.check(z.shape)
    for rows in row_blocks(z.shape):
        near = slice(max(rows.start - 1, 0), min(rows.stop + 1, len(z)))
        within = slice(rows.start - near.start, rows.stop - near.start)
        log_depth = np.log(z[near])
        right, down = (
            (None, None)
            if discontinuities is None
            else (discontinuities.right[rows], discontinuities.down[near.start : near.stop - 1].T)
        )
        yield rows, _slope(log_depth[within], grid.dx, right), _slope(log_depth.T, grid.dy, down).T[within]


def _slope(values: Array, spacing: float, cut: Mask | None) -> Array:
    """Along rows, the mean of backward and forward difference, or whichever of the two exists."""
    height, width = values.shape
    # Columns are given as the rows of a transposed array: all others lie in the memory as that does.
    order: Literal["C", "F"] = "C" if values.flags.c_contiguous else "F"
    steps = np.zeros((height, width + 1), order=order)
    inner = steps[:, 1:-1]
    np.subtract(values[:, 1:], values[:, :-1], out=inner)
    slope: Array
    if cut is None and np.isfinite(inner).all():
        slope = steps[:, :-1] + steps[:, 1:]
        slope[:, 1:-1] /= 2.0 * spacing
        for end in {0, width - 1}:
            slope[:, end] /= spacing
        if width == 1:
            np.copyto(slope, np.nan, where=np.isnan(values))
        return slope
    exists = np.zeros(steps.shape, bool, order=order)
    if cut is not None:
        inner[cut] = np.nan
    np.isfinite(inner, out=exists[:, 1:-1])
    np.copyto(steps, 0.0, where=~exists)
    slope = steps[:, :-1] + steps[:, 1:]
    slope /= np.where(exists[:, :-1] & exists[:, 1:], 2.0 * spacing, spacing)
    np.copyto(slope, np.nan, where=np.isnan(values))
    return slope


def normals(depth: ArrayLike, camera: Camera, discontinuities: Discontinuities | None = None) -> Array:
    """Unit normal of every pixel, pointing to the camera: (p, q, -w) / S, with w = 1 + x p + y q, eq. (3).

    Parameters
    ----------
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    camera : Camera
    discontinuities : Discontinuities, optional
        As in `log_depth_gradient`.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)
        Camera axes (x right, y down, z forward), so a surface that faces the camera squarely has
        (0, 0, -1); NaN where ``depth`` is NaN. Slopes as in `log_depth_gradient`.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map, see `depth_array`, or the discontinuities have another shape.
    """
    z = depth_array(depth)
    return _normals(z, _grid(z, camera), discontinuities)


def _normals(z: Array, grid: PixelGrid, discontinuities: Discontinuities | None) -> Array:
    towards_camera = np.empty((*z.shape, 3))
    for rows, *components in normal_blocks(z, grid, discontinuities):
        for axis, component in enumerate(components):
            towards_camera[rows, :, axis] = component
    return towards_camera


def normal_blocks(
    z: Array, grid: PixelGrid, discontinuities: Discontinuities | None
) -> Iterator[tuple[slice, Array, Array, Array]]:
    """Some rows at a time, and the components of the normals there, see `normals`."""
    for rows, *slopes in _slopes(z, grid, discontinuities):
        p, q = slopes
        w = grid.x * p
        w += 1.0
        w += grid.y[rows] * q
        length = p * p
        length += q * q
        length += w * w
        np.sqrt(length, out=length)
        np.negative(w, out=w)
        p /= length
        q /= length
        w /= length
        yield rows, p, q, w


def normals_of_rows(z: Array, camera: Camera, rows: Indices, discontinuities: Discontinuities | None = None) -> Array:
    """The normals of some rows, as `normals` has them, shape (rows, width, 3), without those of all others.

    Parameters
    ----------
    z : ndarray of float64, shape (height, width)
        Depths, checked.
    camera : Camera
    rows : ndarray of int
    discontinuities : Discontinuities, optional
    """
    if discontinuities is not None:
        discontinuities.check(z.shape)
    # Each with the row above and the row below, and cut from all else.
    near = (rows[:, None] + (-1, 0, 1)).reshape(-1)
    inside = (near >= 0) & (near < len(z))
    near = near.clip(0, len(z) - 1)
    depths = z[near]
    depths[~inside] = np.nan
    cuts = Discontinuities.none(depths.shape)
    cuts.down[2::3] = True
    if discontinuities is not None:
        cuts.right[:] = discontinuities.right[near]
        for above in (0, 1):
            there = (inside[:-1] & inside[1:])[above::3]
            cuts.down[above::3][there] = discontinuities.down[near[above:-1:3][there]]
    whole = _grid(z, camera)
    return _normals(depths, PixelGrid(whole.x, whole.y[near], whole.dx, whole.dy), cuts)[1::3]


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
    grid = _grid(z, camera)
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
