"""A photograph and what is known of the depth in it, checked, made ready, and reduced to as many pixels as a fit needs.

Light, material and tone do not depend on the number of pixels, and means of many pixels have less noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import FARTHEST, NEAREST, as_floats, as_mask, unlike
from persfs_cl.errors import InputError
from persfs_cl.framing.frame import Frame
from persfs_cl.framing.straightened import Straightened
from persfs_cl.grid import PixelGrid
from persfs_cl.guide.guide import Points
from persfs_cl.io.photos import Photo
from persfs_cl.maps import as_depth, as_image
from persfs_cl.preparation.prepare import Preparation, prepare_photo
from persfs_cl.wording import keyword

Normals = Literal["auto", "truth", "solution"]

_LONGEST = 256
"""Pixels along the longer side that a fit has use for."""
_DENSE = 0.5
"""Share of the known pixels that have all four neighbours, from which on a map has slopes of its own."""
_KEPT = 2
"""Of preparations: that of the photograph where a fit is, and that of the one where it looks."""


@dataclass(eq=False)
class Pair:
    """A photograph and its truth.

    Attributes
    ----------
    photo : Photo
    camera : Camera
        Of the photograph.
    preparation : Preparation
        Without vignetting that is a law, which is part of what is assumed.
    mask : ndarray of bool, shape of the photograph
    dense : ndarray of float64, shape of the reduced image, or None
        Depth, NaN where unknown; None where single points are known, of whose slopes nothing is.
    points : ndarray of float64, shape (n, 3)
        Column and row in the reduced image, and depth, of what is known.
    of_map : bool
        Whether the points are pixels of a dense map, of which neighbours err alike.
    frame : Frame or None
        From the pixels of the photograph to those that are reduced, where its lens bends lines.
    """

    photo: Photo
    camera: Camera
    preparation: Preparation
    mask: Mask
    dense: Array | None
    points: Array
    of_map: bool = False
    frame: Frame | None = None
    _prepared: dict[float, tuple[Array, Mask]] = field(default_factory=dict)

    @property
    def straight_shape(self) -> tuple[int, int]:
        """(height, width) of the image that is reduced."""
        return (self.mask.shape[0], self.mask.shape[1]) if self.frame is None else self.frame.shape

    @property
    def factor(self) -> int:
        """Pixels along a side of one of the reduced image."""
        return math.ceil(max(self.straight_shape) / _LONGEST)

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the reduced image."""
        return _reduced_shape(self.straight_shape, self.factor)

    @property
    def reduced_camera(self) -> Camera:
        """That of the reduced image."""
        camera = self.camera if self.frame is None else self.frame.camera
        column, row = camera.centre(self.straight_shape)
        return Camera(
            (camera.fx / self.factor, camera.fy / self.factor),
            ((column + 0.5) / self.factor - 0.5, (row + 0.5) / self.factor - 0.5),
        )

    @property
    def grid(self) -> PixelGrid:
        """Of the reduced image."""
        return self.reduced_camera.grid(self.shape)

    def light(self, exponent: float) -> tuple[Array, Mask]:
        """Linear light of the reduced image, NaN outside the mask, and which pixels tell how bright they are."""
        if exponent not in self._prepared:
            while len(self._prepared) >= _KEPT:
                del self._prepared[next(iter(self._prepared))]
            raised = replace(self.preparation, tone_exponent=exponent)
            prepared = prepare_photo(self.photo, self.camera, raised, mask=self.mask)
            light, told = prepared.light, prepared.mask
            spoilt = prepared.saturated | prepared.below_ambient | prepared.filled | prepared.clipped
            if self.frame is not None:
                light, told = self.frame.light(light, told)
                spoilt = self.frame.anywhere(spoilt)
            light = reduced(np.where(told, light, np.nan), self.factor)
            clean = reduced(np.where(spoilt, np.nan, 0.0), self.factor, whole=True) == 0.0
            self._prepared[exponent] = light, np.isfinite(light) & (light > 0.0) & clean
        return self._prepared[exponent]


def pair_of(
    given: Any, truth: Any, camera: Camera, preparation: Preparation, mask: ArrayLike | None, normals: Normals
) -> Pair:
    """A photograph and its truth, checked.

    Raises
    ------
    InputError
        When one cannot be used, or they do not fit each other.
    """
    photo = given if isinstance(given, Photo) else _as_photo(given)
    shape = (photo.image.shape[0], photo.image.shape[1])
    frame = None if camera.distortion is None else Straightened(camera, shape)
    if frame is None:
        camera.grid(shape)
    inside = np.ones(shape, bool) if photo.mask is None else photo.mask
    inside = inside & np.isfinite(photo.image)
    if mask is not None:
        inside &= as_mask("mask", mask, shape, whose="photo")
    if not inside.any():
        raise InputError(
            f"no pixel of the photo is left: of {inside.size}, all are transparent, unknown or outside "
            f"{keyword('mask')}. Give a mask that is True on the surface.",
            argument="mask",
        )
    pair = Pair(photo, camera, preparation, inside, None, np.empty((0, 3)), frame=frame)
    pair.dense, pair.points, pair.of_map = _truth(truth, pair, normals)
    if not len(pair.points):
        raise InputError(
            f"{keyword('truth')} has no known depth at any pixel that {keyword('mask')} leaves: give points on the "
            "surface, or a mask that holds them.",
            argument="truth",
        )
    _, usable = pair.light(preparation.tone_exponent)
    height, width = pair.shape
    columns, rows = (
        np.clip(np.rint(pair.points[:, axis]).astype(np.int64), 0, size - 1)
        for axis, size in enumerate((width, height))
    )
    told = usable[rows, columns]
    if not told.any():
        raise InputError(
            f"of {told.size} known depths none lies where the photo tells a brightness: all are black, saturated, "
            "highlights, or at the edge of the mask. Give others, or a photo that is exposed less.",
            argument="truth",
        )
    pair.points = pair.points[told]
    return pair


def reduced(values: Array, factor: int, *, whole: bool = False) -> Array:
    """Means over squares of pixels, less those that are NaN; NaN where these are more than half, or `whole`, any.

    What is left of a last square at the right and the bottom is left out.
    """
    if factor == 1:
        return values
    height, width = _reduced_shape(values.shape, factor)
    squares = values[: height * factor, : width * factor].reshape(height, factor, width, factor)
    known = np.isfinite(squares)
    count = known.sum(axis=(1, 3))
    total = np.where(known, squares, 0.0).sum(axis=(1, 3))
    enough = count == factor**2 if whole else 2 * count > factor**2
    means: Array = np.divide(total, count, out=np.full(count.shape, np.nan), where=enough)
    return means


def inner(known: Mask) -> Mask:
    """Known pixels whose four neighbours are known too."""
    padded = np.pad(known, 1)
    return np.asarray(known & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:])


def _reduced_shape(shape: Sequence[int], factor: int) -> tuple[int, int]:
    return max(1, shape[0] // factor), max(1, shape[1] // factor)


def _as_photo(given: Any) -> Photo:
    """An array of linear light as a photograph without a file."""
    if isinstance(given, (str, bytes, Path)):
        raise InputError.about("photo", str(given), "is a path: give read_photo(path), or an array of linear light.")
    image = as_image("photo", given)
    with np.errstate(invalid="ignore"):
        if (negative := image < 0.0).any():
            raise unlike(
                "photo", given, f"goes down to {image[negative].min():g}: light cannot be negative. Clip it at 0."
            )
    colour = np.zeros((*image.shape, 3), np.uint8)
    return Photo(image, colour, None, Path("photo"), 64, "linear", "luminance", image, image, None)


def _truth(given: Any, pair: Pair, normals: Normals) -> tuple[Array | None, Array, bool]:
    """The dense map, if its slopes count, and all points, both of the reduced image; and whether these are dense."""
    shape = pair.mask.shape
    if isinstance(given, Points):
        given = np.stack([given.columns, given.rows, given.depths], axis=1)
    values = as_floats("truth", given)
    if values.shape == shape:
        return _from_map(as_depth("truth", values), pair, normals)
    if values.ndim != 2 or values.shape[1] != 3:
        raise unlike(
            "truth",
            given,
            f"has shape {values.shape}: give a depth map of the photo's shape {shape}, persfs_cl.Points, or an array "
            "of shape (n, 3), with column, row and depth of each point.",
        )
    if normals == "truth":
        raise InputError.about(
            "normals", normals, f"is for a dense truth: points have no slopes. Give {keyword('normals', 'solution')}."
        )
    depths = values[:, 2]
    if not np.isfinite(values).all() or depths.min(initial=1.0) < NEAREST or depths.max(initial=1.0) > FARTHEST:
        raise unlike(
            "truth",
            given,
            f"has points that are not finite, or no depth from {NEAREST:g} to {FARTHEST:g}: leave them out.",
        )
    nearest = np.rint(values[:, 1::-1]).astype(np.int64)
    there = np.all((nearest >= 0) & (nearest < shape), axis=1)
    there[there] = pair.mask[tuple(nearest[there].T)]
    return None, _placed(values[there], pair), False


def _from_map(depth: Array, pair: Pair, normals: Normals) -> tuple[Array | None, Array, bool]:
    known = pair.mask & np.isfinite(depth)
    share = inner(known).sum() / max(1, known.sum())
    if normals == "truth" and share < _DENSE:
        raise InputError.about(
            "normals",
            normals,
            f"is for a dense truth: of the pixels with a known depth {share:.0%} have neighbours with one. Give "
            f"{keyword('normals', 'solution')}.",
        )
    if share < _DENSE:
        rows, columns = np.nonzero(known)
        return None, _placed(np.stack([columns, rows, depth[known]], axis=1), pair), False
    log_depth = np.log(np.where(known, depth, 1.0))
    if pair.frame is not None:
        log_depth, known = pair.frame.light(log_depth, known)
    log_depth = reduced(np.where(known, log_depth, np.nan), pair.factor, whole=True)
    rows, columns = np.nonzero(np.isfinite(log_depth))
    points = np.stack([columns, rows, np.exp(log_depth[rows, columns])], axis=1)
    return (None if normals == "solution" else np.exp(log_depth)), points, True


def _placed(points: Array, pair: Pair) -> Array:
    """Column, row and depth of points of the photograph, in the reduced image, which all see."""
    places = points[:, :2]
    if pair.frame is not None:
        places = pair.frame.placed(places)
    seen = np.isfinite(places).all(axis=1)
    return np.column_stack([(places[seen] + 0.5) / pair.factor - 0.5, points[seen, 2]])
