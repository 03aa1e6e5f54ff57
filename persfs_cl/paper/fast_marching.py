"""Fast marching for a p² + b q² = F on pixels: first order, Godunov upwind, one visit to each pixel.

J. A. Sethian, "A fast marching level set method for monotonically advancing fronts", PNAS 93(4), 1996, 1591-1595.
With no product p q a pixel depends only on neighbours along its row and column that lie lower, so that pixels can be
settled for good in the order of their values.
"""

from __future__ import annotations

import functools
import heapq
import math
from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import UnavailableError

March = Callable[[Array, NDArray[np.bool_], Array, Array, Array], Array]


@functools.cache
def compiled() -> March:
    """:func:`march`, compiled by numba on its first call.

    Raises
    ------
    UnavailableError
        When numba is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise UnavailableError(f"numba cannot be imported ({error}): pip install 'persfs-cl[paper]'.") from error
    return cast("March", numba.njit(march))


def march(
    known_values: Array, solved: NDArray[np.bool_], weight_x: Array, weight_y: Array, right_hand_side: Array
) -> Array:
    """Settle all pixels that known values reach.

    Solves ``weight_x (W - W_x)² + weight_y (W - W_y)² = F`` at each pixel, with W_x and W_y the lower neighbours in its
    row and column, and without the term of a neighbour that is not below W: the Godunov upwind scheme. Plain Python for
    numba, see :func:`compiled`.

    Parameters
    ----------
    known_values : ndarray of float64, shape (height, width)
        W, NaN where unknown.
    solved : ndarray of bool, shape (height, width)
        Pixels that get a value, unless it is known. A pixel that is neither known nor solved is not there.
    weight_x, weight_y : ndarray of float64, shape (height, width)
        a / dx² and b / dy², above 0.
    right_hand_side : ndarray of float64, shape (height, width)
        F, at least 0.

    Returns
    -------
    ndarray of float64, shape (height, width)
        W, infinite where no known value reaches.
    """
    height, width = known_values.shape
    values = np.full((height, width), math.inf)
    open_pixels = solved.copy()
    settled = np.zeros((height, width), np.bool_)
    # Empty, but numba can tell from it what it will hold.
    heap = [(0.0, 0, 0) for _ in range(0)]
    for row in range(height):
        for column in range(width):
            if not math.isnan(known_values[row, column]):
                values[row, column] = known_values[row, column]
                open_pixels[row, column] = False
                heap.append((values[row, column], row, column))
    heapq.heapify(heap)
    while heap:
        _, row, column = heapq.heappop(heap)
        # A pixel is on the heap once for every value that it had; the lowest comes first, the others are void.
        if settled[row, column]:
            continue
        settled[row, column] = True
        for down, right in ((0, -1), (0, 1), (-1, 0), (1, 0)):
            i, j = row + down, column + right
            if not (0 <= i < height and 0 <= j < width) or settled[i, j] or not open_pixels[i, j]:
                continue
            beside, above = math.inf, math.inf
            if j > 0 and settled[i, j - 1]:
                beside = values[i, j - 1]
            if j + 1 < width and settled[i, j + 1]:
                beside = min(beside, values[i, j + 1])
            if i > 0 and settled[i - 1, j]:
                above = values[i - 1, j]
            if i + 1 < height and settled[i + 1, j]:
                above = min(above, values[i + 1, j])
            if beside <= above:
                low, high, weight_low, weight_high = beside, above, weight_x[i, j], weight_y[i, j]
            else:
                low, high, weight_low, weight_high = above, beside, weight_y[i, j], weight_x[i, j]
            force = right_hand_side[i, j]
            value = low + math.sqrt(force / weight_low)
            if value > high:
                # Both neighbours lie below: the larger root of the quadratic, which is not below `high`.
                total, step = weight_low + weight_high, high - low
                root = math.sqrt(max(0.0, total * force - weight_low * weight_high * step**2))
                value = low + (weight_high * step + root) / total
            if value < values[i, j]:
                values[i, j] = value
                heapq.heappush(heap, (value, i, j))
    return values
