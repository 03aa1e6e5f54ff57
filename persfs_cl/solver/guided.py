"""Surfaces that a guide helps to find: solved again between bounds that surface and guide set together.

Section 7 of the method. A surface of the photograph alone has the right slopes nearly everywhere, and errs where it
cannot know: behind a jump whatever is too near drags all with it. A guide knows such places, coarsely. So what is
smoothed is not the guide but the residual, guide less surface, in ln depth, along the edges of the photograph; surface
and residual together bound the depth, and between these bounds it is solved again.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl._cl.smoothing import Smoother
from persfs_cl.arrays import Array, Mask
from persfs_cl.guide.few import kriged
from persfs_cl.guide.fit import GuideFit
from persfs_cl.guide.guide import Guide
from persfs_cl.guide.smoothing import edge_weights
from persfs_cl.solver.agreed import Agreed, about
from persfs_cl.solver.attempt import Attempt, swept
from persfs_cl.solver.bounds import DepthRange
from persfs_cl.solver.iterate import LogDepthAndDepth, Watch
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.outcome import Status

_OF_JUMPS, _OF_SLOPES = 6.0, 2.5
"""Weight of the total variation of the residual, over the pixels from cell to cell, and over their root.

Whichever is more: the jumps around some cells are the longer the more pixels lie between cells, but steps so small that
their squares count fall as fast as their number grows, and with the first weight alone are smoothed the less.
"""
_MANY = 25
"""Cells. Fewer tell nothing of what lies between them."""
_PRESSED = 0.37
"""Share of the pixels on a bound beyond which a guide is distorted."""
_SPACING = 12.0
"""Pixels, or blocks of them, from cell to cell, that sweeps of the smoothing cross."""


def solve_guided(
    device: Device, attempts: Sequence[Attempt], options: Options, watch: Watch | None, numbers: Sequence[int]
) -> list[Attempt]:
    """Solve again those problems that have a guide, with what it tells of the surfaces so far.

    Parameters
    ----------
    device : Device
    attempts : sequence of Attempt
        By the photographs alone.
    options, watch, numbers
        As for :func:`persfs_cl.solver.solve.solve`.

    Returns
    -------
    list of Attempt
        With the changes of all runs; their problems are those that were solved last.

    Raises
    ------
    InputError
        When guide and surface have nothing in common.

    Warns
    -----
    UserWarning
        When the scale of a guide contradicts the light.
    """
    found = list(attempts)
    states: dict[int, _Guided] = {}
    for place, attempt in enumerate(found):
        if attempt.problem.guide is not None and attempt.status is not Status.STOPPED:
            began = time.perf_counter()
            found[place] = attempt.with_surface()
            with about(numbers[place]):
                states[place] = _Guided.of(device, found[place], attempt.problem.guide, options)
            found[place] = replace(found[place], seconds=attempt.seconds + time.perf_counter() - began)
    while states:
        if watch and watch.stopped:
            # What was not in the round that was stopped keeps the surface that it has.
            for place in states:
                found[place].run.statuses[0] = Status.STOPPED
            break
        began = time.perf_counter()
        problems = [state.bounded() for state in states.values()]
        share = (time.perf_counter() - began) / len(states)
        if watch:
            watch.go_on()
        again = swept(device, problems, options, watch, [numbers[place] for place in states])
        for place, latest in zip(list(states), map(Attempt.with_surface, again), strict=True):
            ended = replace(latest.after(found[place]), guide=states[place].fit_to(latest))
            found[place] = replace(ended, seconds=ended.seconds + share)
            if latest.status is Status.STOPPED or states[place].is_done:
                del states[place]
    return found


@dataclass
class _Guided:
    """One image whose guide was fitted to its surface.

    Attributes
    ----------
    agreed : Agreed
        The guide, and the surface so far.
    smoother : Smoother
    middle : ndarray of float64, shape (height, width)
        What surface and guide say together.
    used : int
        Cells that counted in the last round.
    tolerance : float
        Of the last round.
    difference : float
        Of guide and photograph: root mean square of the first smooth residual.
    doubting : Agreed or None
        To begin again from, if the guide turns out to be distorted: see :meth:`fit_to`.
    number : int
        Rounds so far.
    """

    agreed: Agreed
    smoother: Smoother
    middle: Array
    doubting: Agreed | None
    number: int = 0
    used: int = 0
    tolerance: float = 0.0
    difference: float = 0.0

    @classmethod
    def of(cls, device: Device, alone: Attempt, guide: Guide, options: Options) -> _Guided:
        """From the surface of the photograph alone."""
        surface = _surface_of(alone)[0]
        agreed, doubting = Agreed.on(alone.problem, guide, surface, options), None
        if agreed.fitted.trusted is not None:
            doubting, agreed = agreed, Agreed.by(alone.problem, agreed.fitted.trusted, surface, options)
        problem, spacing = agreed.problem, agreed.fitted.cells.spacing
        smoothness = max(_OF_JUMPS / spacing, _OF_SLOPES / math.sqrt(spacing))
        right, below = (smoothness * each for each in edge_weights(problem.image, _joined(problem)))
        levels = max(0, math.floor(math.log2(spacing / _SPACING)))
        return cls(agreed, Smoother(device, options["precision"], right, below, levels), agreed.log_depth, doubting)

    @property
    def is_done(self) -> bool:
        """Whether there is no other round."""
        return self.number == self.agreed.fitted.rounds

    def bounded(self) -> Problem:
        """The problem of a round: between the bounds that surface and guide set together."""
        problem, fitted, log_depth = self.agreed.problem, self.agreed.fitted, self.agreed.log_depth
        residuals = fitted.residuals(log_depth)
        self.used = int(np.count_nonzero(~np.isnan(residuals)))
        smooth = self._smoothed(residuals)
        if self.number == 0:
            self.difference = float(np.sqrt(np.nanmean(smooth**2)))
        self.middle, self.tolerance = log_depth + smooth, fitted.tolerance(self.number, self.difference)
        near, far = (problem.window.spread(bound, np.nan) for bound in fitted.around(self.middle, self.tolerance))
        given = problem.given_range or DepthRange.none(problem.window.image_shape)
        fixed = problem.window.spread(problem.domain.known, False)
        return problem.between(given.within(near, far).but(fixed))

    def _smoothed(self, residuals: Array) -> Array:
        """Residuals of the cells, NaN for those that do not count, along the edges; NaN where no cell reaches."""
        fitted, known = self.agreed.fitted, ~np.isnan(residuals)
        cells, joined = fitted.cells, _joined(self.agreed.problem)
        start, distance = cells.nearest(residuals)
        if fitted.few:
            smooth = kriged(residuals, cells, fitted.noise, doubted=not fitted.told)
        else:
            if cells.count < _MANY:
                start = np.where(distance <= cells.spacing * cells.count / _MANY, start, 0.0)
            voting = joined & cells.near_median(self.agreed.log_depth, cells.values - residuals)
            voters = np.bincount(cells.of_pixel[voting], minlength=cells.count)
            votes = np.divide(1.0, voters, out=np.zeros(cells.count), where=known & (voters > 0))
            smooth = self.smoother.smoothed(
                start,
                cells.on_pixels(np.where(known, residuals, 0.0), 0.0),
                np.where(voting, cells.on_pixels(votes, 0.0), 0.0),
                fitted.noise,
            )
        # What no cell reaches is left to the photograph.
        smooth[(distance > cells.reach) | ~joined] = np.nan
        return smooth

    def fit_to(self, latest: Attempt) -> GuideFit:
        """What became of the guide, once the surface was solved again.

        A surface that fits the photograph lies on few of the bounds of a guide that is right, however wrong it was in
        large parts before. Between those of a distorted one most of it is pressed against them: then the guide is
        taken for what it seemed to be, and all begins again.
        """
        self.agreed = agreed = replace(self.agreed, log_depth=_surface_of(latest)[0])
        self.number += 1
        departure = agreed.problem.window.spread(self.middle - agreed.log_depth, np.nan)
        fit = agreed.fitted.outcome(self.used, self.tolerance, agreed.gain, departure)
        if self.doubting is not None and _pressed(latest) > _PRESSED:
            self.agreed, self.number = self.doubting, 0
        self.doubting = None
        return fit


def _pressed(attempt: Attempt) -> float:
    """Share of the pixels between bounds that lie on one."""
    problem, (_, depth) = attempt.problem, _surface_of(attempt)
    assert problem.depth_range is not None  # noqa: S101 - for the type checker
    bounds = problem.depth_range.cut(problem.window)
    between = problem.domain.solved & ~np.isnan(bounds.near) & ~np.isnan(depth)
    return float(np.mean(bounds.touched(depth)[between])) if between.any() else 0.0


def _joined(problem: Problem) -> Mask:
    """Pixels over which residuals are smoothed."""
    return problem.domain.solved | problem.domain.known


def _surface_of(attempt: Attempt) -> LogDepthAndDepth:
    assert attempt.surface is not None  # noqa: S101 - for the type checker
    return attempt.surface
