"""What is not of the lamp, or not let through by the lens, taken out of a photograph's linear light."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import as_array, as_floats, unlike
from persfs_cl.maps import as_map
from persfs_cl.preparation.normalise import checked


def subtract_ambient(image: ArrayLike, ambient: ArrayLike, *, mask: ArrayLike | None = None) -> tuple[Array, Mask]:
    """Take away the light that would be there without the lamp.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light.
    ambient : float or array_like, shape (H, W)
        Ambient light or black level, not negative, on the scale of `image`: one number, or a second photograph
        without the lamp, which may hold anything outside the mask.
    mask : array_like of bool, shape (H, W), optional
        Pixels to use. Those outside are returned as they came.

    Returns
    -------
    light : ndarray of float64, shape (H, W)
        The difference; 0 where it is negative.
    below : ndarray of bool, shape (H, W)
        True where it is negative by more than rounding errors.

    Raises
    ------
    InputError
        When `ambient` has another shape, or is negative or not finite inside the mask; when `image` or `mask` cannot
        be used.
    """
    values, inside = checked(image, mask)
    offset = _map("ambient", ambient, values.shape)
    bad = inside & ~(np.isfinite(offset) & (offset >= 0))
    if bad.any():
        raise unlike(
            "ambient",
            ambient,
            f"is {offset[bad][0]:g} or so at {np.count_nonzero(bad)} pixels: give finite numbers, 0 or more.",
        )
    light = np.subtract(values, offset, out=values.copy(), where=inside)
    negative = inside & (light < 0)
    # A photo's grey level and the same level as ambient light may be decoded with different rounding errors.
    below = negative & (light < -1e-12 * offset)
    light[negative] = 0.0
    return light, below


def divide_vignetting(image: ArrayLike, vignetting: ArrayLike, *, mask: ArrayLike | None = None) -> Array:
    """Undo the darkening of a lens away from the middle of the image.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, less any ambient light.
    vignetting : array_like, shape (H, W)
        Share of the light that the lens lets through at each pixel, above 0. It may hold anything outside the mask.
    mask : array_like of bool, shape (H, W), optional
        Pixels to use. Those outside are returned as they came.

    Returns
    -------
    ndarray of float64, shape (H, W)

    Raises
    ------
    InputError
        When `vignetting` has another shape, or is not finite and above 0 inside the mask; when `image` or `mask`
        cannot be used.
    """
    values, inside = checked(image, mask)
    share = _map("vignetting", vignetting, values.shape)
    bad = inside & ~(np.isfinite(share) & (share > 0))
    if bad.any():
        raise unlike(
            "vignetting",
            vignetting,
            f"is {share[bad][0]:g} or so at {np.count_nonzero(bad)} pixels: give finite numbers above 0, or mask these "
            "pixels out.",
        )
    return np.divide(values, share, out=values.copy(), where=inside)


_RAYS = 64
"""Along a side of an image, of a lens with distortion."""

MOST_POWER = 20.0
"""A lens that darkens by a higher power of the cosine shows hardly anything but the middle."""

_LAW = re.compile(r"cos(\d{1,2}(?:\.\d{1,9})?)")


def cosine_power(law: str) -> float | None:
    """N of a law "cosN" of vignetting; None of any other text.

    Examples
    --------
    >>> from persfs_cl.preparation.correct import cosine_power
    >>> cosine_power("cos4"), cosine_power("cos2.5"), cosine_power("none")
    (4.0, 2.5, None)
    """
    found = _LAW.fullmatch(law)
    power = math.inf if found is None else float(found[1])
    return power if power <= MOST_POWER else None


def cosine_vignetting(camera: Camera, shape: tuple[int, int], power: float = 4.0) -> Array:
    """Share of the light that a lens lets through, a power of the cosine between viewing ray and optical axis.

    It is (1 + x² + y²)^(-power/2) in normalised coordinates. A simple lens has the power 4; lenses of many elements
    often darken less, and stops and narrow tubes add to it.

    Parameters
    ----------
    camera : Camera
    shape : (int, int)
        (height, width) of the image.
    power : float

    Returns
    -------
    ndarray of float64, shape `shape`
        In (0, 1]; 1 on the optical axis.

    Raises
    ------
    CameraError, InputError
        As :meth:`Camera.grid <persfs_cl.Camera.grid>`.
    """
    if camera.distortion is not None:
        return _bent_vignetting(camera, shape, power)
    grid = camera.grid(shape)
    return np.asarray((1.0 + grid.x**2 + grid.y**2) ** (-0.5 * power))


def _bent_vignetting(camera: Camera, shape: tuple[int, int], power: float) -> Array:
    """The same where the rays of a lens take long to find: of a few of them, and cubic in between."""
    from scipy.interpolate import RectBivariateSpline  # slow to import

    down, across = (np.linspace(0.0, side - 1.0, min(side, _RAYS)) for side in shape)
    pixels = np.stack(np.meshgrid(across, down), axis=-1)
    places = camera.places(pixels.reshape(-1, 2), shape)
    share = ((1.0 + (places**2).sum(axis=1)) ** (-0.5 * power)).reshape(down.size, across.size)
    # Where the lens shows nothing, anything above 0 will do.
    share = np.where(np.isnan(share), np.nanmin(share), share)
    order = [min(3, along.size - 1) for along in (down, across)]
    if min(order) < 1:
        return np.broadcast_to(share, shape)
    found = RectBivariateSpline(down, across, share, kx=order[0], ky=order[1])(np.arange(shape[0]), np.arange(shape[1]))
    return np.asarray(np.clip(found, share.min(), 1.0))


def _map(name: str, given: ArrayLike, shape: tuple[int, ...]) -> Array:
    """One number a pixel, from one an image or one a pixel."""
    whole = as_array(name, given).ndim == 0
    return np.broadcast_to(as_floats(name, given), shape) if whole else as_map(name, given, shape)
