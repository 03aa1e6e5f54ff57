"""Depths that are known with a tolerance: the nearest and the farthest that a pixel may have."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import FARTHEST, NEAREST
from persfs_cl.errors import InputError
from persfs_cl.maps import as_depth_range
from persfs_cl.solver.window import Window
from persfs_cl.wording import keyword


@dataclass(frozen=True)
class DepthRange:
    """Bounds of the depth, one of each kind a pixel, NaN where there is none.

    Attributes
    ----------
    near, far : ndarray of float64, shape (height, width)
        Perhaps views of what was given.
    """

    near: Array
    far: Array

    @classmethod
    def of(cls, given: ArrayLike, shape: tuple[int, int]) -> DepthRange:
        """What a user gave for an image of that shape.

        Raises
        ------
        InputError
            When it is no range, see :func:`persfs_cl.maps.as_depth_range`.
        """
        near, far = as_depth_range("depth_range", given, shape)
        return cls(near, far)

    def cut(self, window: Window) -> DepthRange:
        """Those of a window."""
        return DepthRange(window.cut(self.near), window.cut(self.far))

    def within(self, log_near: Array, log_far: Array) -> DepthRange:
        """The part of the range that lies between other bounds, in ln depth, and where none does its nearer end."""
        lowest, highest = math.log(NEAREST), math.log(FARTHEST)
        near, far = (np.exp(np.clip(bound, lowest, highest)) for bound in (log_near, log_far))
        # NaN is no bound.
        return DepthRange(
            near=np.fmin(np.fmax(near, self.near), self.far), far=np.fmax(np.fmin(far, self.far), self.near)
        )

    @classmethod
    def none(cls, shape: tuple[int, int]) -> DepthRange:
        """Without a bound."""
        return cls(*[np.broadcast_to(np.nan, shape)] * 2)

    def but(self, pixels: Mask) -> DepthRange:
        """The same without bounds at some pixels."""
        return DepthRange(*(np.where(pixels, np.nan, bound) for bound in (self.near, self.far)))

    def with_known(self, depths: Array | None) -> Array | None:
        """Known depths, NaN elsewhere, with those of pixels where both bounds are the same; None where there are none.

        Raises
        ------
        InputError
            When one lies outside the bounds.
        """
        if depths is not None:
            # Written so that a NaN is never outside.
            outside = (depths < self.near) | (depths > self.far)
            if outside.any():
                row, column = np.argwhere(outside)[0]
                depth, near, far = (float(each[row, column]) for each in (depths, self.near, self.far))
                raise InputError(
                    f"{keyword('known_depth', depth)} at pixel [{row}, {column}] lies outside {keyword('depth_range')} "
                    f"there, from {keyword('near', near)} to {keyword('far', far)} ({np.count_nonzero(outside)} such "
                    "pixels): widen the range, or leave one of the two out there (NaN).",
                    argument="depth_range",
                    value=(self.near, self.far),
                )
        fixed = self.near == self.far
        if not fixed.any():
            return depths
        return np.where(fixed, self.near, np.nan if depths is None else depths)

    def anchors(self, sign: float) -> Mask:
        """Pixels that are held by the bound towards which values begin: that of W from above."""
        return ~np.isnan(self.far if sign > 0 else self.near)

    def of_values(self, sign: float, offset: Array) -> tuple[Array, Array]:
        """Bounds of W = ±(Z + offset) from below and from above, NaN where there is none."""
        near, far = np.log(self.near) + offset, np.log(self.far) + offset
        return (near, far) if sign > 0 else (-far, -near)

    def keep(self, log_depth: Array, depth: Array, at_near: Mask | bool = False, at_far: Mask | bool = False) -> None:
        """Put on the very bound, in place, what lies beyond it by rounding or otherwise, and what is on it anyway."""
        for bound, beyond in ((self.near, (depth < self.near) | at_near), (self.far, (depth > self.far) | at_far)):
            np.copyto(depth, bound, where=beyond)
            np.copyto(log_depth, np.log(bound, where=beyond, out=np.zeros(bound.shape)), where=beyond)

    def touched(self, depth: Array) -> Mask:
        """Pixels whose depth is one of their bounds."""
        return np.asarray((depth == self.near) | (depth == self.far))
