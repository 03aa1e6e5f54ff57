"""The Hamiltonians in plain NumPy, float64: what the kernels of light and material are held to.

What the upwind kernels have in closed form is found from these by bisection, see :mod:`persfs_cl.solver.reference`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.shading.forward import Direction, Parallel, reflectance_map, shade, surface_norm
from persfs_cl.shading.reflectance import Reflectance

Slopes = tuple[Array, Array]

_HALVINGS = 56
"""These take [0, 1] down to the rounding of a float64."""
_ROUNDING = 2e-16


@dataclass(frozen=True)
class Equation(ABC):
    """H(Z, P) = dh_dz Z + H(0, P) <= 0 at some cells, and what the schemes ask of it. All arrays have one shape.

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
    def dh_dz(self) -> float:
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
    def argmin_p(self, q: Array) -> Array:
        """The p at which H is least."""

    @abstractmethod
    def argmin_q(self, p: Array) -> Array:
        """The q at which H is least."""

    def at(self, log_depth: Array) -> Equation:
        """The equation whose H(0, P) is H(Z, P) - dh_dz Z: another one where Z stands in it in other ways too."""
        return self


@dataclass(frozen=True)
class ParallelEquation(Equation):
    """H(P) = E S - n / k, eq. (7), under a parallel light. Where H falls for ever the least slope is ±`steepest`."""

    light: Parallel
    steepest: float

    @property
    def dh_dz(self) -> float:
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

    def argmin_p(self, q: Array) -> Array:
        """See :class:`Equation`."""
        return self._least(q, self.x, self.y, self.light.p0)

    def argmin_q(self, p: Array) -> Array:
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
    def dh_dz(self) -> float:
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

    def argmin_p(self, q: Array) -> Array:
        """Where S is least."""
        return -self.x * (1.0 + self.y * q) / (1.0 + self.x**2)

    def argmin_q(self, p: Array) -> Array:
        """Where S is least."""
        return -self.y * (1.0 + self.x * p) / (1.0 + self.y**2)


@dataclass(frozen=True)
class MaterialEquation(Equation):
    """H(P) = E - R(P) under a parallel light, for any material.

    Attributes
    ----------
    light : Parallel
    reflectance : Reflectance
    steepness : float
        Of the brightness, see :class:`persfs_cl.shading.parallel_light.MaterialModel`.
    steepest : float
        The least slope is no more than this.
    """

    light: Parallel
    reflectance: Reflectance
    steepness: float
    steepest: float

    @property
    def dh_dz(self) -> float:
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

    def argmin_p(self, q: Array) -> Array:
        """Where a Lambertian surface is brightest."""
        return self._brightest(q, self.x, self.y, self.light.p0, self.light.q0)

    def argmin_q(self, p: Array) -> Array:
        """Where a Lambertian surface is brightest."""
        return self._brightest(p, self.y, self.x, self.light.q0, self.light.p0)

    def _brightest(
        self, across: Array, along: Array, beside: Array, light_along: Array | float, light_across: Array | float
    ) -> Array:
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
    def dh_dz(self) -> float:
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

    def argmin_p(self, q: Array) -> Array:
        """Where S is least."""
        return -self.x * self.y * q / (1.0 + self.x**2)

    def argmin_q(self, p: Array) -> Array:
        """Where S is least."""
        return -self.x * self.y * p / (1.0 + self.y**2)


@dataclass(frozen=True)
class LampEquation(ParallelEquation):
    """With an off-axis lamp: at a given depth each pixel has a parallel light of its own, and a brightness.

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
        """The cosine at which so much returns; above 1 where that is more than the material can.

        Where it is not the brightness itself it is found by false position with halving, the Illinois method: far fewer
        steps than by bisection, of which each takes a sweep of the reference.
        """
        material = self.reflectance
        if material.perfectly_matt:
            return returned
        low, high = np.zeros_like(returned), np.ones_like(returned)
        below, above = material.coaxial(low) - returned, material.coaxial(high) - returned
        inside = (below < 0.0) & (above > 0.0)
        found, kept = np.where(above > 0.0, 0.0, 1.0), np.zeros_like(returned)
        for _ in range(_HALVINGS):
            found = np.where(inside, low - below * (high - low) / np.where(inside, above - below, 1.0), found)
            excess = material.coaxial(found) - returned
            if (np.abs(excess[inside]) <= _ROUNDING).all():
                break
            darker = excess < 0.0
            # The end that stays for the second time is given half its weight.
            above = np.where(darker, np.where(kept < 0.0, 0.5 * above, above), excess)
            below = np.where(darker, excess, np.where(kept > 0.0, 0.5 * below, below))
            low, high, kept = np.where(darker, found, low), np.where(darker, high, found), np.where(darker, -1.0, 1.0)
        return np.where(returned > material.brightest, returned / material.brightest, found)


def _half_gradient_of_square_norm(p: Array, q: Array, x: Array, y: Array) -> Slopes:
    """Half the derivatives of S² by p and q."""
    w = 1.0 + x * p + y * q
    return p + x * w, q + y * w
