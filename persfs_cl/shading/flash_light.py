"""A point light at the camera or near it: a flash, a torch, the lamp of an endoscope; and the models that it makes.

All of them in one file, since the light makes the models, and each model reads the light.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.checks import FARTHEST, NEAREST, as_flag, as_number, as_numbers
from persfs_cl.choices import Precision
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.quantiles import median, sampled
from persfs_cl.shading.equations import Equation, FlashEquation, HeadlightEquation, LampEquation
from persfs_cl.shading.forward import Direction, surface_norm
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import DARKEST, Extremes, Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword

_FARTHEST = 1e9

_MOST_POWER = 300.0
"""Of ten, in a brightness: beyond, double precision ends."""

_BLACK = 1e-6
"""Share of the brightest value that even a black pixel is taken to have: less than any camera tells."""

_SAMPLES = 2**14
"""Pixels that stand for all of them where a typical depth is wanted."""

_LEAST_LIGHT, _MOST_LIGHT = 1e-100, 1e100
"""What the brightest pixel may be, so that products of it have double-precision numbers."""

_FARTHEST_LAMP = 1e3
"""A lamp that is so many times farther from the camera than from the surface leaves nothing of its relief."""


@dataclass(frozen=True)
class FlashLight(Light):
    """A point light at the optical centre of the camera, or off its axis: a flash, a torch, the lamp of an endoscope.

    With ρ the distance from lamp to surface and c what the reflectance returns, the image is I = κ c / ρ², or
    I = κ c without fall-off (section 4 of the method).

    Parameters
    ----------
    falloff : bool
        Light fades with the square of the distance. False for photographs that were corrected for this: they tell of
        the slopes only, and the surface can have any size.
    gain : float or None
        κ > 0, the brightness of a surface that faces the lamp at distance 1 and returns all its light. It holds the
        unit of depth: 100 times the gain makes every depth 10 times as large. None where it is not known: then
        :func:`persfs_cl.reconstruct` finds it from a guide whose scale is known.
    offset : (float, float, float)
        Where the lamp is, from the optical centre, in units of depth along the camera's axes (x right, y down,
        z forward). (0, 0, 0) is a coaxial light. A lamp that is seen an angle away from the camera, from depth d, is
        d times its tangent aside.

    Raises
    ------
    InputError
        When the gain is not a finite number above 0, the offset not three finite numbers, or the fall-off not a bool;
        or when the gain is not known of a flash without fall-off, whose photographs do not tell it.

    Examples
    --------
    A flash 5 cm to the right of the camera, for depths in metres:

    >>> import persfs_cl as ps
    >>> light = ps.FlashLight(gain=0.8, offset=(0.05, 0.0, 0.0))
    >>> light.coaxial
    False
    """

    shading_kernel: ClassVar[str] = "lamp_shading"
    summary: ClassVar[str] = "a lamp at the camera, or close by, as of a phone or an endoscope"

    falloff: bool = field(
        default=True,
        metadata={
            "help": "Whether the flash fades with the square of the distance, as by default, or the photo was "
            "corrected for that."
        },
    )
    gain: float | None = field(
        default=1.0,
        metadata={
            "help": "Of the flash: brightness, in linear light, of a white surface that faces it at distance 1; 1 by "
            "default. It sets the unit of depth. 'unknown' finds it from the guide.",
            "metavar": "BRIGHTNESS|unknown",
        },
    )
    offset: tuple[float, float, float] = field(
        default=(0.0, 0.0, 0.0),
        metadata={
            "help": "Where the flash is, to the right of the camera, below it and in front of it, in units of depth; "
            "0,0,0 by default. Or as an angle between camera and flash, seen from depth 1: 0,-5deg,0.",
            "metavar": "X,Y,Z",
            "option": "lamp",
        },
    )

    def __post_init__(self) -> None:
        hint = " where light fades with the square of the distance, or False"
        falloff = as_flag("falloff", self.falloff, hint=hint)
        hint = ", the brightness of a white surface that faces the lamp at distance 1"
        gain = None if self.gain is None else as_number("gain", self.gain, above=0.0, what="a brightness", hint=hint)
        if gain is None and not falloff:
            raise InputError.about(
                "gain",
                None,
                "without fall-off: the photograph does not tell it. Give the brightness of a white surface that faces "
                "the lamp.",
            )
        offset = as_numbers(
            "offset",
            self.offset,
            (3,),
            least=-_FARTHEST,
            most=_FARTHEST,
            what="a place",
            remedy=f"give three numbers up to {_FARTHEST:g}, (right, down, forward) from the optical centre in units "
            "of depth, (0, 0, 0) for a light at the camera",
        )
        object.__setattr__(self, "falloff", falloff)
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "offset", offset)

    @property
    def coaxial(self) -> bool:
        """True when the lamp is at the optical centre."""
        return self.offset == (0.0, 0.0, 0.0)

    @property
    def determines_depth(self) -> bool:
        """By its fall-off."""
        return self.falloff

    @property
    def unknown(self) -> str | None:
        """See :attr:`Light.unknown`: the gain may be."""
        return "gain" if self.gain is None else None

    @property
    def known_gain(self) -> float:
        """The gain; InputError where it is not known."""
        if self.gain is None:
            raise InputError.about("light", self, "has an unknown gain, for which there is no brightness: give it.")
        return self.gain

    @property
    def off_axis(self) -> bool:
        """True when the lamp is not at the optical centre."""
        return not self.coaxial

    def model(self, reflectance: Reflectance) -> Model:
        """See :meth:`Light.model`: as of a lamp at the camera, with rounds for the rest if it is off the axis."""
        if not (self.coaxial or self.falloff):
            raise InputError.about(
                "light",
                self,
                "has no scheme here: a lamp without fall-off must be at the camera. Leave its "
                "place out, or photograph with fall-off.",
            )
        if self.falloff:
            kernels = ("elementary", reflectance.kernel, "flash_light")
            return FlashModel(self, reflectance, kernels, in_rounds=self.off_axis)
        if not reflectance.monotone:
            raise InputError.about(
                "reflectance",
                reflectance,
                "under a flash without fall-off: this material is not brightest face on, "
                "so that a brightness belongs to two angles. Give a flash with fall-off, or another material.",
            )
        return HeadlightModel(self, reflectance, ("elementary", reflectance.kernel, "headlight"), ("climb", "upwind"))

    def upwind_model(self, reflectance: Reflectance) -> Model:
        """See :meth:`Light.upwind_model`: for materials of which a brightness belongs to one angle."""
        model = self.model(reflectance)
        if not self.falloff:
            return model
        if self.coaxial:
            return UpwindFlashModel(self, reflectance, model.kernels, ("steepness", "upwind_flash"))
        kernels = ("elementary", reflectance.kernel, "steepness", "light_cone", "off_axis_lamp")
        return OffAxisModel(
            self, reflectance, kernels, ("climb", "upwind_off_axis"), in_rounds=not reflectance.perfectly_matt
        )

    def has_upwind(self, reflectance: Reflectance) -> bool:
        """See :meth:`Light.has_upwind`: for materials of which a brightness belongs to one angle."""
        return reflectance.monotone

    def brightness(
        self, log_depth: ArrayLike, p: ArrayLike, q: ArrayLike, x: ArrayLike, y: ArrayLike, reflectance: Reflectance
    ) -> Array:
        """κ c / ρ², or κ c without fall-off (section 4 of the method); see :meth:`Light.brightness`."""
        p, q, x, y = (np.asarray(value, np.float64) for value in (p, q, x, y))
        depth, norm = np.exp(np.asarray(log_depth, np.float64)), surface_norm(p, q, x, y)
        ray = np.sqrt(1.0 + x**2 + y**2)
        cosine_view = 1.0 / (ray * norm)
        if self.coaxial:
            distance = depth * ray
            returned = reflectance.coaxial(cosine_view)
        else:
            # From the surface to the lamp. The unit normal is (p, q, -w) / S, the direction to the viewer
            # -(x, y, 1) / R.
            right, down, forward = (
                place - depth * along for place, along in zip(self.offset, (x, y, 1.0), strict=True)
            )
            distance = np.sqrt(right**2 + down**2 + forward**2)
            cosine_light = (p * right + q * down - (1.0 + x * p + y * q) * forward) / (norm * distance)
            cosine_between = -(x * right + y * down + forward) / (ray * distance)
            returned = reflectance.shade(cosine_light, cosine_view, cosine_between)
        return np.asarray(self.known_gain * (returned / distance**2 if self.falloff else returned))

    @property
    def shading_numbers(self) -> dict[str, float]:
        """The place of the lamp, and whether it fades; see :attr:`Light.shading_numbers`."""
        right, below, ahead = self.offset
        return {"lamp_x": right, "lamp_y": below, "lamp_z": ahead, "fading": float(self.falloff)}

    def toward(self, depth: Array, x: Array, y: Array) -> Array:
        """See :meth:`Light.toward`."""
        right, down, forward = self.offset
        return np.stack([right - depth * x, down - depth * y, forward - depth], axis=-1)

    @property
    def of_unit_gain(self) -> FlashLight:
        """See :attr:`Light.of_unit_gain`."""
        return replace(self, gain=1.0)

    def in_unit(self, unit: float) -> FlashLight:
        """See :meth:`Light.in_unit`; the gain stays."""
        right, below, ahead = self.offset
        return replace(self, offset=(right / unit, below / unit, ahead / unit))

    def for_farther(self, log_depth: float) -> FlashLight:
        """See :meth:`Light.for_farther`: of a higher gain, while the lamp stays where it is."""
        return replace(self, gain=self.known_gain * math.exp(2.0 * log_depth))

    def scaled(self, brightness: Array, log_depth: float) -> Array:
        """See :meth:`Light.scaled`."""
        log_scale = -2.0 * log_depth if self.falloff else 0.0
        most = float(max(np.fmax.reduce(brightness, axis=None), -np.fmin.reduce(brightness, axis=None)))
        power = (math.log(self.known_gain) + log_scale + math.log(most)) / math.log(10.0) if most > 0.0 else 0.0
        if not abs(power) < _MOST_POWER:
            raise InputError.about(
                "light",
                self,
                f"makes this depth as bright as 1e{power:+.0f}: give a gain in the unit of the depth, "
                "or the depth in that of the gain.",
            )
        scaled = brightness * math.exp(log_scale)
        scaled *= self.known_gain
        return scaled


@dataclass(frozen=True)
class _LampModel(Model):
    """What all models of a flash have in common."""

    light: FlashLight

    def too_bright(self, most: float) -> str:
        """See :meth:`Model.too_bright`."""
        if self.light.falloff:
            return "light is not negative. Subtract less, or mask these pixels out."
        return (
            f"{self.light!r} on {self.reflectance!r} gives at most {most:g}. Scale the image, or give the gain "
            "that belongs to it."
        )

    def brightest(self, grid: PixelGrid) -> float:
        """See :meth:`Model.brightest`."""
        return np.inf if self.light.falloff else self.light.known_gain * self.reflectance.brightest


@dataclass(frozen=True)
class HeadlightModel(_LampModel):
    """A lamp at the camera without fall-off: the angle between surface and ray alone tells, and Z is ln (z R)."""

    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """See :meth:`Model.numbers`."""
        return self.reflectance.numbers

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        return HeadlightEquation(brightness, x, y)

    def offset(self, grid: PixelGrid) -> Array:
        """ln R, see :meth:`Model.offset`."""
        return np.asarray(0.5 * np.log1p(grid.x**2 + grid.y**2))

    def shading(self, image: Array, extremes: Extremes) -> Array:
        """Cosine of the angle between surface and ray, to which the viscosity is proportional.

        What is darker than the material at grazing gets next to 0, and what rounding leaves beyond the brightest value
        gets 1.
        """
        return self.not_black(self.reflectance.facing(image / self.light.known_gain), self._cosines(extremes).darkest)

    def degenerate(
        self, image: Array, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, extremes: Extremes
    ) -> Mask:
        """Every pixel that is as dark as the material at grazing."""
        cosines = self._cosines(extremes)
        if cosines.darkest > (black := max(_BLACK * cosines.brightest, DARKEST)):
            return np.zeros_like(solved)
        return np.asarray(solved & (shading <= black))

    def _cosines(self, extremes: Extremes) -> Extremes:
        """The least and the largest cosine, of the pixels to solve: the brighter, the more they face the lamp."""
        at_both = np.array([extremes.darkest, extremes.brightest]) / self.light.known_gain
        return Extremes(*map(float, self.reflectance.facing(at_both)))


@dataclass(frozen=True)
class FlashModel(_LampModel):
    """A lamp at the camera that fades, in F = I R² / κ: exp(2 Z) F = c(θ)."""

    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """See :meth:`Model.numbers`."""
        return self.with_material(steepest_log=self.reflectance.steepest_log)

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        return FlashEquation(brightness, x, y, self.reflectance)

    def check_scale(self, extremes: Extremes, grid: PixelGrid) -> None:
        """Refuse brightness and gain that put the surface where numbers end."""
        brightest, light = extremes.brightest, self.light
        if not _LEAST_LIGHT <= brightest <= _MOST_LIGHT:
            raise InputError(
                f"image goes up to {brightest:g} under {keyword('light', light)}: give a brightest value from "
                f"{_LEAST_LIGHT:g} to {_MOST_LIGHT:g}, and the gain on the same scale.",
                argument="image",
            )
        returned = math.log(light.known_gain) + math.log(self.reflectance.brightest) - math.log(brightest)
        reach, apart = math.exp(min(0.5 * returned, 500.0)), math.hypot(*light.offset)
        if apart > _FARTHEST_LAMP * reach:
            raise InputError.about(
                "light",
                light,
                f"is {apart:g} away from the camera, but the brightest pixel, {brightest:g}, tells of "
                f"a surface at most {reach:g} from the lamp: give {keyword('offset')} and {keyword('gain')} in the "
                "same unit of depth.",
            )
        ray = 1.0 + max(abs(grid.x[0]), abs(grid.x[-1])) ** 2 + max(abs(grid.y[0, 0]), abs(grid.y[-1, 0])) ** 2
        nearest, farthest = 0.5 * (returned - math.log(ray)), 0.5 * (returned - math.log(_BLACK))
        if nearest < math.log(NEAREST) or farthest > math.log(FARTHEST):
            power = 0.5 * returned / math.log(10.0)
            raise InputError.about(
                "light",
                light,
                f"puts an image that goes up to {brightest:g} at a depth of 1e{power:+.0f} or so: give "
                "the gain, on the scale of the image, for a unit of depth in which the surface lies well between "
                f"{NEAREST:g} and {FARTHEST:g}.",
            )

    def start(
        self, image: Array, solved: Mask, grid: PixelGrid, extremes: Extremes, precision: Precision
    ) -> tuple[NDArray[np.floating], float]:
        """See :meth:`Model.start`; the level is about the median of the first values."""
        darkest, per_gain = _BLACK * extremes.brightest, 1.0 / self.light.known_gain
        everything = bool(solved.all())
        pixels = solved if everything else np.flatnonzero(solved)
        some = sampled(pixels, _SAMPLES)
        row, column = np.divmod(some if everything else pixels[some], image.shape[1])
        x, y = grid.x[column], grid.y[row, 0]
        typical = np.maximum(image[row, column], darkest) * per_gain
        first = np.empty_like(typical)
        self._read(typical, x, y, 0.0)
        self._first(typical, x, y, 0.0, first)
        level = median(first)
        shading = np.empty(image.shape, precision)

        def read(rows: slice) -> None:
            block = np.maximum(image[rows], darkest)
            block *= per_gain
            if not everything:
                # What is not solved may hold anything.
                np.copyto(block, 1.0, where=~solved[rows])
            self._read(block, grid.x, grid.y[rows], level)
            shading[rows] = block

        in_row_blocks(read, image.shape)
        return shading, level

    def first(self, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, level: float) -> Array:
        """See :meth:`Model.first`.

        From exp(2 Z) F = c(θ) follows Z <= ½ ln(max c / F), where the surface would return the most light; with the
        lamp off the axis likewise at the distance from the lamp.
        """
        first = np.empty(shading.shape)
        everything = bool(solved.all())

        def begin(rows: slice) -> None:
            self._first(shading[rows], grid.x, grid.y[rows], level, first[rows])
            if not everything:
                np.copyto(first[rows], -level, where=~solved[rows])

        in_row_blocks(begin, first.shape)
        return first

    # Both write in place: arrays for what lies between would cost more than the arithmetic.

    def _read(self, seen: Array, x: Array, y: Array, level: float) -> None:
        """Make of brightness above 0, under a gain of 1, what the kernels read: F exp(2 level)."""
        seen *= 1.0 + x**2 + y**2
        seen *= math.exp(2.0 * level)

    def _first(self, read: NDArray[np.floating], x: Array, y: Array, level: float, out: Array) -> None:
        """Make of what they read the first values."""
        np.log(read, out=out, dtype=np.float64)
        out -= math.log(self.reflectance.brightest)
        out *= -0.5

    def degenerate(
        self, image: Array, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, extremes: Extremes
    ) -> Mask:
        """Black pixels."""
        if extremes.darkest > (black := _BLACK * extremes.brightest):
            return np.zeros_like(solved)
        return np.asarray(solved & (image <= black))

    def brightness_of_equation(self, log_depth: Array, p: Array, q: Array, x: Array, y: Array) -> tuple[Array, Array]:
        """By the equation the lamp is at the camera; see :meth:`Model.brightness_of_equation`."""
        at_camera = replace(self.light, offset=(0.0, 0.0, 0.0))
        surface = log_depth, p, q, x, y, self.reflectance
        return at_camera.brightness(*surface), self.light.brightness(*surface)


@dataclass(frozen=True)
class UpwindFlashModel(FlashModel):
    """The same for the upwind scheme."""

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        return super().equation(np.exp(brightness), x, y, numbers, steepest)

    def _read(self, seen: Array, x: Array, y: Array, level: float) -> None:
        """Its logarithm, ln F + 2 level, which the kernels would have to compute for each cell."""
        seen *= 1.0 + x**2 + y**2
        np.log(seen, out=seen)
        seen += 2.0 * level

    def _first(self, read: NDArray[np.floating], x: Array, y: Array, level: float, out: Array) -> None:
        """See :class:`FlashModel`."""
        np.subtract(read, math.log(self.reflectance.brightest), out=out, dtype=np.float64)
        out *= -0.5


@dataclass(frozen=True)
class OffAxisModel(FlashModel):
    """A lamp off the axis, for the upwind scheme: F = I / κ, and each pixel sees it in a direction of its own."""

    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """The place of the lamp, see :meth:`Model.numbers`."""
        right, below, ahead = self.light.offset
        return self.with_material(lamp_x=right / unit, lamp_y=below / unit, lamp_z=ahead / unit)

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        nowhere = np.zeros_like(brightness)
        direction = Direction(nowhere, nowhere, nowhere)
        return LampEquation(brightness, x, y, direction, steepest, self.light.offset, self.reflectance)

    def _read(self, seen: Array, x: Array, y: Array, level: float) -> None:
        """The brightness itself is F, see :class:`FlashModel`."""
        seen *= math.exp(2.0 * level)

    def _first(self, read: NDArray[np.floating], x: Array, y: Array, level: float, out: Array) -> None:
        """From the farther depth at which a ray is so far from the lamp, or else the nearest that there is."""
        right, below, ahead = self.light.offset
        square_ray, along = 1.0 + x**2 + y**2, right * x + below * y + ahead
        square_distance = (self.reflectance.brightest * math.exp(2.0 * level)) / read.astype(np.float64)
        excess = along**2 + square_ray * (square_distance - (right**2 + below**2 + ahead**2))
        farther = (along + np.sqrt(np.maximum(excess, 0.0))) / square_ray
        np.log(np.maximum(farther, self.nearest_depth(x, y)), out=out)
        out -= level

    def nearest_depth(self, x: Array, y: Array) -> Array:
        """Depth at which the equation ends, of rays (x, y, 1), as in kernels/models/off_axis_lamp.cl.

        It lies beyond the point of the ray that is nearest to the lamp, by some margin, and beyond the lamp's plane.
        """
        right, below, ahead = self.light.offset
        square_ray, along = 1.0 + x**2 + y**2, right * x + below * y + ahead
        square = right**2 + below**2 + ahead**2
        aside = np.sqrt(np.maximum(0.0, square_ray * square - along**2))
        nearest = np.maximum((1.05 * along + 0.25 * aside) / square_ray, 1.02 * ahead)
        return np.asarray(np.maximum(nearest, 1e-3 * math.sqrt(square)))

    def brightness_of_equation(self, log_depth: Array, p: Array, q: Array, x: Array, y: Array) -> tuple[Array, Array]:
        """By the equation the angle to the lamp alone matters; see :meth:`Model.brightness_of_equation`."""
        # The distance to the lamp is the same in both.
        lamp = replace(self.light, falloff=False, gain=1.0)
        surface = log_depth, p, q, x, y
        cosine = lamp.brightness(*surface, Lambertian())
        return self.reflectance.coaxial(cosine), lamp.brightness(*surface, self.reflectance)
