"""What every material answers: the questions that the rest of the package asks of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array

_ANGLES = 2**18 + 1
"""So many that what interpolation between them loses is less than single precision can tell."""

SAMPLES = 100_001
_MARGIN = 1.001
"""More than a smooth function can rise between its samples above the largest of them."""


@dataclass(frozen=True)
class Reflectance(ABC):
    """What every material answers. Its numbers are its dataclass fields; `metadata` of a field describes an option.

    Attributes
    ----------
    kernel : str
        File of kernels/materials/ that stands for it.
    summary : str
        What it is, for the command's help.
    perfectly_matt : bool
        Whether the brightness is the cosine between normal and light itself, from wherever the surface is seen.
    """

    kernel: ClassVar[str]
    summary: ClassVar[str]
    perfectly_matt: ClassVar[bool] = False

    @property
    def numbers(self) -> dict[str, float]:
        """What its kernel reads, by the names that it has there: its fields, if it does not say otherwise."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

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

    def facing(self, returned: Array) -> Array:
        """Cos θ from c(θ), of a monotone material; 0 where it is darker than at grazing, 1 where brighter than c(0).

        Examples
        --------
        >>> import persfs_cl as ps
        >>> rough = ps.OrenNayar(roughness=0.3)
        >>> bool(abs(rough.facing(rough.coaxial(0.7)) - 0.7) < 1e-6)
        True
        """
        return np.interp(returned, *_returned_at_cosines(self))


@lru_cache(maxsize=8)
def _returned_at_cosines(reflectance: Reflectance) -> tuple[Array, Array]:
    """What a material returns at many angles, from grazing to face on, and their cosines."""
    cosines = np.sin(np.linspace(0.0, 0.5 * np.pi, _ANGLES))
    return reflectance.coaxial(cosines), cosines


def visible(cosine: ArrayLike) -> Array:
    """Cosines within [0, 1]."""
    return np.clip(np.asarray(cosine, np.float64), 0.0, 1.0)


def floats(*values: ArrayLike) -> list[Array]:
    """The values as arrays of float64."""
    return [np.asarray(value, np.float64) for value in values]


def largest_log_slope(angle: Array, slope: Array, brightness: Array) -> float:
    """Max |dc/dθ| / (c dt/dθ) over samples, with dt/dθ = 1 / cos² θ, and a margin for what lies between them."""
    return _MARGIN * float((np.abs(slope) * np.cos(angle) ** 2 / brightness).max())
