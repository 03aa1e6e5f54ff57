"""Shiny spots of a photograph: found by their shape, and filled from around them.

A matt surface is as bright as its slope allows, and a shiny spot tells nothing of the slope. Such a spot is small and
far brighter than everything that it touches.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import as_mask, as_number, as_whole_number, unlike
from persfs_cl.masks import connected
from persfs_cl.preparation.inpaint import harmonic
from persfs_cl.preparation.normalise import checked

Light = NDArray[np.float32]

_NOTEWORTHY = 0.1
"""Share of the brightest value below which noise could be taken for a spot."""


def find_specular(
    image: ArrayLike, *, mask: ArrayLike | None = None, factor: float = 2.5, size: int | None = None
) -> Mask:
    """Isolated bright spots, such as wet or polished surfaces have.

    A pixel is taken for one when it is more than `factor` times as bright as the opening by reconstruction of the
    image (L. Vincent, IEEE Transactions on Image Processing 2(2), 1993, pp. 176-201). This is the image with every
    spot into which no square of side `size` fits cut down to the brightest way that leads out of it. A bright surface
    next to a dark one is no spot, however narrow in places, because it keeps its brightness from where it is wide.
    What is darker than a tenth of the brightest (99.5th percentile) is no spot either: noise in the dark looks alike.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, not negative, on any scale.
    mask : array_like of bool, shape (H, W), optional
        Pixels to look at. Those outside are no surroundings either.
    factor : float
        At least 1.
    size : int, optional
        Odd, in pixels. Left out, it is a tenth of the shorter side of the image, and at least 3.

    Returns
    -------
    ndarray of bool, shape (H, W)
        False outside the mask.

    Raises
    ------
    InputError
        When `factor` or `size` is impossible, the image has negative values, or `image` or `mask` cannot be used.
    """
    values, inside = checked(image, mask)
    if (lowest := float(values[inside].min())) < 0:
        raise unlike("image", image, f"goes down to {lowest:g}: linear light cannot be negative. Clip it at 0.")
    factor = as_number("factor", factor, least=1.0)
    if size is None:
        size = max(3, min(values.shape) // 10 | 1)
    else:
        size = as_whole_number("size", size, least=1, odd=True, what="a width", hint=", of pixels that no spot has")
    # Outside there is nothing to see, and single precision finds the same pixels in half the time.
    rows, columns = _span(np.logical_or.reduce(inside, axis=1)), _span(np.logical_or.reduce(inside))
    within, light = inside[rows, columns], values[rows, columns].astype(np.float32)
    floor = np.where(within, light, np.float32(-1))
    darkest = extreme(np.where(within, light, np.float32(np.inf)), int(size), np.minimum, np.inf)
    opened = extreme(np.where(within, darkest, np.float32(-1)), int(size), np.maximum, -1.0)
    surroundings = _reconstruction(np.minimum(opened, floor), floor)
    bright = _NOTEWORTHY * np.percentile(values[inside], 99.5)
    found = np.zeros_like(inside)
    found[rows, columns] = within & (light > np.float32(factor) * surroundings) & (light > bright)
    return found


def dilate(pixels: ArrayLike, radius: int) -> Mask:
    """A set of pixels and all within a square around each.

    Parameters
    ----------
    pixels : array_like of bool, shape (H, W)
    radius : int
        Half the square's side, in pixels; 0 changes nothing.

    Returns
    -------
    ndarray of bool, shape (H, W)

    Raises
    ------
    InputError
        When `pixels` is no image of bool, or `radius` is no whole number, 0 or more.
    """
    given = as_mask("pixels", pixels)
    width = 2 * as_whole_number("radius", radius) + 1
    return np.asarray(extreme(given, width, np.logical_or, False))


def fill_smoothly(image: ArrayLike, holes: ArrayLike, *, mask: ArrayLike | None = None) -> tuple[Array, Mask]:
    """Fill holes by harmonic inpainting: every pixel becomes the mean of its four neighbours.

    This is Laplace's equation. It continues linear shading exactly, and never makes a pixel brighter or darker than
    the surroundings of its hole. A neighbour outside the mask or the image is left out of the mean.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Brightness on any scale.
    holes : array_like of bool, shape (H, W)
        Pixels to fill.
    mask : array_like of bool, shape (H, W), optional
        Pixels to use. Those outside are returned as they came, holes or not.

    Returns
    -------
    filled : ndarray of float64, shape (H, W)
    left : ndarray of bool, shape (H, W)
        Holes inside the mask that have nothing around them to be filled from; they are returned as they came.

    Raises
    ------
    InputError
        When `holes` is no array of bool of the image's shape, or `image` or `mask` cannot be used.
    """
    values, inside = checked(image, mask)
    pixels = as_mask("holes", holes, values.shape)
    given = inside & ~pixels
    unknown = inside & pixels & connected(given, inside)
    filled = values.copy()
    if unknown.any():
        filled[unknown] = harmonic(values, unknown, given)
    return filled, inside & pixels & ~unknown


def _span(line: Mask) -> slice:
    """From the first True to the last."""
    there = np.flatnonzero(line)
    return slice(there[0], there[-1] + 1)


def _reconstruction(level: Light, image: Light) -> Light:
    """A marker, at most the image, spread under it, in place: the highest level at which one reaches each pixel."""
    # Contiguous copies of the transposed images make columns as fast as rows.
    turned, ceilings = np.empty_like(image.T, order="C"), (image, np.ascontiguousarray(image.T))
    before = np.empty_like(level)
    reaching = np.empty(max(image.shape), image.dtype)
    while True:
        np.copyto(before, level)
        for ceiling in ceilings:
            reached = reaching[: ceiling.shape[1]]
            for order in (range(1, len(level)), range(len(level) - 2, -1, -1)):
                for row in order:
                    np.minimum(level[row - order.step], ceiling[row], out=reached)
                    np.maximum(level[row], reached, out=level[row])
            np.copyto(turned, level.T)
            level, turned = turned, level
        if np.array_equal(before, level):
            return level


def extreme(values: NDArray[Any], size: int, choose: Callable[..., NDArray[Any]], nothing: float) -> NDArray[Any]:
    """The extreme over a square of odd side around each pixel, from spans that double."""
    found = np.pad(values, size // 2, constant_values=nothing)
    for _axis in range(2):
        span = 1
        while span < size:
            step = min(span, size - span)
            found = choose(found[:-step], found[step:])
            span += step
        found = np.ascontiguousarray(found.T)
    return found
