"""Problems to solutions: which images share launches, what is run, and what comes of it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl.checks import FARTHEST, NEAREST, warn
from persfs_cl.solver.iterate import Iteration, Watch, stop_at_once
from persfs_cl.solver.options import Options, reported
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.rounds import solve_corrected
from persfs_cl.surface.solution import Elapsed, Solution, Status
from persfs_cl.told import concerning
from persfs_cl.wording import keyword


def pieces(shapes: Sequence[tuple[int, ...]], device: Device, precision: str) -> Iterator[list[int]]:
    """Numbers of images that may share launches: of one shape, and together well within the device's memory."""
    # Values, their copy, brightness and flags, with something to spare for padding.
    bytes_a_pixel = 3 * np.dtype(precision).itemsize + 2
    by_shape: dict[tuple[int, ...], list[int]] = {}
    for number, shape in enumerate(shapes):
        by_shape.setdefault(shape, []).append(number)
    for shape, numbers in by_shape.items():
        # Index arithmetic within an array is done in 32 bits here and there, hence the second bound.
        cells = math.prod(length + 96 for length in shape)
        most = max(1, min(device.memory // (4 * cells * bytes_a_pixel), 2**30 // cells))
        for begin in range(0, len(numbers), most):
            yield numbers[begin : begin + most]


def solve(
    device: Device,
    problems: Sequence[Problem],
    options: Options,
    watch: Watch | None,
    numbers: Sequence[int] | None = None,
) -> list[Solution]:
    """Solve problems of one shape in shared launches.

    Parameters
    ----------
    device : Device
    problems : sequence of Problem
    options : Options
        Complete, see :func:`persfs_cl.solver.options.complete`.
    watch : Watch, optional
    numbers : sequence of int, optional
        Those of the problems that warnings concern, see :func:`persfs_cl.told.concerning`; their places by default.

    Returns
    -------
    list of Solution
        `elapsed` is an image's share of the time that this took.

    Warns
    -----
    UserWarning
        When pixels come out where they cannot be relied on.
    """
    began = time.perf_counter()
    numbers = range(len(problems)) if numbers is None else numbers
    run = Iteration.of(device, problems, options, stop_at_once if watch and watch.stopped else watch)
    surfaces = run.surfaces(problems)
    rounds = None
    if problems[0].model.in_rounds:
        rounds = solve_corrected(device, problems, surfaces, run, options, watch, numbers)
    discontinuities = []
    for number, problem, surface, status in zip(numbers, problems, surfaces, run.statuses, strict=True):
        with concerning(number):
            _warn_if_too_near(problem, surface[1])
            if status is Status.CONVERGED:
                _warn_if_lost(problem, surface[1])
            discontinuities.append(problem.continue_onto_walls(*surface))
    clamped = [problem.degenerate for problem in problems]
    share = 1.0 / len(problems)
    elapsed = Elapsed(share * (time.perf_counter() - began), share * run.kernel_seconds, share * run.build_seconds)
    solutions = []
    for place, (problem, (log_depth, depth)) in enumerate(zip(problems, surfaces, strict=True)):
        solved = np.isfinite(depth)
        solutions.append(
            Solution(
                depth=depth,
                log_depth=log_depth,
                solved=solved,
                unreached=(problem.domain.solved | problem.domain.unreached) & ~solved,
                clamped=clamped[place] & solved,
                iterations=len(run.changes[place]),
                changes=np.array(run.changes[place]),
                status=run.statuses[place],
                distance=run.distances[place],
                elapsed=elapsed,
                device=device,
                image=problem.photograph,
                camera=problem.camera,
                light=problem.model.light,
                reflectance=problem.model.reflectance,
                parameters={
                    **reported(options),
                    "sweep": run.variant,
                    **({"lamp_rounds": rounds[place]} if rounds else {}),
                },
                albedo=problem.albedo,
                walls=problem.walls,
                discontinuities=discontinuities[place],
            )
        )
    return solutions


def _warn_if_too_near(problem: Problem, depth: NDArray[np.float64]) -> None:
    nearest = problem.model.nearest_depth(problem.grid.x, problem.grid.y)
    if nearest is None:
        return
    if count := int(np.count_nonzero(problem.domain.solved & (depth <= 1.001 * nearest))):
        warn(
            f"{count} pixels come out as near to the camera as the lamp of {keyword('light', problem.model.light)}, "
            "where their depth ends: do not rely on them. Mask out what is too bright, or check the lamp's place and "
            "its gain, which go by the same unit of depth."
        )


def _warn_if_lost(problem: Problem, depth: NDArray[np.float64]) -> None:
    if count := int(np.count_nonzero(problem.domain.solved & np.isnan(depth))):
        bound = keyword("max_slope", problem.max_slope, written=f"{problem.max_slope:g}")
        warn(
            f"{count} pixels come out nearer than {NEAREST:g} or farther than {FARTHEST:g}, and have no depth: they, "
            "or those between them and a known depth, are too dark for the light, and only "
            f"{bound} bounds their slope. Mask them out, or lower {keyword('max_slope')}."
        )
