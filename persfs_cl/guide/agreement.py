"""What cells of a guide and a surface say of each other: noise, a common offset, and where neither can be trusted.

Everything is in ln depth. A residual is ln guide - ln depth. The surface that a photograph alone gives errs to one
side: whatever is too near drags down all behind it. So residuals are skewed, and their most frequent value counts.
"""

from __future__ import annotations

import math

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.guide.cells import Cells
from persfs_cl.guide.few import are_few, noise_of_few

LEAST_NOISE, _LEAST_OF_RELIEF = 0.003, 0.006
"""In ln depth, and as a share of the relief, whichever is less: any guide is taken to have so much."""

_SIGMAS = 1.4826
"""From the median of absolute values to a standard deviation."""
_OF_NEIGHBOURS = 1.2
"""A difference from the median of neighbours scatters so much more than one value."""
_FEW = 8
"""Cells from which neighbours tell the noise."""
_AGREE = 3.0 * math.sqrt(2.0)
_SLACK = 0.5
"""Slope, in depths over distance aside, by which neighbours may differ besides."""
_NEEDED = 2
_STEPS_A_NOISE = 8
_MOST_STEPS = 2**18
_ROUNDS, _WIDEST, _SHRINKS = 25, 0.03, 0.8


def noise_of(residuals: Array, cells: Cells) -> float:
    """By how much neighbouring residuals scatter; `cells` are of ln depth."""
    there = ~np.isnan(residuals)
    relief = float(np.ptp(np.percentile(cells.values[there], (2, 98)))) if there.any() else 0.0
    beside = cells.beside(residuals)
    known = there & ~np.isnan(beside).all(axis=1)
    if np.count_nonzero(known) < _FEW or are_few(cells):
        return noise_of_few(relief)
    differences = residuals[known] - np.nanmedian(beside[known], axis=1)
    scatter = _SIGMAS * float(np.median(np.abs(differences))) / _OF_NEIGHBOURS
    return max(scatter, min(LEAST_NOISE, _LEAST_OF_RELIEF * relief or LEAST_NOISE))


def mode_of(residuals: Array, noise: float) -> float:
    """The most frequent residual, of a density smoothed by the noise."""
    from scipy.ndimage import gaussian_filter1d  # slow to import

    known = np.sort(residuals[~np.isnan(residuals)])
    lowest, highest = known[0] - 4.0 * noise, known[-1] + 4.0 * noise
    steps = min(_MOST_STEPS, math.ceil((highest - lowest) / noise * _STEPS_A_NOISE) + 1)
    counts, edges = np.histogram(known, steps, (lowest, highest))
    density = gaussian_filter1d(counts.astype(np.float64), noise / (edges[1] - edges[0]), mode="constant")
    peak = int(np.argmax(density))
    return float(0.5 * (edges[peak] + edges[peak + 1]))


def drift_of(residuals: Array, cells: Cells, noise: float) -> Array:
    """A quadratic of row and column that most residuals lie near, at each cell."""
    middles = cells.middles
    known = ~np.isnan(residuals) & ~np.isnan(middles).any(axis=1)
    extent = max(1.0, float(np.ptp(middles[known], axis=0).max()))
    v, u = np.nan_to_num((middles - middles[known].mean(axis=0)) / extent).T
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    factors = np.zeros(terms.shape[1])
    factors[0] = mode_of(residuals, noise)
    for number in range(_ROUNDS):
        scale = max(noise, _WIDEST * _SHRINKS**number)
        error = residuals - terms @ factors
        weight = np.where(known, 1.0 / (1.0 + (error / scale) ** 2) ** 2, 0.0)
        weighted = terms[known] * weight[known, None]
        # A little of each, so that few cells determine them too.
        normal = weighted.T @ terms[known] + 1e-6 * weight.sum() * np.eye(terms.shape[1])
        factors = np.linalg.solve(normal, weighted.T @ residuals[known])
    return np.asarray(terms @ factors)


def distortion_of(residuals: Array, trusted: Mask, noise: float) -> float:
    """What a guide errs beyond its noise, of residuals less their offset: of those below, where nothing drags."""
    below = residuals[trusted & (residuals < 0.0)]
    if below.size == 0:
        return 0.0
    scatter = _SIGMAS * float(np.median(-below))
    return math.sqrt(max(scatter**2 - noise**2, 0.0))


def agreeing(residuals: Array, cells: Cells, noise: float, step: float) -> Mask:
    """Cells of which at least two neighbours say the same, in residual or in depth.

    Parameters
    ----------
    residuals : ndarray of float64, shape (cells,)
    cells : Cells
        Of ln depth.
    noise : float
    step : float
        Between neighbouring cells, in depths aside.
    """
    known = ~np.isnan(residuals)
    with np.errstate(invalid="ignore"):
        difference = np.fmin(
            np.abs(cells.beside(residuals) - residuals[:, None]),
            np.abs(cells.beside(cells.values) - cells.values[:, None]),
        )
        near = difference < _AGREE * noise + _SLACK * step
    # Of a few points there may be no two.
    needed = np.minimum(_NEEDED, (~np.isnan(cells.beside(residuals))).sum(axis=1))
    return np.asarray(known & (near.sum(axis=1) >= needed))
