"""Medians and percentiles of whole images, exact, and samples that stand for all pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Indices
from persfs_cl.blocks import row_blocks

_SAMPLES = 2**14
_MARGIN = 3 * 2**7
"""Ranks in the sample to each side of the one that is looked for: three standard deviations of the whole sample's."""
_LARGE = 2**18
"""Of fewer numbers NumPy finds a quantile as fast."""
_STRIDE = 40_503
"""By which samples are moved within their stretches, lest all lie in a few columns of an image."""


def median(values: Array) -> float:
    """Median of the numbers that are not NaN, as :func:`numpy.nanmedian`; NaN where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> from persfs_cl.quantiles import median
    >>> median(np.array([4.0, np.nan, 1.0, 2.0]))
    2.0
    """
    low, high, part = _around(values, 0.5)
    return 0.5 * (low + high) if part else low


def quantile(values: Array, share: float) -> float:
    """Number below which a share of all lies that are not NaN, as :func:`numpy.nanquantile`; NaN where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> from persfs_cl.quantiles import quantile
    >>> quantile(np.array([4.0, np.nan, 1.0, 2.0]), 0.75)
    3.0
    """
    low, high, part = _around(values, share)
    return float(np.quantile([low, high], part))


def sampled(values: NDArray[np.generic], most: int) -> Indices:
    """Places of some numbers in the flat array, evenly spread over it; of all when there are no more than `most`.

    Examples
    --------
    >>> import numpy as np
    >>> from persfs_cl.quantiles import sampled
    >>> sampled(np.zeros((2, 2)), most=10)
    array([0, 1, 2, 3])
    """
    if values.size <= most:
        return np.arange(values.size)
    stretch = values.size // most
    stretches = np.arange(most)
    return stretches * stretch + stretches * _STRIDE % stretch + stretches * (values.size - stretch * most) // most


def _around(values: Array, share: float) -> tuple[float, float, float]:
    """The numbers of the ranks next to a quantile, and how far it is on the way from one to the other, 0 to 1.

    Numbers of a sample that surely lie to both sides of them leave few that have to be sorted.
    """
    flat = values.reshape(-1)
    some = flat[sampled(flat, _SAMPLES)] if flat.size > _LARGE else flat[:0]
    some = np.sort(some[~np.isnan(some)])
    place = share * (some.size - 1)
    begin, end = int(place) - _MARGIN, int(place) + 1 + _MARGIN
    least = some[begin] if begin >= 0 else -np.inf
    greatest = some[end] if end < some.size else np.inf
    count = below = 0
    found = []
    for part in row_blocks((flat.size, 1)):
        numbers = flat[part]
        count += int(np.count_nonzero(numbers == numbers))
        below += int(np.count_nonzero(numbers < least))
        found.append(numbers[(numbers >= least) & (numbers <= greatest)])
    if not count:
        return np.nan, np.nan, 0.0
    near = np.concatenate(found)
    rank = int(share * (count - 1))
    first, last = rank - below, min(rank + 1, count - 1) - below
    if first < 0 or last >= near.size:
        near, first, last = flat[~np.isnan(flat)], rank, min(rank + 1, count - 1)
    near.partition((first, last))
    return float(near[first]), float(near[last]), share * (count - 1) - rank
