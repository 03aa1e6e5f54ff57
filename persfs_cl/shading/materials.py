"""The materials that there are: how each returns the light that falls on it.

Angles are those between the surface normal and the directions to the light (θi) and to the viewer (θr); where light
and viewer are in one direction, as with a flash, both are θ.
"""

from __future__ import annotations

from persfs_cl.errors import InputError
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.phong import Phong
from persfs_cl.shading.reflectance import Reflectance

MATERIALS: dict[str, type[Reflectance]] = {
    "lambertian": Lambertian,
    "oren-nayar": OrenNayar,
    "phong": Phong,
}
"""All materials, by the names that users type. Whatever else knows of a material reads it from here."""


def require_reflectance(reflectance: object) -> Reflectance:
    """The material, or InputError when it is none."""
    if not isinstance(reflectance, Reflectance):
        *first, last = (f"{kind.__name__}(...)" for kind in MATERIALS.values())
        raise InputError.about("reflectance", reflectance, f"is no known material: give {', '.join(first)} or {last}.")
    return reflectance
