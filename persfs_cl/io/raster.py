"""What a decoded image file holds: its samples, upright, and what they mean."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.colour import ColourSpace
from persfs_cl.io.code_points import CodePoints

# What each EXIF orientation but 1, upright, has done to the photo.
ON_A_SIDE = (5, 6, 7, 8)
"""EXIF orientations that exchange height and width."""
_ROWS_BACKWARDS, _COLUMNS_BACKWARDS = (3, 4, 7, 8), (2, 3, 6, 7)
"""After that."""
TURNED = {2: "mirrored", 3: "turned by 180°", 4: "flipped", 5: "transposed", 6: "turned", 7: "transposed", 8: "turned"}


@dataclass(frozen=True, eq=False)
class Raster:
    """Samples as the file holds them, upright: (H, W, C) with C = grey, grey + alpha, RGB or RGB + alpha.

    Attributes
    ----------
    samples : ndarray, shape (H, W, C)
    bits : int
        Of a sample.
    orientation : int
        By EXIF, already undone.
    space : ColourSpace, bytes, CodePoints or None
        What the file says of its numbers: what is known of them for sure, an ICC profile, or codes; None when nothing.
    """

    samples: NDArray[Any]
    bits: int
    orientation: int = 1
    space: ColourSpace | bytes | CodePoints | None = None

    @property
    def white(self) -> float:
        """The sample of full brightness."""
        return 1.0 if self.samples.dtype.kind == "f" else float(2**self.bits - 1)

    @property
    def colours(self) -> NDArray[Any]:
        """(H, W, 1) or (H, W, 3): the samples without alpha."""
        return self.samples[..., : 3 if self.samples.shape[2] > 2 else 1]

    @property
    def opaque(self) -> NDArray[np.bool_] | None:
        """(H, W), True where alpha is above one half; None without alpha."""
        has_alpha = self.samples.shape[2] in (2, 4)
        return np.asarray(self.samples[..., -1] > self.white / 2) if has_alpha else None


@dataclass(frozen=True)
class Header:
    """What a file says of its samples before they are decoded.

    Attributes
    ----------
    shape : tuple of int
        (height, width) of the upright image; of a NumPy file whatever it holds.
    bits : int
        Of a sample.
    dtype : dtype
    orientation : int
        By EXIF.
    """

    shape: tuple[int, ...]
    bits: int
    dtype: np.dtype[Any]
    orientation: int = 1


def unsigned(bits: int) -> np.dtype[Any]:
    """The type of whole samples of so many bits."""
    return np.dtype(np.uint16 if bits > 8 else np.uint8)


def exif_number(value: object) -> float | None:
    """An EXIF value as a number, whatever type it was written with; None when it is none, or several."""
    # Bytes are EXIF's BYTE, of which one is a number.
    values = tuple(value) if isinstance(value, bytes | tuple | list) else (value,)
    if len(values) == 1 and isinstance(values[0], tuple):  # exifread's floats
        values = values[0]
    if len(values) != 1 or not isinstance(values[0], SupportsFloat | str):
        return None
    try:
        number = float(values[0])
    except (TypeError, ValueError, ArithmeticError):  # a fraction over 0 is one of these
        return None
    return number if math.isfinite(number) else None


def exif_orientation(value: object) -> int:
    """EXIF's orientation; 1, upright, for what EXIF does not know, such as the 0 of some cameras."""
    number = value if isinstance(value, int) else exif_number(value)
    return int(number) if number in TURNED else 1


def upright_shape(size: tuple[int, int], orientation: int) -> tuple[int, int]:
    """(height, width) once EXIF's orientation is undone."""
    return size[::-1] if orientation in ON_A_SIDE else size


def upright(samples: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Undo EXIF's orientation: 1 is upright, 3 upside down, 6 and 8 on a side, the others mirrored."""
    if orientation in ON_A_SIDE:
        samples = samples.swapaxes(0, 1)
    if orientation in _ROWS_BACKWARDS:
        samples = samples[::-1]
    if orientation in _COLUMNS_BACKWARDS:
        samples = samples[:, ::-1]
    return np.ascontiguousarray(samples)


def upright_places(places: Array, size: tuple[int, int], orientation: int) -> Array:
    """Where points of a photo of some height and width lie once :func:`upright` has turned it.

    Columns and rows, shape (points, 2), are counted from the outer edges of the first pixel.
    """
    columns, rows = places.T
    height, width = size
    if orientation in ON_A_SIDE:
        columns, rows, height, width = rows, columns, width, height
    if orientation in _ROWS_BACKWARDS:
        rows = height - rows
    if orientation in _COLUMNS_BACKWARDS:
        columns = width - columns
    return np.stack([columns, rows], axis=1)
