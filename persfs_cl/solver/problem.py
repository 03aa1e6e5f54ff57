"""One image made ready for the sweeps, and what becomes of their result."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import masks
from persfs_cl._cl.image import Image
from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks, row_blocks
from persfs_cl.camera import Camera
from persfs_cl.checks import FARTHEST, NEAREST
from persfs_cl.shading.model import Extremes, Light
from persfs_cl.solver.bounds import DepthRange
from persfs_cl.solver.domain import nothing_reached
from persfs_cl.solver.given import Given, check
from persfs_cl.solver.options import Options
from persfs_cl.surface.discontinuities import fill_walls
from persfs_cl.surface.geometry import Discontinuities

_NEAREST_LOG, _FARTHEST_LOG = math.log(NEAREST), math.log(FARTHEST)
_BLOCK = 16
"""Pixels of a side of the blocks that are looked at first."""


@dataclass(frozen=True)
class Problem(Given):
    """One image made ready for the sweeps: everything the equation needs, as arrays and numbers.

    Attributes
    ----------
    first : ndarray of float64, shape (height, width), or float, or None
        Values of W, less `level`, from which the others begin: above all known ones. None where the image tells them.
    shading : ndarray of float, shape (height, width)
        What the kernels read in place of the image, see :class:`persfs_cl.shading.model.Model`; at the scale of `level`
        where the image tells the depth.
    highest_known : float
        Largest known W, or bound of one, less `level`; infinite where no known value is needed.
    level : float
        Smallest known W, or bound of one from above, or a typical one; subtracting it keeps single precision for the
        relief.
    """

    first: Array | float | None
    shading: NDArray[np.floating]
    highest_known: float
    level: float

    @classmethod
    def of(cls, given: Given) -> Problem:
        """Where the sweeps begin."""
        if given.scheme.by_energy:
            return cls(**vars(given), first=0.0, shading=given.image, highest_known=np.inf, level=0.0)
        if given.model.light.determines_depth:
            shading, level = given.model.start(
                given.image, given.domain.solved, given.grid, given.extremes, given.precision
            )
            return cls(**vars(given), first=None, shading=shading, highest_known=np.inf, level=level)
        held = [given.known_values[given.seen]]
        bounds: list[Array] = []
        if given.depth_range is not None:
            solved = given.domain.solved
            within = given.depth_range.cut(given.window).of_values(given.sign, given.offset)
            bounds, upper = ([bound[solved & ~np.isnan(bound)] for bound in within[side:]] for side in (0, 1))
            held += upper
        anchors = np.concatenate(held)
        if not anchors.size:
            raise nothing_reached(given.known_values.size, int(np.count_nonzero(given.domain.solved)))
        level = float(anchors.min())
        # No cell lies more than one step above a neighbour, so no path from a known value can climb higher than this.
        steps = np.count_nonzero(given.domain.solved) + 1
        highest = float(np.concatenate([anchors, *bounds]).max()) - level
        return cls(
            **vars(given),
            first=highest + steps * given.max_slope * max(given.grid.dx, given.grid.dy),
            shading=given.model.shading(given.image, given.extremes),
            highest_known=highest,
            level=level,
        )

    @property
    def accelerates(self) -> bool:
        """Whether its limit is the same wherever the iteration begins, so that it may be accelerated.

        Under a flash the first values are bounds. Boundary cells only fall, eq. (12): their limit depends on the way.
        Between bounds of the depth a mixture would lie beyond them. Where a neighbour is missing and the model only
        estimates argmin H, the scheme is not monotone, and has more than one limit.
        """
        bounded = self.model.light.determines_depth or self.depth_range is not None
        if not self.scheme.accelerates or bounded or len(self.domain.boundary.cells):
            return False
        return self.model.exact_argmin or not (self.domain.flags[self.domain.solved] & masks.LACKING).any()

    @property
    def start(self) -> Array:
        """First values of W, less `level`, in an array of their own."""
        known = self.domain.known
        first = None if self.first is None else np.broadcast_to(self.first, known.shape)
        if first is None:
            start = self.model.first(self.shading, self.domain.solved, self.grid, self.level)
        else:
            start = np.empty(known.shape)
        outside = self.scheme.outside

        def fill(rows: slice) -> None:
            if first is not None:
                start[rows] = first[rows]
            if outside is not None:
                # What is not there must not look like a low neighbour.
                np.copyto(start[rows], outside, where=~(known[rows] | self.domain.solved[rows]))

        if first is not None or outside is not None:
            in_row_blocks(fill, start.shape)
        start[known] = self.known_values - self.level
        if self.limits is not None:
            lower, upper = self.limits
            np.fmin(start, upper, out=start)
            np.fmax(start, lower, out=start)
        return start

    @cached_property
    def limits(self) -> Array | None:
        """Bounds of W, less `level`, from below and from above, shape (2, height, width); None where there are none.

        NaN for pixels that have none, or are not solved.
        """
        if self.depth_range is None:
            return None
        found = np.stack(self.depth_range.cut(self.window).of_values(self.sign, self.offset)) - self.level
        found[:, ~self.domain.solved] = np.nan
        return found

    @property
    def kernel_arguments(self) -> Image:
        """The problem as the kernels want it."""
        x_axis, y_axis = self.model.axes(self.grid)
        boundary = self.domain.boundary
        return Image(
            log_depth=self.start,
            brightness=self.shading,
            flags=self.domain.flags,
            # Some are bounds over the whole image.
            parameters=self.model.parameters(
                self.image_grid, sign=self.sign, max_slope=self.max_slope, unit=math.exp(self.level)
            ),
            x_axis=x_axis,
            y_axis=y_axis,
            cells=boundary.cells,
            inwards=boundary.inwards,
            edges=boundary.edges,
            settles=self.scheme.settles,
            outside=self.scheme.outside,
            limits=self.limits,
        )

    @property
    def given(self) -> Given:
        """What it was made of."""
        return Given(**{field.name: getattr(self, field.name) for field in fields(Given)})

    def between(self, within: DepthRange, light: Light | None = None) -> Problem:
        """The same with other bounds of the depth, and perhaps in another light of the same kind."""
        model = self.model if light is None else self.scheme.model(light, self.model.reflectance)
        return Problem.of(replace(self.given, depth_range=within, model=model))

    def corrected(self, image: Array) -> Problem:
        """The same where the image tells the depth, with another brightness to be solved for; `image` stays."""
        solved = self.domain.solved
        shading, level = self.model.start(image, solved, self.grid, Extremes.of(image, solved), self.precision)
        return replace(self, shading=shading, level=level)

    def depth(self, values: Array, *, converged: bool) -> tuple[Array, Array]:
        """Log depth, in the place of the values of a run, and depth; NaN where there is none.

        A run that was ended early may not have brought every pixel down from the start value. What a known value has
        reached lies no higher than one step for each pixel on the shortest way from it.
        """
        known, solved = self.domain.known, self.domain.solved
        if not converged and np.isfinite(self.highest_known):
            self._forget_unreached(values)
        log_depth, depth = values, np.empty_like(values)
        within = None if self.depth_range is None else self.depth_range.cut(self.window)

        def convert(rows: slice) -> None:
            block, here = log_depth[rows], known[rows]
            if self.limits is not None:
                # As the device has rounded them.
                lower, upper = self.limits[:, rows].astype(self.precision)
                on_lower, on_upper = block <= lower, block >= upper
            block += self.level
            block *= self.sign
            block -= self.offset[rows]
            # Both are NaN where one value is.
            lowest, highest = block.min(), block.max()
            if not (lowest >= _NEAREST_LOG and highest <= _FARTHEST_LOG and solved[rows].all()):
                np.copyto(block, np.nan, where=~(solved[rows] & (block >= _NEAREST_LOG) & (block <= _FARTHEST_LOG)))
            np.exp(block, out=depth[rows])
            if within is not None:
                # The lower bound of W = -Z is that of Z from above.
                at_near, at_far = (on_lower, on_upper) if self.sign > 0 else (on_upper, on_lower)
                DepthRange(within.near[rows], within.far[rows]).keep(block, depth[rows], at_near, at_far)
            if here.any():
                np.log(self.known_depth[rows], out=block, where=here)
                np.copyto(depth[rows], self.known_depth[rows], where=here)

        in_row_blocks(convert, depth.shape)
        return log_depth, depth

    def _forget_unreached(self, values: Array) -> None:
        """Make those NaN that lie higher than a known value can have brought them."""
        known, present = self.domain.known, self.domain.known | self.domain.solved
        if self.limits is not None:
            # As good as known: they are no higher than what they begin with.
            known = known | ~np.isnan(self.limits[1])
        # No way is shorter than the straight one through whatever lies between, which is found much sooner.
        unreached = self._beyond_straight_steps(values, known, everywhere=bool(present.all()))
        if not unreached.any():
            return
        if not present.all():
            steps = masks.steps_from(known, present)
            for rows in row_blocks(values.shape):
                unreached[rows] = self.domain.solved[rows] & (values[rows] > self._climbed(steps[rows]))
        np.copyto(values, np.nan, where=unreached)

    def _beyond_straight_steps(self, values: Array, known: Mask, *, everywhere: bool) -> Mask:
        """Which of the pixels to solve are higher than the straight steps can climb that a known value is away.

        `everywhere` says whether all other pixels are known. Most blocks can be decided at once.
        """
        solved = self.domain.solved
        # What is neither solved nor known has the value that it began with, which may be as high as any.
        counted = values if everywhere else np.where(solved, values, -np.inf)
        lowest, highest = (masks.in_square_blocks(of, counted, _BLOCK) for of in (np.minimum, np.maximum))
        least, most = masks.steps_to_blocks(known, _BLOCK)
        beyond = lowest > self._climbed(most)
        # A known value itself is no higher than what one step climbs. A NaN decides nothing.
        undecided = ~(highest <= self._climbed(np.maximum(least, 1))) & ~beyond
        steps, farthest = masks.StraightSteps(known), int(most.max(where=undecided, initial=0))

        def is_beyond(part: tuple[slice, slice]) -> Mask:
            return np.asarray(values[part] > self._climbed(steps.to(*part, farthest)))

        return masks.decided_by_blocks(solved, beyond, undecided, _BLOCK, is_beyond)

    def _climbed(self, steps: masks.Steps) -> Array:
        """How high so many steps can climb from the highest known value."""
        step = self.max_slope * max(self.grid.dx, self.grid.dy)
        return np.asarray((self.highest_known + step * steps) * (1.0 + 1e-5) + 1e-6)

    def continue_onto_walls(self, log_depth: Array, depth: Array) -> Discontinuities | None:
        """Give walls a log depth and a depth, in place, and say where they cut the surface; None without walls."""
        if self.walls is None:
            return None
        known = self.known_depth[self.walls]
        discontinuities = fill_walls(log_depth, self.walls, self.image, np.log(known))
        filled = log_depth[self.walls]
        filled[~((filled >= _NEAREST_LOG) & (filled <= _FARTHEST_LOG))] = np.nan
        log_depth[self.walls] = filled
        depth[self.walls] = np.where(np.isfinite(known), known, np.exp(filled))
        if self.depth_range is not None:
            self.depth_range.cut(self.window).keep(log_depth, depth)
        return discontinuities

    @property
    def degenerate(self) -> Mask:
        """Pixels to solve where the equation gives no bound to the slope."""
        if self.scheme.by_energy:
            return np.zeros_like(self.domain.solved)
        return self.model.degenerate(self.image, self.shading, self.domain.solved, self.grid, self.extremes)

    @property
    def kernels(self) -> tuple[str, ...]:
        """Kernel files of model and scheme."""
        return self.scheme.kernels(self.model)


def prepare(
    image: ArrayLike,
    camera: Camera,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    albedo: ArrayLike | None = None,
    depth_range: Any = None,
    guide: Any = None,
    *,
    options: Options,
) -> Problem:
    """The problem of a whole image; see :func:`persfs_cl.solver.given.check`."""
    given = check(image, camera, mask, walls, known_depth, albedo, depth_range, guide, options=options, whole=True)
    return Problem.of(given)
