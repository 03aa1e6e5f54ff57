"""What pixels that are too dark for the light say of it, where they are many."""

from __future__ import annotations

from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.wording import keyword

MANY = 0.25
"""Share of pixels without a bound on the slope beyond which shadow and paint are no likely reason."""


def too_dark(clamped: int, solved: int, light: Light, *, levelled: bool) -> str | None:
    """What to warn of; None where such pixels are few.

    Parameters
    ----------
    clamped, solved : int
        Pixels without a bound of their own on the slope, and pixels with a depth.
    light : Light
    levelled : bool
        Whether the brightness is normalised to that of level ground.
    """
    if clamped <= MANY * solved:
        return None
    direction, bound = f"{keyword('p0')} and {keyword('q0')}", keyword("max_slope")
    counted = f"{clamped} pixels, {100 * clamped / solved:.2g} % of those with a depth,"
    if light.normalised and light.cosine_of_ground < 1.0:
        normalise = "" if levelled else f", and on open ground give {keyword('normalise', 'level')}"
        return (
            f"{counted} are darker than level ground, and under a slanting light only {bound} bounds their slope. "
            f"Check {direction}{normalise}; where noise or shadow leads astray, {keyword('guide')} with "
            f"{keyword('scheme', 'regularised')}."
        )
    if light.normalised:
        other = keyword("light", FlashLight(), written="FlashLight()")
        check = f"{direction} for one from the side, {other} for a lamp at the camera"
    else:
        other = keyword("light", ParallelLight(), written="ParallelLight()")
        # Without falloff a lamp is at the camera, and nowhere else.
        beside = f"{keyword('offset')} for one beside the lens, " if light.determines_depth else ""
        check = f"{beside}{other} for one far away"
    return (
        f"{counted} are too dark for the light, and only {bound} bounds their slope. With so many the light is hardly "
        f"the one that was told, or they are background. Check it: {check}. Mask out the background."
    )
