"""From the brightness of a photo to the normalised reflectance E: smooth, normalise, clip highlights.

Every function takes an (H, W) array of numbers and an optional mask (bool, True = use this pixel), looks only
at the pixels in the mask, and returns a new float64 array. Pixels outside the mask may hold anything, NaN
included; each function says what becomes of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.checks import as_mask, as_number, as_whole_number, unlike
from persfs_cl.errors import InputError
from persfs_cl.maps import as_image

_LARGEST = 1e100
"""Of a number of an image: products of it with any other still have a double-precision number."""


def mean_filter(image: ArrayLike, size: int, mask: ArrayLike | None = None) -> Array:
    """Mean over a square window, the smoothing that the paper applies to its photograph (section 4.2).

    Near the edge of the image or mask the mean is taken over the pixels that exist.

    Parameters
    ----------
    image : array_like, shape (H, W)
    size : int
        Side of the window in pixels: odd, at most the shorter side of the image. 1 changes nothing.
    mask : array_like of bool, shape (H, W), optional
        Pixels to use. Those outside are returned as they came.

    Returns
    -------
    ndarray of float64, shape (H, W)

    Raises
    ------
    InputError
        When `size` is not such a number, or `image` or `mask` cannot be used.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.mean_filter([[0, 0, 0], [0, 9, 0], [0, 0, 0]], 3)
    array([[2.25, 1.5 , 2.25],
           [1.5 , 1.  , 1.5 ],
           [2.25, 1.5 , 2.25]])
    """
    values, inside = checked(image, mask)
    size = as_whole_number("size", size, least=1, odd=True, what="a width", hint=", such as 3 or 5")
    if size > min(values.shape):
        raise InputError.about("size", size, f"is larger than the image, {_size(values)}: give a smaller mean filter.")
    margin = size // 2
    light, present = np.pad(np.where(inside, values, 0.0), margin), np.pad(inside, margin)
    filtered = values.copy()
    for rows in row_blocks(values.shape):
        near = slice(rows.start, rows.stop + 2 * margin)
        total = _window_sum(light[near], size)
        count = _window_sum(present[near].astype(np.float64), size)
        np.divide(total, count, out=filtered[rows], where=inside[rows])
    return filtered


def normalise_grey(image: ArrayLike, mask: ArrayLike | None = None, *, percentile: float = 100.0) -> Array:
    """Stretch the grey values to [0, 1], eq. (2): E = (I - I_min) / (I_max - I_min).

    This is the paper's recipe. On linear light it shifts E, because the darkest pixel becomes 0 whatever it
    was; `normalise_linear` keeps the shading equation exact.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Grey values on any scale, negative ones included.
    mask : array_like of bool, shape (H, W), optional
        Pixels that set I_min and I_max. Those outside are stretched alike, then cut to [0, 1].
    percentile : float
        In (0, 100]; I_max is this percentile, so that a few hot pixels do not set it. 100 is the brightest pixel,
        the paper's.

    Returns
    -------
    ndarray of float64, shape (H, W)
        E in [0, 1]: 0 at the darkest pixel, 1 at I_max and above.

    Raises
    ------
    InputError
        When all pixels up to the percentile have one value, `percentile` is impossible, or `image` or `mask` cannot
        be used.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.normalise_grey([[50, 100], [150, 250]])
    array([[0.  , 0.25],
           [0.5 , 1.  ]])
    """
    values, inside = checked(image, mask)
    darkest, brightest = float(values[inside].min()), _percentile(values, inside, percentile)
    if darkest == brightest:
        many = "Every pixel" if percentile == 100 else f"{percentile:g} %"
        raise InputError(
            f"{many} of the image is {darkest:g}: there is no shading in it. "
            "Give another image, or a mask that takes in more of it.",
            argument="image",
            value=image,
        )
    # What lies outside the mask may be anything.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.clip((values - darkest) / (brightest - darkest), 0.0, 1.0))


def brightest_diffuse(image: ArrayLike, *, mask: ArrayLike | None = None, percentile: float = 99.5) -> float:
    """Brightness of a matt surface where it faces the light: a percentile, which a few highlights do not move.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, not negative, on any scale.
    mask : array_like of bool, shape (H, W), optional
        Pixels to look at.
    percentile : float
        In (0, 100]; 100 is the brightest pixel.

    Returns
    -------
    float
        Above 0, in units of `image`.

    Raises
    ------
    InputError
        When so much of the image is black, `percentile` is impossible, or `image` or `mask` cannot be used.
    """
    values, inside = checked(image, mask)
    brightest = _percentile(values, inside, percentile)
    if brightest <= 0:
        raise InputError(
            f"{percentile:g} % of the image is black: its brightest diffuse value cannot be told. "
            "Give another image, or a mask that leaves out what is black around the object.",
            argument="image",
            value=image,
        )
    return brightest


def normalise_linear(
    image: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    brightest: float | None = None,
    percentile: float = 99.5,
) -> Array:
    """Divide linear light by its brightest diffuse value, so that a pixel facing the light has E = 1.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, not negative, on any scale.
    mask : array_like of bool, shape (H, W), optional
        Pixels that set the brightest value. Those outside are divided alike, then cut to [0, 1].
    brightest : float, optional
        Brightness of the matt surface where it faces the light, in units of `image`. Left out, it is that of
        `brightest_diffuse`.
    percentile : float
        In (0, 100]; used when `brightest` is left out. 100 is the brightest pixel.

    Returns
    -------
    ndarray of float64, shape (H, W)
        E in [0, 1]; what is brighter than the brightest diffuse value is 1.

    Raises
    ------
    InputError
        When the image has negative values or is black, when `brightest` or `percentile` is impossible, or
        when `image` or `mask` cannot be used.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.normalise_linear([[0.1, 0.2], [0.3, 0.4]], percentile=100)
    array([[0.25, 0.5 ],
           [0.75, 1.  ]])
    """
    values, inside = checked(image, mask)
    negative = np.count_nonzero(values[inside] < 0)
    if negative:
        raise InputError(
            f"The image has {negative} negative pixels, the lowest {values[inside].min():g}: "
            "linear light cannot be negative. Clip it at 0, or use normalise_grey.",
            argument="image",
            value=image,
        )
    if brightest is None:
        brightest = brightest_diffuse(values, mask=inside, percentile=percentile)
    else:
        brightest = as_number("brightest", brightest, above=0.0, what="a brightness")
    # What lies outside the mask may be anything.
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(np.clip(values / brightest, 0.0, 1.0))


def clip_highlights(
    image: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    threshold: float | None = None,
    percentile: float = 99.0,
) -> tuple[Array, Mask]:
    """Cut highlights, where a shiny spot is brighter than the matt surface around it could be.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Brightness on any scale.
    mask : array_like of bool, shape (H, W), optional
        Pixels to look at. Those outside are returned as they came.
    threshold : float, optional
        Brightest value to keep, in units of `image`. Left out, it is a percentile of the image.
    percentile : float
        In (0, 100]; used when `threshold` is left out.

    Returns
    -------
    clipped : ndarray of float64, shape (H, W)
        The image with every brighter value set to the threshold.
    highlights : ndarray of bool, shape (H, W)
        True where a value was changed.

    Raises
    ------
    InputError
        When `threshold` or `percentile` is impossible, or `image` or `mask` cannot be used.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> matt, highlights = ps.clip_highlights([[0.2, 0.4], [0.3, 9.0]], threshold=0.5)
    >>> matt
    array([[0.2, 0.4],
           [0.3, 0.5]])
    >>> int(highlights.sum())
    1
    """
    values, inside = checked(image, mask)
    if threshold is None:
        threshold = _percentile(values, inside, percentile)
    else:
        threshold = as_number("threshold", threshold, what="a brightness")
    highlights = inside & (values > threshold)
    return np.where(highlights, threshold, values), highlights


def checked(image: ArrayLike, mask: ArrayLike | None) -> tuple[Array, Mask]:
    """The image as float64 and the mask as bool, each known to be usable.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Numbers, finite where the mask is True.
    mask : array_like of bool, shape (H, W), or None
        None is True everywhere.

    Returns
    -------
    values : ndarray of float64, shape (H, W)
        Perhaps the image itself: not to be changed, nor returned to a user as it is.
    inside : ndarray of bool, shape (H, W)

    Raises
    ------
    InputError
        When one of the two is of another kind, or the mask selects no pixel.
    """
    values = as_image("image", image)
    inside = np.ones(values.shape, dtype=np.bool_) if mask is None else as_mask("mask", mask, values.shape)
    if not inside.any():
        raise unlike("mask", mask, "selects no pixel: give one that is True where the image is to be used.")
    bad, largest = 0, 0.0
    for rows in row_blocks((values.shape[0], values.shape[1])):
        sizes = np.abs(values[rows])
        np.copyto(sizes, 0.0, where=~inside[rows])
        if not (most := float(sizes.max())) <= _LARGEST:
            bad += int(np.count_nonzero(~np.isfinite(sizes)))
        largest = max(largest, most)
    if bad:
        raise unlike("image", image, f"has {bad} NaN or infinite pixels: mask them out, or replace them.")
    if largest > _LARGEST:
        raise unlike("image", image, f"goes up to {largest:g}, of which sums overflow: divide it by its largest value.")
    return values, inside


def _percentile(values: Array, inside: Mask, percentile: float) -> float:
    share = as_number("percentile", percentile, above=0.0, most=100.0)
    return float(np.percentile(values[inside], share))


def _window_sum(padded: Array, size: int) -> Array:
    # Shifted slices are added instead of differences of cumulative sums: those cancel, and would leave
    # traces of a highlight (even negative ones) in black pixels next to it.
    height, width = (length - size + 1 for length in padded.shape)
    rows = np.zeros((height, padded.shape[1]))
    for shift in range(size):
        rows += padded[shift : shift + height]
    total = np.zeros((height, width))
    for shift in range(size):
        total += rows[:, shift : shift + width]
    return total


def _size(values: Array) -> str:
    return f"{values.shape[1]}×{values.shape[0]} pixels"
