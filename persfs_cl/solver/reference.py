"""The method in plain NumPy, float64: the independent judge of every kernel.

Nothing here imports the OpenCL side or the solver. Sweeps go along anti-diagonals, whose cells do not read each other:
the same values as the paper's double loop, at NumPy's speed. What the upwind kernels have in closed form is found here
by bisection, from the Hamiltonian and the direction of its gradient alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.camera import PixelGrid
from persfs_cl.masks import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, SWEPT
from persfs_cl.shading.light import Light, ParallelLight
from persfs_cl.shading.material import Lambertian, Reflectance
from persfs_cl.solver.domain import Boundary

if TYPE_CHECKING:
    from persfs_cl.solver.problem import Problem

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Slopes = tuple[Array, Array]

_QUADRANTS = ((0, 0), (1, 0), (0, 1), (1, 1))
_HALVINGS = 56
"""These take the widest bracket, some hundred pixels at the steepest slope, down to the rounding of a float64."""
_UNBOUNDED = 1e9
"""Stands for the slope at which H is least where it falls for ever."""


def surface_norm(p: Array, q: Array, x: Array, y: Array) -> Array:
    """S = sqrt(p² + q² + w²) with w = 1 + x p + y q, the length of the unnormalised normal, eq. (3)."""
    w = 1.0 + x * p + y * q
    return np.asarray(np.sqrt(p**2 + q**2 + w**2))


@dataclass(frozen=True)
class Direction:
    """Of a parallel light for each cell: its slopes, and k = sqrt(1 + p0² + q0²)."""

    p0: Array
    q0: Array
    norm: Array


def shade(p: Array, q: Array, x: Array, y: Array, light: ParallelLight | Direction) -> Array:
    """n / k = (1 + (x - p0) p + (y - q0) q) / k, the cosine between normal and light times S."""
    return np.asarray((1.0 + (x - light.p0) * p + (y - light.q0) * q) / light.norm)


def reflectance_map(
    p: ArrayLike,
    q: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    light: ParallelLight,
    reflectance: Reflectance = Lambertian(),
) -> Array:
    """Brightness under a parallel light, eq. (6) and its kin for other materials.

    Parameters
    ----------
    p, q : array_like
        dZ/dx and dZ/dy of the log depth Z = ln z, in normalised image coordinates.
    x, y : array_like
        Normalised image coordinates; everything broadcasts.
    light : ParallelLight
    reflectance : Reflectance

    Returns
    -------
    ndarray of float64
        E, for a Lambertian surface n / (k S), at most 1. Negative where the surface turns its back to the light.
    """
    p, q, x, y = (np.asarray(value, np.float64) for value in (p, q, x, y))
    norm, ray = surface_norm(p, q, x, y), np.sqrt(1.0 + x**2 + y**2)
    cosine_light = shade(p, q, x, y, light) / norm
    cosine_between = (1.0 + x * light.p0 + y * light.q0) / (light.norm * ray)
    return reflectance.shade(cosine_light, 1.0 / (ray * norm), cosine_between)


def brightness(
    log_depth: ArrayLike,
    p: ArrayLike,
    q: ArrayLike,
    x: ArrayLike,
    y: ArrayLike,
    light: Light,
    reflectance: Reflectance,
) -> Array:
    """Brightness of a surface under any light.

    Parameters
    ----------
    log_depth : array_like
        Z = ln z, with the depth in the unit of the light's gain and offset. It plays no part under a parallel light.
    p, q, x, y : array_like
        As for :func:`reflectance_map`; everything broadcasts.
    light : ParallelLight or FlashLight
    reflectance : Reflectance

    Returns
    -------
    ndarray of float64
        Eq. (6) under a parallel light. Under a flash κ c / ρ², or κ c without fall-off, with ρ the distance to the
        lamp (section 4 of the method). Negative where the surface turns its back to the light.
    """
    if isinstance(light, ParallelLight):
        return reflectance_map(p, q, x, y, light, reflectance)
    p, q, x, y = (np.asarray(value, np.float64) for value in (p, q, x, y))
    depth, norm, ray = np.exp(np.asarray(log_depth, np.float64)), surface_norm(p, q, x, y), np.sqrt(1.0 + x**2 + y**2)
    cosine_view = 1.0 / (ray * norm)
    if light.coaxial:
        distance = depth * ray
        returned = reflectance.coaxial(cosine_view)
    else:
        # From the surface to the lamp; the unit normal is (p, q, -w) / S, the direction to the viewer -(x, y, 1) / R.
        right, down, forward = (place - depth * along for place, along in zip(light.offset, (x, y, 1.0), strict=True))
        distance = np.sqrt(right**2 + down**2 + forward**2)
        cosine_light = (p * right + q * down - (1.0 + x * p + y * q) * forward) / (norm * distance)
        cosine_between = -(x * right + y * down + forward) / (ray * distance)
        returned = reflectance.shade(cosine_light, cosine_view, cosine_between)
    return np.asarray(light.gain * (returned / distance**2 if light.falloff else returned))


@dataclass(frozen=True)
class Equation(ABC):
    """H(Z, P) = pull Z + H(0, P) <= 0 at some cells, and what the schemes ask of it. All arrays have one shape.

    Attributes
    ----------
    brightness : ndarray of float64
        What the kernels read under this name.
    x, y : ndarray of float64
        Normalised image coordinates.
    """

    brightness: Array
    x: Array
    y: Array

    @property
    @abstractmethod
    def pull(self) -> float:
        """∂H/∂Z."""

    @abstractmethod
    def hamiltonian(self, p: Array, q: Array) -> Array:
        """H at Z = 0."""

    @abstractmethod
    def gradient(self, p: Array, q: Array) -> Slopes:
        """(∂H/∂p, ∂H/∂q), or a positive multiple of it."""

    @abstractmethod
    def viscosity(self) -> Slopes:
        """σx and σy: bounds of |∂H/∂p| and |∂H/∂q| over all P."""

    @abstractmethod
    def least_p(self, q: Array) -> Array:
        """The p at which H is least."""

    @abstractmethod
    def least_q(self, p: Array) -> Array:
        """The q at which H is least."""

    def at(self, log_depth: Array) -> Equation:  # noqa: ARG002 # of those below one needs it
        """The equation whose H(0, P) is H(Z, P) - pull Z: another one where Z stands in it in other ways too."""
        return self


@dataclass(frozen=True)
class ParallelEquation(Equation):
    """H(P) = E S - n / k, eq. (7), under a parallel light. Where H falls for ever the least slope is ±`steepest`."""

    light: ParallelLight | Direction
    steepest: float

    @property
    def pull(self) -> float:
        """Z plays no part."""
        return 0.0

    def hamiltonian(self, p: Array, q: Array) -> Array:
        """See :class:`Equation`."""
        return self.brightness * surface_norm(p, q, self.x, self.y) - shade(p, q, self.x, self.y, self.light)

    def gradient(self, p: Array, q: Array) -> Slopes:
        """See :class:`Equation`."""
        light, per_norm = self.light, self.brightness / surface_norm(p, q, self.x, self.y)
        along_x, along_y = _half_gradient_of_square_norm(p, q, self.x, self.y)
        return per_norm * along_x - (self.x - light.p0) / light.norm, per_norm * along_y - (
            self.y - light.q0
        ) / light.norm

    def viscosity(self) -> Slopes:
        """σx = E sqrt(1 + x²) + |x - p0| / k and σy likewise."""
        light = self.light
        along_x = self.brightness * np.sqrt(1.0 + self.x**2) + np.abs(self.x - light.p0) / light.norm
        along_y = self.brightness * np.sqrt(1.0 + self.y**2) + np.abs(self.y - light.q0) / light.norm
        return along_x, along_y

    def least_p(self, q: Array) -> Array:
        """See :class:`Equation`."""
        return self._least(q, self.x, self.y, self.light.p0)

    def least_q(self, p: Array) -> Array:
        """See :class:`Equation`."""
        return self._least(p, self.y, self.x, self.light.q0)

    def _least(self, across: Array, along: Array, beside: Array, slope_of_light: Array | float) -> Array:
        m = (along - slope_of_light) / self.light.norm
        a = 1.0 + along**2
        excess = a * self.brightness**2 - m**2
        bounded = np.where(excess > 0.0, excess, 1.0)
        w = 1.0 + beside * across
        least = (m * np.sqrt((a * across**2 + w**2) / bounded) - along * w) / a
        least = np.where(excess > 0.0, least, np.copysign(np.inf, m))
        return np.clip(least, -self.steepest, self.steepest)


@dataclass(frozen=True)
class FlashEquation(Equation):
    """H(Z, P) = 2 Z + ln F - ln c(θ) under a light at the camera, with F = I R² / κ for the brightness.

    The steepness of the surface as the light sees it is in S: cos θ = 1 / (R S).
    """

    reflectance: Reflectance

    @property
    def pull(self) -> float:
        """Of the fall-off."""
        return 2.0

    def hamiltonian(self, p: Array, q: Array) -> Array:
        """See :class:`Equation`."""
        cosine = 1.0 / (np.sqrt(1.0 + self.x**2 + self.y**2) * surface_norm(p, q, self.x, self.y))
        return np.asarray(np.log(self.brightness) - np.log(self.reflectance.coaxial(cosine)))

    def gradient(self, p: Array, q: Array) -> Slopes:
        """That of S², a multiple where the material is darker the steeper it is seen."""
        return _half_gradient_of_square_norm(p, q, self.x, self.y)

    def viscosity(self) -> Slopes:
        """σx = max |d ln c / dt| R sqrt(1 + x²) with t = tan θ, and σy likewise."""
        scale = self.reflectance.steepest_log * np.sqrt(1.0 + self.x**2 + self.y**2)
        return scale * np.sqrt(1.0 + self.x**2), scale * np.sqrt(1.0 + self.y**2)

    def least_p(self, q: Array) -> Array:
        """Where S is least."""
        return -self.x * (1.0 + self.y * q) / (1.0 + self.x**2)

    def least_q(self, p: Array) -> Array:
        """Where S is least."""
        return -self.y * (1.0 + self.x * p) / (1.0 + self.y**2)


@dataclass(frozen=True)
class MaterialEquation(Equation):
    """H(P) = E - R(P) under a parallel light, for any material.

    Attributes
    ----------
    light : ParallelLight
    reflectance : Reflectance
    steepness : float
        Of the brightness, see :meth:`persfs_cl.shading.model.Model.steepness`.
    steepest : float
        The least slope is no more than this.
    """

    light: ParallelLight
    reflectance: Reflectance
    steepness: float
    steepest: float

    @property
    def pull(self) -> float:
        """Z plays no part."""
        return 0.0

    def hamiltonian(self, p: Array, q: Array) -> Array:
        """See :class:`Equation`."""
        return self.brightness - reflectance_map(p, q, self.x, self.y, self.light, self.reflectance)

    def gradient(self, p: Array, q: Array) -> Slopes:
        """Central differences: see :class:`Equation`."""
        step = 1e-6
        along_x = self.hamiltonian(p + step, q) - self.hamiltonian(p - step, q)
        along_y = self.hamiltonian(p, q + step) - self.hamiltonian(p, q - step)
        return along_x / (2.0 * step), along_y / (2.0 * step)

    def viscosity(self) -> Slopes:
        """σx = steepness R sqrt(1 + x²) and σy likewise."""
        scale = self.steepness * np.sqrt(1.0 + self.x**2 + self.y**2)
        return scale * np.sqrt(1.0 + self.x**2), scale * np.sqrt(1.0 + self.y**2)

    def least_p(self, q: Array) -> Array:
        """Where a Lambertian surface is brightest."""
        return self._brightest(q, self.x, self.y, self.light.p0, self.light.q0)

    def least_q(self, p: Array) -> Array:
        """Where a Lambertian surface is brightest."""
        return self._brightest(p, self.y, self.x, self.light.q0, self.light.p0)

    def _brightest(self, across: Array, along: Array, beside: Array, light_along: float, light_across: float) -> Array:
        """The brightest normal of the plane of all those with a slope across is the light's direction projected on it.

        The plane has the axes a = (1, 0, -along) and b = (0, across, -(1 + beside across)); a normal is slope a + b.
        """
        down = 1.0 + beside * across
        aa, ab, bb = 1.0 + along**2, along * down, across**2 + down**2
        # Towards the light, on the side of the camera: (-p0, -q0, -1).
        toward_a, toward_b = along - light_along, down - across * light_across
        weight_a, weight_b = bb * toward_a - ab * toward_b, aa * toward_b - ab * toward_a
        slope = np.where(weight_b > 0.0, weight_a / np.where(weight_b > 0.0, weight_b, 1.0), np.inf)
        slope = np.where((weight_b <= 0.0) & (toward_a < 0.0), -np.inf, slope)
        return np.clip(slope, -self.steepest, self.steepest)


@dataclass(frozen=True)
class HeadlightEquation(Equation):
    """H(P) = E R S - 1 under a light at the camera without fall-off, with E = cos θ for the brightness.

    Z stands for the log distance ln (z R), so that S is that of the gradient P - (x, y) / R² of ln z.
    """

    @property
    def pull(self) -> float:
        """Z plays no part."""
        return 0.0

    def hamiltonian(self, p: Array, q: Array) -> Array:
        """See :class:`Equation`."""
        square_ray = 1.0 + self.x**2 + self.y**2
        norm = surface_norm(p - self.x / square_ray, q - self.y / square_ray, self.x, self.y)
        return np.asarray(self.brightness * np.sqrt(square_ray) * norm - 1.0)

    def gradient(self, p: Array, q: Array) -> Slopes:
        """That of S², a multiple."""
        square_ray = 1.0 + self.x**2 + self.y**2
        return _half_gradient_of_square_norm(p - self.x / square_ray, q - self.y / square_ray, self.x, self.y)

    def viscosity(self) -> Slopes:
        """σx = E R sqrt(1 + x²) and σy likewise."""
        scale = self.brightness * np.sqrt(1.0 + self.x**2 + self.y**2)
        return scale * np.sqrt(1.0 + self.x**2), scale * np.sqrt(1.0 + self.y**2)

    def least_p(self, q: Array) -> Array:
        """Where S is least."""
        return -self.x * self.y * q / (1.0 + self.x**2)

    def least_q(self, p: Array) -> Array:
        """Where S is least."""
        return -self.x * self.y * p / (1.0 + self.y**2)


@dataclass(frozen=True)
class LampEquation(ParallelEquation):
    """With the lamp beside the camera: at a given depth each pixel has a parallel light of its own, and a brightness.

    I = κ c(θ) / ρ², with ρ the distance to the lamp, tells cos θ, which takes the place of E. All that may be asked of
    it is :meth:`at`.

    Attributes
    ----------
    offset : (float, float, float)
        Of the lamp, in units of depth.
    reflectance : Reflectance
        Of which a brightness belongs to one angle.
    """

    offset: tuple[float, float, float]
    reflectance: Reflectance

    def at(self, log_depth: Array) -> Equation:
        """See :class:`Equation`."""
        depth = np.exp(log_depth)
        right, below, ahead = (place / depth for place in self.offset)
        square_distance = depth**2 * ((self.x - right) ** 2 + (self.y - below) ** 2 + (1.0 - ahead) ** 2)
        p0, q0 = (self.x - right) / (1.0 - ahead), (self.y - below) / (1.0 - ahead)
        light = Direction(p0, q0, np.sqrt(1.0 + p0**2 + q0**2))
        cosine = self._cosine(self.brightness * square_distance)
        return ParallelEquation(cosine, self.x, self.y, light, self.steepest)

    def _cosine(self, returned: Array) -> Array:
        """By bisection; above 1 where more returns than the material can."""
        low, high = np.zeros_like(returned), np.ones_like(returned)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            darker = self.reflectance.coaxial(middle) < returned
            low, high = np.where(darker, middle, low), np.where(darker, high, middle)
        return np.where(returned > self.reflectance.brightest, returned / self.reflectance.brightest, low)


def _half_gradient_of_square_norm(p: Array, q: Array, x: Array, y: Array) -> Slopes:
    """Half the derivatives of S² by p and q."""
    w = 1.0 + x * p + y * q
    return p + x * w, q + y * w


def _at_scale(light: Light, unit: float) -> Light:
    """The light where depths are counted in another unit."""
    if isinstance(light, ParallelLight):
        return light
    right, below, ahead = light.offset
    return replace(light, offset=(right / unit, below / unit, ahead / unit))


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
        E, or F under a flash.
    flags : ndarray of uint8, shape (height, width)
    boundary : Boundary
    grid : PixelGrid
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    scheme : {"lax-friedrichs", "upwind"}
    sign : float
        +1 for W = Z, -1 for W = -Z.
    max_slope : float
    steepness : float
        Of the brightness of materials under a parallel light.
    linear : bool
        Extrapolate the boundary cells linearly, never below `lowest`.
    lowest : float
    """

    log_depth: Array
    brightness: Array
    flags: NDArray[np.uint8]
    boundary: Boundary
    grid: PixelGrid
    light: Light
    reflectance: Reflectance = Lambertian()
    scheme: str = "lax-friedrichs"
    sign: float = 1.0
    max_slope: float = 30.0
    steepness: float = 0.0
    linear: bool = False
    lowest: float = 0.0

    @classmethod
    def of(cls, problem: Problem, *, linear: bool = False) -> Reference:
        """The same as the kernels are given of a problem, at its start values; `linear` is a matter of the run."""
        return cls(
            log_depth=problem.start,
            brightness=problem.shading,
            flags=problem.domain.flags,
            boundary=problem.domain.boundary,
            grid=problem.grid,
            light=_at_scale(problem.model.light, float(np.exp(problem.level))),
            reflectance=problem.model.reflectance,
            scheme=problem.scheme,
            sign=problem.sign,
            max_slope=problem.max_slope,
            steepness=problem.model.steepness(problem.grid),
            linear=linear,
        )

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
        ) / (sigma_x / dx + sigma_y / dy + equation.pull)
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
        level_p, level_q = self._level_slopes(rows, columns)

        def along_x(value: Array) -> Slopes:
            p = per_x * (value - beside) + level_p
            return p, equation.at(value).least_q(p)

        def along_y(value: Array) -> Slopes:
            q = per_y * (value - above) + level_q
            return equation.at(value).least_p(q), q

        def between(value: Array) -> Slopes:
            return per_x * (value - beside) + level_p, per_y * (value - above) + level_q

        def allowed(slopes: Callable[[Array], Slopes], low: Array, high: Array, level: Array | None = None) -> Array:
            """Where H, at the slopes that belong to a value, becomes positive for good; H(level, P) if given."""
            for _ in range(_HALVINGS):
                value = 0.5 * (low + high)
                p, q = slopes(value)
                there = equation.at(value)
                rise_p, rise_q = there.gradient(p, q)
                excess = there.hamiltonian(p, q) + equation.pull * (value if level is None else level)
                beyond = (excess > 0.0) & (per_x * rise_p + per_y * rise_q > 0.0)
                low, high = np.where(beyond, low, value), np.where(beyond, value, high)
            return low

        edge_x = allowed(along_x, beside - step_x, beside + step_x)
        edge_y = allowed(along_y, above - step_y, above + step_y)
        if equation.pull and not both_edges:
            now_x = allowed(along_x, beside - step_x, beside + 1e3 * step_x, here)
            now_y = allowed(along_y, above - step_y, above + 1e3 * step_y, here)
            edge_x, edge_y = np.where(now_x >= now_y, np.nan, edge_x), np.where(now_x < now_y, np.nan, edge_y)
        highest = np.fmin(beside + step_x, above + step_y)
        triangle = allowed(between, np.fmin(beside, above) - step_x - step_y, highest)
        rise_p, rise_q = equation.at(triangle).gradient(*between(triangle))
        triangle[~((per_x * rise_p > 0.0) & (per_y * rise_q > 0.0))] = np.nan
        return np.asarray(np.fmin(np.fmin(np.fmin(edge_x, edge_y), triangle), highest))

    def _level_slopes(self, rows: Indices, columns: Indices) -> tuple[Array | float, Array | float]:
        """Gradient of Z where the unknown of the upwind scheme is level: that of -ln(1 + p0 x + q0 y)."""
        if not isinstance(self.light, ParallelLight):
            return 0.0, 0.0
        p0, q0 = self.light.p0, self.light.q0
        facing = 1.0 + p0 * self.grid.x[columns] + q0 * self.grid.y[rows, 0]
        return -p0 / facing, -q0 / facing

    def equation(self, rows: Indices, columns: Indices, steepest: float) -> Equation:
        """The equation at some cells."""
        cells = self.brightness[rows, columns], self.grid.x[columns], self.grid.y[rows, 0]
        if isinstance(self.light, ParallelLight):
            if isinstance(self.reflectance, Lambertian):
                return ParallelEquation(*cells, self.light, steepest)
            return MaterialEquation(*cells, self.light, self.reflectance, self.steepness, steepest)
        if not self.light.falloff:
            return HeadlightEquation(*cells)
        if self.scheme == "upwind" and not self.light.coaxial:
            nowhere = np.zeros_like(cells[0])
            return LampEquation(
                *cells, Direction(nowhere, nowhere, nowhere), steepest, self.light.offset, self.reflectance
            )
        return FlashEquation(*cells, self.reflectance)

    def _gradient(self, here: Array, left: Array, right: Array, up: Array, down: Array, equation: Equation) -> Slopes:
        """Central differences; where a neighbour is missing (NaN) one-sided ones, as far as H falls along them."""
        p = np.where(np.isnan(left + right), 0.0, (right - left) / (2.0 * self.grid.dx))
        q = np.zeros_like(p)
        for _ in range(3):
            q = constrained(here, up, down, self.grid.dy, self.sign * equation.least_q(self.sign * p))
            p = constrained(here, left, right, self.grid.dx, self.sign * equation.least_p(self.sign * q))
        return p, q

    def _update(self, rows: Indices, columns: Indices, quadrants: Sequence[tuple[int, int]]) -> None:
        values = self.log_depth[rows, columns]
        if self.scheme == "upwind":
            found = [self.upwind(rows, columns, *quadrant) for quadrant in quadrants]
        else:
            found = [self.lax_friedrichs(rows, columns)]
        for candidate in found:
            values = np.fmin(values, candidate)
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
        return float(min(found))
