"""A light infinitely far away: the paper's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import masks
from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import as_number
from persfs_cl.choices import Boundary
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.shading.equations import Equation, MaterialEquation, ParallelEquation
from persfs_cl.shading.forward import reflectance_map
from persfs_cl.shading.model import Extremes, Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword

_STEEPEST = 1e3
"""Beyond this slope the light grazes the image plane at less than a tenth of a degree."""

_BLOCK = 32
"""Pixels of a side of the blocks that are looked at before their pixels."""

_ROUNDING = 1e-7
"""Of the root of a difference of squares, compared with the larger one, and some."""

_MARGIN, _SMALL_MARGIN = 1.02, 1.001
"""More than a slope, and a value with level top, can rise between its samples above the largest of them."""


@dataclass(frozen=True)
class ParallelLight(Light):
    """A light infinitely far away, the paper's s = (-p0, -q0, 1).

    Parameters
    ----------
    p0, q0 : float
        Slopes of the light. In camera axes (x right, y down, z forward) the light travels along
        (p0, q0, 1): ``p0 > 0`` puts the lamp to the left of the camera, ``q0 > 0`` above it.
        Both 0 is a frontal light.

    Raises
    ------
    InputError
        When a slope is not a number between -1000 and 1000.

    Examples
    --------
    A lamp far away, 45 degrees to the left:

    >>> import persfs_cl as ps
    >>> light = ps.ParallelLight(p0=1.0)
    >>> round(light.norm, 3)
    1.414
    """

    summary: ClassVar[str] = "a light far away, the paper's s = (-p0, -q0, 1)"
    shading_kernel: ClassVar[str] = "parallel_shading"
    normalised: ClassVar[bool] = True
    flat_rim: ClassVar[bool] = True
    bounds_slope: ClassVar[bool] = False
    boundary: ClassVar[Boundary] = "outflow"

    p0: float = field(
        default=0.0,
        metadata={"help": "Slope of the parallel light, 0 by default: above 0 the lamp is left of the camera."},
    )
    q0: float = field(
        default=0.0,
        metadata={"help": "Slope of the parallel light, 0 by default: above 0 the lamp is above the camera."},
    )

    def __post_init__(self) -> None:
        for slope in fields(self):
            number = as_number(
                slope.name,
                getattr(self, slope.name),
                least=-_STEEPEST,
                most=_STEEPEST,
                what="a light slope",
                hint=", 0 for a frontal light",
            )
            object.__setattr__(self, slope.name, number)

    @property
    def norm(self) -> float:
        """Length of s, k = sqrt(1 + p0² + q0²)."""
        return math.hypot(1.0, self.p0, self.q0)

    @property
    def cosine_of_ground(self) -> float:
        """1 / k, see :attr:`Light.cosine_of_ground`."""
        return 1.0 / self.norm

    def model(self, reflectance: Reflectance) -> Model:
        """See :meth:`Light.model`: eq. (7) for a perfectly matt material."""
        if reflectance.perfectly_matt:
            return CosineModel(self, reflectance, ("light_cone", "parallel_light"))
        return MaterialModel(self, reflectance, ("elementary", reflectance.kernel, "parallel_material"))

    def upwind_model(self, reflectance: Reflectance) -> Model:
        """See :meth:`Light.upwind_model`: for perfectly matt materials."""
        if not self.has_upwind(reflectance):
            raise InputError.about(
                "scheme",
                "upwind",
                f"with {keyword('reflectance', reflectance)} under a parallel light: this scheme is for perfectly matt "
                f"materials there. Use {keyword('scheme', 'lax-friedrichs')}.",
            )
        return LevelCosineModel(self, reflectance, ("light_cone", "parallel_light"), ("climb", "upwind"))

    def has_upwind(self, reflectance: Reflectance) -> bool:
        """See :meth:`Light.has_upwind`: for perfectly matt materials."""
        return reflectance.perfectly_matt

    def brightness(
        self, log_depth: ArrayLike, p: ArrayLike, q: ArrayLike, x: ArrayLike, y: ArrayLike, reflectance: Reflectance
    ) -> Array:
        """Eq. (6), in which the depth plays no part; see :meth:`Light.brightness`."""
        return reflectance_map(p, q, x, y, self, reflectance)

    @property
    def tilt(self) -> tuple[float, float]:
        """See :attr:`Light.tilt`."""
        return self.p0, self.q0

    @property
    def shading_numbers(self) -> dict[str, float]:
        """Its slopes and 1 / k, see :attr:`Light.shading_numbers`."""
        return {"p0": self.p0, "q0": self.q0, "inverse_norm": 1.0 / self.norm}

    def toward(self, depth: Array, x: Array, y: Array) -> Array:
        """The same from everywhere; see :meth:`Light.toward`."""
        return np.array([-self.p0, -self.q0, -1.0])


@dataclass(frozen=True)
class _ParallelModel(Model):
    """What both models have of the light."""

    light: ParallelLight

    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """See :meth:`Model.numbers`."""
        return {"p0": self.light.p0, "q0": self.light.q0, "inverse_norm": 1.0 / self.light.norm}

    def constant_viscosity(self, coordinate: Array, *, along_y: int) -> Array:
        """|x - p0| / k, see :meth:`Model.constant_viscosity`."""
        return np.abs(coordinate - (self.light.q0 if along_y else self.light.p0)) / self.light.norm


@dataclass(frozen=True)
class CosineModel(_ParallelModel):
    """Eq. (7): of a perfectly matt material."""

    coarsens: ClassVar[bool] = True

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        return ParallelEquation(brightness, x, y, self.light, steepest)

    def shading(self, image: Array, extremes: Extremes) -> Array:
        """See :meth:`Model.shading`: along the light the viscosity is proportional to it."""
        return self.not_black(image, extremes.darkest)

    def brightest(self, grid: PixelGrid) -> float:
        """1."""
        return 1.0

    def too_bright(self, most: float) -> str:
        """See :meth:`Model.too_bright`."""
        return "E must lie in [0, 1]. Use normalise_grey, or divide by the brightest value."

    def degenerate(
        self, image: Array, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, extremes: Extremes
    ) -> Mask:
        """Pixels where {P : H(P) <= 0} is unbounded, H not coercive.

        The set is bounded where A = e² (I + xx') - ññ', e = k E, is positive definite: for
        e² > |ñ|² - (x·ñ)² / (1 + r²), with ñ = (x - p0, y - q0) and r² = x² + y².
        """
        light = self.light
        least, most = self._bounds_of_blocks(grid)
        if light.norm * extremes.darkest > most.max():
            return np.zeros_like(solved)
        # Nearly everywhere the extremes of a block tell.
        lowest, highest = (light.norm * masks.in_square_blocks(of, image, _BLOCK) for of in (np.minimum, np.maximum))
        everywhere = highest < least

        def is_unbounded(part: tuple[slice, slice]) -> Mask:
            rows, columns = part
            x, y = grid.x[columns], grid.y[rows]
            offset_x, offset_y = x - light.p0, y - light.q0
            along = x * offset_x + y * offset_y
            bound = offset_x**2 + offset_y**2 - along**2 / (1.0 + x**2 + y**2)
            return np.asarray((light.norm * image[part]) ** 2 <= bound)

        undecided = ~(everywhere | (lowest > most))
        return masks.decided_by_blocks(solved, everywhere, undecided, _BLOCK, is_unbounded)

    def _bounds_of_blocks(self, grid: PixelGrid) -> tuple[Array, Array]:
        """Bounds of the e at which H begins to be coercive, over the pixels of each block: see :meth:`degenerate`."""
        squares_x, alongs_x, rays_x = _terms_of_blocks(grid.x, self.light.p0)
        squares_y, alongs_y, rays_y = (
            (least[:, None], most[:, None]) for least, most in _terms_of_blocks(grid.y[:, 0], self.light.q0)
        )
        along = alongs_x[0] + alongs_y[0], alongs_x[1] + alongs_y[1]
        closest = np.maximum(0.0, np.maximum(along[0], -along[1]))
        farthest = np.maximum(-along[0], along[1])
        largest = squares_x[1] + squares_y[1]
        least = squares_x[0] + squares_y[0] - farthest**2 / (1.0 + rays_x[0] + rays_y[0])
        most = largest - closest**2 / (1.0 + rays_x[1] + rays_y[1])
        # Beyond what rounding makes of it.
        rounding = _ROUNDING * np.sqrt(largest)
        return np.sqrt(np.maximum(least, 0.0)) - rounding, np.sqrt(np.maximum(most, 0.0)) + rounding


def _terms_of_blocks(coordinate: Array, slope: float) -> list[tuple[Array, Array]]:
    """The least and the largest (x - p0)², x (x - p0) and x² of the pixels of each block along one axis."""
    begins, offset = np.arange(0, coordinate.size, _BLOCK), coordinate - slope
    terms = offset**2, coordinate * offset, coordinate**2
    return [(np.minimum.reduceat(term, begins), np.maximum.reduceat(term, begins)) for term in terms]


@dataclass(frozen=True)
class LevelCosineModel(CosineModel):
    """The same for the upwind scheme, whose unknown is Z + ln f: level where the surface faces the light."""

    def offset(self, grid: PixelGrid) -> Array:
        """ln f, see :meth:`Model.offset`.

        Raises
        ------
        InputError
            When pixels look into the light, where no surface faces it.
        """
        if self.light.p0 == self.light.q0 == 0.0:
            return super().offset(grid)
        facing = 1.0 + self.light.p0 * grid.x + self.light.q0 * grid.y
        if facing.min() <= 0.0:
            raise InputError.about(
                "light",
                self.light,
                f"with {keyword('scheme', 'upwind')}: some pixels look into the light, where no surface faces it. Crop "
                f"or mask the image, or use {keyword('scheme', 'lax-friedrichs')}.",
            )
        return np.asarray(np.log(facing))

    def level_slopes(self, x: Array, y: Array) -> tuple[Array | float, Array | float]:
        """That of -ln f, see :meth:`Model.level_slopes`."""
        facing = 1.0 + self.light.p0 * x + self.light.q0 * y
        return -self.light.p0 / facing, -self.light.q0 / facing


@dataclass(frozen=True)
class MaterialModel(_ParallelModel):
    """H(P) = E - R(P): of any material."""

    exact_argmin: ClassVar[bool] = False

    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """See :meth:`Model.numbers`."""
        steepness = self._survey(grid)[0]
        return self.with_material(**super().numbers(grid, unit), steepness=steepness)

    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """See :meth:`Model.equation`."""
        return MaterialEquation(brightness, x, y, self.light, self.reflectance, numbers["steepness"], steepest)

    def brightest(self, grid: PixelGrid) -> float:
        """Over all normals and rays of the image."""
        return self._survey(grid)[1]

    def too_bright(self, most: float) -> str:
        """See :meth:`Model.too_bright`."""
        return f"{self.reflectance!r} is seen no brighter than {most:.3g} under this light. Scale the image."

    def degenerate(
        self, image: Array, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, extremes: Extremes
    ) -> Mask:
        """Every pixel that is as dark as the material at grazing."""
        between = self._between(grid)
        grazing = self.reflectance.shade(np.sqrt(np.maximum(0.0, 1.0 - between**2)), 0.0, between)
        return np.asarray(solved & (image <= grazing))

    def _between(self, grid: PixelGrid) -> Array:
        """Cosine of the angle between the rays and the light, shape (height, width)."""
        p0, q0, norm = self.light.p0, self.light.q0, self.light.norm
        return np.asarray((1.0 + grid.x * p0 + grid.y * q0) / (norm * np.sqrt(1.0 + grid.x**2 + grid.y**2)))

    def _survey(self, grid: PixelGrid) -> tuple[float, float]:
        """What :func:`_survey` finds, over all rays of an image."""
        between = self._between(grid)
        cosines = np.linspace(between.min(), between.max(), 5)
        found = np.array([_survey(self.reflectance, float(cosine)) for cosine in cosines])
        return float(found[:, 0].max()), float(found[:, 1].max())


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
