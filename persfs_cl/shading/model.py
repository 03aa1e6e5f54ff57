"""Which kernels stand for a light, a material and a scheme, and the numbers that they want."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from persfs_cl.camera import PixelGrid
from persfs_cl.checks import brief
from persfs_cl.choices import Scheme
from persfs_cl.errors import InputError
from persfs_cl.shading.light import FlashLight, Light, ParallelLight
from persfs_cl.shading.material import Lambertian, OrenNayar, Phong, Reflectance

_MATERIAL_KERNELS: dict[type[Reflectance], str] = {
    Lambertian: "lambertian",
    OrenNayar: "oren_nayar",
    Phong: "phong",
}

_ANGLES = 2**18 + 1

_MARGIN, _SMALL_MARGIN = 1.02, 1.001
"""More than a slope, and a value with level top, can rise between its samples above the largest of them."""


@dataclass(frozen=True)
class Model:
    """A light on a material.

    Attributes
    ----------
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    kernels : tuple of str
        Kernel files that hold the Hamiltonian, in the order in which they are composed. Of a lamp beside the camera
        that of one at the camera, but for the upwind scheme: see :mod:`persfs_cl.solver.rounds`.
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
                f"reflectance={brief(reflectance)} is no known material: give Lambertian(), OrenNayar(...) or "
                "Phong(...)."
            )
        if isinstance(light, ParallelLight):
            if isinstance(reflectance, Lambertian):
                return cls(light, reflectance, ("light_cone", "parallel_light"))
            return cls(light, reflectance, ("elementary", _MATERIAL_KERNELS[type(reflectance)], "parallel_material"))
        if not isinstance(light, FlashLight):
            raise InputError(f"light={brief(light)} is no known light: give a ParallelLight or a FlashLight.")
        if not (light.coaxial or light.falloff):
            raise InputError(
                f"light={light!r} has no scheme here: a lamp without fall-off must be at the camera. Leave its "
                "place out, or photograph with fall-off."
            )
        if not light.falloff and not reflectance.monotone:
            raise InputError(
                f"reflectance={reflectance!r} under a flash without fall-off: this material is not brightest face on, "
                "so that a brightness belongs to two angles. Give a flash with fall-off, or another material."
            )
        material = _MATERIAL_KERNELS[type(reflectance)]
        return cls(light, reflectance, ("elementary", material, "flash_light" if light.falloff else "headlight"))

    @property
    def falls_off(self) -> bool:
        """Whether the light fades with distance, so that the image alone determines the depth."""
        return isinstance(self.light, FlashLight) and self.light.falloff

    @property
    def at_camera(self) -> bool:
        """Whether the light comes from the camera, so that only the angle between surface and ray shades."""
        return isinstance(self.light, FlashLight)

    @property
    def flash(self) -> FlashLight:
        """The light, where it is a flash.

        Raises
        ------
        TypeError
            When it is not.
        """
        if not isinstance(self.light, FlashLight):
            raise TypeError(f"{self.light!r} is no flash")
        return self.light

    @property
    def of_unit_gain(self) -> Model:
        """The same with a gain of 1, where there is one, for the device: single precision may not reach another."""
        return replace(self, light=replace(self.light, gain=1.0)) if isinstance(self.light, FlashLight) else self

    @property
    def beside_camera(self) -> bool:
        """Whether the light is a lamp somewhere beside the camera."""
        return isinstance(self.light, FlashLight) and not self.light.coaxial

    def brightest(self, grid: PixelGrid) -> float:
        """The largest value that an image may have; infinite where it depends on the depth."""
        if isinstance(self.light, FlashLight):
            return np.inf if self.light.falloff else self.light.gain * self.reflectance.brightest
        return 1.0 if isinstance(self.reflectance, Lambertian) else self._survey(grid)[1]

    def facing(self, image: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cosine of the angle between surface and ray, from the brightness under a flash without fall-off.

        What is darker than the material at grazing gets 0, and what rounding leaves beyond the brightest value 1. Found
        by interpolation between so many angles that what is lost is less than single precision can tell.
        """
        returned = image / self.flash.gain
        if isinstance(self.reflectance, Lambertian):
            return np.minimum(returned, 1.0)
        cosines = np.sin(np.linspace(0.0, 0.5 * np.pi, _ANGLES))
        return np.interp(returned, self.reflectance.coaxial(cosines), cosines)

    def scheme(self, chosen: Scheme) -> Scheme:
        """The scheme's name, "auto" resolved: the paper's under a parallel light, upwind under a flash.

        Raises
        ------
        InputError
            When the material is not for the upwind scheme, which wants a convex set of gradients.
        """
        upwind = self.at_camera and self.reflectance.monotone
        resolved = ("upwind" if upwind else "lax-friedrichs") if chosen == "auto" else chosen
        if resolved == "upwind" and not self.reflectance.monotone:
            raise InputError(
                f"scheme='upwind' with reflectance={self.reflectance!r}: this material is not brightest face on, so "
                "that a brightness belongs to two angles. Use scheme='lax-friedrichs'."
            )
        if resolved == "upwind" and not (self.at_camera or isinstance(self.reflectance, Lambertian)):
            raise InputError(
                f"scheme='upwind' with reflectance={self.reflectance!r} under a parallel light: this scheme is for "
                "perfectly matt materials there. Use scheme='lax-friedrichs'."
            )
        return resolved

    def kernels_with(self, scheme: str) -> tuple[str, ...]:
        """Kernel files of the model and of a scheme by its resolved name."""
        if scheme == "lax-friedrichs":
            return (*self.kernels, "lax_friedrichs")
        if not self.falls_off:
            return (*self.kernels, "climb", "upwind")
        if not self.beside_camera:
            return (*self.kernels, "steepness", "upwind_flash")
        elementary, material, _ = self.kernels
        return (elementary, material, "steepness", "light_cone", "off_axis_lamp", "climb", "upwind_off_axis")

    def parameters(
        self,
        grid: PixelGrid,
        *,
        scheme: str = "lax-friedrichs",
        sign: float = 1.0,
        max_slope: float = 1.0,
        unit: float = 1.0,
    ) -> dict[str, float]:
        """Numbers of one image by the names that the kernels have for them; Z = 0 is `unit`."""
        common = {
            "half_inverse_dx": 0.5 / grid.dx,
            "half_inverse_dy": 0.5 / grid.dy,
            "step_x": max_slope * grid.dx,
            "step_y": max_slope * grid.dy,
            "steepest": max_slope,
            "sign": sign,
        }
        if isinstance(self.light, ParallelLight):
            numbers = {**common, "p0": self.light.p0, "q0": self.light.q0, "inverse_norm": 1.0 / self.light.norm}
            if isinstance(self.reflectance, Lambertian):
                return numbers
            return {**numbers, "steepness": self.steepness(grid), **_material_numbers(self.reflectance)}
        material = _material_numbers(self.reflectance)
        if not self.light.falloff:
            return {**common, "gain": self.light.gain, **material}
        if scheme == "upwind" and self.beside_camera:
            lamp = (f"lamp_{axis}" for axis in "xyz")
            return {
                **common,
                **{name: place / unit for name, place in zip(lamp, self.light.offset, strict=True)},
                **material,
            }
        return {**common, "gain": self.light.gain, "steepest_log": self.reflectance.steepest_log, **material}

    def between(self, grid: PixelGrid) -> NDArray[np.float64]:
        """Cosine of the angle between the rays and a parallel light, shape (height, width)."""
        p0, q0, norm = self.light.p0, self.light.q0, self.light.norm  # type: ignore[union-attr] # it is parallel
        return np.asarray((1.0 + grid.x * p0 + grid.y * q0) / (norm * np.sqrt(1.0 + grid.x**2 + grid.y**2)))

    def steepness(self, grid: PixelGrid) -> float:
        """How steeply the brightness falls at most over the normals, under a parallel light; 0 where no scheme asks."""
        if isinstance(self.light, FlashLight) or isinstance(self.reflectance, Lambertian):
            return 0.0
        return self._survey(grid)[0]

    def _survey(self, grid: PixelGrid) -> tuple[float, float]:
        """What :func:`_survey` finds, over all rays of an image."""
        between = self.between(grid)
        cosines = np.linspace(between.min(), between.max(), 5)
        found = np.array([_survey(self.reflectance, float(cosine)) for cosine in cosines])
        return float(found[:, 0].max()), float(found[:, 1].max())

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


@lru_cache(maxsize=64)
def _survey(reflectance: Reflectance, between: float) -> tuple[float, float]:
    """Upper bounds of cos θr |dR/dN| across the ray, and of the brightness R, over all unit normals N seen and lit.

    `between` is the cosine between light and ray. In axes along the ray e, with R_i and R_r the derivatives of R by the
    two cosines, dR/dN = R_i (l - N cos θi) + R_r (e - N cos θr). The normals are taken in circles around the direction
    half way between light and ray, which lie the closer the smaller they are: highlights are there.
    """
    half = 0.5 * np.arccos(np.clip(between, -1.0, 1.0))
    radius, turn = np.geomspace(1e-4, np.pi, 400)[:, None], np.linspace(0.0, np.pi, 65)
    along, beside = np.cos(radius) + 0.0 * turn, np.sin(radius) * np.cos(turn)
    normal_x = np.cos(half) * beside + np.sin(half) * along
    normal_y = np.sin(radius) * np.sin(turn)
    seen = np.cos(half) * along - np.sin(half) * beside
    lit = seen * np.cos(2.0 * half) + normal_x * np.sin(2.0 * half)
    step = 1e-6
    used = (seen > 2.0 * step) & (lit > 2.0 * step)
    lit, seen, normal_x, normal_y = lit[used], seen[used], normal_x[used], normal_y[used]
    by_lit, by_seen = (
        (reflectance.shade(lit + a, seen + b, between) - reflectance.shade(lit - a, seen - b, between)) / (2.0 * step)
        for a, b in ((step, 0.0), (0.0, step))
    )
    slope_x = by_lit * (np.sin(2.0 * half) - lit * normal_x) - by_seen * seen * normal_x
    slope_y = -(by_lit * lit + by_seen * seen) * normal_y
    steepest, brightest = seen * np.hypot(slope_x, slope_y), reflectance.shade(lit, seen, between)
    return _MARGIN * float(steepest.max()), _SMALL_MARGIN * float(brightest.max())


def _material_numbers(reflectance: Reflectance) -> dict[str, float]:
    if isinstance(reflectance, OrenNayar):
        return {"direct": reflectance.direct, "rim": reflectance.rim}
    if isinstance(reflectance, Phong):
        return {name: getattr(reflectance, name) for name in ("diffuse", "specular", "shininess")}
    return {}
