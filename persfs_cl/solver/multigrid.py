"""A multigrid method for the Lax-Friedrichs scheme, where every pixel to solve has all its neighbours.

The full approximation scheme of Brandt (1977), see docs/method.md. The surface is found on coarse grids first, and each
grid begins with what the coarser one has come to; cycles through all grids then take away of what is left what varies
slowly, which iterations of the finest grid alone would take hundreds for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.multigrid import (
    ABSENT,
    KNOWN,
    LEAST_CELLS,
    SOLVED,
    Level,
    Multigrid,
    Part,
    Steps,
    coarse_cells,
    coarse_kinds,
    part_of,
)
from persfs_cl.grid import PixelGrid
from persfs_cl.masks import LACKING, SWEPT, Neighbours
from persfs_cl.solver.options import Callback
from persfs_cl.solver.problem import Problem

_LEAST_PIXELS = 80**2
"""Of an image: what is smaller takes less time by mixtures, above all in a batch, whose images these take together."""
_MOST_PIXELS = 2**29
"""Of an image: places in the arrays of all levels are numbers of 32 bits."""
_LEAST_LEVELS = 3
"""With fewer the coarsest is not much coarser than the finest."""
_LEAST_SOLVED = 9
"""Cells to solve of the coarsest level."""
_MOST_COARSEST = 64**2
"""Cells of the coarsest level: of a long strip, or a thin ring, there would be no end to its iterations."""
_SLOWEST = 0.7
"""Factor by which the change of a cycle shrinks at least, in one of two cycles that follow each other."""
_FASTEST = 0.2
"""Factor by which it is taken to shrink at most: at first it may be of what shrinks faster than the rest."""
_FARTHEST = 1e3
"""Of values, and changes, from 0: of more there is no depth, and a coarse grid may have gone astray."""
_GROWTH = 4.0
"""Of the change from cycle to cycle, at most, unless it is one of rounding: more of it would come."""
LEAST_ITERATIONS = 16
"""That must be allowed: what few of them have come to is of less use than what as many of the scheme's own have."""
_MOST_CYCLES = 24
"""Before it is left to other means."""
ROUNDINGS = 32.0
"""Spacings of the numbers about 1 by which a cycle, or an iteration at its end, may change values by rounding alone."""
_LEFT = 5.0
"""Changes of a cycle, by rounding alone, that values may be away from their limit."""


@dataclass(frozen=True)
class Hierarchy:
    """The grids of a problem.

    Attributes
    ----------
    part : indices
        Rows and columns with pixels to solve and those next to them. Others have nothing to do with it, whether there
        are any or not.
    levels : list of Level
        From fine to coarse.
    """

    part: Part
    levels: list[Level]

    @classmethod
    def of(cls, problem: Problem) -> Hierarchy | None:
        """None where the method is not for the problem."""
        flags = problem.domain.flags
        if not (problem.accelerates and problem.model.coarsens):
            return None
        solved = flags & SWEPT != 0
        if (solved & (flags & LACKING != 0)).any() or not solved.any():
            return None
        rows, columns = _around(solved.any(axis=1)), _around(solved.any(axis=0))
        if not _LEAST_PIXELS <= len(rows) * len(columns) <= _MOST_PIXELS:
            return None
        part, whole = part_of(rows, columns), problem.grid
        grid = PixelGrid(whole.x[columns], whole.y[rows], whole.dx, whole.dy)
        solved = solved[part]
        # What is known farther away plays no part, as much of it as the image may have.
        near = Neighbours.of(Neighbours.of(solved).any | solved).any
        kinds = np.where(problem.domain.known[part] & near, np.uint8(KNOWN), np.uint8(ABSENT))
        kinds[solved] = SOLVED
        levels = [_level(problem, kinds, grid)]
        while min(map(coarse_cells, kinds.shape)) >= LEAST_CELLS:
            down, across = map(Steps.of, kinds.shape)
            kinds = coarse_kinds(kinds, down, across)
            if np.count_nonzero(kinds == SOLVED) < _LEAST_SOLVED:
                break
            x, y = across.sampled(grid.x), down.sampled(grid.y[:, 0])[:, None]
            grid = PixelGrid(x, y, grid.dx * across.spacing, grid.dy * down.spacing)
            levels.append(_level(problem, kinds, grid))
        enough = len(levels) >= _LEAST_LEVELS and kinds.size <= _MOST_COARSEST
        return cls(part, levels) if enough else None


def _around(wanted: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Places that are wanted, and those before and after them."""
    places = np.flatnonzero(wanted)
    return np.unique(places[:, None] + np.array([-1, 0, 1]))


def _level(problem: Problem, kinds: NDArray[np.uint8], grid: PixelGrid) -> Level:
    return Level(
        kinds,
        *problem.model.axes(grid),
        parameters=problem.model.parameters(
            grid, sign=problem.sign, max_slope=problem.max_slope, unit=math.exp(problem.level)
        ),
    )


@dataclass
class Cycles:
    """What the changes of the cycles say.

    Attributes
    ----------
    rounding : float
        Spacing of the numbers about 1.
    tolerance : float
    distance : float
        Estimate of max |W - limit|; NaN as long as there is none.
    ended : bool
        Whether no cycle more is wanted.
    failed : bool
        Whether what they have come to is of no use.
    """

    rounding: float
    tolerance: float
    distance: float = math.nan
    ended: bool = False
    failed: bool = False
    _changes: list[float] = field(default_factory=list)
    _rates: list[float] = field(default_factory=list)

    @property
    def converged(self) -> bool:
        """Whether the limit is as near as is wanted, or rounding allows."""
        return self.ended and not self.failed and self.tolerance > 0.0

    def fail(self) -> None:
        """What they have come to is of no use."""
        self.ended = self.failed = True

    def note(self, change: float) -> None:
        """Take another cycle into account, by its largest change."""
        self._changes.append(change)
        if not change < _FARTHEST:
            self.fail()
        elif len(self._changes) > 1:
            before = self._changes[-2]
            self._rates.append(change / before if before > 0.0 else 0.0)
            self._judge(change)

    def _judge(self, change: float) -> None:
        latest = self._rates[-2:]
        rate = max(_FASTEST, *latest)
        slow = len(latest) == 2 and min(latest) >= _SLOWEST
        # What rounding makes of it shrinks at no rate; what never shrank fast may be no rounding.
        stands_still = self._rates[-1] >= _SLOWEST > min(self._rates) and change <= ROUNDINGS * self.rounding
        if change <= self.rounding or stands_still:
            self.distance = _LEFT * max(change, self.rounding)
            self.ended = True
        elif rate < 1.0:
            self.distance = max(change, self.rounding) * rate / (1.0 - rate)
            self.ended = len(latest) == 2 and self.distance <= self.tolerance
        if not self.ended and (slow or len(self._changes) >= _MOST_CYCLES):
            # At a tolerance of 0 what is left is brought to rest otherwise, if it is known how much that is.
            self.ended = True
            self.failed = slow or self.tolerance > 0.0 or math.isnan(self.distance)


@dataclass
class Descent:
    """An image on its way.

    Attributes
    ----------
    grids : Multigrid
    cycles : Cycles
    limit : int
        Iterations of the finest grid that there may be.
    changes : list of float
        max |ΔW| of each of them.
    """

    grids: Multigrid
    cycles: Cycles
    limit: int
    changes: list[float] = field(default_factory=list)

    def iterations(self) -> Iterator[float]:
        """Changes of the iterations, one by one, until no cycle more is wanted or none is left."""
        if not self.grids.start() < _FARTHEST:
            self.cycles.fail()
        while not self.cycles.ended and len(self.changes) < self.limit:
            if self._note(self.grids.smooth()):
                yield self.changes[-1]
            if self.cycles.ended or len(self.changes) >= self.limit:
                break
            change, of_cycle = self.grids.correct()
            if self._note(change):
                self.cycles.note(of_cycle)
                yield self.changes[-1]

    def _note(self, change: float) -> bool:
        """Whether values are still such as to be used: else they have nothing to do with those that come after them."""
        # A cycle is of two iterations.
        before = self.changes[-2] if len(self.changes) > 1 else math.inf
        if not change < min(_FARTHEST, max(_GROWTH * before, ROUNDINGS * self.cycles.rounding)):
            self.cycles.fail()
            return False
        self.changes.append(change)
        return True


def descend(descents: Sequence[Descent], callback: Callback | None) -> bool:
    """Iterate images side by side, each as if it were alone; whether the callback has stopped them."""
    going = [descent.iterations() for descent in descents]
    for done in count(1):
        steps = [(each, change) for each in going if (change := next(each, None)) is not None]
        if not steps:
            return False
        going = [each for each, _ in steps]
        if callback is not None and callback(done, max(change for _, change in steps)):
            return True
    return False
