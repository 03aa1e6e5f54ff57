"""How far each pixel of a reconstructed surface can be believed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.quantiles import median, quantile
from persfs_cl.shading.reflectance import Reflectance

BRIGHTNESS_ERROR = 0.01
"""Relative error of the brightness that :class:`SlopeErrors` assumes."""

_GRAZING = math.radians(89.9)
_ANGLES = 20_001


@dataclass(frozen=True, eq=False)
class Confidence:
    """What is known of the errors of a surface without knowing the surface.

    Attributes
    ----------
    slope_error : ndarray of float64, shape (height, width)
        By how much the slope is wrong where the brightness is 1 % wrong, see :class:`SlopeErrors`; NaN where not
        solved.
    unreliable : mapping of str to ndarray of bool, shape (height, width)
        Pixels whose brightness does not tell of the slope, by the reason.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> confidence = ps.reconstruct(scene.image, scene.camera, light=scene.light).confidence()
    >>> confidence.slope_error.shape, sorted(confidence.unreliable)
    ((20, 20), ['clamped', 'unreached'])
    """

    slope_error: Array
    unreliable: Mapping[str, Mask]

    def __repr__(self) -> str:
        height, width = self.slope_error.shape
        middle = median(self.slope_error)
        known = "" if math.isnan(middle) else f", median slope error {middle:.3g}"
        return f"<Confidence, {width} x {height} pixels{known}, {np.count_nonzero(self._unreliable)} unreliable>"

    @property
    def _unreliable(self) -> Mask:
        """Pixels that are unreliable for any reason."""
        found = np.zeros(self.slope_error.shape, bool)
        for pixels in self.unreliable.values():
            found |= pixels
        return found

    def report(self) -> dict[str, Any]:
        """Medians and counts, ready for JSON.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> confidence = ps.reconstruct(scene.image, scene.camera, light=scene.light).confidence()
        >>> confidence.report()["doubtful_pixels"]
        {'unreached': 0, 'clamped': 0, 'any': 0}
        """
        return {
            "slope_error": {
                "assumed_brightness_error": BRIGHTNESS_ERROR,
                "median": median(self.slope_error),
                "percentile_90": quantile(self.slope_error, 0.9),
            },
            "doubtful_pixels": {
                **{reason: int(np.count_nonzero(pixels)) for reason, pixels in self.unreliable.items()},
                "any": int(np.count_nonzero(self._unreliable)),
            },
        }


class SlopeErrors:
    """By how much the slope changes when the brightness changes by 1 %, all else being equal.

    The slope is t = tan θ, with θ the angle between normal and light. With f = ln c(t) the change Δ solves
    ½ |f''| Δ² + |f'| Δ = 0.01: it is 0.01 / |f'| but where the surface faces the light. There f' = 0, and brightness
    tells of slopes least: for a Lambertian surface Δ is 0.14 face on, 0.02, the least, at 45°, and 0.01 t where steep.
    Under a light at the camera t is the relative change of distance per radian of the view, so that t times the angle
    between two pixels is what the step from one to the other may be wrong by. Errors of many pixels add up along the
    way from a known depth; under a flash that fades with distance no further than to half the relative error of the
    brightness in places that face it.

    Numbers are taken from a table by the sine of half the angle, which follows from the cosine by a square root alone
    and is as even as the angle itself.

    Parameters
    ----------
    reflectance : Reflectance
        As seen from the light: c(θ) is :meth:`Reflectance.coaxial <persfs_cl.shading.reflectance.Reflectance.coaxial>`.
        For a Lambertian surface this is no restriction.
    """

    def __init__(self, reflectance: Reflectance) -> None:
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
        sines = np.linspace(0.0, math.sin(_GRAZING / 2), _ANGLES)
        self._values = np.interp(2.0 * np.arcsin(sines), angle[half], change)
        # Beyond the last number it goes on.
        self._steps = np.append(np.diff(self._values), 0.0)
        self._scale = (_ANGLES - 1) / sines[-1]

    def __call__(self, cosine: Array) -> Array:
        """Above 0, of some cos θ; NaN where they are. What is turned away from the light counts as grazing."""
        place = np.clip(cosine, 0.0, 1.0)
        np.subtract(1.0, place, out=place)
        place *= 0.5 * self._scale**2
        np.sqrt(place, out=place)
        np.minimum(place, _ANGLES - 1.0, out=place)
        with np.errstate(invalid="ignore"):
            before = place.astype(np.int32)
        place -= before
        # Of NaN there is no number: any will do, for it stays NaN.
        place *= self._steps.take(before, mode="clip")
        place += self._values.take(before, mode="clip")
        return place


def cosine_to_light(components: Sequence[Array], to_light: Array) -> Array:
    """Cosine of the angle between normal and light.

    Parameters
    ----------
    components : sequence of 3 ndarray of float64, shape (height, width)
        Of the normals.
    to_light : ndarray of float64, shape (..., 3)
        See :meth:`Light.toward <persfs_cl.shading.model.Light.toward>`.

    Returns
    -------
    ndarray of float64, shape (height, width)
        NaN where there is no surface.
    """
    right, down, forward = (to_light[..., axis] for axis in range(3))
    cosine: Array = components[0] * right
    cosine += components[1] * down
    cosine += components[2] * forward
    cosine /= np.sqrt(right * right + down * down + forward * forward)
    return cosine
