"""Linear light and what files and screens hold: the curve of sRGB, and whole levels."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array

_CELLS = 2**12


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
