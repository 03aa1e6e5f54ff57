"""How far an estimate lies from the truth: the paper's ME and RS, and their kin."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.checks import as_floats, as_mask, check_choice
from persfs_cl.errors import InputError
from persfs_cl.quantiles import median
from persfs_cl.wording import keyword

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

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.compare([1.0, 2.0, 4.0, 5.0], [1.0, 2.0, 4.0, 3.0])
    Errors(mean=0.5, root_mean_square=1.0, maximum=2.0, median=0.0, count=4)
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
        is infinite, ``align`` is unknown, a value is not positive under ``"scale"``, an array is constant under
        ``"range"``, or the arrays are so far apart that an error is no double-precision number.

    Examples
    --------
    A depth that is right up to its size:

    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> truth = np.array([[1.0, 1.5], [2.0, np.nan]])
    >>> ps.compare(2.0 * truth, truth).mean
    1.5
    >>> ps.compare(2.0 * truth, truth, align="scale").mean
    0.0
    """
    check_choice("align", align, Align, optional=True)
    estimated, true = as_floats("estimate", estimate), as_floats("truth", truth)
    if estimated.shape != true.shape:
        raise InputError(f"estimate has shape {estimated.shape} but truth has {true.shape}: give both the same shape.")
    compared = ~(np.isnan(estimated) | np.isnan(true))
    if mask is not None:
        compared &= as_mask("mask", mask, true.shape, whose="truth")
    if not compared.any():
        raise InputError(
            f"none of {true.size} pixels can be compared: at each, estimate or truth is NaN or mask is False."
            " Give at least one pixel that both arrays hold."
        )
    if compared.all():
        estimated, true = estimated.reshape(-1), true.reshape(-1)
    else:
        estimated, true = estimated[compared], true[compared]
    for name, values in (("estimate", estimated), ("truth", true)):
        if np.isinf(values).any():
            raise InputError(
                f"{name} is infinite at {np.isinf(values).sum()} compared pixels: use NaN for unknown values."
            )

    # What overflows is found at the end, once for all.
    with np.errstate(over="ignore", invalid="ignore"):
        errors = _aligned_errors(estimated, true, align)
    figures = errors.mean, errors.root_mean_square, errors.maximum, errors.median
    if errors.count < true.size or not np.isfinite(figures).all():
        largest = max(np.abs(values).max() for values in (estimated, true))
        raise InputError(
            f"estimate and truth, which go up to {largest:g}, are too far apart for double precision: give both in a "
            "unit in which they are nearer to 1, or mask out the values that are none."
        )
    return errors


def _aligned_errors(estimated: Array, true: Array, align: Align | None) -> Errors:
    """The errors of values that can be compared; some are not finite where a number is too large."""
    if align == "scale":
        for name, values in (("estimate", estimated), ("truth", true)):
            if values.min() <= 0:
                raise InputError(
                    f"{name} goes down to {values.min():g}, but {keyword('align', 'scale')} needs values above 0: mask "
                    f"such pixels out, or use {keyword('align', 'range')}.",
                    argument=name,
                )
        estimated = estimated * np.median(true / estimated)
    elif align == "range":
        estimated, true = _to_unit_range("estimate", estimated), _to_unit_range("truth", true)

    return errors_of(estimated - true)


def errors_of(differences: Array) -> Errors:
    """The errors of estimate - truth, in an array that is kept for absolute values; NaN where nothing is compared.

    Raises
    ------
    InputError
        When all are NaN.
    """
    flat = differences.reshape(-1)
    count = flat.size - int(np.count_nonzero(np.isnan(flat)))
    if not count:
        raise InputError(f"none of {flat.size} pixels can be compared, for one of two is NaN: give one that both have.")
    np.abs(flat, out=flat)
    maximum = float(np.fmax.reduce(flat))
    # A power of two, so that nothing is rounded, and squares neither overflow nor vanish.
    unit = math.ldexp(1.0, min(math.frexp(maximum)[1], 1023)) if math.isfinite(maximum) and maximum else 1.0
    sums, squares = [], []
    for some in row_blocks((flat.size, 1)):
        shares = flat[some] / unit
        if count < flat.size:
            np.copyto(shares, 0.0, where=np.isnan(shares))
        sums.append(shares.sum())
        shares *= shares
        squares.append(shares.sum())
    return Errors(
        mean=unit * float(np.sum(sums) / count),
        root_mean_square=unit * float(np.sqrt(np.sum(squares) / count)),
        maximum=maximum,
        median=median(flat),
        count=count,
    )


def _to_unit_range(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    least, greatest = values.min(), values.max()
    if least == greatest:
        raise InputError(
            f"{name} is {least:g} at every compared pixel, which {keyword('align', 'range')} cannot spread over "
            f"[0, 1]: compare more pixels, or use {keyword('align', 'scale')}.",
            argument=name,
        )
    return np.asarray((values - least) / (greatest - least))
