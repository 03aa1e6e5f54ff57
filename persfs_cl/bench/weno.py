"""Third-order WENO differences in the Lax-Friedrichs sweep: a scheme that was tried, and not taken.

Y.-T. Zhang, H.-K. Zhao, J. Qian, "High order fast sweeping methods for static Hamilton-Jacobi equations", Journal of
Scientific Computing 29 (2006), 25-56. From the derivatives p-, p+, q-, q+ of third order, each from its side, a sweep
takes at every pixel

    Z := Z + (s_x (p+ - p-) / 2 + s_y (q+ - q-) / 2 - H((p- + p+) / 2, (q- + q+) / 2)) / (s_x / dx + s_y / dy)

even where that lies above the present value, since a correction may. Two rows and columns all round must be known.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.bench.baselines import compiled_by_numba
from persfs_cl.scenes.scene import Scene

_REGULAR = 1e-6
"""Keeps the weights finite where the surface is a parabola: ε of the paper."""
_DIRECTIONS = ((1, 1), (-1, 1), (1, -1), (-1, -1))


def solve(
    scene: Scene, unknown: NDArray[np.bool_], start: Array, *, tolerance: float, max_iterations: int
) -> tuple[Array, int, bool]:
    """Sweep on from a surface until it changes by no more than the tolerance.

    Parameters
    ----------
    scene : Scene
        Lambertian, under a frontal parallel light.
    unknown : ndarray of bool, shape (height, width)
        True where to solve: not in the two outermost rows and columns.
    start : ndarray of float64, shape (height, width)
        Z = ln z, right where it is known.
    tolerance : float
        Largest change of Z in an iteration.
    max_iterations : int
        Of four sweeps each.

    Returns
    -------
    log_depth : ndarray of float64, shape (height, width)
    iterations : int
    settled : bool
        Whether it came to the tolerance.

    Raises
    ------
    UnavailableError
        When numba is not installed.
    """
    sweep = _sweep()
    grid = scene.camera.grid((start.shape[0], start.shape[1]))
    sign = 1.0 if scene.surface == "away" else -1.0
    values = sign * start
    iterations, change = 0, math.inf
    while change > tolerance and iterations < max_iterations:
        iterations += 1
        change = max(
            sweep(values, unknown, scene.image, grid.x.ravel(), grid.y.ravel(), grid.dx, grid.dy, sign, *direction)
            for direction in _DIRECTIONS
        )
    return sign * values, iterations, change <= tolerance


@functools.cache
def _sweep() -> Any:
    one_sided = compiled_by_numba(_one_sided)

    def sweep(
        values: Array,
        unknown: NDArray[np.bool_],
        brightness: Array,
        x: Array,
        y: Array,
        dx: float,
        dy: float,
        sign: float,
        column_step: int,
        row_step: int,
    ) -> float:
        """One sweep, in place, over `sign` times Z; returns the largest change."""
        height, width = values.shape
        change = 0.0
        for i in range(2, height - 2):
            row = i if row_step > 0 else height - 1 - i
            for j in range(2, width - 2):
                column = j if column_step > 0 else width - 1 - j
                if not unknown[row, column]:
                    continue
                here, e, a, b = values[row, column], brightness[row, column], x[column], y[row]
                left, right = values[row, column - 1], values[row, column + 1]
                up, down = values[row - 1, column], values[row + 1, column]
                p_before = one_sided(values[row, column - 2], left, here, right) / dx
                p_after = -one_sided(values[row, column + 2], right, here, left) / dx
                q_before = one_sided(values[row - 2, column], up, here, down) / dy
                q_after = -one_sided(values[row + 2, column], down, here, up) / dy
                p, q = 0.5 * sign * (p_before + p_after), 0.5 * sign * (q_before + q_after)
                # Eq. (7) with the light at (0, 0), and bounds of its derivatives.
                w = 1.0 + a * p + b * q
                hamiltonian = e * math.sqrt(p * p + q * q + w * w) - w
                viscosity_x, viscosity_y = e * math.sqrt(1.0 + a * a) + abs(a), e * math.sqrt(1.0 + b * b) + abs(b)
                smoothing = 0.5 * (viscosity_x * (p_after - p_before) + viscosity_y * (q_after - q_before))
                step = (smoothing - hamiltonian) / (viscosity_x / dx + viscosity_y / dy)
                values[row, column] = here + step
                change = max(change, abs(step))
        return change

    return compiled_by_numba(sweep)


def _one_sided(second: float, first: float, here: float, beyond: float) -> float:
    """Derivative at `here` along the way from `second`, in units of a pixel: two differences weighed by smoothness."""
    ratio = (_REGULAR + (here - 2.0 * first + second) ** 2) / (_REGULAR + (beyond - 2.0 * here + first) ** 2)
    weight = 1.0 / (1.0 + 2.0 * ratio * ratio)
    return (1.0 - weight) * 0.5 * (beyond - first) + weight * 0.5 * (3.0 * here - 4.0 * first + second)
