"""Reflectances: how the material returns the light that falls on it.

Angles are those between the surface normal and the directions to the light (θi) and to the viewer (θr); where light
and viewer are in one direction, as with a flash, both are θ.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.checks import brief, finite_number
from persfs_cl.errors import InputError

Array = NDArray[np.float64]

_SAMPLES = 100_001
_STRONGEST, _SHINIEST = 1e12, 1e6
"""A highlight of such an exponent is a tenth of a degree wide: with more, single precision loses it."""
_MARGIN = 1.001
"""More than a smooth function can rise between its samples above the largest of them."""


class Reflectance(ABC):
    """What every material answers."""

    @abstractmethod
    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ), the brightness where light and viewer are in one direction.

        Parameters
        ----------
        cosine : array_like
            cos θ in [0, 1]. What rounding leaves beyond is taken as the end it passed: below 0 as grazing, θ = 90°.

        Returns
        -------
        ndarray of float64
            At least 0, and 0 at grazing for all but rough materials.
        """

    @abstractmethod
    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Brightness for any directions of light and viewer; :meth:`coaxial` where the two are one.

        Parameters
        ----------
        cosine_light : array_like
            cos θi in [-1, 1]; everything broadcasts.
        cosine_view : array_like
            cos θr in [0, 1]: the surface is seen.
        cosine_between : array_like
            Cosine of the angle between the directions to the light and to the viewer.

        Returns
        -------
        ndarray of float64
            Where the surface turns its back to the light, the matt part continued with its sign, below 0.
        """

    @property
    @abstractmethod
    def monotone(self) -> bool:
        """True when c(θ) decreases strictly from 0° to 90°, so that a brightness belongs to one angle."""

    @property
    @abstractmethod
    def brightest(self) -> float:
        """The largest c(θ)."""

    @property
    @abstractmethod
    def steepest_log(self) -> float:
        """An upper bound of abs(d ln c / dt) over all t = tan θ >= 0, less than 1 % above the least."""


@dataclass(frozen=True)
class Lambertian(Reflectance):
    """A perfectly matt material: brightness is the cosine between normal and light, eq. (2)."""

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = cos θ; see :meth:`Reflectance.coaxial`."""
        return _visible(cosine)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Cos θi from wherever it is seen; see :meth:`Reflectance.shade`."""
        lit, *_ = np.broadcast_arrays(cosine_light, cosine_view, cosine_between)
        return lit.astype(np.float64)

    @property
    def monotone(self) -> bool:
        """Always."""
        return True

    @property
    def brightest(self) -> float:
        """1, face on."""
        return 1.0

    @property
    def steepest_log(self) -> float:
        """½: ln c = -½ ln(1 + t²), steepest at t = 1."""
        return 0.5


@dataclass(frozen=True)
class OrenNayar(Reflectance):
    """A rough matt material such as plaster, clay, sand or the moon: flatter than Lambertian, bright up to the rim.

    The qualitative model of Oren and Nayar (SIGGRAPH 1994), with an albedo of 1:
    cos θi (A + B max(0, cos(φi - φr)) sin α tan β), α = max(θi, θr), β = min(θi, θr),
    A = 1 - 0.5 σ² / (σ² + 0.33), B = 0.45 σ² / (σ² + 0.09). From the direction of the light: A cos θ + B sin² θ.

    Parameters
    ----------
    roughness : float
        σ, the standard deviation of the slopes of the facets, in radians from 0 (Lambertian) to π/2.

    Raises
    ------
    InputError
        When the roughness is out of its range.
    """

    roughness: float

    def __post_init__(self) -> None:
        roughness = finite_number(self.roughness)
        if not 0.0 <= roughness <= math.pi / 2:
            raise InputError(
                f"roughness={brief(self.roughness)} is not an angle from 0 to π/2: give it in radians, 0 for a smooth "
                "surface, 0.5 for a rough one."
            )
        object.__setattr__(self, "roughness", roughness)

    @property
    def direct(self) -> float:
        """A of the model."""
        return 1.0 - 0.5 * self.roughness**2 / (self.roughness**2 + 0.33)

    @property
    def rim(self) -> float:
        """B of the model: c at 90°."""
        return 0.45 * self.roughness**2 / (self.roughness**2 + 0.09)

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = A cos θ + B sin² θ, B at grazing; see :meth:`Reflectance.coaxial`."""
        seen = _visible(cosine)
        return self.direct * seen + self.rim * (1.0 - seen**2)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Brightness for any directions; see :meth:`Reflectance.shade`."""
        lit, seen, between = _floats(cosine_light, cosine_view, cosine_between)
        # cos(φi - φr) sin θi sin θr, so that neither azimuths nor sines are needed.
        azimuthal = np.maximum(between - lit * seen, 0.0)
        # sin α tan β = sin θi sin θr / the larger cosine. The quotient is 1 at grazing from the light's direction.
        higher = np.maximum(lit, seen)
        quotient = np.divide(np.maximum(lit, 0.0), higher, out=np.ones_like(higher), where=higher > 0.0)
        return np.asarray(self.direct * lit + self.rim * azimuthal * quotient)

    @property
    def monotone(self) -> bool:
        """2 B <= A, up to σ = 0.62: c'(θ) = -sin θ (A - 2 B cos θ)."""
        return 2.0 * self.rim <= self.direct

    @property
    def brightest(self) -> float:
        """A, face on; where c is not monotone B + A² / 4B, at cos θ = A / 2B."""
        return self.direct if self.monotone else self.rim + self.direct**2 / (4.0 * self.rim)

    @cached_property
    def steepest_log(self) -> float:
        """See :attr:`Reflectance.steepest_log`; found numerically."""
        angle = np.linspace(0.0, math.pi / 2, _SAMPLES)
        slope = np.sin(angle) * (2.0 * self.rim * np.cos(angle) - self.direct)
        return _largest_log_slope(angle, slope, self.coaxial(np.cos(angle)))


@dataclass(frozen=True)
class Phong(Reflectance):
    """A matt material with a highlight, such as glazed ware or wet tissue.

    diffuse · cos θi + specular · max(cos ψ, 0)^shininess, where ψ lies between the mirrored direction of the light and
    the viewer (Phong 1975). From the direction of the light ψ = 2θ.

    Parameters
    ----------
    diffuse : float
        Brightness of the matt part face on, from 1e-12 to 1e12.
    specular : float
        Brightness of the highlight, from 0 to 1e12. With ``diffuse + specular = 1`` the
        brightest value is 1.
    shininess : float
        From 1 to 1e6; the higher, the smaller the highlight.

    Raises
    ------
    InputError
        When a parameter is out of its range, or not finite.
    """

    diffuse: float = 0.7
    specular: float = 0.3
    shininess: float = 10.0

    def __post_init__(self) -> None:
        diffuse, specular, shininess = map(finite_number, (self.diffuse, self.specular, self.shininess))
        if not 1.0 / _STRONGEST <= diffuse <= _STRONGEST:
            raise InputError(
                f"diffuse={brief(self.diffuse)} is no matt part: give a number from {1 / _STRONGEST:g} to "
                f"{_STRONGEST:g}, such as 0.7."
            )
        if not 0.0 <= specular <= _STRONGEST:
            raise InputError(
                f"specular={brief(self.specular)} is no highlight: give a number from 0, for none, to {_STRONGEST:g}."
            )
        if not 1.0 <= shininess <= _SHINIEST:
            raise InputError(
                f"shininess={brief(self.shininess)} is no exponent: give a number from 1 to {_SHINIEST:g}, such as 10."
            )
        object.__setattr__(self, "diffuse", diffuse)
        object.__setattr__(self, "specular", specular)
        object.__setattr__(self, "shininess", shininess)

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = diffuse cos θ + specular max(cos 2θ, 0)^shininess; see :meth:`Reflectance.coaxial`."""
        seen = _visible(cosine)
        return self.diffuse * seen + self._highlight(2.0 * seen**2 - 1.0)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Brightness for any directions, without a highlight in shadow; see :meth:`Reflectance.shade`."""
        lit, seen, between = _floats(cosine_light, cosine_view, cosine_between)
        mirrored = np.where(lit > 0.0, 2.0 * lit * seen - between, 0.0)
        return np.asarray(self.diffuse * lit + self._highlight(mirrored))

    @property
    def monotone(self) -> bool:
        """Always."""
        return True

    @property
    def brightest(self) -> float:
        """Diffuse + specular, face on."""
        return self.diffuse + self.specular

    @cached_property
    def steepest_log(self) -> float:
        """See :attr:`Reflectance.steepest_log`; found numerically."""
        # The highlight ends at 45°. It may fall steeply near 0°, within 1 / √shininess, or just before its end.
        to_end = np.geomspace(1e-12, math.pi / 4, _SAMPLES)
        angle = np.concatenate(
            [np.geomspace(1e-3 / math.sqrt(self.shininess), math.pi / 4, _SAMPLES), math.pi / 4 - to_end, [math.pi / 4]]
        )
        mirrored = np.concatenate([np.cos(2.0 * angle[:_SAMPLES]), np.sin(2.0 * to_end), [0.0]])
        falling = 2.0 * self.shininess * np.sin(2.0 * angle) * np.maximum(mirrored, 0.0) ** (self.shininess - 1.0)
        slope = self.diffuse * np.sin(angle) + self.specular * falling
        brightness = self.diffuse * np.cos(angle) + self._highlight(mirrored)
        # Beyond 45° c is Lambertian.
        return max(0.5, _largest_log_slope(angle, slope, brightness))

    def _highlight(self, cosine: Array) -> Array:
        return self.specular * np.maximum(cosine, 0.0) ** self.shininess


def _visible(cosine: ArrayLike) -> Array:
    return np.clip(np.asarray(cosine, np.float64), 0.0, 1.0)


def _floats(*values: ArrayLike) -> list[Array]:
    return [np.asarray(value, np.float64) for value in values]


def _largest_log_slope(angle: Array, slope: Array, brightness: Array) -> float:
    """Max |dc/dθ| / (c dt/dθ) over samples, with dt/dθ = 1 / cos² θ, and a margin for what lies between them."""
    return _MARGIN * float((np.abs(slope) * np.cos(angle) ** 2 / brightness).max())
