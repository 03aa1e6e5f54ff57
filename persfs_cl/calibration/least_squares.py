"""Robust least squares for a handful of numbers whose residuals are dear: Levenberg-Marquardt with weights.

First come Huber's, which lead to one minimum, and then Tukey's, by which outliers do not count at all. SciPy has no
weights that redescend to 0, which are what keeps parts of a surface out that a jump drags along; and the sandwich that
tells the standard errors wants these weights with the Jacobian at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array, Indices
from persfs_cl.calibration.parameters import Parameter
from persfs_cl.errors import InputError

_HUBER, _TUKEY = 1.345, 4.685
"""In standard deviations: 95 % as efficient as plain least squares where all errors are normal."""
_LEAST_SCALE = 1e-4
"""A relative error below which neither brightness nor depth is taken to be known."""
_MOST_STEPS, _MOST_TRIALS, _LEAST_DAMPING = 30, 7, 1e-6
_SETTLED, _NEAR = 0.05, 0.5
"""In steps of differences: a step that is no larger is the last one, with Tukey's and with Huber's weights."""
_PRIOR = 0.1
"""Weight of the prior: nothing where the data tell, but they do not let go of what they cannot tell."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """Where a fit has come to.

    Attributes
    ----------
    numbers : ndarray of float64, shape (parameters,)
    residuals : ndarray of float64, shape (n,)
        NaN where there is none.
    jacobian : ndarray of float64, shape (n, parameters)
        0 where there is no residual.
    weights : ndarray of float64, shape (n,)
        Of each residual, less the smaller its group's scale is; 0 where there is none, or where it is an outlier.
    response : float
        By how much of a change of all residuals their weighted sum changes: less than 1, since weights change too.
    converged : bool
        Whether the numbers had settled when the steps came to an end.
    """

    numbers: Array
    residuals: Array
    jacobian: Array
    weights: Array
    response: float
    converged: bool

    @property
    def information(self) -> Array:
        """JᵀWJ, shape (parameters, parameters)."""
        return np.asarray(self.jacobian.T @ (self.jacobian * self.weights[:, None]))

    def step(self, used: Array, start: Array, spread: Array) -> Array:
        """Where some of the data alone would have led, by one step from here; `used` is 1 for these and 0 for others.

        The prior is that of :func:`fit`. The weights of outliers stay.
        """
        weights = self.weights * used
        held = _PRIOR / spread**2
        system = self.jacobian.T @ (self.jacobian * weights[:, None]) + np.diag(held)
        right = self.jacobian.T @ (weights * np.nan_to_num(self.residuals)) + held * (self.numbers - start)
        return np.asarray(self.numbers - np.linalg.solve(system, right))


def fit(
    residuals: Callable[[Array], Array],
    groups: Indices,
    parameters: Sequence[Parameter],
    begin: Array,
    start: Array,
    fineness: float = 1.0,
    callback: Callable[[int, float], object] | None = None,
) -> Fitted:
    """The numbers that make residuals small, all but outliers.

    Parameters
    ----------
    residuals : callable
        Of the numbers, shape (n,), NaN where there is none; InputError where the numbers are impossible.
    groups : ndarray of int, shape (n,)
        Which residuals have one scale: those of one photograph.
    parameters : sequence of Parameter
    begin, start : ndarray of float64
        Where to begin, and the middle of the prior.
    fineness : float
        Share of their steps by which differences are taken, where residuals are as smooth as that.
    callback : callable, optional
        Called with the number of each step and the typical residual.

    Raises
    ------
    InputError
        As the residuals, where the fit begins.
    """
    least, most, spread, step = (
        np.array([getattr(one, name) for one in parameters]) for name in ("least", "most", "spread", "step")
    )
    prior = _PRIOR / spread**2
    numbers, damping = np.clip(begin, least, most), _LEAST_DAMPING
    found, tukey, converged = residuals(numbers), False, False
    for count in range(1, _MOST_STEPS + 1):
        if callback is not None:
            callback(count, float(np.nanmedian(np.abs(found))))
        slopes = _differences(residuals, numbers, found, fineness * step, most)
        scale = _scales(found, groups)
        weights = _weights(found, scale, tukey)
        system = slopes.T @ (slopes * weights[:, None])
        gradient = slopes.T @ (weights * np.nan_to_num(found)) + prior * (numbers - start)
        here = _cost(found, scale, tukey) + 0.5 * float(prior @ (numbers - start) ** 2)
        for _trial in range(_MOST_TRIALS):
            damped = system + np.diag(prior + damping * np.diag(system))
            there = np.clip(numbers - np.linalg.solve(damped, gradient), least, most)
            moved = np.abs(there - numbers) / step
            tried = _or_none(residuals, there)
            if tried is not None and _cost(tried, scale, tukey) + 0.5 * float(prior @ (there - start) ** 2) <= here:
                numbers, found, damping = there, tried, max(damping / 30.0, _LEAST_DAMPING)
                break
            damping *= 30.0
        else:
            moved = np.zeros_like(step)
        if moved.max(initial=0.0) <= (_SETTLED if tukey else _NEAR) or (not tukey and count >= _MOST_STEPS // 2):
            if tukey:
                converged = True
                break
            tukey, damping = True, _LEAST_DAMPING
    scale = _scales(found, groups)
    weights = _weights(found, scale, True)
    return Fitted(numbers, found, slopes, weights, _response(found, scale), converged)


def _differences(residuals: Callable[[Array], Array], numbers: Array, found: Array, step: Array, most: Array) -> Array:
    """Derivatives of the residuals, by forward differences; 0 where there is none."""
    columns = []
    for place in range(numbers.size):
        slope = np.zeros_like(found)
        ahead = step[place] if numbers[place] + step[place] <= most[place] else -step[place]
        for length in (ahead, -ahead):
            there = numbers.copy()
            there[place] += length
            if (moved := _or_none(residuals, there)) is not None:
                slope = np.nan_to_num((moved - found) / length)
                break
        columns.append(slope)
    return np.stack(columns, axis=1)


def _or_none(residuals: Callable[[Array], Array], numbers: Array) -> Array | None:
    try:
        return residuals(numbers)
    except InputError:
        # Such as a lamp within the surface: not that way.
        return None


def _scales(found: Array, groups: Indices) -> Array:
    """Standard deviation of each residual, from the median of its group."""
    scale = np.full(found.shape, _LEAST_SCALE)
    for group in np.unique(groups):
        own = np.abs(found[groups == group])
        if np.isfinite(own).any():
            scale[groups == group] = max(_LEAST_SCALE, 1.4826 * float(np.nanmedian(own)))
    return scale


def _weights(found: Array, scale: Array, tukey: bool) -> Array:
    """Weights over the square of the scale."""
    if tukey:
        share = np.nan_to_num(found / (_TUKEY * scale), nan=1.0)
        weights = np.maximum(0.0, 1.0 - share**2) ** 2
    else:
        weights = 1.0 / np.maximum(1.0, np.abs(np.nan_to_num(found, nan=np.inf)) / (_HUBER * scale))
    return np.asarray(weights / scale**2)


def _response(found: Array, scale: Array) -> float:
    """Mean derivative of weight times residual, over the mean weight."""
    square = (found[np.isfinite(found)] / (_TUKEY * scale[np.isfinite(found)])) ** 2
    inside = np.maximum(0.0, 1.0 - square)
    return float(max(0.1, np.sum(inside * (1.0 - 5.0 * square)) / max(1e-9, np.sum(inside**2))))


def _cost(found: Array, scale: Array, tukey: bool) -> float:
    """The sum that the weights stand for. One that has no residual costs as much as an outlier."""
    share = np.abs(found / scale)
    if tukey:
        inside = np.maximum(0.0, 1.0 - np.nan_to_num(share / _TUKEY, nan=1.0) ** 2)
        return float(np.sum(1.0 - inside**3)) * _TUKEY**2 / 6.0
    share = np.nan_to_num(share, nan=_TUKEY)
    return float(np.sum(np.where(share <= _HUBER, 0.5 * share**2, _HUBER * (share - 0.5 * _HUBER))))
