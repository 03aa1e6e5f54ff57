"""How far an estimate lies from the truth: the paper's ME and RS, and their kin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.errors import InputError

Align = Literal["scale", "range"]


@dataclass(frozen=True)
class Errors:
    """Absolute differences of two arrays, in the units of the arrays after alignment.

    Attributes
    ----------
    mean : float
        Mean of |estimate - truth|, the paper's ME.
    root_mean_square : float
        Square root of the mean of (estimate - truth)², the paper's RS.
    maximum, median : float
        Largest and median |estimate - truth|.
    count : int
        How many pixels were compared.
    """

    mean: float
    root_mean_square: float
    maximum: float
    median: float
    count: int


def compare(
    estimate: ArrayLike, truth: ArrayLike, *, mask: ArrayLike | None = None, align: Align | None = None
) -> Errors:
    """Compare an estimate with the truth, pixel by pixel.

    Parameters
    ----------
    estimate, truth : array_like of float, same shape
        Two depth maps or two images in the same units. Pixels that are NaN in either are left out.
    mask : array_like of bool, same shape, optional
        True = compare here.
    align : {None, "scale", "range"}
        What may differ without counting as an error. ``"scale"``: the estimate is first multiplied by the
        median of truth / estimate, since a depth under a parallel light is known up to a factor.
        ``"range"``: both are first mapped to [0, 1] by their own least and greatest compared values.

    Returns
    -------
    Errors

    Raises
    ------
    InputError
        When an array does not hold numbers, ``mask`` is not bool, the shapes differ, no pixel is left, a compared value
        is infinite, ``align`` is unknown, a value is not positive under ``"scale"``, or an array is constant under
        ``"range"``.
    """
    if align is not None and align not in get_args(Align):
        raise InputError(f'align={align!r} is unknown: choose None, "scale" or "range".')
    estimated, true = _numbers("estimate", estimate), _numbers("truth", truth)
    if estimated.shape != true.shape:
        raise InputError(f"estimate has shape {estimated.shape} but truth has {true.shape}: give both the same shape.")
    compared = ~(np.isnan(estimated) | np.isnan(true))
    if mask is not None:
        wanted = np.asarray(mask)
        if wanted.dtype != np.bool_:
            raise InputError(f"mask holds {wanted.dtype}, not bool: give mask > 0 or similar.")
        if wanted.shape != true.shape:
            raise InputError(f"mask has shape {wanted.shape} but truth has {true.shape}: give both the same shape.")
        compared &= wanted
    if not compared.any():
        raise InputError(
            f"none of {true.size} pixels can be compared: at each, estimate or truth is NaN or mask is False."
            " Give at least one pixel that both arrays hold."
        )
    estimated, true = estimated[compared], true[compared]
    for name, values in (("estimate", estimated), ("truth", true)):
        if np.isinf(values).any():
            raise InputError(
                f"{name} is infinite at {np.isinf(values).sum()} compared pixels: use NaN for unknown values."
            )

    if align == "scale":
        for name, values in (("estimate", estimated), ("truth", true)):
            if values.min() <= 0:
                raise InputError(
                    f'{name} goes down to {values.min():g}, but align="scale" needs values above 0:'
                    ' mask such pixels out, or use align="range".'
                )
        estimated = estimated * np.median(true / estimated)
    elif align == "range":
        estimated, true = _to_unit_range("estimate", estimated), _to_unit_range("truth", true)

    difference = np.abs(estimated - true)
    return Errors(
        mean=float(difference.mean()),
        root_mean_square=float(np.sqrt(np.mean(difference**2))),
        maximum=float(difference.max()),
        median=float(np.median(difference)),
        count=difference.size,
    )


def _numbers(name: str, given: ArrayLike) -> NDArray[np.float64]:
    try:
        values = np.asarray(given)
    except ValueError as error:
        raise InputError(f"{name} is no array ({error}): give numbers in rows of equal length.") from error
    if values.dtype.kind not in "iuf":
        raise InputError(f"{name} holds {values.dtype}, not numbers: give an array of floats.")
    return values.astype(np.float64, copy=False)


def _to_unit_range(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    least, greatest = values.min(), values.max()
    if least == greatest:
        raise InputError(
            f'{name} is {least:g} at every compared pixel, which align="range" cannot spread over [0, 1]:'
            ' compare more pixels, or use align=None or "scale".'
        )
    return np.asarray((values - least) / (greatest - least))
