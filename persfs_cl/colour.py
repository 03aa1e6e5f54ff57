"""Linear light and what files and screens hold: the curve of sRGB, colour spaces, and whole levels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array

Three: TypeAlias = tuple[float, float, float]

LUMINANCE: Three = (0.2126, 0.7152, 0.0722)
"""Shares of linear red, green and blue in the luminance, with the primaries of sRGB (Rec. 709)."""
_SPACE = slice(16, 20)
"""Where an ICC profile says what its numbers are."""
_CELLS = 2**12
Curve: TypeAlias = Literal["srgb", "linear", "profile", "pq", "hlg"]


def decode_srgb(values: ArrayLike) -> Array:
    """Linear light from sRGB values (IEC 61966-2-1).

    Parameters
    ----------
    values : array_like
        sRGB values, 0 (black) to 1 (white); the curve goes on above 1.

    Returns
    -------
    ndarray of float64
        Linear light on the same scale.
    """
    values = np.asarray(values, dtype=np.float64)
    curve = ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
    return np.asarray(np.where(values <= 0.04045, values / 12.92, curve))


def encode_srgb(values: ArrayLike) -> Array:
    """sRGB values from linear light, the inverse of `decode_srgb` (IEC 61966-2-1).

    Parameters
    ----------
    values : array_like
        Linear light, 0 (black) to 1 (white); the curve goes on above 1.

    Returns
    -------
    ndarray of float64
        sRGB values on the same scale.
    """
    values = np.asarray(values, dtype=np.float64)
    curve = 1.055 * np.maximum(values, 0.0) ** (1.0 / 2.4) - 0.055
    return np.asarray(np.where(values <= 0.0031308, values * 12.92, curve))


def decode_pq(values: ArrayLike) -> Array:
    """Linear light from values of the perceptual quantiser of HDR photos (SMPTE ST 2084, ITU-R BT.2100).

    Parameters
    ----------
    values : array_like
        0 (black) to 1, which are 10,000 cd/m².

    Returns
    -------
    ndarray of float64
        1 where the value is 1: paper white is 0.0203.
    """
    root = np.asarray(values, dtype=np.float64) ** (32.0 / 2523.0)
    share = np.maximum(root - 3424.0 / 4096.0, 0.0) / (2413.0 / 128.0 - 2392.0 / 128.0 * root)
    return np.asarray(share ** (16384.0 / 2610.0))


def decode_hlg(values: ArrayLike) -> Array:
    """Linear light of the scene from values of the hybrid log-gamma of HDR photos (ITU-R BT.2100).

    Parameters
    ----------
    values : array_like
        0 (black) to 1.

    Returns
    -------
    ndarray of float64
        1 where the value is 1: paper white, a value of 0.75, is 0.265.
    """
    values = np.asarray(values, dtype=np.float64)
    bright = (np.exp((values - 0.55991073) / 0.17883277) + 0.28466892) / 12.0
    return np.asarray(np.where(values <= 0.5, values**2 / 3.0, bright))


@dataclass(frozen=True)
class ColourSpace:
    """What numbers of a file mean: the curve to linear light, and the light of the primaries.

    Attributes
    ----------
    curve : {"srgb", "linear", "profile", "pq", "hlg"}
        How numbers become linear light: "profile" by the curves of `profile`, the last two as in HDR photos.
    name : str
        Of the profile, code or camera that says so; empty where nothing does.
    luminance, mean : (float, float, float)
        Shares of linear red, green and blue.
    gains : (float, float, float)
        Before the channels are compared, they are multiplied by these.
    to_srgb : three times (float, float, float), or None
        Linear sRGB colours by linear red, green and blue; None where these are sRGB's.
    profile : bytes
        The ICC profile, where the curve is of one.
    """

    curve: Curve
    name: str = ""
    luminance: Three = LUMINANCE
    mean: Three = (1 / 3, 1 / 3, 1 / 3)
    gains: Three = (1.0, 1.0, 1.0)
    to_srgb: tuple[Three, Three, Three] | None = None
    profile: bytes = b""

    def linear(self, values: ArrayLike, channel: int = 0) -> Array:
        """Linear light of one channel, whose numbers are from 0 to 1."""
        values = np.asarray(values, dtype=np.float64)
        if self.curve == "linear":
            return values
        if self.curve == "profile":
            return profile_light(self.profile, values, channel)
        return _DECODERS[self.curve](values)


_DECODERS: dict[str, Callable[[ArrayLike], Array]] = {"srgb": decode_srgb, "pq": decode_pq, "hlg": decode_hlg}


def three(values: ArrayLike) -> Three:
    """Three numbers."""
    first, second, third = np.asarray(values, dtype=np.float64).tolist()
    return first, second, third


def profile_light(profile: bytes, values: ArrayLike, channel: int = 0) -> Array:
    """Linear light by the curve that an ICC profile has for a channel.

    LittleCMS computes it in floating point: nothing is rounded to levels.

    Parameters
    ----------
    profile : bytes
        Of RGB or grey.
    values : array_like
        From 0 to 1.
    channel : int
        0 red, 1 green, 2 blue; of a grey profile any.

    Returns
    -------
    ndarray of float64
        1 where the value is 1.
    """
    values = np.asarray(values, dtype=np.float64)
    asked: Array = np.append(values.reshape(-1), 1.0)
    if profile[_SPACE] == b"RGB ":
        asked = asked[:, None] * np.eye(3)[channel]
    light = profile_xyz(profile, asked)[:, 1]
    return np.asarray(light[:-1] / light[-1]).reshape(values.shape)


def profile_xyz(profile: bytes, colours: Array) -> Array:
    """The colours X, Y and Z, with the white of D50, of n colours (n, 3) or n greys (n) of an ICC profile."""
    import imagecodecs

    grey = colours.ndim == 1
    found = imagecodecs.cms_transform(
        np.ascontiguousarray(colours[None]),
        profile,
        _xyz_profile(),
        colorspace="gray" if grey else "rgb",
        outcolorspace="xyz",
        outdtype="float64",
        intent=1,  # relative colorimetric: white is white
    )
    return np.asarray(found[0], dtype=np.float64)


@cache
def _xyz_profile() -> bytes:
    import imagecodecs

    return bytes(imagecodecs.cms_profile("xyz"))


def to_display(light: ArrayLike) -> NDArray[np.uint8]:
    """Linear light as 8-bit sRGB, for screens and vertex colours.

    Parameters
    ----------
    light : array_like
        Linear light; cut to [0, 1], NaN becomes 0.

    Returns
    -------
    ndarray of uint8, of the same shape

    Examples
    --------
    >>> from persfs_cl.io import to_display
    >>> to_display([0.0, 0.5, 1.0])
    array([  0, 188, 255], dtype=uint8)
    """
    first, changes = _display_table()
    share = np.fmin(np.fmax(np.asarray(light, dtype=np.float64), 0.0), 1.0)
    cell = np.asarray(share * _CELLS).astype(np.int32)
    return np.asarray(first[cell] + (share >= changes[cell]), dtype=np.uint8)


@cache
def _display_table() -> tuple[NDArray[np.uint8], Array]:
    """Of equal cells of linear light the level at their begin, and the least light of the next level.

    A cell is less than a level wide, so that the two tell the level of all light in it, exactly and far faster than
    powers do.
    """
    wanted = np.arange(1, 256)
    below, above = np.zeros(255), np.ones(255)
    # Halved until nothing lies between.
    while (((middle := 0.5 * (below + above)) > below) & (middle < above)).any():
        reached = quantised(encode_srgb(middle), 8) >= wanted
        above, below = np.where(reached, middle, above), np.where(reached, below, middle)
    begin = np.arange(_CELLS + 1) / _CELLS
    first = np.searchsorted(above, begin, side="right")
    return first.astype(np.uint8), np.append(above, np.inf)[first]


def quantised(values: NDArray[np.floating[Any]], bits: int) -> NDArray[np.unsignedinteger[Any]]:
    """Whole levels of values in [0, 1]; what lies outside is cut, NaN becomes 0."""
    white = 2**bits - 1
    levels: Array = np.rint(np.nan_to_num(values, nan=0.0).clip(0.0, 1.0) * white)
    return levels.astype(np.uint8 if bits == 8 else np.uint16)
