"""Paint found along with the surface: piecewise smooth, and by a prior that says what is shading and what is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.choices import Precision
from persfs_cl.solver.energy.minimise import Minimum, Stopping
from persfs_cl.solver.energy.reference import slopes_of
from persfs_cl.solver.energy.regularised import Sought, regularised
from persfs_cl.surface.outcome import Status

SPREADS = (0.2, 0.12, 0.08, 0.05)
"""Of what ln albedo is off by, round after round: the surface is let go only as far as paint is told from shading."""

_STIFFNESS = 30.0
"""Paint is smoothed over the root of so many pixels..."""
_EDGE = 0.1
"""...but not where it changes by more than this from one pixel to the next."""
_REWEIGHTINGS, _STEPS, _ENOUGH = 6, 60, 1e-8
_DARKEST = 1e-3
"""Brightness, as a share of the brightest, below which nothing tells of paint."""


def fit_albedo(
    device: Device,
    sought: Sought,
    stopping: Stopping,
    *,
    smoothing: float | None = None,
    precision: Precision = "float32",
) -> tuple[Minimum, Array]:
    """Find a surface and its paint by turns.

    The paint of a surface is the photograph divided by the shading, smoothed but at its edges; the surface that of the
    photograph divided by the paint. Paint that follows the shape cannot be told from it: then the prior decides.

    Parameters
    ----------
    device : Device
    sought : Sought
        With a prior.
    stopping : Stopping
        Of each round.
    smoothing : float, optional
        Pixels to smooth the surface over; 3 when not given, since paint that is divided out leaves errors.
    precision : {"float32", "float64"}

    Returns
    -------
    found : Minimum
    albedo : ndarray of float64, shape (height, width)
        Share of light, 1 at most; NaN where nothing is solved.
    """
    prior = sought.prior
    assert prior is not None  # noqa: S101 - for the type checker
    solved = sought.solved
    least = _DARKEST * float(sought.image[solved].max())
    image = np.log(np.maximum(np.where(solved, sought.image, 1.0), least))
    log_depth = sought.filled(prior.log_depth)
    start: Array | None = None
    paint = np.where(solved, image - np.log(np.maximum(_shaded(sought, log_depth), least)), 0.0)
    found = Minimum(log_depth)
    rounds: list[Minimum] = []
    for spread in SPREADS:
        shading = np.log(np.maximum(_shaded(sought, log_depth), least))
        bare = np.where(solved, image - shading, 0.0)
        paint = piecewise_smooth(bare, solved, paint)
        # The level of paint is the surface's brightness as a whole, and found along with it.
        paint -= np.median(paint[solved])
        divided = np.where(solved, sought.image / np.exp(paint), 1.0)
        found = regularised(
            device,
            replace(sought, image=divided),
            replace(stopping, callback=_counting_on(stopping, sum(len(each.changes) for each in rounds))),
            paint=spread,
            smoothing=smoothing,
            fitted=True,
            precision=precision,
            start=start,
        )
        rounds.append(found)
        start = log_depth = found.log_depth + found.level
        if found.status is Status.STOPPED:
            break
    found.changes = [change for each in rounds for change in each.changes]
    found.build_seconds = sum(each.build_seconds for each in rounds)
    found.kernel_seconds = sum(each.kernel_seconds for each in rounds)
    # A matt surface returns no more than all light; what is brighter is noise, or a light that is too weak.
    return found, np.where(solved, np.minimum(np.exp(paint + found.white), 1.0), np.nan)


def _counting_on(stopping: Stopping, done: int) -> Callable[[int, float], bool | None] | None:
    """The callback, for iterations that follow others."""
    callback = stopping.callback
    return None if callback is None else lambda iteration, change: callback(done + iteration, change)


def piecewise_smooth(values: Array, there: Mask, start: Array | None = None) -> Array:
    """Values smoothed, but not across edges.

    The least of Σ (a - values)² + Σ g(a - a of neighbours), g the function of Geman and McClure, by quadratic problems
    in turn; in each the weight of a difference is 1 / (1 + (difference / edge)²)².

    Parameters
    ----------
    values : ndarray of float64, shape (height, width)
    there : ndarray of bool, shape (height, width)
        Pixels that count; the others get 0.
    start : ndarray of float64, shape (height, width), optional
        Where to begin; at the values themselves when not given.
    """
    smooth = np.where(there, values if start is None else start, 0.0)
    across, down = there[:, 1:] & there[:, :-1], there[1:] & there[:-1]
    for _ in range(_REWEIGHTINGS):
        weights = tuple(
            joined * _STIFFNESS / (1.0 + (np.diff(smooth, axis=axis) / _EDGE) ** 2) ** 2
            for joined, axis in ((across, 1), (down, 0))
        )
        smooth = _solved(np.where(there, values, 0.0), there, weights, smooth)
    return smooth


def _solved(values: Array, there: Mask, weights: tuple[Array, ...], first: Array) -> Array:
    """The least of a quadratic problem, by conjugate gradients."""
    across, down = weights

    def apply(field: Array) -> Array:
        result = np.where(there, field, 0.0)
        flow = across * np.diff(field, axis=1)
        result[:, 1:] += flow
        result[:, :-1] -= flow
        flow = down * np.diff(field, axis=0)
        result[1:] += flow
        result[:-1] -= flow
        return result

    diagonal = np.ones_like(values)
    diagonal[:, 1:] += across
    diagonal[:, :-1] += across
    diagonal[1:] += down
    diagonal[:-1] += down
    found, remainder = first.copy(), values - apply(first)
    direction, size = np.zeros_like(values), 1.0
    enough = _ENOUGH * float((values**2 / diagonal).sum())
    for _ in range(_STEPS):
        correction = remainder / diagonal
        before, size = size, float((remainder * correction).sum())
        if size <= enough:
            break
        direction = correction + size / before * direction
        product = apply(direction)
        length = size / float((direction * product).sum())
        found += length * direction
        remainder -= length * product
    return found


def _shaded(sought: Sought, log_depth: Array) -> Array:
    """Brightness of a surface without paint."""
    grid, present = sought.grid, sought.solved | ~np.isnan(sought.known)
    filled = np.where(present, log_depth, float(np.median(log_depth[present])))
    slopes = slopes_of(filled, present, grid)
    return sought.light.brightness(filled, *slopes, x=grid.x, y=grid.y, reflectance=sought.reflectance)
