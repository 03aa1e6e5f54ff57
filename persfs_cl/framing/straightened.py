"""The view of a lens that bends straight lines, as a pinhole camera has it."""

from __future__ import annotations

import math
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.camera import Camera
from persfs_cl.checks import warn
from persfs_cl.errors import CameraError
from persfs_cl.framing.frame import Frame
from persfs_cl.guide.cells import part_of
from persfs_cl.lens.distortion import Distortion, is_opencvs, unfolded
from persfs_cl.lens.numbers import Lens
from persfs_cl.lens.opencv import opencv

_WIDEST_VIEW = 70.0
_FARTHEST = math.tan(math.radians(_WIDEST_VIEW))
"""Normalised place, along x or y, up to which a pinhole camera is made to see: beyond, it takes ever more pixels."""
_MOST = 2.0
"""Pixels that the new image may have for one of the old."""
_SAMPLES = 96
"""Places along a side of the image whose rays are looked for, and of a frame where folds are."""
_NOWHERE = -9.0
_FLOATS = 5
"""OpenCV's CV_32FC1."""
_LEAST, _MUCH = 0.05, 0.5
"""Share of the old image below which something is wrong, and up to which it is worth a word."""


@lru_cache(maxsize=64)
def _straight(camera: Camera, old_shape: tuple[int, int]) -> tuple[Camera, tuple[int, int], Mask, float]:
    """The new camera, (height, width) of its image, where in this the lens folds what it shows, and what is kept.

    Folds are told of a few squares: there the lens would show a second time what it shows nearer the axis. What is kept
    is a share of the old image.
    """
    (left, top, right, bottom), kept = _seen(camera, old_shape)
    column, row = camera.centre(old_shape)
    new = (right - left) * camera.fx * (bottom - top) * camera.fy
    shorter = min(1.0, math.sqrt(_MOST * old_shape[0] * old_shape[1] / new))
    fx, fy = shorter * camera.fx, shorter * camera.fy
    first = math.floor(column + left * fx + 0.5), math.floor(row + top * fy + 0.5)
    last = math.ceil(column + right * fx - 0.5), math.ceil(row + bottom * fy - 0.5)
    width, height = (max(1, end - begin + 1) for begin, end in zip(first, last, strict=True))
    straight = Camera((fx, fy), (column - first[0], row - first[1]))
    across, down = (
        (np.arange(count) + 0.5) * size / count - 0.5
        for size, count in ((width, min(width, _SAMPLES)), (height, min(height, _SAMPLES)))
    )
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    fine = unfolded(_bent(camera), straight.places(pixels, (height, width)))
    return straight, (height, width), ~fine.reshape(down.size, across.size), kept


def _seen(camera: Camera, old_shape: tuple[int, int]) -> tuple[tuple[float, float, float, float], float]:
    """The box of normalised places that the old image shows, its pixels to their outer edges, and the share in it."""
    height, width = old_shape
    across, down = (np.linspace(-0.5, size - 0.5, min(size + 1, _SAMPLES)) for size in (width, height))
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    places = camera.places(pixels, old_shape)
    with np.errstate(invalid="ignore"):
        places = places[(np.abs(places) <= _FARTHEST).all(axis=1)]
    kept = len(places) / len(pixels)
    (left, top), (right, bottom) = (places.min(axis=0), places.max(axis=0)) if len(places) else ((0.0, 0.0),) * 2
    if kept < _LEAST or not (left < right and top < bottom):
        raise CameraError.about(
            "distortion",
            camera.distortion,
            f"leaves {100 * kept:.2g} % of an image of {width} × {height} pixels that a pinhole camera could see: "
            "check it, the focal length and the principal point, all in pixels of this very image, not in millimetres.",
        )
    return (float(left), float(top), float(right), float(bottom)), kept


def _bent(camera: Camera) -> Distortion:
    if camera.distortion is None:
        raise CameraError.about("distortion", None, "is none: there is nothing to straighten.")
    return camera.distortion


class Straightened(Frame):
    """What a pinhole camera sees of the view of another, whose lens bends straight lines.

    The new camera has the focal length of the old one, so that no detail is lost in the middle, and sees all that the
    old one does up to 70 degrees from the axis, sidewards and up and down; if that takes more than twice as many
    pixels, its focal length is shorter. Pixels are centred where they were: next to the optical axis nothing moves.

    Parameters
    ----------
    camera : Camera
        Of the old image, with a distortion.
    old_shape : (int, int)
        (height, width) of the old image.

    Raises
    ------
    CameraError
        When the lens shows nothing of what a pinhole camera could see, or OpenCV is not installed.

    Warns
    -----
    UserWarning
        When less than half of the image is kept.
    """

    def __init__(self, camera: Camera, old_shape: tuple[int, int]) -> None:
        self._old, self.old_shape = camera, old_shape
        self.camera, self.shape, self._folded, kept = _straight(camera, old_shape)
        if kept < _MUCH:
            warn(
                f"Of an image of {old_shape[1]} × {old_shape[0]} pixels the distortion of the lens leaves "
                f"{100 * kept:.2g} %: the rest is farther than {_WIDEST_VIEW:g}° from the optical axis, or beyond "
                "where the coefficients hold."
            )

    @cached_property
    def _coordinates(self) -> NDArray[np.float32]:
        """Row and column in the old image of the pixels of the new one, shape (2, height, width)."""
        old, new = (_matrix(one, shape) for one, shape in ((self._old, self.old_shape), (self.camera, self.shape)))
        size, distortion = self.shape[::-1], _bent(self._old)
        if not is_opencvs(distortion):
            columns, rows = self._drawn()
        elif isinstance(distortion, Lens):
            columns, rows = opencv().fisheye.initUndistortRectifyMap(
                old, np.array(distortion.coefficients), np.eye(3), new, size, _FLOATS
            )
        else:
            columns, rows = opencv().initUndistortRectifyMap(old, np.array(distortion), None, new, size, _FLOATS)
        found = np.stack([rows, columns])
        if self._folded.any():
            down, across = (part_of(side, count) for side, count in zip(self.shape, self._folded.shape, strict=True))
            found[:, self._folded[np.ix_(down, across)]] = _NOWHERE
        return found

    def _drawn(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The same, column and row, of a lens that OpenCV does not know."""
        columns, rows = (np.empty(self.shape, np.float32) for _ in range(2))
        along = np.arange(self.shape[1], dtype=np.float64)

        def work(some: slice) -> None:
            down = np.arange(some.start, some.stop, dtype=np.float64)
            pixels = np.stack(np.meshgrid(along, down), axis=-1).reshape(-1, 2)
            found = self._old.pixels(self.camera.places(pixels, self.shape), self.old_shape)
            columns[some], rows[some] = found.T.reshape(2, down.size, along.size)

        in_row_blocks(work, self.shape)
        return columns, rows

    def mean(self, values: Array) -> Array:
        """See :class:`Frame`: linear between the centres of old pixels."""
        from scipy.ndimage import map_coordinates  # slow to import

        places, found = self._coordinates, np.empty(self.shape)

        def work(rows: slice) -> None:
            map_coordinates(values, places[:, rows], output=found[rows], order=1, mode="grid-constant", prefilter=False)

        in_row_blocks(work, self.shape)
        return found

    def least(self, values: Array) -> Array:
        """See :class:`Frame`."""
        padded = np.pad(values, 1, constant_values=np.inf)
        places = self._coordinates
        found = np.full(self.shape, np.inf)
        for down in (np.floor, np.ceil):
            for across in (np.floor, np.ceil):
                row, column = (
                    np.clip(way(along) + 1.0, 0, size + 1).astype(np.intp)
                    for way, along, size in zip((down, across), places, self.old_shape, strict=True)
                )
                np.minimum(found, padded[row, column], out=found)
        return found

    def placed(self, places: Array) -> Array:
        """See :class:`Frame`."""
        return self.camera.pixels(self._old.places(places, self.old_shape), self.shape)

    def guide(self, guide: Array) -> Array:
        """See :class:`Frame`: means over new cells of the old cells that their pixels lie in."""
        places = self._coordinates
        old = [
            np.floor((along + 0.5) * count / size)
            for along, count, size in zip(places, guide.shape, self.old_shape, strict=True)
        ]
        inside = np.logical_and.reduce(
            [(cell >= 0) & (cell < count) for cell, count in zip(old, guide.shape, strict=True)]
        )
        row, column = (cell[inside].astype(np.intp) for cell in old)
        says = guide[row, column]
        # As many pixels a cell as before, and no less than one.
        cells = [
            min(new, max(1, round(count * new / size)))
            for count, new, size in zip(guide.shape, self.shape, self.old_shape, strict=True)
        ]
        down, across = (part_of(side, count) for side, count in zip(self.shape, cells, strict=True))
        cell = (down[:, None] * cells[1] + across)[inside]
        known = ~np.isnan(says)
        count = np.bincount(cell[known], minlength=cells[0] * cells[1])
        total = np.bincount(cell[known], says[known], minlength=cells[0] * cells[1])
        whole = np.bincount((down[:, None] * cells[1] + across).ravel(), minlength=cells[0] * cells[1])
        found = np.divide(total, count, out=np.full(count.shape, np.nan), where=2 * count >= whole)
        return np.asarray(found.reshape(cells))


def _matrix(camera: Camera, shape: tuple[int, int]) -> Array:
    column, row = camera.centre(shape)
    return np.array([[camera.fx, 0.0, column], [0.0, camera.fy, row], [0.0, 0.0, 1.0]])
