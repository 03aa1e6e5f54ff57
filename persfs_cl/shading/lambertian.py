"""A perfectly matt material."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.shading.reflectance import Reflectance, visible


@dataclass(frozen=True)
class Lambertian(Reflectance):
    """A perfectly matt material: brightness is the cosine between normal and light, eq. (2).

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.Lambertian().coaxial([1.0, 0.5, 0.0])
    array([1. , 0.5, 0. ])
    """

    kernel: ClassVar[str] = "lambertian"
    summary: ClassVar[str] = "perfectly matt"
    perfectly_matt: ClassVar[bool] = True

    def coaxial(self, cosine: ArrayLike) -> Array:
        """c(θ) = cos θ; see :meth:`Reflectance.coaxial`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.Lambertian().coaxial([1.0, 0.5, 0.0])
        array([1. , 0.5, 0. ])
        """
        return visible(cosine)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> Array:
        """Cos θi from wherever it is seen; see :meth:`Reflectance.shade`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.Lambertian().shade([0.5, -0.5], 1.0, 0.5)  # the second turns its back to the light
        array([ 0.5, -0.5])
        """
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

    def facing(self, returned: Array) -> Array:
        """The cosine itself; see :meth:`Reflectance.facing`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> float(ps.Lambertian().facing(0.7))
        0.7
        """
        return np.minimum(returned, 1.0)
