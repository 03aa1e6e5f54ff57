"""How much each part of an energy counts: found from the image, and from what a user says of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.preparation.denoise import noise_of
from persfs_cl.quantiles import median, quantile
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.view import View

SMOOTHING = 1.0
"""Pixels over which the surface is smoothed, when nothing else is said."""
SMOOTHING_OF_PAINT = 20.0
"""The same of painted surfaces."""

_TOP = 0.99
"""Share of the pixels that are darker than what is taken for white."""
_LEAST_NOISE = 0.004
"""Of white: the step of 8 bits."""
_MODEL_ERROR = 0.03
"""Share of the brightness by which slopes between pixels, and light that comes from elsewhere, are off anyway."""
_LEAST_SPREAD = 0.02
_SENSITIVITY = 0.125
"""Share of the brightness by which a slope changes it, in directions in which shading tells little. In others the
surface is smoothed over fewer pixels."""
_TRUST = 0.08
"""How much less a pixel of a painted surface counts than its spread says: paint is much the same next to it."""
_SMOOTHING_OF_REST = 3.0
"""Pixels to smooth over where paint has been divided out, which leaves errors of its own."""
_NORMAL = 1.4826
"""From the median of absolute values of a normal distribution to its standard deviation."""


@dataclass(frozen=True)
class Weights:
    """Numbers of an energy, as kernels/energy/linearise.cl has them.

    Attributes
    ----------
    painted : bool
        Whether ratios of brightness count, and not differences.
    noise : float
        Of the brightness; of what is painted the spread of ln albedo.
    share, floor, dark : float
    weight, scale, prior_weight, prior_scale, smoothness, crease : float
    white_is_free : bool
        Whether the level of ln albedo is found along with the surface.
    """

    painted: bool
    noise: float
    share: float
    floor: float
    dark: float
    weight: float
    scale: float
    prior_weight: float
    prior_scale: float
    smoothness: float
    crease: float
    white_is_free: bool = False

    def numbers(self, view: View) -> dict[str, float]:
        """By the names of the kernel's arguments, on one grid."""
        grid, square = view.grid, view.spacing**2
        return {
            "noise": self.noise,
            "share": self.share,
            "floor_brightness": self.floor,
            "dark": self.dark,
            "weight": self.weight,
            "scale": self.scale,
            "prior_weight": self.prior_weight,
            "prior_scale": self.prior_scale,
            "smoothness": self.smoothness,
            "inverse_crease": 1.0 / self.crease,
            # From one pixel of the finest grid to the next, on every grid.
            "bend_x": view.spacing / (grid.dx * square),
            "bend_y": view.spacing / (grid.dy * square),
        }


def weights_for(
    view: View,
    start: Array,
    light: Light,
    reflectance: Reflectance,
    paint: str | float,
    smoothing: float | None,
    prior_weight: float | None,
    *,
    fitted: bool = False,
) -> Weights:
    """The weights for an image.

    Parameters
    ----------
    view : View
    start : ndarray of float64, shape (height, width)
        Z to begin with.
    light, reflectance
        Of unit gain, in the unit of exp Z.
    paint : "plain", "painted" or float
        How far brightness varies beyond the shading; a number is the spread of ln albedo.
    smoothing : float or None
        Pixels to smooth over.
    prior_weight : float or None
        Of a pixel of the prior; None where there is none.
    fitted : bool
        Whether paint has been divided out, so that a number for it is the spread of what is left.
    """
    bright = view.image[view.solved]
    # Black tells of no scale.
    bright = bright[bright > 0.0] if (bright > 0.0).any() else np.ones(1)
    top = quantile(bright, _TOP)
    if paint == "plain":
        noise = max(noise_of(view.image, view.solved), _LEAST_NOISE * top)
        middle = median(bright)
        sigma = math.hypot(noise, _MODEL_ERROR * middle)
        over = SMOOTHING if smoothing is None else smoothing
        return Weights(
            painted=False,
            noise=noise,
            share=_MODEL_ERROR,
            floor=0.02 * top,
            dark=0.02 * top,
            weight=1.0,
            scale=3.0,
            prior_weight=prior_weight or 0.0,
            prior_scale=0.5,
            smoothness=(over * _SENSITIVITY * middle / sigma) ** 2,
            crease=0.2,
        )
    spread = max(
        _LEAST_SPREAD, spread_of(view, start, light, reflectance, 0.02 * top) if paint == "painted" else float(paint)
    )
    usual, weight = (_SMOOTHING_OF_REST, 1.0) if fitted else (SMOOTHING_OF_PAINT, _TRUST)
    over = usual if smoothing is None else smoothing
    return Weights(
        painted=True,
        noise=spread,
        share=0.0,
        floor=0.03 * top,
        dark=0.02 * top,
        weight=weight,
        scale=1.8,
        prior_weight=prior_weight or 0.0,
        prior_scale=0.5,
        smoothness=weight * (over * _SENSITIVITY / spread) ** 2,
        crease=0.02,
        white_is_free=prior_weight is not None or not np.isnan(view.known).all(),
    )


def spread_of(view: View, start: Array, light: Light, reflectance: Reflectance, dark: float) -> float:
    """Spread of ln albedo, if the surface is the one to start with."""
    q, p = (
        np.gradient(start, axis=axis) / step if start.shape[axis] > 1 else np.zeros_like(start)
        for axis, step in ((0, view.grid.dy), (1, view.grid.dx))
    )
    shaded = light.brightness(start, p, q, view.grid.x, view.grid.y, reflectance)
    there = view.solved & np.isfinite(shaded) & (view.image > dark)
    apart = np.log(view.image[there] + dark) - np.log(np.maximum(shaded[there], dark))
    if not apart.size:
        return _LEAST_SPREAD
    return _NORMAL * median(np.abs(apart - median(apart)))
