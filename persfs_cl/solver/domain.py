"""Which pixels are solved, known, out of reach, or on the boundary: the geometry of one problem."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Mask
from persfs_cl.errors import InputError
from persfs_cl.masks import NONE, SWEPT, Neighbours, connected, missing_neighbours
from persfs_cl.solver.window import Window
from persfs_cl.wording import keyword

_RENEWED = ("outflow", "extrapolate")
"""Boundaries whose cells are renewed from inside."""


@dataclass(frozen=True)
class Boundary:
    """Cells renewed from inside after each sweep, eq. (12), instead of being swept.

    Attributes
    ----------
    cells : ndarray of int32, shape (edges + corners,)
        Flat indices.
    inwards : ndarray of int32, shape (edges + corners, 4)
        Next and second next cell inwards along x, then along y; :data:`NONE` where a cell does not look that way.
    edges, corners : int
        Edges look at cells that are not renewed themselves; corners, which come last, look along an edge.
    """

    cells: NDArray[np.int32]
    inwards: NDArray[np.int32]
    edges: int
    corners: int


_NO_CELLS = Boundary(np.empty(0, np.int32), np.empty((0, 4), np.int32), 0, 0)


@dataclass(frozen=True)
class Domain:
    """The geometry of one problem.

    Attributes
    ----------
    known : ndarray of bool, shape (height, width)
        Pixels that keep their value.
    solved : ndarray of bool, shape (height, width)
        Pixels that a known value can reach and that get a value, swept or renewed.
    unreached : ndarray of bool, shape (height, width)
        Pixels that were to be solved but are cut off from every known value.
    flags : ndarray of uint8, shape (height, width)
        For the kernels: which cells are swept and which neighbours are missing.
    boundary : Boundary
    """

    known: Mask
    solved: Mask
    unreached: Mask
    flags: NDArray[np.uint8]
    boundary: Boundary

    def cut(self, window: Window) -> Domain:
        """The same in a window with all that is solved, and what is known within two pixels of it."""
        boundary = self.boundary
        return Domain(
            known=window.cut(self.known),
            solved=window.cut(self.solved),
            unreached=window.cut(self.unreached),
            flags=window.cut(self.flags),
            boundary=replace(boundary, cells=window.pixels(boundary.cells), inwards=window.pixels(boundary.inwards)),
        )


def lay_out(
    wanted: Mask,
    known: Mask,
    walls: Mask | None,
    boundary: str,
    *,
    held: Mask | None = None,
    needs_known: bool = True,
    window: Window | None = None,
) -> Domain:
    """Classify the pixels of a problem.

    Parameters
    ----------
    wanted : ndarray of bool, shape (height, width)
        Pixels to solve.
    known : ndarray of bool, shape (height, width)
        Pixels whose depth is given, inside or outside `wanted`.
    walls : ndarray of bool, shape (height, width), or None
        Pixels that nothing crosses; they get no value.
    boundary : {"outflow", "extrapolate", "fixed", "wall"}
    held : ndarray of bool, shape (height, width), or None
        Pixels whose values have a bound that they begin with: what is known so far is as good as known.
    needs_known : bool
        False where the image alone determines the depth: then all pixels are solved.
    window : Window, optional
        The part that is wanted, with all pixels to solve and what lies within two pixels of them; all by default.

    Returns
    -------
    Domain
        Of the window.

    Raises
    ------
    InputError
        When there is nothing to solve, no known value can reach any pixel, or ``boundary="fixed"`` lacks values.
    """
    unknown = wanted & ~known
    if walls is not None:
        known, unknown = known & ~walls, unknown & ~walls
    if not unknown.any():
        raise InputError(
            f"There is nothing to solve: of {wanted.size} pixels {int(known.sum())} are known, "
            f"{int((~wanted).sum())} masked out and {0 if walls is None else int(walls.sum())} walls. "
            "Leave some pixels unknown (NaN)."
        )
    # Values spread from what is known, and from bounds that pixels begin with.
    anchors = known if held is None else known | (held & unknown)
    if needs_known and not anchors.any():
        raise InputError(
            f"No depth is known: give {keyword('known_depth')} at least one finite value that is not behind a wall, or "
            f"a range with {keyword('far')} bounds, for {keyword('surface', 'toward')} with {keyword('near')} ones.",
            argument="known_depth",
        )
    if window is None:
        window = Window.whole((wanted.shape[0], wanted.shape[1]))
    counts = int(np.count_nonzero(anchors)), int(np.count_nonzero(unknown))
    known_inside = window.cut(known)
    if boundary in _RENEWED and np.count_nonzero(known_inside) < np.count_nonzero(known):
        # A chain of known pixels may leave the window and come back.
        return _laid_out(unknown, known, anchors, boundary, counts, needs_known=needs_known).cut(window)
    inside = window.cut(unknown), known_inside, window.cut(anchors)
    return _laid_out(*inside, boundary, counts, needs_known=needs_known)


def _laid_out(
    unknown: Mask, known: Mask, anchors: Mask, boundary: str, counts: tuple[int, int], *, needs_known: bool
) -> Domain:
    """Classify pixels without walls; `counts` are the anchors, known or held, and the unknown ones, of the image."""
    reached = unknown & connected(anchors, unknown | known) if needs_known else unknown
    if not reached.any():
        raise nothing_reached(*counts)
    present = reached | known
    flags = missing_neighbours(present)
    if boundary == "fixed":
        open_rim = int(np.count_nonzero(reached & (flags != 0)))
        if open_rim:
            raise InputError.about(
                "boundary",
                boundary,
                f"needs a known depth on every edge pixel of the image and mask, but {open_rim} have none: add them to "
                f"{keyword('known_depth')}, or use {keyword('boundary', 'outflow')}.",
            )
    renewed = _boundary(reached, anchors, present, reached & (flags != 0)) if boundary in _RENEWED else _NO_CELLS
    flags |= reached * np.uint8(SWEPT)
    flags.ravel()[renewed.cells] ^= SWEPT
    return Domain(
        known=known,
        solved=reached,
        unreached=unknown & ~reached,
        flags=flags,
        boundary=renewed,
    )


def nothing_reached(known: int, unknown: int) -> InputError:
    """The error where no way leads from so many known depths to any of so many pixels to solve."""
    return InputError(
        f"None of the {known} known depths can reach the {unknown} pixels to solve: give a known depth inside the mask "
        "or next to it.",
        argument="known_depth",
    )


def _boundary(reached: Mask, known: Mask, present: Mask, on_rim: Mask) -> Boundary:
    """Choose the cells that eq. (12) renews, of those on the rim.

    A rim cell looks inwards along each axis on which just one neighbour is missing. Cells that no chain of looks
    joins to a swept cell (strips of one or two pixels) are swept like all others, and so are those next to known values
    that no inner cell would hear: a known corner of the image, say.
    """
    if not on_rim.any():
        return _NO_CELLS
    height, width = reached.shape
    beside = Neighbours.of(present)
    heard = connected(known & Neighbours.of(reached & ~on_rim).any, known)
    index = np.flatnonzero(on_rim & ~Neighbours.of(known & ~heard).any)
    rows, columns = np.divmod(index, width)

    looks = []
    for before, after, line, length, stride in (
        (beside.left, beside.right, columns, width, 1),
        (beside.up, beside.down, rows, height, width),
    ):
        has_before, has_after = before[rows, columns], after[rows, columns]
        step = has_after.astype(np.int64) - has_before.astype(np.int64)
        near = np.where(step != 0, index + step * stride, NONE)
        second = line + 2 * step
        inside = (step != 0) & (second >= 0) & (second < length)
        far = np.where(inside, index + 2 * step * stride, NONE)
        far = np.where(inside & present.ravel()[far], far, near)
        looks.append((near, far))

    def take(goals: Mask) -> NDArray[np.int64]:
        """Looks whose next cell is one of `goals`, as (near x, far x, near y, far y)."""
        good = [(near != NONE) & goals.ravel()[near] for near, _ in looks]
        return np.stack(
            [np.where(ok, cell, NONE) for ok, pair in zip(good, looks, strict=True) for cell in pair], axis=1
        )

    edge_looks = take(present & ~on_rim)
    is_edge = (edge_looks != NONE).any(axis=1)
    edge_pixels = np.zeros_like(reached)
    edge_pixels[rows[is_edge], columns[is_edge]] = True
    corner_looks = take(edge_pixels)
    is_corner = ~is_edge & (corner_looks != NONE).any(axis=1)
    return Boundary(
        cells=np.concatenate([index[is_edge], index[is_corner]]).astype(np.int32),
        inwards=np.concatenate([edge_looks[is_edge], corner_looks[is_corner]]).astype(np.int32),
        edges=int(is_edge.sum()),
        corners=int(is_corner.sum()),
    )
