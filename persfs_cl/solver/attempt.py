"""Problems on the device: the sweeps, and for a lamp that takes them the rounds, without guide."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from persfs_cl._cl.device import Device
from persfs_cl.guide.fit import GuideFit
from persfs_cl.solver.iterate import Iteration, LogDepthAndDepth, Watch, stop_at_once
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.rounds import solve_corrected
from persfs_cl.surface.outcome import Status


@dataclass(frozen=True)
class Attempt:
    """What the device made of a problem.

    Attributes
    ----------
    problem : Problem
    run : Iteration
        Of its image alone.
    surface : (ndarray, ndarray), or None
        None where it is still to be made of the values of the run.
    rounds : int or None
        Runs, for a lamp that takes rounds.
    seconds : float
        Its share of those of all that shared launches.
    guide : GuideFit or None
        What became of its guide.
    """

    problem: Problem
    run: Iteration
    surface: LogDepthAndDepth | None
    rounds: int | None
    seconds: float
    guide: GuideFit | None = None

    @property
    def status(self) -> Status:
        """How the iteration ended."""
        return self.run.statuses[0]

    def with_surface(self) -> Attempt:
        """The same, its surface made."""
        return self if self.surface else replace(self, surface=self.run.surfaces([self.problem])[0])

    def after(self, before: Attempt) -> Attempt:
        """The same as the end of two runs, one after the other."""
        run, earlier = self.run, before.run
        together = replace(
            run,
            changes=[[*earlier.changes[0], *run.changes[0]]],
            build_seconds=earlier.build_seconds + run.build_seconds,
            kernel_seconds=earlier.kernel_seconds + run.kernel_seconds,
        )
        rounds = None if self.rounds is None else self.rounds + (before.rounds or 0)
        return replace(self, run=together, rounds=rounds, seconds=before.seconds + self.seconds)


def swept(
    device: Device, problems: Sequence[Problem], options: Options, watch: Watch | None, numbers: Sequence[int]
) -> list[Attempt]:
    """Run the sweeps; the parameters are those of :func:`persfs_cl.solver.solve.solve`."""
    began = time.perf_counter()
    together = Iteration.of(device, problems, options, stop_at_once if watch and watch.stopped else watch)
    surfaces: Sequence[LogDepthAndDepth | None] = [None] * len(problems)
    rounds: Sequence[int | None] = [None] * len(problems)
    if problems[0].model.in_rounds:
        surfaces = found = together.surfaces(problems)
        rounds = solve_corrected(device, problems, found, together, options, watch, numbers)
    share = (time.perf_counter() - began) / len(problems)
    return [Attempt(*each, share) for each in zip(problems, together.split(), surfaces, rounds, strict=True)]
