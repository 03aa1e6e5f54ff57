"""A matt material with a highlight."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.checks import as_number
from persfs_cl.shading.reflectance import SAMPLES, Reflectance, floats, largest_log_slope, visible

_STRONGEST, _SHINIEST = 1e12, 1e6
"""A highlight of such an exponent is a tenth of a degree wide: with more, single precision loses it."""


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

    Examples
    --------
    >>> import persfs_cl as ps
    >>> shiny = ps.Phong(diffuse=0.6, specular=0.4, shininess=10.0)
    >>> shiny.coaxial([1.0, 0.0])
    array([1., 0.])
    """

    kernel: ClassVar[str] = "phong"
    summary: ClassVar[str] = "with a highlight, as wet tissue"

    diffuse: float = field(default=0.7, metadata={"help": "the matt part; 0.7 by default."})
    specular: float = field(default=0.3, metadata={"help": "the highlight; 0.3 by default."})
    shininess: float = field(default=10.0, metadata={"help": "the higher, the smaller the highlight; 10 by default."})

    def __post_init__(self) -> None:
        diffuse = as_number(
            "diffuse", self.diffuse, least=1.0 / _STRONGEST, most=_STRONGEST, what="a matt part", hint=", such as 0.7"
        )
        specular = as_number(
            "specular", self.specular, least=0.0, most=_STRONGEST, what="a highlight", hint=", 0 for none"
        )
        shininess = as_number(
            "shininess", self.shininess, least=1.0, most=_SHINIEST, what="an exponent", hint=", such as 10"
        )
        object.__setattr__(self, "diffuse", diffuse)
        object.__setattr__(self, "specular", specular)
        object.__setattr__(self, "shininess", shininess)

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = diffuse cos θ + specular max(cos 2θ, 0)^shininess; see :meth:`Reflectance.coaxial`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.Phong(diffuse=0.5, specular=0.5).coaxial([1.0, 0.0])
        array([1., 0.])
        """
        seen = visible(cosine)
        return self.diffuse * seen + self._highlight(2.0 * seen**2 - 1.0)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Brightness for any directions, without a highlight in shadow; see :meth:`Reflectance.shade`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> shiny = ps.Phong(diffuse=0.6, specular=0.4)
        >>> bool(shiny.shade(1.0, 1.0, 1.0) == shiny.coaxial(1.0))  # seen from the light
        True
        """
        lit, seen, between = floats(cosine_light, cosine_view, cosine_between)
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
        to_end = np.geomspace(1e-12, math.pi / 4, SAMPLES)
        angle = np.concatenate(
            [np.geomspace(1e-3 / math.sqrt(self.shininess), math.pi / 4, SAMPLES), math.pi / 4 - to_end, [math.pi / 4]]
        )
        mirrored = np.concatenate([np.cos(2.0 * angle[:SAMPLES]), np.sin(2.0 * to_end), [0.0]])
        falling = 2.0 * self.shininess * np.sin(2.0 * angle) * np.maximum(mirrored, 0.0) ** (self.shininess - 1.0)
        slope = self.diffuse * np.sin(angle) + self.specular * falling
        brightness = self.diffuse * np.cos(angle) + self._highlight(mirrored)
        # Beyond 45° c is Lambertian.
        return max(0.5, largest_log_slope(angle, slope, brightness))

    def _highlight(self, cosine: Array) -> Array:
        return self.specular * np.maximum(cosine, 0.0) ** self.shininess
