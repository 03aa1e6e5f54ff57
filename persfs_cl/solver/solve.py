"""Problems to solutions: what is run on the device, and what comes of it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.checks import FARTHEST, NEAREST, warn
from persfs_cl.solver.attempt import Attempt, swept
from persfs_cl.solver.energy.attempt import minimised
from persfs_cl.solver.guided import solve_guided
from persfs_cl.solver.iterate import LogDepthAndDepth, Watch
from persfs_cl.solver.options import Options, reported
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.window import Window
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.surface.outcome import Elapsed, Status
from persfs_cl.surface.solution import Solution
from persfs_cl.told import concerning
from persfs_cl.wording import keyword


@dataclass(frozen=True)
class Finished:
    """A solution, and what is to be said of it."""

    solution: Solution
    remarks: tuple[str, ...]


def solve(
    device: Device,
    problems: Sequence[Problem],
    options: Options,
    watch: Watch | None,
    numbers: Sequence[int] | None = None,
) -> list[Solution]:
    """Solve problems in shared launches.

    Parameters
    ----------
    device : Device
    problems : sequence of Problem
        Of about one size.
    options : Options
        Complete, see :func:`persfs_cl.solver.complete.complete`.
    watch : Watch, optional
    numbers : sequence of int, optional
        Those of the problems that warnings concern, see :func:`persfs_cl.told.concerning`; their places by default.

    Returns
    -------
    list of Solution
        `elapsed` has an image's share of the time that the sweeps took.

    Warns
    -----
    UserWarning
        When pixels come out where they cannot be relied on.
    """
    numbers = range(len(problems)) if numbers is None else numbers
    return told([finish(device, each, options) for each in attempt(device, problems, options, watch, numbers)], numbers)


def attempt(
    device: Device, problems: Sequence[Problem], options: Options, watch: Watch | None, numbers: Sequence[int]
) -> list[Attempt]:
    """Run the sweeps, and again with what guides tell, or minimise the energy; see :func:`solve`."""
    if watch:
        watch.begin()
    if problems[0].scheme.by_energy:
        return [
            minimised(device, problem, options, watch, number)
            for problem, number in zip(problems, numbers, strict=True)
        ]
    return solve_guided(device, swept(device, problems, options, watch, numbers), options, watch, numbers)


def finish(device: Device, attempted: Attempt, options: Options) -> Finished:
    """The solution of a problem, once and in any thread: this neither warns nor asks anything of the device."""
    began = time.perf_counter()
    problem, run, status = attempted.problem, attempted.run, attempted.status
    surface = attempted.surface or run.surfaces([problem])[0]
    too_near = _too_near(problem, surface[1])
    whole = _Whole.of(problem, surface)
    remarks = (too_near, _lost(problem, whole.lost) if status is Status.CONVERGED else None)
    total = attempted.seconds + time.perf_counter() - began
    solution = Solution(
        depth=whole.depth,
        log_depth=whole.log_depth,
        solved=whole.solved,
        unreached=whole.unreached,
        clamped=whole.clamped,
        at_bound=whole.at_bound,
        iterations=len(run.changes[0]),
        changes=np.array(run.changes[0]),
        status=status,
        distance=run.distances[0],
        elapsed=Elapsed(total, run.kernel_seconds, run.build_seconds),
        device=device,
        image=problem.photograph,
        camera=problem.camera,
        light=problem.model.light,
        reflectance=problem.model.reflectance,
        parameters={
            **reported({**options, "resting": run.resting}),
            "sweep": run.variant,
            **({"lamp_rounds": attempted.rounds} if attempted.rounds else {}),
        },
        albedo=problem.albedo,
        walls=whole.walls,
        discontinuities=whole.discontinuities,
        guide=attempted.guide,
    )
    return Finished(solution, tuple(remark for remark in remarks if remark))


def told(finished: Sequence[Finished], numbers: Sequence[int]) -> list[Solution]:
    """The solutions, once what is to be said of them has been said."""
    for number, each in zip(numbers, finished, strict=True):
        with concerning(number):
            for remark in each.remarks:
                warn(remark)
    return [each.solution for each in finished]


@dataclass(frozen=True)
class _Whole:
    """Arrays of the shape of the image; and how many pixels were solved, but have no depth."""

    depth: Array
    log_depth: Array
    solved: Mask
    unreached: Mask
    clamped: Mask
    at_bound: Mask
    walls: Mask | None
    discontinuities: Discontinuities | None
    lost: int

    @classmethod
    def of(cls, problem: Problem, surface: LogDepthAndDepth) -> _Whole:
        """From those of the window, and what is known around it."""
        window, domain, (log_depth, depth) = problem.window, problem.domain, surface
        discontinuities = problem.continue_onto_walls(log_depth, depth)
        solved, unreached = np.empty(depth.shape, bool), np.empty(depth.shape, bool)
        lost: list[int] = []

        def classify(rows: slice) -> None:
            np.isfinite(depth[rows], out=solved[rows])
            missing = domain.solved[rows] & ~solved[rows]
            lost.append(int(np.count_nonzero(missing)))
            np.logical_and(missing | domain.unreached[rows], ~solved[rows], out=unreached[rows])

        in_row_blocks(classify, depth.shape)
        clamped = problem.degenerate & solved
        whole = cls(
            depth=window.spread(depth, np.nan),
            log_depth=window.spread(log_depth, np.nan),
            solved=window.spread(solved, False),
            unreached=window.spread(unreached, False),
            clamped=window.spread(clamped, False),
            at_bound=np.zeros(window.image_shape, bool),
            walls=None if problem.walls is None else window.spread(problem.walls, False),
            discontinuities=None if discontinuities is None else _spread(discontinuities, window),
            lost=sum(lost),
        )
        if beyond := problem.known_beyond:
            np.copyto(whole.depth, beyond.depth, where=beyond.known)
            np.log(beyond.depth, out=whole.log_depth, where=beyond.known)
            whole.solved[beyond.known] = True
        if problem.depth_range is not None:
            np.logical_and(whole.solved, problem.depth_range.touched(whole.depth), out=whole.at_bound)
        return whole


def _spread(discontinuities: Discontinuities, window: Window) -> Discontinuities:
    """Those of an image from those of a window."""
    if window.is_whole:
        return discontinuities

    def spread(cuts: NDArray[np.bool_], axis: int) -> NDArray[np.bool_]:
        # One less than pixels: at the end of each line nothing follows.
        padded = np.pad(cuts, [(0, int(axis == along)) for along in range(2)])
        return window.spread(padded, False)

    return Discontinuities(spread(discontinuities.right, 1)[:, :-1], spread(discontinuities.down, 0)[:-1])


def _too_near(problem: Problem, depth: Array) -> str | None:
    nearest = problem.model.nearest_depth(problem.grid.x, problem.grid.y)
    if nearest is None:
        return None
    if count := int(np.count_nonzero(problem.domain.solved & (depth <= 1.001 * nearest))):
        return (
            f"{count} pixels come out as near to the camera as the lamp of {keyword('light', problem.model.light)}, "
            "where their depth ends: do not rely on them. Mask out what is too bright, or check the lamp's place and "
            "its gain, which go by the same unit of depth."
        )
    return None


def _lost(problem: Problem, count: int) -> str | None:
    if count:
        bound = keyword("max_slope", problem.max_slope, written=f"{problem.max_slope:g}")
        return (
            f"{count} pixels come out nearer than {NEAREST:g} or farther than {FARTHEST:g}, and have no depth: they, "
            "or those between them and a known depth, are too dark for the light, and only "
            f"{bound} bounds their slope. Mask them out, or lower {keyword('max_slope')}."
        )
    return None
