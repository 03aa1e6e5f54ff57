"""A rough matt material."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.checks import finite_number
from persfs_cl.errors import InputError
from persfs_cl.shading.reflectance import SAMPLES, Reflectance, floats, largest_log_slope, visible


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

    Examples
    --------
    Seen at 60 degrees it is brighter than a perfectly matt surface:

    >>> import persfs_cl as ps
    >>> rough = ps.OrenNayar(roughness=0.3)
    >>> bool(rough.coaxial(0.5) / rough.coaxial(1.0) > 0.5)
    True
    """

    kernel: ClassVar[str] = "oren_nayar"
    summary: ClassVar[str] = "rough, as plaster"

    roughness: float = field(
        metadata={
            "help": "spread of the slopes of the facets; 0 is smooth, 0.5 rough.",
            "metavar": "RADIANS",
        }
    )

    def __post_init__(self) -> None:
        roughness = finite_number(self.roughness)
        if not 0.0 <= roughness <= math.pi / 2:
            raise InputError.about(
                "roughness",
                self.roughness,
                "is not an angle from 0 to π/2: give it in radians, 0 for a smooth surface, 0.5 for a rough one.",
            )
        object.__setattr__(self, "roughness", roughness)

    @property
    def numbers(self) -> dict[str, float]:
        """A and B of the model."""
        return {"direct": self.direct, "rim": self.rim}

    @property
    def direct(self) -> float:
        """A of the model."""
        return 1.0 - 0.5 * self.roughness**2 / (self.roughness**2 + 0.33)

    @property
    def rim(self) -> float:
        """B of the model: c at 90°."""
        return 0.45 * self.roughness**2 / (self.roughness**2 + 0.09)

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = A cos θ + B sin² θ, B at grazing; see :meth:`Reflectance.coaxial`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> bool(ps.OrenNayar(roughness=0.3).coaxial(0.0) > 0.0)
        True
        """
        seen = visible(cosine)
        return self.direct * seen + self.rim * (1.0 - seen**2)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Brightness for any directions; see :meth:`Reflectance.shade`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> rough = ps.OrenNayar(roughness=0.3)
        >>> bool(abs(rough.shade(0.5, 0.5, 1.0) - rough.coaxial(0.5)) < 1e-9)  # seen from the light
        True
        """
        lit, seen, between = floats(cosine_light, cosine_view, cosine_between)
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
        angle = np.linspace(0.0, math.pi / 2, SAMPLES)
        slope = np.sin(angle) * (2.0 * self.rim * np.cos(angle) - self.direct)
        return largest_log_slope(angle, slope, self.coaxial(np.cos(angle)))
