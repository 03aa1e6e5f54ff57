"""The lights that there are: where the illumination of a photograph comes from."""

from __future__ import annotations

from persfs_cl.errors import InputError
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight

LIGHTS: dict[str, type[Light]] = {
    "parallel": ParallelLight,
    "flash": FlashLight,
}
"""All lights, by the names that users type. Whatever else knows of a light reads it from here."""


def require_light(light: object) -> Light:
    """The light, or InputError when it is none."""
    if not isinstance(light, Light):
        if isinstance(light, str) and (kind := LIGHTS.get(light)):
            raise InputError.about("light", light, f"is only the name of one: give persfs_cl.{kind.__name__}().")
        names = " or ".join(f"a {kind.__name__}" for kind in LIGHTS.values())
        raise InputError.about("light", light, f"is no known light: give {names}.")
    return light
