"""How far each pixel of a reconstructed surface can be believed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.shading.reflectance import Reflectance

BRIGHTNESS_ERROR = 0.01
"""Relative error of the brightness that :func:`slope_error` assumes."""

_GRAZING = math.radians(89.9)
_ANGLES = 20_001


@dataclass(frozen=True, eq=False)
class Confidence:
    """What is known of the errors of a surface without knowing the surface.

    Attributes
    ----------
    slope_error : ndarray of float64, shape (height, width)
        By how much the slope is wrong where the brightness is 1 % wrong; see :func:`slope_error`. NaN where not solved.
    doubts : mapping of str to ndarray of bool, shape (height, width)
        Pixels whose brightness does not tell of the slope, by the reason.
    """

    slope_error: Array
    doubts: Mapping[str, Mask]

    def report(self) -> dict[str, Any]:
        """Medians and counts, ready for JSON."""
        median, high = np.nanpercentile(self.slope_error, (50, 90))
        doubtful = np.logical_or.reduce(list(self.doubts.values()))
        return {
            "slope_error": {
                "assumed_brightness_error": BRIGHTNESS_ERROR,
                "median": float(median),
                "percentile_90": float(high),
            },
            "doubtful_pixels": {
                **{reason: int(np.count_nonzero(pixels)) for reason, pixels in self.doubts.items()},
                "any": int(np.count_nonzero(doubtful)),
            },
        }


def slope_error(cosine: ArrayLike, reflectance: Reflectance) -> Array:
    """By how much the slope changes when the brightness changes by 1 %, all else being equal.

    The slope is t = tan θ, with θ the angle between normal and light. With f = ln c(t) the change Δ solves
    ½ |f''| Δ² + |f'| Δ = 0.01: it is 0.01 / |f'| but where the surface faces the light. There f' = 0, and brightness
    tells of slopes least: for a Lambertian surface Δ is 0.14 face on, 0.02, the least, at 45°, and 0.01 t where steep.
    Under a light at the camera t is the relative change of distance per radian of the view, so that t times the angle
    between two pixels is what the step from one to the other may be wrong by. Errors of many pixels add up along the
    way from a known depth; under a flash that fades with distance no further than to half the relative error of the
    brightness in places that face it.

    Parameters
    ----------
    cosine : array_like
        cos θ, NaN where there is no surface. What is turned away from the light counts as grazing.
    reflectance : Reflectance
        As seen from the light: c(θ) is :meth:`Reflectance.coaxial <persfs_cl.shading.reflectance.Reflectance.coaxial>`.
        For a Lambertian surface this is no restriction.

    Returns
    -------
    ndarray of float64
        Above 0; NaN where `cosine` is.
    """
    # Both sides of 0, where c is level, so that differences are central there too.
    angle = np.linspace(-_GRAZING, _GRAZING, _ANGLES)
    squared = np.cos(angle) ** 2
    logarithm = np.log(reflectance.coaxial(np.cos(angle)))
    # dθ/dt = cos² θ.
    first = np.gradient(logarithm, angle) * squared
    second = np.gradient(first, angle) * squared
    half = slice(_ANGLES // 2, None)
    slope, bend = np.abs(first[half]), np.abs(second[half])
    change = 2 * BRIGHTNESS_ERROR / (slope + np.sqrt(slope**2 + 2 * BRIGHTNESS_ERROR * bend))
    cosines = np.asarray(cosine, dtype=np.float64)
    found = np.empty(cosines.size)
    for some in row_blocks((cosines.size, 1)):
        found[some] = np.interp(np.arccos(np.clip(cosines.reshape(-1)[some], 0.0, 1.0)), angle[half], change)
    return found.reshape(cosines.shape)
