"""Samples of a surface that stand for all of it: what is drawn between them is near to what was left out."""

from __future__ import annotations

import numpy as np

from persfs_cl.arrays import Array


def fitted_samples(values: Array, step: int) -> Array:
    """Values for every so many rows and columns, with which bilinear interpolation comes near to all values.

    Single values would have the noise of single pixels, and what is interpolated between them would lie on the inside
    of every curve. These are means of all values around, each weighted by its share of the sample in the interpolation
    (a tent, one step wide to each side), less a sixth of the second difference of these means: about the least squares
    fit, whose matrix has the inverse (-1, 8, -1) / 6 up to terms of fourth order. Of a linear function they are its
    values.

    Parameters
    ----------
    values : ndarray of float64, shape (height, width)
        NaN where there are none.
    step : int

    Returns
    -------
    ndarray of float64, shape (ceil(height / step), ceil(width / step))
        Of rows and columns 0, step, 2 step and so on; NaN within two steps of an edge or a NaN.
    """
    return _along_columns(_along_columns(values, step).T, step).T


def _along_columns(values: Array, step: int) -> Array:
    count = (len(values) - 1) // step + 1
    found = np.full((count, values.shape[1]), np.nan)
    if count < 5:
        return found
    means = np.zeros((count - 2, values.shape[1]))
    for offset in range(1 - step, step):
        first = step + offset
        means += (step - abs(offset)) / step**2 * values[first : first + (count - 3) * step + 1 : step]
    np.add(means[:-2], means[2:], out=found[2:-2])
    found[2:-2] /= -6.0
    found[2:-2] += 4.0 / 3.0 * means[1:-1]
    return found
