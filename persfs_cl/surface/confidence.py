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
from persfs_cl.camera import Camera
from persfs_cl.shading.model import Light
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
        known = self.slope_error[~np.isnan(self.slope_error)]
        median = f", median slope error {np.median(known):.3g}" if known.size else ""
        return f"<Confidence, {width} x {height} pixels{median}, {np.count_nonzero(self._unreliable)} unreliable>"

    @property
    def _unreliable(self) -> Mask:
        """Pixels that are unreliable for any reason."""
        return np.asarray(np.logical_or.reduce([np.zeros(self.slope_error.shape, bool), *self.unreliable.values()]))

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
        median, high = np.nanpercentile(self.slope_error, (50, 90))
        return {
            "slope_error": {
                "assumed_brightness_error": BRIGHTNESS_ERROR,
                "median": float(median),
                "percentile_90": float(high),
            },
            "doubtful_pixels": {
                **{reason: int(np.count_nonzero(pixels)) for reason, pixels in self.unreliable.items()},
                "any": int(np.count_nonzero(self._unreliable)),
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
    interpolate = _Interpolation(angle[half], change)
    for some in row_blocks((cosines.size, 1)):
        found[some] = interpolate(np.arccos(np.clip(cosines.reshape(-1)[some], 0.0, 1.0)))
    return found.reshape(cosines.shape)


class _Interpolation:
    """What `np.interp` gives, to the bit, but between points at equal distances, which need no search.

    Parameters
    ----------
    places, values : ndarray of float64, shape (n,)
        The points; places ascend.
    """

    def __init__(self, places: Array, values: Array) -> None:
        self._places, self._values = places, values
        # Beyond the last point its value goes on.
        self._slopes = np.append(np.diff(values) / np.diff(places), 0.0)
        self._next = np.append(places[1:], np.inf)
        self._spacing = (places[-1] - places[0]) / (len(places) - 1)

    def __call__(self, wanted: Array) -> Array:
        """The values at places, none of which lies before the first."""
        wanted = np.clip(wanted, self._places[0], self._places[-1])
        known = np.where(np.isnan(wanted), 0.0, wanted)
        point = ((known - self._places[0]) / self._spacing).astype(np.intp)
        # By rounding it may be the one beside.
        point -= known < self._places[point]
        point += known >= self._next[point]
        wanted -= self._places[point]
        wanted *= self._slopes[point]
        wanted += self._values[point]
        return wanted


def cosine_to_light(depth: Array, normals: Array, camera: Camera, light: Light) -> Array:
    """Cosine of the angle between normal and light at every pixel.

    Parameters
    ----------
    depth : ndarray of float64, shape (height, width)
    normals : ndarray of float64, shape (height, width, 3)
    camera : Camera
    light : ParallelLight or FlashLight

    Returns
    -------
    ndarray of float64, shape (height, width)
        NaN where there is no surface.
    """
    grid = camera.grid((depth.shape[0], depth.shape[1]))
    cosine = np.empty(depth.shape)
    for rows in row_blocks(depth.shape):
        z = depth[rows]
        to_light = light.toward(z, grid.x, grid.y[rows])
        np.divide(_sum(normals[rows] * to_light), np.sqrt(_sum(to_light * to_light)), out=cosine[rows])
    return cosine


def _sum(products: Array) -> Array:
    """Of the three along the last axis, as `sum` adds them up, which is slow where they are few."""
    total: Array = products[..., 0] + products[..., 1]
    total += products[..., 2]
    return total
