"""The method in plain NumPy, float64: the independent reference of every kernel.

Nothing here imports the OpenCL side or the solver. Sweeps go along anti-diagonals, whose cells do not read each other:
the same values as the paper's double loop, at NumPy's speed. What the upwind kernels have in closed form is found here
by bisection, from the Hamiltonian and the direction of its gradient alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Indices
from persfs_cl.grid import PixelGrid
from persfs_cl.masks import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, SWEPT
from persfs_cl.shading.equations import Equation, Slopes
from persfs_cl.shading.model import Model
from persfs_cl.solver.domain import Boundary
from persfs_cl.solver.schemes.scheme import Scheme

if TYPE_CHECKING:
    from persfs_cl.solver.problem import Problem

_QUADRANTS = ((0, 0), (1, 0), (0, 1), (1, 1))
_HALVINGS = 56
"""These take the widest bracket, some hundred pixels at the steepest slope, down to the rounding of a float64."""
_UNBOUNDED = 1e9
"""Stands for the slope at which H is least where it falls for ever."""


def constrained(here: Array, before: Array, after: Array, spacing: float, least: Array) -> Array:
    """Difference quotient along one axis; where a neighbour is missing (NaN) a state constraint.

    It is one-sided there, and stops at the slope `least` where H is smallest, so that H never rises with the inner
    neighbour. Where both neighbours are missing it is `least` itself.
    """
    from_after = np.fmin((after - here) / spacing, least)
    from_before = np.fmax((here - before) / spacing, least)
    one_sided = np.where(np.isnan(before), from_after, from_before)
    one_sided = np.where(np.isnan(before) & np.isnan(after), least, one_sided)
    return np.where(np.isnan(before + after), one_sided, (after - before) / (2.0 * spacing))


@dataclass
class Reference:
    """One problem and its state, stepped like the device's sweeps.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        W = ±Z, changed in place.
    brightness : ndarray of float64, shape (height, width)
        What the kernels read: E, or under a flash F or its logarithm.
    flags : ndarray of uint8, shape (height, width)
    boundary : Boundary
    grid : PixelGrid
    model : Model
    scheme : Scheme
    sign : float
        +1 for W = Z, -1 for W = -Z.
    max_slope : float
    linear : bool
        Extrapolate the boundary cells linearly, never below `lowest`.
    lowest : float
    least : ndarray of float64, shape (height, width)
        What no value may lie below; minus infinity where there is no such bound.
    """

    log_depth: Array
    brightness: Array
    flags: NDArray[np.uint8]
    boundary: Boundary
    grid: PixelGrid
    model: Model
    scheme: Scheme
    sign: float = 1.0
    max_slope: float = 30.0
    linear: bool = False
    lowest: float = 0.0
    least: Array = field(default_factory=lambda: np.array([[-np.inf]]))

    def __post_init__(self) -> None:
        self.least = np.broadcast_to(self.least, self.log_depth.shape)

    @classmethod
    def of(cls, problem: Problem, *, linear: bool = False) -> Reference:
        """The same as the kernels are given of a problem, at its start values; `linear` is a matter of the run."""
        return cls(
            log_depth=problem.start,
            brightness=problem.shading.astype(np.float64),
            flags=problem.domain.flags,
            boundary=problem.domain.boundary,
            grid=problem.grid,
            model=problem.model.in_unit(float(np.exp(problem.level))),
            scheme=problem.scheme,
            sign=problem.sign,
            max_slope=problem.max_slope,
            linear=linear,
            least=cls._least(problem),
        )

    @staticmethod
    def _least(problem: Problem) -> Array:
        """Of W = Z the bound from below is that of the nearest depth, of W = -Z that of the farthest."""
        if problem.depth_range is None:
            return np.array([[-np.inf]])
        bounds = problem.depth_range.cut(problem.window)
        depth = bounds.near if problem.sign > 0 else bounds.far
        return np.nan_to_num(problem.sign * (np.log(depth) + problem.offset) - problem.level, nan=-np.inf)

    def iterate(self) -> float:
        """Four sweeps, the boundary renewed after each; returns max |ΔZ|."""
        before = self.log_depth.copy()
        for leftwards, upwards in _QUADRANTS:
            self.sweep(leftwards, upwards)
            self.renew_boundary()
        return float(np.abs(self.log_depth - before).max())

    def sweep(self, leftwards: int, upwards: int) -> None:
        """One Gauss-Seidel sweep in the given direction."""
        height, width = self.log_depth.shape
        for diagonal in range(height + width - 1):
            rows = np.arange(max(0, diagonal - width + 1), min(diagonal, height - 1) + 1)
            columns = diagonal - rows
            if upwards:
                rows = height - 1 - rows
            if leftwards:
                columns = width - 1 - columns
            swept = (self.flags[rows, columns] & SWEPT) != 0
            self._update(rows[swept], columns[swept], [(leftwards, upwards)])

    def sweep_colour(self, colour: int) -> None:
        """Update all cells whose row + column has the parity `colour`."""
        rows, columns = np.nonzero(self.flags & SWEPT)
        chosen = (rows + columns) % 2 == colour
        self._update(rows[chosen], columns[chosen], _QUADRANTS)

    def renew_boundary(self) -> None:
        """Eq. (12): edges first, corners last; the values of a pass are computed before the first is written."""
        edges = self.boundary.edges
        for part in (slice(0, edges), slice(edges, None)):
            cells = self.boundary.cells[part]
            renewed = [
                self._renewed(int(cell), inwards)
                for cell, inwards in zip(cells, self.boundary.inwards[part], strict=True)
            ]
            values = self.log_depth.ravel()
            values[cells] = np.minimum(values[cells], renewed)

    def lax_friedrichs(self, rows: Indices, columns: Indices) -> Array:
        """New values of some cells, eq. (11) with its sign put right, and the bound on the slope."""
        here, left, right, up, down = self._around(rows, columns)
        dx, dy = self.grid.dx, self.grid.dy
        equation = self.equation(rows, columns, self.max_slope)
        p, q = self._gradient(here, left, right, up, down, equation)
        sum_x = np.where(np.isnan(left + right), 2.0 * here, left + right)
        sum_y = np.where(np.isnan(up + down), 2.0 * here, up + down)
        sigma_x, sigma_y = equation.viscosity()
        value = (
            -equation.hamiltonian(self.sign * p, self.sign * q)
            + sigma_x * sum_x / (2.0 * dx)
            + sigma_y * sum_y / (2.0 * dy)
        ) / (sigma_x / dx + sigma_y / dy + equation.dh_dz)
        steepest_x = np.fmin(left, right) + self.max_slope * dx
        steepest_y = np.fmin(up, down) + self.max_slope * dy
        return np.asarray(np.fmin(value, np.fmin(steepest_x, steepest_y)))

    def upwind(
        self, rows: Indices, columns: Indices, leftwards: int, upwards: int, *, both_edges: bool = False
    ) -> Array:
        """New values of some cells from the two neighbours that a sweep visits before; NaN where both are missing.

        The largest value that H allows given one neighbour, whatever the slope across (an edge), or given both (the
        triangle), which counts if H rises there with both slopes, so that both neighbours matter.

        Where H depends on Z the kernel follows one edge only: that which allows less at the steepness of the present
        value. So does this, unless `both_edges`.
        """
        here, left, right, up, down = self._around(rows, columns)
        dx, dy = self.grid.dx, self.grid.dy
        equation = self.equation(rows, columns, _UNBOUNDED)
        beside, per_x = (right, -self.sign / dx) if leftwards else (left, self.sign / dx)
        above, per_y = (down, -self.sign / dy) if upwards else (up, self.sign / dy)
        step_x, step_y = self.max_slope * dx, self.max_slope * dy
        level_p, level_q = self.model.level_slopes(self.grid.x[columns], self.grid.y[rows, 0])

        def along_x(value: Array) -> Slopes:
            p = per_x * (value - beside) + level_p
            return p, equation.at(value).argmin_q(p)

        def along_y(value: Array) -> Slopes:
            q = per_y * (value - above) + level_q
            return equation.at(value).argmin_p(q), q

        def between(value: Array) -> Slopes:
            return per_x * (value - beside) + level_p, per_y * (value - above) + level_q

        def allowed(slopes: Callable[[Array], Slopes], low: Array, high: Array, level: Array | None = None) -> Array:
            """Where H, at the slopes that belong to a value, becomes positive for good; H(level, P) if given."""
            for _ in range(_HALVINGS):
                value = 0.5 * (low + high)
                p, q = slopes(value)
                there = equation.at(value)
                rise_p, rise_q = there.gradient(p, q)
                excess = there.hamiltonian(p, q) + equation.dh_dz * (value if level is None else level)
                beyond = (excess > 0.0) & (per_x * rise_p + per_y * rise_q > 0.0)
                low, high = np.where(beyond, low, value), np.where(beyond, value, high)
            return low

        edge_x = allowed(along_x, beside - step_x, beside + step_x)
        edge_y = allowed(along_y, above - step_y, above + step_y)
        if equation.dh_dz and not both_edges:
            now_x = allowed(along_x, beside - step_x, beside + 1e3 * step_x, here)
            now_y = allowed(along_y, above - step_y, above + 1e3 * step_y, here)
            edge_x, edge_y = np.where(now_x >= now_y, np.nan, edge_x), np.where(now_x < now_y, np.nan, edge_y)
        highest = np.fmin(beside + step_x, above + step_y)
        triangle = allowed(between, np.fmin(beside, above) - step_x - step_y, highest)
        rise_p, rise_q = equation.at(triangle).gradient(*between(triangle))
        triangle[~((per_x * rise_p > 0.0) & (per_y * rise_q > 0.0))] = np.nan
        return np.asarray(np.fmin(np.fmin(np.fmin(edge_x, edge_y), triangle), highest))

    @cached_property
    def _numbers(self) -> dict[str, float]:
        """Of light and material, for the whole image: some are searched for over all its rays."""
        return self.model.numbers(self.grid, 1.0)

    def equation(self, rows: Indices, columns: Indices, steepest: float) -> Equation:
        """The equation at some cells."""
        x, y = self.grid.x[columns], self.grid.y[rows, 0]
        return self.model.equation(self.brightness[rows, columns], x, y, self._numbers, steepest)

    def _gradient(self, here: Array, left: Array, right: Array, up: Array, down: Array, equation: Equation) -> Slopes:
        """Central differences; where a neighbour is missing (NaN) one-sided ones, as far as H falls along them."""
        p = np.where(np.isnan(left + right), 0.0, (right - left) / (2.0 * self.grid.dx))
        q = np.zeros_like(p)
        for _ in range(3):
            q = constrained(here, up, down, self.grid.dy, self.sign * equation.argmin_q(self.sign * p))
            p = constrained(here, left, right, self.grid.dx, self.sign * equation.argmin_p(self.sign * q))
        return p, q

    def _update(self, rows: Indices, columns: Indices, quadrants: Sequence[tuple[int, int]]) -> None:
        values = self.log_depth[rows, columns]
        for candidate in self.scheme.plain_values(self, rows, columns, quadrants):
            values = np.fmin(values, np.maximum(candidate, self.least[rows, columns]))
        self.log_depth[rows, columns] = values

    def _around(self, rows: Indices, columns: Indices) -> tuple[Array, Array, Array, Array, Array]:
        """Values here, left, right, up and down; NaN where a neighbour is missing."""
        flags = self.flags[rows, columns]
        padded = np.pad(self.log_depth, 1)

        def beside(row: int, column: int, missing: int) -> Array:
            return np.where(flags & missing, np.nan, padded[rows + 1 + row, columns + 1 + column])

        return (
            self.log_depth[rows, columns],
            beside(0, -1, NO_LEFT),
            beside(0, 1, NO_RIGHT),
            beside(-1, 0, NO_UP),
            beside(1, 0, NO_DOWN),
        )

    def _renewed(self, cell: int, inwards: NDArray[np.int32]) -> float:
        values = self.log_depth.ravel()
        found = []
        for near, far in inwards.reshape(2, 2):
            if near != NONE:
                outwards = 2.0 * values[near] - values[far]
                found.append(max(outwards, self.lowest if self.linear else values[far]))
        width = self.log_depth.shape[1]
        flags = self.flags.flat[cell]
        for bit, stride, step in (
            (NO_LEFT, -1, self.grid.dx),
            (NO_RIGHT, 1, self.grid.dx),
            (NO_UP, -width, self.grid.dy),
            (NO_DOWN, width, self.grid.dy),
        ):
            if not flags & bit:
                found.append(values[cell + stride] + self.max_slope * step)
        return float(max(min(found), self.least.flat[cell]))
