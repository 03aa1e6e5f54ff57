"""Arrays, numbers and choices that a user gave: what they are, or an error that says why they are none.

Every check of an input is here, once, but for those of an image's maps, in :mod:`persfs_cl.maps`. Each takes the name
of the argument, by which its message begins, and what was given for it; the error carries both.
"""

from __future__ import annotations

import inspect
import math
import os
import sys
import warnings
from collections.abc import Collection
from numbers import Integral, Real
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.errors import ArgumentError, InputError, PersfsWarning
from persfs_cl.wording import brief, keyword

_MOST_NUMBERS = 2**31
"""An array of more, such as a broadcast one that takes no memory, would be copied, and take all there is."""

NEAREST, FARTHEST = 1e-30, 1e30
"""Depths from here to there can be squared, and written in single precision, in any unit that somebody may choose."""


def as_array(name: str, given: ArrayLike) -> NDArray[Any]:
    """The array that a user gave, perhaps the very one.

    Raises
    ------
    InputError
        When it is a path, its rows have unequal lengths, it has masked elements, or whatever an object raises that is
        asked for an array; or when it has more numbers than any image.
    """
    if isinstance(given, (str, bytes, os.PathLike)):
        raise InputError.about(name, given, "is no array: read the file first if it is a path.")
    # Without that module there are none; its import would delay every start of the command.
    if "numpy.ma" in sys.modules and isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        remedy = f"give {name}.filled(...), and the mask by itself."
        raise unlike(name, given, f"is a masked array, whose mask would be lost: {remedy}")
    try:
        values = np.asarray(given)
    except Exception as error:  # an object may raise anything
        raise unlike(name, given, f"is no array ({brief(error)}): give numbers in rows of equal length.") from error
    if values.size > _MOST_NUMBERS:
        raise unlike(
            name, given, f"has shape {values.shape}: give at most {_MOST_NUMBERS} numbers, of a smaller image."
        )
    return values


def as_floats(name: str, given: ArrayLike) -> Array:
    """The array that a user gave as float64, perhaps the very one.

    Raises
    ------
    InputError
        When it is no array, see :func:`as_array`, or holds something else than real numbers.
    """
    values = as_array(name, given)
    if values.dtype.kind not in "iuf":
        # A scene, or a solution.
        if values.ndim == 0 and (held := next((each for each in (name, "depth") if hasattr(given, each)), None)):
            raise unlike(name, given, f"is a {type(given).__name__}, no array: give its .{held}.")
        raise unlike(name, given, f"holds {values.dtype}, not numbers: give an array of floats.")
    return to_float64(values)


def to_float64(values: NDArray[Any]) -> Array:
    """Numbers in double precision; those of longer types that it does not reach become infinite."""
    with np.errstate(over="ignore", invalid="ignore"):
        return values.astype(np.float64, copy=False)


def as_mask(name: str, given: ArrayLike, shape: tuple[int, ...] | None = None, whose: str = "image") -> Mask:
    """The array of bool that a user gave, of a shape if it is known, else of any (height, width).

    Raises
    ------
    InputError
        When it is no array, not of bool, or has another shape.
    """
    pixels = as_array(name, given)
    if pixels.dtype != bool or (pixels.ndim != 2 if shape is None else pixels.shape != shape):
        wanted = "shape (height, width)" if shape is None else f"the {whose}'s shape {shape}"
        hint = "" if pixels.dtype == bool else f", such as {name} > 0"
        raise unlike(name, given, f"is {pixels.dtype} of shape {pixels.shape}: give a bool array of {wanted}{hint}.")
    return pixels


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


def as_number(
    name: str,
    value: object,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    what: str = "possible",
    hint: str = "",
    error: type[ArgumentError] = InputError,
) -> float:
    """A finite number that a user gave, as a float.

    Parameters
    ----------
    name : str
    value : object
    least, above, most : float, optional
        Bounds: it may be `least`, must be above `above`, and may be `most`.
    what : str
        What it is not, where it is refused.
    hint : str
        What the message says after the bounds, before its full stop.
    error : type
        What is raised.

    Raises
    ------
    ArgumentError
        When it is no number, not finite, or out of the bounds. Texts and truth values are no numbers.
    """
    number = finite_number(value)
    # Written so that a NaN is refused too.
    inside = number >= (-math.inf if least is None else least)
    inside &= number > (-math.inf if above is None else above)
    inside &= number <= (math.inf if most is None else most)
    if not inside:
        raise error.about(name, value, f"is not {what}: give a finite number{_bounds(least, above, most)}{hint}.")
    return number


def as_whole_number(
    name: str,
    value: object,
    *,
    least: int = 0,
    most: int | None = None,
    odd: bool = False,
    what: str = "possible",
    hint: str = "",
) -> int:
    """A whole number that a user gave, as an int.

    Parameters
    ----------
    name : str
    value : object
    least, most : int
        It may be both.
    odd : bool
        Whether it must be odd.
    what, hint : str
        As for :func:`as_number`.

    Raises
    ------
    InputError
        When it is none, or out of the bounds. Floats, texts and truth values are none.
    """
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    # For the eyes of mypy, which does not see that what is whole can be compared.
    number = int(value) if whole else least - 1  # type: ignore[call-overload]
    if number < least or (most is not None and number > most) or (odd and number % 2 == 0):
        kind = "an odd number" if odd else "a whole number"
        raise InputError.about(name, value, f"is not {what}: give {kind}{_bounds(least, None, most)}{hint}.")
    return number


def as_numbers(
    name: str,
    value: object,
    counts: Collection[int],
    *,
    least: float = -math.inf,
    most: float = math.inf,
    what: str = "possible",
    remedy: str,
    error: type[ArgumentError] = InputError,
) -> tuple[float, ...]:
    """A few finite numbers that a user gave, such as a pair; a single one counts as a sequence of one.

    Parameters
    ----------
    name : str
    value : object
    counts : collection of int
        How many there may be.
    least, most : float
        Each may be both.
    what : str
        As for :func:`as_number`.
    remedy : str
        The sentence about what to give, without its full stop.
    error : type
        What is raised.

    Raises
    ------
    ArgumentError
        When it is something else.
    """
    numbers = finite_numbers(value) or ()
    if len(numbers) not in counts or not all(least <= number <= most for number in numbers):
        raise error.about(name, value, f"is not {what}: {remedy}.")
    return numbers


def as_flag(name: str, value: object, *, hint: str = "") -> bool:
    """A truth value that a user gave.

    Raises
    ------
    InputError
        When it is neither True nor False.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InputError.about(name, value, f"is no choice: give True{hint or ' or False'}.")
    return bool(value)


def check_choice(name: str, value: object, choices: Any, *, optional: bool = False) -> None:
    """InputError when the value of an argument is none of the choices.

    Parameters
    ----------
    name : str
    value : object
    choices : Literal or collection of str
        What it may be.
    optional : bool
        Whether it may be None too.
    """
    texts = get_args(choices) or tuple(choices)
    if (value is None and optional) or (isinstance(value, str) and value in texts):
        return
    *first, last = [*["None"] * optional, *(f'"{choice}"' for choice in texts)]
    listed = f"{', '.join(first)} or {last}" if first else last
    raise InputError.about(name, value, f"is unknown: choose {listed}.")


def check_finite(name: str, *values: float) -> None:
    """InputError when an argument is no number, or not finite."""
    if any(math.isnan(finite_number(value)) for value in values):
        raise InputError.about(name, values if len(values) > 1 else values[0], "is not finite: give numbers.")


def check_positive(name: str, value: float) -> None:
    """InputError when an argument is no finite number above 0."""
    as_number(name, value, above=0.0, what="a length")


def warn(message: str) -> None:
    """Warn, in the place where the package was called from, however many of its functions lie between.

    Parameters
    ----------
    message : str
        May mention keywords, see :func:`persfs_cl.wording.keyword`.
    """
    # Context managers and decorators of the standard library may lie between.
    within = (__package__, "contextlib", "functools")
    frame, level = inspect.currentframe(), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in within:
        frame, level = frame.f_back, level + 1
    warnings.warn(PersfsWarning(message), stacklevel=level)


def unlike(name: str, given: object, why: str) -> InputError:
    """The error about an array, which is not shown: its name, and why it cannot be used."""
    return InputError(f"{keyword(name)} {why}", argument=name, value=given)


def _bounds(least: float | None, above: float | None, most: float | None) -> str:
    """What follows "a number"."""
    if least is not None and most is not None:
        return f" from {least:g} to {most:g}"
    if least is not None:
        return f", {least:g} or more"
    lower = "" if above is None else f" above {above:g}"
    return lower if most is None else f"{lower}{',' if lower else ''} at most {most:g}"
