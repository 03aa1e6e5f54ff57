"""What becomes of maps of all kinds when the pixels of an image are exchanged for others."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.guide.guide import Points

_HALF = 0.5
"""Share of a new pixel that must be known."""
_ANY = 1e-6
"""Share that is no rounding error."""


class Frame(ABC):
    """New pixels for the old ones of an image, and the camera that has them.

    Attributes
    ----------
    old_shape, shape : (int, int)
        (height, width) of the old image and of the new one.
    camera : Camera
        Of the new image, a pinhole camera if the old one is.
    """

    old_shape: tuple[int, int]
    shape: tuple[int, int]
    camera: Camera

    @abstractmethod
    def mean(self, values: Array) -> Array:
        """Mean of the old pixels under each new one; an old pixel that there is not counts as 0."""

    @abstractmethod
    def least(self, values: Array) -> Array:
        """Least of the old pixels under each new one; infinite where there is none."""

    @abstractmethod
    def placed(self, places: Array) -> Array:
        """Where old places are in the new image: column and row, shape (n, 2); NaN for nowhere."""

    @abstractmethod
    def guide(self, guide: Array) -> Array:
        """A coarse map over the old view as one over the new, with cells of about the same size."""

    def light(self, values: Array, inside: Mask) -> tuple[Array, Mask]:
        """Means of light over old pixels that are `inside`, and where these are more than half of a new one."""
        share = self.mean(inside.astype(np.float64))
        total = self.mean(np.where(inside, values, 0.0))
        known = share >= _HALF
        return np.divide(total, share, out=np.zeros(self.shape), where=share > _ANY), known

    def mostly(self, flags: Mask) -> Mask:
        """Where more than half of a new pixel is flagged."""
        if not flags.any():
            return np.zeros(self.shape, bool)
        return np.asarray(self.mean(flags.astype(np.float64)) >= _HALF)

    def anywhere(self, flags: Mask) -> Mask:
        """Where any of a new pixel is flagged."""
        if not flags.any():
            return np.zeros(self.shape, bool)
        return np.asarray(self.mean(flags.astype(np.float64)) > _ANY)

    def known(self, depth: Array) -> Array:
        """Known depths, NaN where unknown: means of those under a new pixel, single ones on the nearest."""
        there = ~np.isnan(depth)
        means, enough = self.light(np.where(there, depth, 0.0), there)
        found = np.where(enough, means, np.nan)
        rows, columns = np.nonzero(there)
        places = np.rint(self.placed(np.stack([columns, rows], axis=1).astype(np.float64)))
        height, width = self.shape
        with np.errstate(invalid="ignore"):
            inside = ((places >= 0) & (places < (width, height))).all(axis=1)
        column, row = places[inside].astype(np.intp).T
        alone = np.isnan(found[row, column])
        pixel = row[alone] * width + column[alone]
        count = np.bincount(pixel, minlength=found.size)
        total = np.bincount(pixel, depth[rows[inside][alone], columns[inside][alone]], minlength=found.size)
        new = count > 0
        found.ravel()[new] = total[new] / count[new]
        return found

    def nearest(self, bound: Array) -> Array:
        """Bounds from below, NaN where there is none: the least of a new pixel, if it is bounded all over."""
        return self._bound(np.where(np.isnan(bound), -np.inf, bound))

    def farthest(self, bound: Array) -> Array:
        """The same from above."""
        return -self._bound(np.where(np.isnan(bound), -np.inf, -bound))

    def _bound(self, values: Array) -> Array:
        least = self.least(values)
        return np.where(np.isfinite(least), least, np.nan)

    def points(self, points: Points) -> Points:
        """Points that are in the new view too; InputError if there is none."""
        places = self.placed(np.stack([points.columns, points.rows], axis=1))
        there = np.isfinite(places).all(axis=1)
        if not there.any():
            why = "has no point in the view of the camera: see that it is of this image."
            raise InputError.about("guide", points, why)
        columns, rows = places[there].T
        return Points(columns, rows, points.depths[there])

    def colour(self, colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """A picture of shape (height, width, channels), for people to look at."""
        channels = [self.mean(colour[..., number].astype(np.float64)) for number in range(colour.shape[2])]
        share = self.mean(np.ones(self.old_shape))
        means = [np.divide(one, share, out=np.zeros(self.shape), where=share > _ANY) for one in channels]
        return np.stack([np.rint(one).astype(np.uint8) for one in means], axis=2)
