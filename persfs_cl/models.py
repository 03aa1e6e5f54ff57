"""Which kernels stand for a light, a material and a scheme, and the numbers that they want."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl.camera import PixelGrid
from persfs_cl.errors import InputError
from persfs_cl.light import FlashLight, Light, ParallelLight
from persfs_cl.reflectance import Lambertian, OrenNayar, Phong, Reflectance

SCHEMES = ("auto", "lax-friedrichs", "upwind")


@dataclass(frozen=True)
class Model:
    """A light on a material.

    Attributes
    ----------
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    kernels : tuple of str
        Kernel files that hold the Hamiltonian, in the order in which they are composed.
    """

    light: Light
    reflectance: Reflectance
    kernels: tuple[str, ...]

    @classmethod
    def of(cls, light: Light, reflectance: Reflectance) -> Model:
        """The model of a light and a material.

        Raises
        ------
        InputError
            When there is none for them.
        """
        if not isinstance(reflectance, (Lambertian, OrenNayar, Phong)):
            raise InputError(
                f"reflectance={reflectance!r} is no known material: give Lambertian(), OrenNayar(...) or Phong(...)."
            )
        if isinstance(light, ParallelLight):
            if not isinstance(reflectance, Lambertian):
                raise InputError(
                    f"reflectance={reflectance!r} under a parallel light has no scheme here: give Lambertian(), or "
                    "photograph with a FlashLight."
                )
            return cls(light, reflectance, ("parallel_light",))
        if not isinstance(light, FlashLight):
            raise InputError(f"light={light!r} is no known light: give a ParallelLight or a FlashLight.")
        if not light.falloff or not light.coaxial:
            raise InputError(
                f"light={light!r} has no scheme here: the lamp must be at the camera, with fall-off. Give "
                "FlashLight(gain=...), or a ParallelLight."
            )
        material = {Lambertian: "lambertian", OrenNayar: "oren_nayar", Phong: "phong"}[type(reflectance)]
        return cls(light, reflectance, (material, "flash_light"))

    @property
    def falls_off(self) -> bool:
        """Whether the light fades with distance, so that the image alone determines the depth."""
        return isinstance(self.light, FlashLight) and self.light.falloff

    def scheme(self, chosen: str) -> str:
        """The scheme's name, "auto" resolved: the paper's under a parallel light, upwind under a flash.

        Raises
        ------
        InputError
            When the material is not for the upwind scheme.
        """
        upwind = self.falls_off and self.reflectance.monotone
        resolved = ("upwind" if upwind else "lax-friedrichs") if chosen == "auto" else chosen
        if resolved == "upwind" and not self.reflectance.monotone:
            raise InputError(
                f"scheme='upwind' with reflectance={self.reflectance!r}: this material is not brightest face on, so "
                "that a brightness belongs to two angles. Use scheme='lax-friedrichs'."
            )
        return resolved

    def kernels_with(self, scheme: str) -> tuple[str, ...]:
        """Kernel files of the model and of a scheme by its resolved name."""
        files = {"lax-friedrichs": "lax_friedrichs", "upwind": "upwind_flash" if self.falls_off else "upwind"}
        return (*self.kernels, files[scheme])

    def parameters(self, grid: PixelGrid, *, sign: float = 1.0, max_slope: float = 1.0) -> list[float]:
        """Numbers of one image, in the order of kernels/prelude.cl and of the model's files."""
        steps = [0.5 / grid.dx, 0.5 / grid.dy, max_slope * grid.dx, max_slope * grid.dy, max_slope]
        common = [*steps, sign, grid.dx, grid.dy]
        if isinstance(self.light, ParallelLight):
            return [*common, self.light.p0, self.light.q0, 1.0 / self.light.norm]
        return [*common, self.light.gain, self.reflectance.steepest_log, *_material_numbers(self.reflectance)]

    def axes(self, grid: PixelGrid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Numbers of the columns and of the rows, shapes (3, width) and (3, height).

        Coordinate x, sqrt(1 + x²) / (2 dx) and, for a parallel light, |x - p0| / (2 k dx); likewise for y.
        """
        light = self.light
        slopes, norm = ((light.p0, light.q0), light.norm) if isinstance(light, ParallelLight) else ((0.0, 0.0), np.inf)
        tables = []
        for coordinate, spacing, slope in zip((grid.x, grid.y[:, 0]), (grid.dx, grid.dy), slopes, strict=True):
            root, offset = np.sqrt(1.0 + coordinate**2), np.abs(coordinate - slope) / norm
            tables.append(np.stack([coordinate, root / (2.0 * spacing), offset / (2.0 * spacing)]))
        return tables[0], tables[1]


def _material_numbers(reflectance: Reflectance) -> list[float]:
    if isinstance(reflectance, OrenNayar):
        return [reflectance.direct, reflectance.rim]
    if isinstance(reflectance, Phong):
        return [reflectance.diffuse, reflectance.specular, reflectance.shininess]
    return []
