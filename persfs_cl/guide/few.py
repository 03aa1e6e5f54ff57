"""Few points: too few for neighbours to tell their noise from what the photograph errs in between."""

from __future__ import annotations

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.guide.cells import Cells

_MANY = 25
"""Points, from which on neighbours tell how much they scatter."""
_NOISE, _OF_RELIEF = 0.01, 0.02
"""In ln depth, and as a share of the relief, whichever is less: what single points are taken to err."""
_SIGMAS = 1.4826
"""From the median of absolute values to a standard deviation."""
_SHARES = np.linspace(0.0, 0.95, 20)
"""Of the variance, that neighbours may have in common."""
_DOUBT = 4.0
"""Points that would have to say that the photograph is right, for it to be believed as much as all others together."""
_LEAST = 1e-12
"""Variance, so that residuals that are all the same have a likelihood."""


def are_few(cells: Cells) -> bool:
    """Whether they are points, and few of them."""
    return cells.count < _MANY and cells.are_points


def noise_of_few(relief: float) -> float:
    """What is taken for the noise of points where nothing tells it."""
    return min(_NOISE, _OF_RELIEF * relief or _NOISE)


def scatter_of(residuals: Array) -> float:
    """By how much residuals, NaN for none, scatter around their median."""
    return _SIGMAS * float(np.nanmedian(np.abs(residuals - np.nanmedian(residuals))))


def kriged(residuals: Array, cells: Cells, noise: float, *, doubted: bool = False) -> Array:
    """The expected residual at each pixel, 0 far from all points.

    Simple kriging: residuals are a random function of mean 0 whose correlation falls as exp(-d / L), and noise. The
    share of either is averaged over all shares by their likelihood: few points do not tell it. L is the fewer pixels
    the fewer points there are: nothing is known then of what lies between them.

    Parameters
    ----------
    residuals : ndarray of float64, shape (cells,)
        NaN for those that do not count.
    cells : Cells
        Points.
    noise : float
        That they have at least.
    doubted : bool
        Whether the noise is a guess, so that the fewer points there are the less is believed: n / (n + 4).
    """
    from scipy.spatial.distance import cdist  # slow to import

    known = ~np.isnan(residuals) & ~np.isnan(cells.middles).any(axis=1)
    places, values = cells.middles[known], residuals[known]
    length = cells.spacing * cells.count / _MANY
    correlation = np.exp(-cdist(places, places) / length)
    together, alone = _variances(values, correlation)
    matrix = together * correlation + max(alone, noise**2) * np.eye(values.size)
    rows, columns = (np.arange(size) for size in cells.of_pixel.shape)
    found = np.zeros(cells.of_pixel.shape)
    # A point at a time: pixels times points may not fit into memory.
    believed = values.size / (values.size + _DOUBT) if doubted else 1.0
    weights = believed * together * np.linalg.solve(matrix, values)
    for (row, column), weight in zip(places, weights, strict=True):
        found += weight * np.exp(np.hypot(rows[:, None] - row, columns - column) / -length)
    return found


def _variances(values: Array, correlation: Array) -> tuple[float, float]:
    """Of what neighbours have in common, and of what each has alone."""
    count = values.size
    logarithms, variances = [], []
    for share in _SHARES:
        matrix = share * correlation + (1.0 - share) * np.eye(count)
        variance = max(float(values @ np.linalg.solve(matrix, values)) / count, _LEAST)
        logarithms.append(-0.5 * (count * np.log(variance) + np.linalg.slogdet(matrix)[1]))
        variances.append((share * variance, (1.0 - share) * variance))
    weights = np.exp(np.array(logarithms) - max(logarithms))
    together, alone = weights @ np.array(variances) / weights.sum()
    return float(together), float(alone)
