"""Maps that a user gave, one number a pixel: what they are, or an error that says why they are none."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import FARTHEST, NEAREST, as_array, as_floats, to_float64, unlike
from persfs_cl.errors import InputError
from persfs_cl.wording import keyword

_READERS = {
    "image": "read_image(path)",
    "mask": "read_mask(path, shape)",
    "walls": "read_mask(path, shape)",
    "known_depth": "read_depth(path, shape)",
    "albedo": "read_light(path, shape)",
}
_ARRAYS_OF_PHOTOS = {"image": "its .image", "light": "its .light, or for a parallel light its .normalised().image"}


def as_array_of_image(name: str, given: ArrayLike) -> NDArray[Any]:
    """The image, or the map that goes with one, that a user gave, perhaps the very array.

    Raises
    ------
    InputError
        As :func:`as_array`; and when it is a path or a photograph, saying what to give instead.
    """
    if isinstance(given, (str, os.PathLike)):
        remedy = (
            f"give {_READERS[name]} if it is a path." if name in _READERS else "read the file first if it is a path."
        )
        raise InputError.about(name, str(given), f"is no array: {remedy}")
    for attribute, remedy in _ARRAYS_OF_PHOTOS.items():
        if hasattr(given, attribute):
            raise unlike(name, given, f"is a {type(given).__name__}, no array: give {remedy}.")
    return as_array(name, given)


def as_image(name: str, given: ArrayLike) -> Array:
    """One number a pixel, shape (height, width), as float64, perhaps the very array given; any but complex numbers.

    Raises
    ------
    InputError
        When it is something else, or has no pixel.
    """
    values = as_floats(name, given)
    if values.ndim != 2 or values.size == 0:
        raise unlike(name, given, f"has shape {values.shape}: give (height, width), one number a pixel.")
    return values


def no_numbers(values: Array, inside: Mask) -> str:
    """Why an image cannot be solved that holds NaN or infinite values among the pixels to solve."""
    bad = int(np.count_nonzero(~np.isfinite(values[inside])))
    return f"holds {bad} NaN or infinite values inside the mask: mask them out."


def as_map(name: str, given: ArrayLike, shape: tuple[int, ...], *, whose: str = "image") -> Array:
    """One number a pixel of an image whose shape is known, as float64, perhaps the very array given.

    Raises
    ------
    InputError
        When it is something else.
    """
    values = as_array(name, given)
    if values.dtype.kind not in "iuf" or values.shape != shape:
        raise unlike(
            name,
            given,
            f"is {values.dtype} of shape {values.shape}: give an array of numbers of the {whose}'s shape {shape}.",
        )
    return to_float64(values)


def as_depth(name: str, given: ArrayLike) -> Array:
    """A depth map as float64, perhaps the very array given.

    Parameters
    ----------
    name : str
    given : array_like, shape (height, width)
        Depth along the optical axis, from 1e-30 to 1e30; NaN where there is no surface.

    Raises
    ------
    InputError
        When it is no array of two dimensions, has no pixels, or holds a depth out of that range.
    """
    z = as_floats(name, given)
    if z.ndim != 2 or z.size == 0:
        raise unlike(name, given, f"has shape {z.shape}: give a (height, width) array with at least one pixel.")
    # NaN is none of them. Most have none at all, which the extremes tell without an array for it.
    if np.fmin.reduce(z, axis=None) < NEAREST or np.fmax.reduce(z, axis=None) > FARTHEST:
        wrong = (z < NEAREST) | (z > FARTHEST)
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"{keyword(f'{name}[{row}, {column}]', float(z[row, column]))} is not a distance in front of the camera "
            f"({np.count_nonzero(wrong)} such pixels): give values from {NEAREST:g} to {FARTHEST:g}, NaN where there "
            "is no surface.",
            argument=name,
            value=given,
        )
    return z


def as_known_depth(name: str, given: ArrayLike, shape: tuple[int, ...]) -> tuple[Array, Mask]:
    """Depths that are known at some pixels of an image, NaN elsewhere, and where they are.

    Raises
    ------
    InputError
        When they are no floats of the shape, there are none, or one is no depth from 1e-30 to 1e30.
    """
    depths = as_array_of_image(name, given)
    if depths.shape != shape or not np.issubdtype(depths.dtype, np.floating):
        raise unlike(
            name,
            given,
            f"is {depths.dtype} of shape {depths.shape}: give a float array of the image's shape {shape}, NaN where "
            "the depth is unknown.",
        )
    known = ~np.isnan(depths)
    values = to_float64(depths[known])
    if values.size == 0:
        raise unlike(name, given, "holds no value: leave it out for z = 1 on the edge, or give at least one depth.")
    if infinite := np.count_nonzero(np.isinf(values)):
        raise unlike(name, given, f"holds {infinite} infinite values: use NaN for unknown.")
    nearest, farthest = float(values.min()), float(values.max())
    if nearest <= 0:
        raise unlike(
            name,
            given,
            f"goes down to {nearest:g}: depths are distances along the optical axis and positive; use NaN for unknown.",
        )
    if nearest < NEAREST or farthest > FARTHEST:
        value = nearest if nearest < NEAREST else farthest
        raise unlike(
            name,
            given,
            f"holds {value:g}: give depths from {NEAREST:g} to {FARTHEST:g}, in another unit if need be, and NaN for "
            "unknown.",
        )
    return to_float64(depths), known


def as_depth_range(name: str, given: Any, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """The nearest and the farthest depth that each pixel of an image may have, NaN where it has no bound.

    Both are of the image's shape, perhaps views of what was given: two numbers or arrays, or None for no bound.

    Raises
    ------
    InputError
        When it is no pair of these, one holds something else than depths from 1e-30 to 1e30 and NaN, or a bound from
        below lies above the other.
    """
    if isinstance(given, (str, os.PathLike)):
        raise InputError.about(name, str(given), "is no range: give a pair (near, far) of numbers or arrays.")
    try:
        near, far = given
    except Exception as error:  # an object may raise anything
        why = "is no range: give a pair (near, far) of numbers or arrays, NaN for no bound."
        raise unlike(name, given, why) from error
    nearest, farthest = (_as_bound(name, side, bound, shape) for side, bound in (("near", near), ("far", far)))
    crossed = nearest > farthest
    if crossed.any():
        row, column = np.argwhere(crossed)[0]
        at_near, at_far = float(nearest[row, column]), float(farthest[row, column])
        raise InputError(
            f"{name} has {keyword('near', at_near)} beyond {keyword('far', at_far)} at pixel [{row}, {column}] "
            f"({np.count_nonzero(crossed)} such pixels): let the first be the smaller depth, and use NaN where one of "
            "them is not known.",
            argument=name,
            value=given,
        )
    return nearest, farthest


def _as_bound(name: str, side: str, given: Any, shape: tuple[int, ...]) -> Array:
    """One side of a range of depths."""

    def wrong(why: str) -> InputError:
        return InputError(f"{keyword(side)} of {name} {why}", argument=name, value=given)

    if isinstance(given, (str, os.PathLike)):
        raise wrong(f"is {str(given)!r}, no depth: give a number, or read_depth(path, shape) if it is a path.")
    values = as_array(side, np.nan if given is None else given)
    if values.dtype.kind not in "iuf" or values.shape not in ((), shape):
        raise wrong(
            f"is {values.dtype} of shape {values.shape}: give a number, or numbers of the image's shape {shape}, NaN "
            "where there is no bound."
        )
    values = to_float64(values)
    # Written so that NaN is none of them.
    if (bad := (values < NEAREST) | (values > FARTHEST)).any():
        raise wrong(
            f"holds {float(values[bad][0]):g} ({np.count_nonzero(bad)} such values): depths are distances along the "
            f"optical axis, from {NEAREST:g} to {FARTHEST:g}; use NaN where there is no bound."
        )
    return np.broadcast_to(values, shape)


def as_albedo(name: str, given: ArrayLike, used: Mask) -> Array:
    """Share of light that a surface returns at the pixels that are used, as float64 in a new array, 1 elsewhere.

    Raises
    ------
    InputError
        When it is no array of floats of that shape, or not in (0, 1] where it is used.
    """
    shares = as_array_of_image(name, given)
    if shares.shape != used.shape or not np.issubdtype(shares.dtype, np.floating):
        raise unlike(
            name,
            given,
            f"is {shares.dtype} of shape {shares.shape}: give a float array of the image's shape {used.shape}, the "
            "share of light in (0, 1] that each pixel's surface returns.",
        )
    # Written so that a NaN is found too.
    if bad := int(np.count_nonzero(~((shares > 0) & (shares <= 1)) & used)):
        raise unlike(
            name,
            given,
            f"is not in (0, 1] at {bad} pixels with a surface, where it ranges from {shares[used].min():g} to "
            f"{shares[used].max():g}: divide by its largest value, and mask out what is black or unknown.",
        )
    return np.where(used, shares, 1.0).astype(np.float64)
