"""Bright specks of a photograph: hot pixels and dust, found by how far they stand out, and replaced.

Under a light with fall-off brightness tells the distance, and what is too bright drags all that lies around it forward,
where what is too dark harms only itself. So what is brighter than its surroundings is replaced, and nothing else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.checks import unlike
from persfs_cl.preparation.highlights import extreme
from persfs_cl.preparation.normalise import checked

_WINDOW = 5
"""Side, in pixels, of what counts as the surroundings."""
_DEVIATIONS = 2.5
"""By how many robust standard deviations of its surroundings a speck is brighter than their median."""
_SHARE = 0.2
"""Of that median by which it is brighter at least."""
_NOTEWORTHY = 0.02
"""Share of the brightest value below which nothing can do harm, and noise stands out by itself."""
_LARGEST = 3
"""Pixels along a side of a speck: what is larger, such as a thin bright line, belongs to the surface."""
_AT_A_TIME = 2**15
_TO_SIGMA = 1.4826
"""Of a median deviation, for noise with a normal distribution."""


def replace_specks(image: ArrayLike, *, mask: ArrayLike | None = None) -> tuple[Array, Mask]:
    """Replace small bright specks by the median of what surrounds them.

    A speck is at most 3 pixels wide and high. Each of its pixels is brighter than the median of the 5 × 5 pixels around
    it by a fifth and by 2.5 robust standard deviations of these.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, not negative, on any scale.
    mask : array_like of bool, shape (H, W), optional
        Pixels to look at. Those outside are no surroundings either, and are returned as they came.

    Returns
    -------
    light : ndarray of float64, shape (H, W)
    specks : ndarray of bool, shape (H, W)
        True where a value was replaced.

    Raises
    ------
    InputError
        When the image has negative values, or `image` or `mask` cannot be used.
    """
    values, inside = checked(image, mask)
    if (lowest := float(values.min(where=inside, initial=np.inf))) < 0:
        raise unlike("image", image, f"goes down to {lowest:g}: linear light cannot be negative. Clip it at 0.")
    replaced, specks = without_specks(values, inside)
    return (values.copy() if replaced is values else replaced), specks


def without_specks(values: Array, inside: Mask) -> tuple[Array, Mask]:
    """See :func:`replace_specks`, of what has been checked; the same array where there are none."""
    specks = np.zeros_like(inside)
    rows, columns = _standing_out(values, inside)
    if not rows.size:
        return values, specks
    medians, deviations = _surroundings(values, inside, rows, columns)
    found = values[rows, columns] > medians + np.maximum(_DEVIATIONS * deviations, _SHARE * medians)
    specks[rows[found], columns[found]] = True
    specks = _small(specks)
    kept = specks[rows, columns]
    if not kept.any():
        return values, specks
    replaced = values.copy()
    replaced[rows[kept], columns[kept]] = medians[kept]
    return replaced, specks


def _standing_out(values: Array, inside: Mask) -> tuple[Indices, Indices]:
    """Pixels that may belong to a speck: brighter than the opening of the image, which no square fits into."""
    candidates = np.zeros_like(inside)
    height, reach = values.shape[0], 2 * (_WINDOW // 2)
    brightest = []

    def work(rows: slice) -> None:
        begin, end = max(0, rows.start - reach), min(height, rows.stop + reach)
        there = inside[begin:end]
        # Single precision finds the same pixels in half the time.
        light = values[begin:end].astype(np.float32)
        light[~there] = np.inf
        darkest = extreme(light, _WINDOW, np.minimum, np.inf)
        darkest[~there] = -np.inf
        opened = extreme(darkest, _WINDOW, np.maximum, -np.inf)
        own = slice(rows.start - begin, rows.stop - begin)
        candidates[rows] = there[own] & (light[own] > np.float32(1.0 + _SHARE) * opened[own])
        brightest.append(float(opened[own].max()))

    in_row_blocks(work, values.shape)
    rows, columns = np.nonzero(candidates)
    bright = values[rows, columns] > _NOTEWORTHY * max(brightest)
    return rows[bright], columns[bright]


def _surroundings(values: Array, inside: Mask, rows: Indices, columns: Indices) -> tuple[Array, Array]:
    """Median, and robust standard deviation, of the pixels around some."""
    margin = _WINDOW // 2
    padded = np.pad(np.where(inside, values, np.nan), margin, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (_WINDOW, _WINDOW))
    medians, deviations = np.empty(rows.size), np.empty(rows.size)
    for begin in range(0, rows.size, _AT_A_TIME):
        some = slice(begin, begin + _AT_A_TIME)
        around = windows[rows[some], columns[some]].reshape(-1, _WINDOW**2)
        medians[some] = np.nanmedian(around, axis=1)
        deviations[some] = _TO_SIGMA * np.nanmedian(np.abs(around - medians[some, None]), axis=1)
    return medians, deviations


def _small(specks: Mask) -> Mask:
    """Those that are not wider or higher than a speck."""
    from scipy.ndimage import find_objects, label  # slow to import

    numbers, count = label(specks, np.ones((3, 3)))
    small = np.zeros(count + 1, bool)
    for number, (rows, columns) in enumerate(find_objects(numbers), 1):
        small[number] = max(rows.stop - rows.start, columns.stop - columns.start) <= _LARGEST
    return np.asarray(small[numbers])
