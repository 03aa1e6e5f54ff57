"""A surface as a solid to be printed: a relief on a base plate, in millimetres.

Top and bottom are joined along the lines of sight: from its outline the block widens away from the camera. Lines of
sight do not cross, so that neither do its sides, whatever the surface is; and no side overhangs what is below it.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import as_number
from persfs_cl.errors import InputError
from persfs_cl.surface import geometry, triangulation
from persfs_cl.surface.simplify import as_mesh_faces, simplified_mesh
from persfs_cl.wording import keyword

if TYPE_CHECKING:
    import trimesh

Faces = NDArray[np.int64]

_APART = 0.1
"""By so many pixels are parts drawn back from a pixel in which they touch: files without indices would join them."""

_TRIES, _FEWEST = 12, 4
"""How often simplification is tried for a number of triangles that counts sides and bottom too, and its least."""

_LARGEST = 1e6


@dataclass(frozen=True)
class Block:
    """The size of a solid.

    Parameters
    ----------
    width : float
        Of its larger horizontal side, in millimetres.
    base : float
        Thickness below the deepest point, in millimetres.

    Raises
    ------
    InputError
        When one is no length above 0.

    Examples
    --------
    >>> from persfs_cl.surface.solid import Block
    >>> Block(width=80)
    Block(width=80.0, base=3.0)
    """

    width: float = 100.0
    base: float = 3.0

    def __post_init__(self) -> None:
        for name in ("width", "base"):
            length = as_number(name, getattr(self, name), above=0.0, most=_LARGEST, what="a length in millimetres")
            object.__setattr__(self, name, length)


def solid_mesh(depth: ArrayLike, camera: Camera, block: Block, mesh_faces: int | None = None) -> trimesh.Trimesh:
    """A watertight solid with the surface on its top.

    Parameters
    ----------
    depth : array_like, shape (height, width)
        NaN where there is no surface.
    camera : Camera
    block : Block
    mesh_faces : int, optional
        At most so many triangles, as for :func:`persfs_cl.surface.simplify.simplified_mesh`; None or 0 keeps all.

    Returns
    -------
    trimesh.Trimesh
        In millimetres, x right, y up in the image, z up toward the camera, with a corner of its bounds in the origin.
        Its parts are as many as those of the surface, unless `mesh_faces` has no triangles for the smallest.

    Raises
    ------
    InputError
        When no three neighbouring pixels have a depth, the base is too thick for the width, or holes and parts take
        more triangles than `mesh_faces`.
    """
    import trimesh

    z, most = geometry.depth_array(depth), as_mesh_faces(mesh_faces)
    vertices, faces = _top(z, camera, most)
    if not len(faces):
        raise InputError(
            "depth has no three neighbouring pixels with a depth: a solid needs a surface that is wider than a pixel."
        )
    # As the camera sees it: x and y aside at depth 1, and ln z.
    seen = np.stack([vertices[:, 0] / vertices[:, 2], vertices[:, 1] / vertices[:, 2], np.log(vertices[:, 2])], axis=-1)
    seen, faces = _without_pinches(seen, faces, _APART / max(camera.fx, camera.fy))
    rim = _rim(faces, len(seen))
    z = np.exp(seen[:, 2])
    scale = _scale(seen, z, block)
    bottom = z.max() + block.base / scale
    count = len(seen)
    heights = np.concatenate([z, np.full(count, bottom)])
    x, y = (np.tile(seen[:, axis], 2) * heights for axis in (0, 1))
    begin, end = rim.T
    closed = np.concatenate(
        [
            faces,
            faces[:, ::-1] + count,
            np.stack([end, begin, begin + count], axis=-1),
            np.stack([end, begin + count, end + count], axis=-1),
        ]
    )
    points = np.stack([x, -y, bottom - heights], axis=-1)
    points[:, :2] -= points[:, :2].min(axis=0)
    return trimesh.Trimesh(points * scale, closed, process=False)


def _top(z: Array, camera: Camera, most: int | None) -> tuple[Array, Faces]:
    """Points and triangles of the surface: few enough that those of the whole solid are at most so many."""
    if most is None:
        whole = triangulation.mesh(z, camera)
        return _used(
            np.asarray(whole.vertices), _each_edge_once(np.asarray(whole.faces, np.int64), len(whole.vertices))
        )
    least, largest = _FEWEST, most // 2
    wanted, fewest = largest, sys.maxsize
    found: tuple[Array, Faces] | None = None
    for _ in range(_TRIES):
        some = simplified_mesh(z, camera, wanted)
        faces = _each_edge_once(np.asarray(some.faces, np.int64), len(some.vertices))
        # The bottom has as many as the top, and each edge of the rim a side of two.
        total = 2 * len(faces) + 2 * len(_rim(faces, len(some.vertices)))
        over = total - most
        if over <= 0:
            if found is None or len(faces) > len(found[1]):
                found = _used(np.asarray(some.vertices), faces)
            if 2 * total >= most:
                break
        if over <= 0 or total > fewest:
            # So few that parts have gone, or that simplification gave up.
            least = wanted + 1
            wanted = (least + largest) // 2
        else:
            fewest, largest = total, wanted - 1
            # Next to the last the rim hardly changes; far from it, it shrinks with the rest.
            fewer = (over + 1) // 2 if 8 * over <= most else len(faces) * over // total
            wanted = max(min(largest, len(faces) - fewer), least)
        if least > largest:
            break
    if found is not None:
        return found
    raise InputError.about(
        "mesh_faces",
        most,
        f"is too few for a solid with the holes and parts of this surface: give {fewest} or more, or a mask that has "
        "fewer.",
    )


def _used(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Without the vertices that are in no triangle."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1)[faces]


def _edges(faces: Faces) -> Faces:
    """The three edges of each triangle, in its sense, shape (triangles, 3, 2)."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)


def _each_edge_once(faces: Faces, count: int) -> Faces:
    """Without triangles that lie upon others: where a surface is whole, an edge is passed once in each direction.

    Simplification may fold a rim upon itself.
    """
    while True:
        edges = _edges(faces).reshape(-1, 2)
        keys = edges[:, 0] * count + edges[:, 1]
        order = np.argsort(keys, kind="stable")
        again = np.zeros(len(keys), bool)
        again[order[1:]] = keys[order[1:]] == keys[order[:-1]]
        again |= edges[:, 0] == edges[:, 1]
        if not again.any():
            return faces
        faces = faces[~again.reshape(-1, 3).any(axis=1)]


def _rim(faces: Faces, count: int) -> Faces:
    """Edges with a triangle on one side only, in the sense of that triangle, shape (n, 2)."""
    edges = _edges(faces).reshape(-1, 2)
    keys = edges[:, 0] * count + edges[:, 1]
    alone: Mask = ~np.isin(keys, edges[:, 1] * count + edges[:, 0])
    return edges[alone]


def _without_pinches(seen: Array, faces: Faces, apart: float) -> tuple[Array, Faces]:
    """Give each part of the surface that meets others in a point alone a point of its own, drawn back a little.

    Parameters
    ----------
    seen : ndarray of float64, shape (n, 3)
        Points as the camera sees them.
    faces : ndarray of int
    apart : float
        How far each is drawn back, aside at depth 1.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(seen)
    begins = np.bincount(_rim(faces, count)[:, 0], minlength=count)
    at, corner = np.nonzero((begins > 1)[faces])
    if not len(at):
        return seen, faces
    # Each corner of a triangle in such a point, and the triangle's other two in its sense.
    point, following, previous = (faces[at, (corner + step) % 3] for step in range(3))
    leaving, coming = point * count + following, point * count + previous
    order = np.argsort(coming)
    place = np.minimum(np.searchsorted(coming[order], leaving), len(order) - 1)
    neighbour = order[place]
    joined = coming[neighbour] == leaving
    size = len(at)
    links = coo_array((np.ones(joined.sum()), (np.flatnonzero(joined), neighbour[joined])), shape=(size, size))
    number, part = connected_components(links, directed=False)
    # Toward the middle of what is around it.
    toward = np.zeros((number, 3))
    np.add.at(toward, part, seen[following] + seen[previous] - 2.0 * seen[point])
    length = np.hypot(toward[:, 0], toward[:, 1])
    toward *= np.divide(apart, length, out=np.zeros(number), where=length > 0.0)[:, None]
    of_part = np.empty(number, np.int64)
    of_part[part] = point
    faces = faces.copy()
    faces[at, corner] = count + part
    return _used(np.concatenate([seen, seen[of_part] + toward]), faces)


def _scale(seen: Array, z: Array, block: Block) -> float:
    """Millimetres for a unit of depth, so that the larger side of top and bottom together has the width.

    The base has its thickness in millimetres, and widens with it: along each axis the side is linear in the scale.
    """
    deepest, scales = float(z.max()), []
    for axis in (0, 1):
        across = seen[:, axis]
        most, least = float(across.max()), float(across.min())
        at_top = across * z
        # The bottom reaches farther out than the top, but on the side of the optical axis where there is nothing.
        slope = max(most, 0.0) - min(least, 0.0)
        fixed = (float(at_top.max()) if most < 0.0 else 0.0) - (float(at_top.min()) if least > 0.0 else 0.0)
        scales.append((block.width - block.base * slope) / (deepest * slope + fixed))
    if min(scales) <= 0.0:
        raise InputError.about(
            "base",
            block.base,
            f"is too thick for {keyword('width', block.width)}: the plate alone is wider, since the view widens with "
            "depth. Give a thinner base, or a larger width.",
        )
    return min(scales)
