"""Meshes of few triangles: the grid of pixels thinned where the surface is whole, then quadric decimation.

Everything happens in pixels as the camera sees them: column, row, and the focal length times ln z, which is to depth
what a pixel is to width. An error counts by the pixels that it spans, near or far, in any unit of depth; and a triangle
faces the camera where its corners turn the same way in the image.
"""

from __future__ import annotations

import itertools
import math
import threading
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import as_whole_number
from persfs_cl.surface import geometry, triangulation
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.surface.sampling import fitted_samples
from persfs_cl.surface.triangles import Triangles

if TYPE_CHECKING:
    import trimesh

_ENOUGH = 2.0
"""The thinned grid has at least so many times the triangles that are wanted, as far as whole steps of pixels allow:
decimation chooses among them."""

_SKIRT = 15.0
"""Depth of the skirt in pixels' width. Along edges that are far shorter or longer its triangles would be slivers, which
are not touched."""

_TILT = math.tan(math.radians(11.0))
"""Collapses turn no triangle by more than 78 degrees from where it was: what was tilted by less than the remaining 12
cannot come to lie upside down. So the surface is made so flat."""

_FLATTER = 4.0
_ATTEMPTS = 3
"""By what factor it is flattened further where a sliver was turned over by rounding, and how often."""

_PATIENT, _RESOLUTE = 9.0, 10.0
"""How fast the error grows that is allowed from pass to pass. There are 100 of them, after which the fast way has left
no edge that could be collapsed."""

_CLOSE, _TRIES = 0.8, 4
"""Share of the wanted triangles that is enough, and how often it is tried to come so close."""

_FEWEST = 100
"""Fewer triangles make no surface."""

# The library keeps the mesh that it is at in global variables, from loading to returning it.
_decimating = threading.Lock()


def as_mesh_faces(value: object) -> int | None:
    """The number of triangles that a user allows a mesh, or None for all.

    Raises
    ------
    InputError
        When it is neither 0, which allows all, nor None, nor a whole number that is large enough.
    """
    if value is None or (isinstance(value, Integral) and value == 0 and not isinstance(value, bool)):
        return None
    return as_whole_number("mesh_faces", value, least=_FEWEST, what="a number of triangles", hint=", or 0 for all")


def simplified_mesh(
    depth: ArrayLike,
    camera: Camera,
    most: int,
    colour: ArrayLike | None = None,
    discontinuities: Discontinuities | None = None,
) -> trimesh.Trimesh:
    """The mesh of :func:`persfs_cl.surface.triangulation.mesh`, or one of fewer triangles.

    Parameters
    ----------
    depth, camera, colour, discontinuities
        As there.
    most : int
        At most so many triangles, or somewhat more where holes and cuts leave no edge that could be collapsed. A mesh
        that has no more stays as it is.

    Returns
    -------
    trimesh.Trimesh
        Simplified, its vertices are no pixels, and have the colour of the pixel nearest in space. Pixels without a
        triangle are left out.

    Raises
    ------
    InputError
        As there.

    Notes
    -----
    From 24 million triangles, of 12 megapixels, to 500,000 takes 2.5 s of one core of an AMD EPYC (Zen 3), half of them
    for the last halving; to make them all, and write them as PLY, takes 10 s and 2.2 GB, for a file of 504 MB instead
    of 10 MB.
    """
    return simplified_triangles(depth, camera, most, colour, discontinuities).mesh()


def simplified_triangles(
    depth: ArrayLike,
    camera: Camera,
    most: int | None,
    colour: ArrayLike | None = None,
    discontinuities: Discontinuities | None = None,
) -> Triangles:
    """What :func:`simplified_mesh` is made of, or with None that of :func:`persfs_cl.surface.triangulation.mesh`."""
    if most is None:
        return triangulation.mesh_triangles(depth, camera, colour, discontinuities)
    z = geometry.depth_array(depth)
    along_rows, along_columns = triangulation.joined(~np.isnan(z), discontinuities)
    count = triangulation.triangle_count(along_rows, along_columns)
    if count <= most:
        return triangulation.mesh_triangles(z, camera, colour, discontinuities)
    step = math.ceil(math.sqrt(count / (_ENOUGH * most)))
    pixels, faces = _corners(_thinned(along_rows, along_columns, step), z.size)
    view = _View(z, camera)
    seen, faces = _upright(view.of_samples(pixels, step, discontinuities), faces, most)
    colours = None
    if colour is not None:
        colours = triangulation.rgb(colour, z.shape).reshape(-1, 3)[view.nearest_pixels(seen, pixels)]
    return Triangles(view.in_space(seen), faces, colours)


def _corners(faces: NDArray[np.int32], count: int) -> tuple[Indices, NDArray[np.int32]]:
    """Which of so many pixels are corners of triangles, and the triangles by the numbers of these among them."""
    used = np.zeros(count, bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32)
    return np.flatnonzero(used), number[faces] - 1


class _View:
    """Points as the camera sees them, in pixels: column, row and nearness to depth 1, shape (n, 3)."""

    def __init__(self, z: Array, camera: Camera) -> None:
        self._z = z
        self._grid = camera.grid((z.shape[0], z.shape[1]))

    def of_pixels(self, pixels: Indices) -> Array:
        """What the pixels of some indices in the flat image show."""
        rows, columns = np.divmod(pixels, self._z.shape[1])
        grid = self._grid
        return np.stack([grid.x[columns], grid.y[rows, 0], np.log(self._z[rows, columns])], axis=-1) / grid.dx

    def of_samples(self, pixels: Indices, step: int, discontinuities: Discontinuities | None) -> Array:
        """The same; those in every so many rows and columns stand for all pixels around, where those are all there."""
        seen = self.of_pixels(pixels)
        if step == 1:
            return seen
        log_depth = np.log(self._z)
        if discontinuities is not None:
            # What goes across would have one of these pixels in it.
            log_depth[:, :-1][discontinuities.right] = np.nan
            log_depth[:-1][discontinuities.down] = np.nan
        rows, columns = np.divmod(pixels, self._z.shape[1])
        sampled = np.flatnonzero((rows % step == 0) & (columns % step == 0))
        fitted = fitted_samples(log_depth, step)[rows[sampled] // step, columns[sampled] // step]
        whole = ~np.isnan(fitted)
        seen[sampled[whole], 2] = fitted[whole] / self._grid.dx
        return seen

    def in_space(self, seen: Array) -> Array:
        """Points in camera axes."""
        x, y, log_depth = seen.T * self._grid.dx
        z = np.exp(log_depth)
        return np.stack([z * x, z * y, z], axis=-1)

    def nearest_pixels(self, seen: Array, pixels: Indices) -> Indices:
        """Of each point the pixel whose own is nearest, as its index in the flat image.

        Parameters
        ----------
        seen : ndarray of float64, shape (n, 3)
            Near the surface.
        pixels : ndarray of int
            Pixels of the surface, those on its rims among them.
        """
        (height, width), grid = self._z.shape, self._grid
        columns = np.rint(seen[:, 0] - grid.x[0] / grid.dx).astype(np.intp)
        rows = np.rint((seen[:, 1] * grid.dx - grid.y[0, 0]) / grid.dy).astype(np.intp)
        nearest = np.zeros(len(seen), np.intp)
        least = np.full(len(seen), np.inf)
        for down, right in itertools.product((-1, 0, 1), repeat=2):
            there = (rows + down).clip(0, height - 1) * width + (columns + right).clip(0, width - 1)
            distance = ((self.of_pixels(there) - seen) ** 2).sum(axis=-1)
            nearer = distance < least
            least[nearer] = distance[nearer]
            nearest[nearer] = there[nearer]
        # A few lie beside a rim that was straightened, and their nearest pixel on it.
        beside = np.flatnonzero(np.isinf(least))
        if beside.size:
            points = self.of_pixels(pixels)
            for number in beside:
                nearest[number] = pixels[((points - seen[number]) ** 2).sum(axis=-1).argmin()]
        return nearest


def _thinned(along_rows: Mask, along_columns: Mask, step: int) -> NDArray[np.int32]:
    """Triangles of the grid of pixels, as indices in the flat image; fewer where the surface is whole.

    Cells of `step` x `step` squares without a hole or a cut become two triangles, all others keep those of the full
    grid: outlines and cuts stay as they are. A cell beside such a one is a fan around its middle, with every pixel of
    the common side for a corner, so that no gap opens.
    """
    shape = len(along_rows), along_columns.shape[1]
    index = np.arange(shape[0] * shape[1], dtype=np.int32).reshape(shape)
    if step == 1:
        return triangulation.triangles(index, along_rows, along_columns)
    rows, columns = (size // step for size in (len(along_columns), along_rows.shape[1]))
    squares = along_rows[:-1] & along_rows[1:] & along_columns[:, :-1] & along_columns[:, 1:]
    blocks = squares[: rows * step, : columns * step].reshape(rows, step, columns, step)
    coarse = blocks.all(axis=(1, 3))
    fine = np.ones(squares.shape, bool)
    fine[: rows * step, : columns * step] = ~coarse.repeat(step, axis=0).repeat(step, axis=1)
    found = [triangulation.triangles(index, along_rows, along_columns, fine)]

    # Whether what lies next to a cell is coarse; of the image's own edge there is nothing to be kept.
    around = np.pad(coarse, 1, constant_values=True)
    around[-1] &= rows * step == len(along_columns)
    around[:, -1] &= columns * step == along_rows.shape[1]
    beside = {
        "left": around[1:-1, :-2],
        "bottom": around[2:, 1:-1],
        "right": around[1:-1, 2:],
        "top": around[:-2, 1:-1],
    }
    plain = coarse & np.logical_and.reduce(list(beside.values()))
    corner = index[:-1:step, :-1:step][:rows, :columns]
    down, right = np.int32(step * shape[1]), np.int32(step)
    top_left = corner[plain]
    found.append(np.stack([top_left, top_left + down, top_left + right], axis=-1))
    found.append(np.stack([top_left + right, top_left + down, top_left + down + right], axis=-1))
    # Around each cell the way that its triangles turn: from which corner, and by how much from pixel to pixel.
    sides = {
        "left": (0, shape[1]),
        "bottom": (down, 1),
        "right": (down + right, -shape[1]),
        "top": (right, -1),
    }
    middle = np.int32(step // 2 * (shape[1] + 1))
    for side, (begin, along) in sides.items():
        for whole in (True, False):
            top_left = corner[coarse & ~plain & (beside[side] == whole)]
            for first in (0,) if whole else range(step):
                last = step if whole else first + 1
                ends = [top_left + np.int32(begin + along * place) for place in (first, last)]
                found.append(np.stack([top_left + middle, *ends], axis=-1))
    return np.concatenate(found)


def _upright(points: Array, faces: NDArray[np.int32], most: int) -> tuple[Array, NDArray[np.int32]]:
    """Fewer triangles, all of which face the camera.

    Parameters
    ----------
    points : ndarray of float64, shape (n, 3)
        In pixels, as the camera sees them; each is a corner of a triangle.
    faces : ndarray of int32, shape (m, 3)
        Their corners go round in one sense, in the image.
    most : int
        At most so many triangles, if edges are left that can be collapsed.

    Returns
    -------
    points, faces
        The same, simplified.
    """
    a, b, c = (points[corner] for corner in faces.T)
    right, down, away = np.cross(b - a, c - a).T
    steepest = float((np.hypot(right, down) / np.abs(away)).max())
    simpler, kept = points, faces
    stretch = max(steepest / _TILT, 1.0)
    for _ in range(_ATTEMPTS):
        # Stretched across, not pressed flat: the errors that decide are those of depth, in pixels.
        scale = np.array([stretch, stretch, 1.0])
        simpler, kept = _fitted(points * scale, faces, most, _SKIRT * stretch)
        simpler /= scale
        a, b, c = (simpler[corner] for corner in kept.T)
        if (np.cross(b - a, c - a)[:, 2] * away[0] > 0).all():
            break
        stretch *= _FLATTER
    return simpler, kept


def _fitted(points: Array, faces: NDArray[np.int32], most: int, skirt: float) -> tuple[Array, NDArray[np.int32]]:
    """Fewer triangles, about as many as are wanted and no more, if possible."""
    hanging, below = _skirt(points, faces, skirt)
    enough, too_many = (0, 0), (len(faces) + len(hanging), len(faces))
    target, haste, found = most, _PATIENT, (points, faces)
    for _ in range(_TRIES):
        simpler, kept = _decimated(points, faces, below, hanging, target, haste)
        found = max(found, (simpler, kept), key=lambda mesh: _worth(len(mesh[1]), most))
        if _CLOSE * most <= len(kept) <= most:
            break
        # The skirt has its share of the target, which is large where there are many small holes.
        if len(kept) <= most:
            enough = target, len(kept)
        elif target <= most:
            haste = _RESOLUTE
            continue
        else:
            too_many = target, len(kept)
        target = round(np.interp(0.95 * most, (enough[1], too_many[1]), (enough[0], too_many[0])))
    return found


def _worth(count: int, most: int) -> int:
    """What a mesh is preferred for: enough triangles or else few, and some in any case."""
    return count if 0 < count <= most else -count if count else -(2**62)


def _decimated(
    points: Array, faces: NDArray[np.int32], below: Array, hanging: NDArray[np.int32], target: int, haste: float
) -> tuple[Array, NDArray[np.int32]]:
    """The surface, after the edges of surface and skirt were collapsed whose collapse moves them least."""
    import fast_simplification

    if target >= len(faces) + len(hanging):
        return points, faces
    with _decimating:
        simpler, simpler_faces, collapses = fast_simplification.simplify(
            np.concatenate([points, below]),
            np.concatenate([faces, hanging]),
            target_count=target,
            agg=haste,
            return_collapses=True,
        )
    # Each vertex went into one other, at most, and that perhaps into another. Triangles keep their order, and those
    # of the surface come first; what has lost a corner is none any more.
    into = np.arange(len(points) + len(below), dtype=np.int32)
    into[collapses[:, 1]] = collapses[:, 0]
    while not np.array_equal(further := into[into], into):
        into = further
    a, b, c = into[faces].T
    kept = simpler_faces[: np.count_nonzero((a != b) & (b != c) & (c != a))]
    # So do points. Those of the skirt are merged with each other only: its lower rim is a rim, and the upper is none.
    return simpler[: kept.max(initial=-1) + 1], kept


def _skirt(points: Array, faces: NDArray[np.int32], reach: float) -> tuple[NDArray[np.int32], Array]:
    """Triangles that hang from the rim of a surface straight away from the camera, and their further points.

    Without them flat ground would be eaten away from its rim, at no cost that decimation knows of. The skirt of an edge
    is the plane that the camera sees as a line: it costs to leave that line, and nothing to stay on it.
    """
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    # In the order of its ends, with a bit for its direction: sorted, what both sides have lies side by side.
    first, last = edges.T
    keys = (np.minimum(first, last).astype(np.int64) * len(points) + np.maximum(first, last)) * 2 + (first > last)
    keys.sort()
    new = np.diff(keys >> 1) != 0
    alone = keys[np.r_[True, new] & np.r_[new, True]]
    low, high = (ends.astype(np.int32) for ends in np.divmod(alone >> 1, len(points)))
    turned = alone % 2 == 1
    begin, end = np.where(turned, high, low), np.where(turned, low, high)
    rim = np.unique(np.concatenate([begin, end]))
    begin_below, end_below = (len(points) + np.searchsorted(rim, ends).astype(np.int32) for ends in (begin, end))
    hanging = np.concatenate(
        [np.stack([end, begin, begin_below], axis=-1), np.stack([end, begin_below, end_below], axis=-1)]
    )
    return hanging, points[rim] + (0.0, 0.0, reach)
