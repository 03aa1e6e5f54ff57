"""The method in plain NumPy, float64: the independent judge of every kernel.

Nothing here imports the OpenCL side or the solver. Sweeps go along anti-diagonals, whose cells do not read each other:
the same values as the paper's double loop, at NumPy's speed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.camera import PixelGrid
from persfs_cl.domain import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, SWEPT, Boundary
from persfs_cl.light import Light, ParallelLight
from persfs_cl.reflectance import Lambertian, Reflectance

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def surface_norm(p: Array, q: Array, x: Array, y: Array) -> Array:
    """S = sqrt(p² + q² + w²) with w = 1 + x p + y q, the length of the unnormalised normal, eq. (3)."""
    w = 1.0 + x * p + y * q
    return np.asarray(np.sqrt(p**2 + q**2 + w**2))


def shade(p: Array, q: Array, x: Array, y: Array, light: ParallelLight) -> Array:
    """n / k = (1 + (x - p0) p + (y - q0) q) / k, the cosine between normal and light times S."""
    return (1.0 + (x - light.p0) * p + (y - light.q0) * q) / light.norm


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


def hamiltonian(brightness: Array, p: Array, q: Array, x: Array, y: Array, light: ParallelLight) -> Array:
    """H(P) = E S - n / k, eq. (7)."""
    return brightness * surface_norm(p, q, x, y) - shade(p, q, x, y, light)


def viscosity(brightness: Array, x: Array, y: Array, light: ParallelLight) -> tuple[Array, Array]:
    """σx = E sqrt(1 + x²) + |x - p0| / k and σy likewise: bounds of |∂H/∂p| and |∂H/∂q| over all P."""
    along_x = brightness * np.sqrt(1.0 + x**2) + np.abs(x - light.p0) / light.norm
    along_y = brightness * np.sqrt(1.0 + y**2) + np.abs(y - light.q0) / light.norm
    return along_x, along_y


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
    flags : ndarray of uint8, shape (height, width)
    boundary : Boundary
    grid : PixelGrid
    light : ParallelLight
    sign : float
        +1 for W = Z, -1 for W = -Z.
    max_slope : float
    linear : bool
        Extrapolate the boundary cells linearly, never below `lowest`.
    lowest : float
    """

    log_depth: Array
    brightness: Array
    flags: NDArray[np.uint8]
    boundary: Boundary
    grid: PixelGrid
    light: ParallelLight
    sign: float = 1.0
    max_slope: float = 30.0
    linear: bool = False
    lowest: float = 0.0

    def iterate(self) -> float:
        """Four sweeps, the boundary renewed after each; returns max |ΔZ|."""
        before = self.log_depth.copy()
        for leftwards, upwards in ((0, 0), (1, 0), (0, 1), (1, 1)):
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
            self._update(rows[swept], columns[swept])

    def sweep_colour(self, colour: int) -> None:
        """Update all cells whose row + column has the parity `colour`."""
        rows, columns = np.nonzero(self.flags & SWEPT)
        chosen = (rows + columns) % 2 == colour
        self._update(rows[chosen], columns[chosen])

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

    def candidate(self, rows: Indices, columns: Indices) -> Array:
        """Lax-Friedrichs values of some cells, eq. (11) with its sign put right, and the bound on the slope."""
        here, left, right, up, down = self._around(rows, columns)
        x, y = self.grid.x[columns], self.grid.y[rows, 0]
        dx, dy = self.grid.dx, self.grid.dy
        brightness = self.brightness[rows, columns]
        p, q = self._gradient(here, left, right, up, down, brightness, x, y)
        sum_x = np.where(np.isnan(left + right), 2.0 * here, left + right)
        sum_y = np.where(np.isnan(up + down), 2.0 * here, up + down)
        sigma_x, sigma_y = viscosity(brightness, x, y, self.light)
        value = (
            -hamiltonian(brightness, self.sign * p, self.sign * q, x, y, self.light)
            + sigma_x * sum_x / (2.0 * dx)
            + sigma_y * sum_y / (2.0 * dy)
        ) / (sigma_x / dx + sigma_y / dy)
        steepest_x = np.fmin(left, right) + self.max_slope * dx
        steepest_y = np.fmin(up, down) + self.max_slope * dy
        return np.asarray(np.fmin(value, np.fmin(steepest_x, steepest_y)))

    def _gradient(
        self, here: Array, left: Array, right: Array, up: Array, down: Array, brightness: Array, x: Array, y: Array
    ) -> tuple[Array, Array]:
        """Central differences; where a neighbour is missing (NaN) one-sided ones, as far as H falls along them."""
        p = np.where(np.isnan(left + right), 0.0, (right - left) / (2.0 * self.grid.dx))
        q = np.zeros_like(p)
        for _ in range(3):
            least = self.sign * self._least_slope(brightness, self.sign * p, y, x, self.light.q0)
            q = constrained(here, up, down, self.grid.dy, least)
            least = self.sign * self._least_slope(brightness, self.sign * q, x, y, self.light.p0)
            p = constrained(here, left, right, self.grid.dx, least)
        return p, q

    def _least_slope(self, brightness: Array, q: Array, x: Array, y: Array, slope: float) -> Array:
        m = (x - slope) / self.light.norm
        a = 1.0 + x**2
        excess = a * brightness**2 - m**2
        bounded = np.where(excess > 0.0, excess, 1.0)
        least = (m * np.sqrt((a * q**2 + (1.0 + y * q) ** 2) / bounded) - x * (1.0 + y * q)) / a
        least = np.where(excess > 0.0, least, np.copysign(np.inf, m))
        return np.clip(least, -self.max_slope, self.max_slope)

    def _update(self, rows: Indices, columns: Indices) -> None:
        here = self.log_depth[rows, columns]
        self.log_depth[rows, columns] = np.minimum(here, self.candidate(rows, columns))

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
