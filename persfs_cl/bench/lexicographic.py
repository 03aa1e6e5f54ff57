"""The sweep of lexicographic.c, line by line in Python: for numba, which compiles it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


def sweep(
    log_depth: Array,
    brightness: Array,
    x_table: Array,
    y_table: Array,
    parameters: Array,
    leftwards: int,
    upwards: int,
    one: np.floating,
    half: np.floating,
) -> None:
    """One Lax-Friedrichs sweep, in place.

    Parameters
    ----------
    log_depth, brightness : ndarray, shape (height, width)
        Z or W = -Z, and E, NaN where a pixel keeps its value; the frame is not visited.
    x_table, y_table : ndarray, shapes (3, width) and (3, height)
    parameters : ndarray, shape (9,)
        Those of :data:`persfs_cl._cl.parameters.COMMON`, then p0, q0 and inverse_norm.
    leftwards, upwards : int
        1: columns from the right, rows from the bottom.
    one, half : floating
        These two numbers, in the type of the arrays.
    """
    height, width = log_depth.shape
    sign = parameters[5]
    to_p, to_q = sign * parameters[0], sign * parameters[1]
    step_x, step_y = parameters[2], parameters[3]
    p0, q0, inverse_norm = parameters[6], parameters[7], parameters[8]
    for i in range(1, height - 1):
        row = height - 1 - i if upwards else i
        y, root_y, offset_y = y_table[0, row], y_table[1, row], y_table[2, row]
        for j in range(1, width - 1):
            column = width - 1 - j if leftwards else j
            x, root_x, offset_x = x_table[0, column], x_table[1, column], x_table[2, column]
            e, here = brightness[row, column], log_depth[row, column]
            left, right = log_depth[row, column - 1], log_depth[row, column + 1]
            up, down = log_depth[row - 1, column], log_depth[row + 1, column]

            p, q = (right - left) * to_p, (down - up) * to_q
            weight_x = e * root_x + offset_x
            weight_y = e * root_y + offset_y
            scale = half / (weight_x + weight_y)
            shade = ((x - p0) * p + ((y - q0) * q + one)) * inverse_norm
            regular = weight_x * (right + left) + (weight_y * (down + up) + shade)
            w = x * p + (y * q + one)
            norm = math.sqrt(w * w + (p * p + q * q))
            value = regular * scale - e * scale * norm

            highest = min(min(left, right) + step_x, min(up, down) + step_y)
            bounded = min(value, highest)
            log_depth[row, column] = min(here, bounded)
