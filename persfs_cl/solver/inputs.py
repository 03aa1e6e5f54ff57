"""What a user gave for one image, checked before any work is done with it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import checks
from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.choices import GuideScale
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.guide.guide import Guide
from persfs_cl.maps import as_array_of_image, no_numbers
from persfs_cl.masks import Neighbours, rim
from persfs_cl.shading.model import Extremes, Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword

_MOST_RELIEF = 1e9
"""Ratio of depths beyond which single precision no longer tells a step of the tolerance from none."""

_STEEPEST_GROUND = 30.0
"""Degrees. A coin whose edge is bevelled has a median of 20 along its outline, a sphere 75 and more."""

_DARKEST_GROUND = 0.25
"""Share of the ground's brightness below which half of the frame is no ground: a relief that goes on has more, what
lies behind an object far less."""

_MOST_PIXELS = 2**30
"""Indices within an array are computed in 32 bits here and there."""

_DARK, _DARK_SHARE = 0.005, 0.05
"""When so many pixels are so dark compared with the brightest, 14 times as far away if they face the lamp, they are
probably no part of the object."""


def require_image(image: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.floating]]:
    """The image as an array, shape (height, width), perhaps the very array given; InputError when it is none."""
    given = as_array_of_image("image", image)
    if given.ndim != 2 or given.size < 2:
        remedy = " A colour image must be made grey first: see read_image." if given.ndim == 3 else ""
        shape = f"has shape {given.shape}: give a (height, width) array of at least 2 pixels.{remedy}"
        raise checks.unlike("image", image, shape)
    if not np.issubdtype(given.dtype, np.floating):
        raise checks.unlike(
            "image",
            image,
            f"has dtype {given.dtype}: give floats in [0, 1] in linear light, as read_image returns them (grey levels "
            "of 8 bits: divide by 255).",
        )
    if given.size > _MOST_PIXELS:
        raise checks.unlike("image", image, f"has shape {given.shape}: give one of at most {_MOST_PIXELS} pixels.")
    return given


def require_scale(light: Light, guide: Guide | None, scale: GuideScale, *, others: bool) -> None:
    """InputError when nothing tells how far away anything is; `others` are known depths or a range."""
    if light.unknown is not None and guide is None:
        raise InputError.about(
            "light",
            light,
            f"has an unknown {light.unknown}, which is found from a guide of fixed scale only: give "
            f"{keyword('guide')}, or the {light.unknown}; 1 leaves the unit of depth open.",
        )
    if light.determines_depth or others:
        return
    if guide is not None and scale != "fixed":
        raise InputError.about(
            "guide_scale",
            scale,
            f"needs something that has a scale, and {keyword('light', light)} has none: give "
            f"{keyword('known_depth')}, or a guide in units of depth with {keyword('guide_scale', 'fixed')}.",
        )
    if guide is None and not light.flat_rim:
        raise InputError(
            f"{keyword('known_depth')} is not given, but {keyword('light', light)} without fall-off tells of slopes "
            "only: give at least one depth, or photograph with fall-off.",
            argument="known_depth",
        )


def light_for(light: Light, guide: Guide, photograph: Array, grid: PixelGrid, reflectance: Reflectance) -> Light:
    """A light whose unknown number is about right: a surface at the guide that faces the camera is as bright.

    It is not told apart from one that slopes, so that the surface tells more.
    """
    cells, known = guide.cells, light.of_unit_gain
    row, column = np.divmod(np.flatnonzero(cells.of_pixel >= 0), cells.of_pixel.shape[1])
    depth = cells.values[cells.of_pixel[row, column]]
    level = np.zeros_like(depth)
    facing = known.brightness(depth, level, level, grid.x[column], grid.y[row, 0], reflectance)
    seen = photograph[row, column]
    usual = (seen > 0.0) & (seen < np.inf) & (facing > 0.0)
    if not usual.any():
        raise InputError.about("light", light, "lights none of the pixels of which the guide tells: check both.")
    return known.for_farther(0.5 * float(np.median(np.log(seen[usual] / facing[usual]))))


def require_shading(
    brightness: NDArray[np.float64], solved: NDArray[np.bool_], model: Model, most: float, name: str
) -> Extremes:
    """InputError when the pixels that are used are no image for the model; the others may hold anything."""
    extremes = Extremes.of(brightness, solved)
    darkest, brightest = extremes.darkest, extremes.brightest
    why = None
    if not (math.isfinite(darkest) and math.isfinite(brightest)):
        why = no_numbers(brightness, solved)
    elif darkest < 0.0 or brightest > most * (1.0 + 1e-6):
        why = f"ranges from {darkest:g} to {brightest:g}: {model.too_bright(most)}"
    elif brightest == 0.0:
        why = "is all black inside the mask: it carries no shading to reconstruct from."
    elif darkest == brightest and np.count_nonzero(solved) > 1 and np.isfinite(most):
        why = f"is constant ({darkest:g}) inside the mask: it carries no shading to reconstruct from."
    if why:
        raise InputError(f"{name} {why}", argument="image", value=brightness)
    return extremes


def warn_of_steep_outline(
    brightness: NDArray[np.float64],
    looked_at: NDArray[np.bool_],
    wanted: NDArray[np.bool_],
    light: Light,
    reflectance: Reflectance,
) -> None:
    """Warn where z = 1 is assumed along the outline of a mask that is no flat ground, as far as its brightness tells.

    Flat ground facing the camera has the angle θ0 = acos(1 / k) to a parallel light. A pixel at the angle θ, by its
    brightness compared with that of the ground, is tilted by abs(θ - θ0) at least, whichever way. Beside a mask the
    frame of the image is not looked at: the object goes on there. Without one it may do so too, with slopes of its own,
    so that only a frame is warned of that is far too dark.

    Parameters
    ----------
    brightness : ndarray of float64, shape (height, width)
    looked_at, wanted : ndarray of bool, shape (height, width)
        Pixels whose brightness counts, and the mask.
    light : Light
        One far away.
    reflectance : Reflectance
    """
    masked = not wanted.all()
    outline = looked_at & (Neighbours.of(~wanted).any if masked else rim(wanted)) & np.isfinite(brightness)
    if not outline.any():
        return
    ground = light.cosine_of_ground
    relative = brightness[outline] / float(reflectance.shade(ground, 1.0, ground))
    if not masked:
        if (level := float(np.median(relative))) < _DARKEST_GROUND:
            checks.warn(
                f"{keyword('known_depth')} is not given, and the edge of the image is taken for flat ground at z = 1; "
                f"but half of it has at most {100 * level:.2g} % of the brightness of such ground, as has a background "
                "or what is steep, and the surface falls off there. Give a mask that leaves out the background, "
                f"{keyword('known_depth')}, or the right light."
            )
        return
    tilts = np.abs(np.arccos(np.clip(relative * ground, 0.0, 1.0)) - math.acos(ground))
    tilt = math.degrees(float(np.median(tilts)))
    if tilt > _STEEPEST_GROUND:
        checks.warn(
            f"{keyword('known_depth')} is not given, and the outline of the mask is taken for flat ground at z = 1; "
            f"but by its brightness half of it is {tilt:.0f} degrees or more from flat, as where an object turns away. "
            "The surface may then be worse than a flat sheet, or than the outline inflated like a balloon: give "
            f"{keyword('known_depth')}, try the other surface, or clip highlights if they set the white level."
        )


def warn_of_background(brightness: NDArray[np.float64], solved: NDArray[np.bool_], extremes: Extremes) -> None:
    """Warn where under a fading light many pixels are as dark as what lies behind an object."""
    dim = _DARK * extremes.brightest
    if extremes.darkest >= dim:
        return
    dark = sum(np.count_nonzero((brightness[rows] < dim) & solved[rows]) for rows in row_blocks(solved.shape))
    share = dark / np.count_nonzero(solved)
    if share > _DARK_SHARE:
        checks.warn(
            f"{100 * share:.0f} % of the pixels to solve are darker than {100 * _DARK:g} % of the brightest, and "
            "become a surface far away: if they are background or shadow, mask them out."
        )


def require_relief(depths: NDArray[np.float64]) -> None:
    """Refuse known depths, of those that the surface meets, that are too far apart for single precision."""
    nearest, farthest = float(depths.min(initial=np.inf)), float(depths.max(initial=0.0))
    if farthest > _MOST_RELIEF * nearest:
        raise InputError(
            f"{keyword('known_depth')} goes from {nearest:g} to {farthest:g} next to pixels to solve: give depths of "
            f"which the farthest is at most {_MOST_RELIEF:g} times the nearest, and NaN for what is not known, or has "
            "no end.",
            argument="known_depth",
        )
