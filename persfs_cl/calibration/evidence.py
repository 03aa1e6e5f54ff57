"""What a photograph of a known surface says of light and material, as residuals.

By the truth: the brightness that the true surface, with its true slopes, would have. It wants a dense truth, and says
something under every light.

By the surface: the depth that is reconstructed under what is assumed, slopes and all, at the places where it is known.
It wants a light that determines depth; a few points will do, and no slope of theirs is asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.calibration.pairs import Pair, inner
from persfs_cl.calibration.parameters import Assumed
from persfs_cl.solver.reconstruct import reconstruct
from persfs_cl.surface.geometry import log_depth_gradient
from persfs_cl.told import hearing

_MOST_PIXELS, _MOST_POINTS = 20_000, 4_000
"""Of a dense truth: a fit gains nothing from more."""
_WHITE = 99.5
"""Percentile that is white, as in :meth:`persfs_cl.preparation.prepared.PreparedPhoto.normalised`."""
_DARK = 0.05
"""Share of the white at which noise of the photograph weighs as much as the brightness."""
_FACING = 0.7
"""Brightness of a typical pixel, as a share of one that faces the lamp: where a fit begins."""
_LEAST_SHADING = 1e-3
"""Of a surface that turns away from the light: none has no logarithm."""
_BLOCKS = 8
"""A photograph has so many blocks along each side, of pixels that err alike."""


class Evidence(ABC):
    """Residuals of one photograph.

    Attributes
    ----------
    pair : Pair
    places : ndarray of float64, shape (n, 2)
        Column and row of each residual in the reduced image.
    depth : ndarray of float64, shape (n,)
        The true depth there.
    fineness : float
        As for :func:`persfs_cl.calibration.least_squares.fit`.
    """

    fineness: ClassVar[float]
    pair: Pair
    places: Array
    depth: Array

    @property
    def clusters(self) -> Indices:
        """Which residuals err alike: those of one block of a dense truth. Points err each by itself."""
        if not self.pair.of_map:
            return np.arange(len(self.places))
        columns, rows = (
            np.minimum(_BLOCKS - 1, self.places[:, axis] * _BLOCKS // size).astype(np.int64)
            for axis, size in enumerate(reversed(self.pair.shape))
        )
        return np.asarray(rows * _BLOCKS + columns)

    def folds(self, count: int) -> Indices:
        """Which fold each residual is in: blocks of a dense truth go together, and points at random, always alike."""
        if not self.pair.of_map:
            return np.random.default_rng(0).permutation(len(self.places)) % count
        block = self.clusters
        return (block % _BLOCKS + 2 * (block // _BLOCKS)) % count

    @abstractmethod
    def residuals(self, assumed: Assumed) -> Array:
        """Relative errors, shape (n,), by their logarithms; NaN where there is none.

        Raises
        ------
        InputError
            When there is no photograph under what is assumed.
        """

    @abstractmethod
    def level(self, assumed: Assumed) -> float:
        """By which factor the photograph is brighter than what is assumed makes it, about."""

    @abstractmethod
    def errors(self, assumed: Assumed) -> Array:
        """How far off what is explained is from the photograph or the truth, as a share of it, shape (n,)."""


class ByTruth(Evidence):
    """The brightness that the true surface would have."""

    fineness = 1e-3

    def __init__(self, pair: Pair, depth: Array) -> None:
        self.pair = pair
        rows, columns = np.nonzero(inner(np.isfinite(depth)))
        kept = _evenly(rows.size, _MOST_PIXELS)
        self._pixels = rows[kept], columns[kept]
        self.places = np.stack([columns[kept], rows[kept]], axis=1).astype(np.float64)
        p, q = log_depth_gradient(depth, pair.reduced_camera)
        self._slopes = p[self._pixels], q[self._pixels]
        self.depth = depth[self._pixels]
        grid = pair.grid
        self._rays = grid.x[self._pixels[1]], grid.y[self._pixels[0], 0]

    def residuals(self, assumed: Assumed) -> Array:
        """Of the brightness in the file, the darker the less: noise is there, before any tone curve is undone."""
        light, usable = self._light(assumed)
        apart = np.log(light) - np.log(np.maximum(self._shading(assumed), _LEAST_SHADING * np.median(light)))
        brightness = light ** (1.0 / assumed.exponent)
        dark = _DARK * np.percentile(brightness[usable], _WHITE) if usable.any() else 1.0
        found = apart / assumed.exponent * brightness / (brightness + dark)
        return np.where(usable, found, np.nan)

    def errors(self, assumed: Assumed) -> Array:
        """Of the brightness in linear light, with those pixels that are nearly black left out."""
        light, usable = self._light(assumed)
        told = usable & (light > _DARK * np.percentile(light[usable], _WHITE)) if usable.any() else usable
        return np.where(told, np.abs(self._shading(assumed) / light - 1.0), np.nan)

    def level(self, assumed: Assumed) -> float:
        """By the median over pixels that are lit; see :meth:`Evidence.level`."""
        light, usable = self._light(assumed)
        lit = usable & (self._shading(assumed) > 0.0)
        return float(np.median(light[lit] / self._shading(assumed)[lit])) if lit.any() else 1.0

    def _light(self, assumed: Assumed) -> tuple[Array, Mask]:
        """Of the samples, and which of them tell it; anything above 0 at the others."""
        light, usable = self.pair.light(assumed.exponent)
        told = usable[self._pixels]
        return np.where(told, light[self._pixels], 1.0), told

    def _shading(self, assumed: Assumed) -> Array:
        """Light of the true surface."""
        surface = np.log(self.depth), *self._slopes, *self._rays
        shading = assumed.light.brightness(*surface, assumed.reflectance)
        if assumed.light.normalised:
            shading = shading * white_of(self.pair, assumed)
        square_ray = 1.0 + self._rays[0] ** 2 + self._rays[1] ** 2
        return np.asarray(shading * square_ray ** (-0.5 * assumed.vignetting))


class BySurface(Evidence):
    """The depth that is reconstructed, in single precision."""

    fineness = 1.0

    def __init__(self, pair: Pair, device: int | str | Device | None) -> None:
        self.pair, self._device = pair, device
        kept = _evenly(len(pair.points), _MOST_POINTS)
        self.places, self.depth = pair.points[kept, :2], pair.points[kept, 2]

    def residuals(self, assumed: Assumed) -> Array:
        """Of the depth."""
        light, _ = self.pair.light(assumed.exponent)
        grid = self.pair.grid
        mask = np.isfinite(light)
        image = np.where(mask, light * (1.0 + grid.x**2 + grid.y**2) ** (0.5 * assumed.vignetting), 0.0)
        # A surface of second order has hardly any error of its own that the light would have to make up for.
        order = 2 if assumed.light.has_upwind(assumed.reflectance) else 1
        with hearing():
            solution = reconstruct(
                image,
                self.pair.reduced_camera,
                light=assumed.light,
                reflectance=assumed.reflectance,
                mask=mask,
                accuracy_order=order,
                device=self._device,
            )
        return _at(np.log(solution.depth), self.places) - np.log(self.depth)

    def errors(self, assumed: Assumed) -> Array:
        """Of the depth."""
        return np.abs(np.expm1(self.residuals(assumed)))

    def level(self, assumed: Assumed) -> float:
        """Of points whose slopes make them somewhat darker than what faces the lamp; see :meth:`Evidence.level`."""
        light, usable = self.pair.light(assumed.exponent)
        values = _at(np.where(usable, light, np.nan), self.places)
        white = assumed.light.brightness(np.log(self.depth), 0.0, 0.0, 0.0, 0.0, assumed.reflectance)
        return float(np.nanmedian(values / (_FACING * white))) if np.isfinite(values).any() else 1.0


def white_of(pair: Pair, assumed: Assumed) -> float:
    """What light is white, as assumed or by the usual percentile."""
    if assumed.white is not None:
        return assumed.white
    light, usable = pair.light(assumed.exponent)
    return float(np.percentile(light[usable], _WHITE)) if usable.any() else 1.0


def _evenly(count: int, most: int) -> Indices:
    """Numbers of at most so many of some things in a row."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _at(values: Array, places: Array) -> Array:
    """Values of a map between its pixels, linearly; the nearest one where not all four around are known."""
    height, width = values.shape
    columns, rows = np.clip(places[:, 0], 0.0, width - 1.0), np.clip(places[:, 1], 0.0, height - 1.0)
    left, top = np.floor(columns).astype(np.int64), np.floor(rows).astype(np.int64)
    right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
    across, down = columns - left, rows - top
    above = (1.0 - across) * values[top, left] + across * values[top, right]
    below = (1.0 - across) * values[bottom, left] + across * values[bottom, right]
    between = (1.0 - down) * above + down * below
    nearest = values[np.rint(rows).astype(np.int64), np.rint(columns).astype(np.int64)]
    return np.where(np.isnan(between), nearest, between)
