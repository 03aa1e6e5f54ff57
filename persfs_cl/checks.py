"""Arrays and numbers that a user gave: what they are, or an error that says why they are none."""

from __future__ import annotations

import inspect
import math
import os
import sys
import threading
import warnings
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.errors import InputError

_MOST_NUMBERS = 2**31
"""An array of more, such as a broadcast one that takes no memory, would be copied, and take all there is."""

NEAREST, FARTHEST = 1e-30, 1e30
"""Depths from here to there can be squared, and written in single precision, in any unit that somebody may choose."""

changing_warnings = threading.RLock()
"""Held around `warnings.catch_warnings`, which changes a state that all threads share.

Of two blocks at once, the one that ends last would bring back what the other had set.
"""


def as_array(name: str, given: ArrayLike) -> NDArray[Any]:
    """The array that a user gave, perhaps the very one.

    Raises
    ------
    InputError
        When it is a path, its rows have unequal lengths, it has masked elements, or whatever an object raises that is
        asked for an array; or when it has more numbers than any image.
    """
    if isinstance(given, (str, bytes, os.PathLike)):
        raise InputError(f"{name}={brief(given)} is no array: read the file first if it is a path.")
    # Without that module there are none; its import would delay every start of the command.
    if "numpy.ma" in sys.modules and isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        raise InputError(
            f"{name} is a masked array, whose mask would be lost: give {name}.filled(...), and the mask by itself."
        )
    try:
        values = np.asarray(given)
    except Exception as error:  # an object may raise anything
        raise InputError(f"{name} is no array ({brief(error)}): give numbers in rows of equal length.") from error
    if values.size > _MOST_NUMBERS:
        raise InputError(f"{name} has shape {values.shape}: give at most {_MOST_NUMBERS} numbers, of a smaller image.")
    return values


def as_floats(name: str, given: ArrayLike) -> NDArray[np.float64]:
    """The array that a user gave as float64, perhaps the very one.

    Raises
    ------
    InputError
        When it is no array, see :func:`as_array`, or holds something else than real numbers.
    """
    values = as_array(name, given)
    if values.dtype.kind not in "iuf":
        raise InputError(f"{name} holds {values.dtype}, not numbers: give an array of floats.")
    return to_float64(values)


def to_float64(values: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers in double precision; those of longer types that it does not reach become infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(np.float64, copy=False)


def as_mask(name: str, given: ArrayLike, shape: tuple[int, ...], whose: str = "image") -> NDArray[np.bool_]:
    """The array of bool that a user gave.

    Raises
    ------
    InputError
        When it is no array, not of bool, or has another shape.
    """
    pixels = as_array(name, given)
    if pixels.dtype != bool or pixels.shape != shape:
        raise InputError(
            f"{name} is {pixels.dtype} of shape {pixels.shape}: give a bool array of the {whose}'s shape {shape}."
        )
    return pixels


def brief(value: object) -> str:
    """`repr` of a value for a message: at most one line, whatever the value is."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # noqa: BLE001  # too many digits, or nested too deep: a message must not fail over it
        text = f"<{type(value).__name__}>"
    return text if len(text) <= 80 else f"{text[:79]}…"


def finite_number(value: object) -> float:
    """`value` as a number; NaN when it is none, or not finite. Texts and truth values are none."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if not isinstance(value, Real) or isinstance(value, bool):
        return math.nan
    try:
        number = float(value)
    except OverflowError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def finite_numbers(value: object) -> tuple[float, ...] | None:
    """The numbers in a scalar or a flat sequence, or None when it is neither, or one is not finite."""
    try:
        numbers = np.atleast_1d(np.asarray(value))
    except Exception:  # noqa: BLE001  # an object that is asked for an array may raise anything
        return None
    if numbers.dtype.kind not in "iuf" or numbers.ndim != 1 or numbers.size == 0:
        return None
    found = tuple(map(finite_number, numbers.tolist()))
    return None if any(map(math.isnan, found)) else found


def check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """InputError when the value of an argument is none of the choices."""
    if not isinstance(value, str) or value not in choices:
        *first, last = (f'"{choice}"' for choice in choices)
        listed = f"{', '.join(first)} or {last}"
        raise InputError(f"{name}={brief(value)} is unknown: choose {listed}.")


def check_finite(name: str, *values: float) -> None:
    """InputError when an argument is no number, or not finite."""
    if any(math.isnan(finite_number(value)) for value in values):
        raise InputError(f"{name}={brief(values if len(values) > 1 else values[0])} is not finite: give numbers.")


def check_positive(name: str, value: float) -> None:
    """InputError when an argument is no finite number above 0."""
    if not finite_number(value) > 0:
        raise InputError(f"{name}={brief(value)} is not a length: give a finite number above 0.")


def warn(message: str) -> None:
    """Warn, in the place where the package was called from, however many of its functions lie between."""
    # Context managers and decorators of the standard library may lie between.
    within = (__package__, "contextlib", "functools")
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in within:
        frame, level = frame.f_back, level + 1
    warnings.warn(message, UserWarning, stacklevel=level)


_READERS = {
    "image": "read_image(path)",
    "mask": "read_mask(path, shape)",
    "walls": "read_mask(path, shape)",
    "known_depth": "read_depth(path, shape)",
    "albedo": "read_light(path, shape)",
}
_ARRAYS_OF_PHOTOS = {"image": "its .image", "light": "its .light, or for a parallel light its .normalised().image"}


def as_map(name: str, given: ArrayLike) -> NDArray[Any]:
    """The image, or the map that goes with one, that a user gave, perhaps the very array.

    Raises
    ------
    InputError
        As :func:`as_array`; and when it is a path or a photograph, saying what to give instead.
    """
    if isinstance(given, (str, os.PathLike)):
        raise InputError(f"{name}={str(given)!r} is no array: give {_READERS[name]} if it is a path.")
    for attribute, remedy in _ARRAYS_OF_PHOTOS.items():
        if hasattr(given, attribute):
            raise InputError(f"{name} is a {type(given).__name__}, no array: give {remedy}.")
    return as_array(name, given)


def require_albedo(albedo: ArrayLike, used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The albedo as float64, shape (height, width), 1 where it is not used; InputError when it is none."""
    given = as_map("albedo", albedo)
    if given.shape != used.shape or not np.issubdtype(given.dtype, np.floating):
        raise InputError(
            f"albedo is {given.dtype} of shape {given.shape}: give a float array of the image's shape {used.shape}, "
            "the share of light in (0, 1] that each pixel's surface returns."
        )
    # Written so that a NaN is found too.
    if bad := int(np.count_nonzero(~((given > 0) & (given <= 1)) & used)):
        raise InputError(
            f"albedo is not in (0, 1] at {bad} pixels with a surface, where it ranges from {given[used].min():g} to "
            f"{given[used].max():g}: divide by its largest value, and mask out what is black or unknown."
        )
    return np.where(used, given, 1.0).astype(np.float64)
