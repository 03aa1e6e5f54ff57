"""What the equation that is solved has not of the light: rounds of corrected images.

The upwind scheme has a lamp off the axis at its place, and a material that shades by the angle to the lamp alone, as a
Lambertian one does. The Lax-Friedrichs scheme has the lamp at the camera. What is missing is found from the surface, by
which the image is corrected and solved again, until the surface stays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array
from persfs_cl.checks import warn
from persfs_cl.solver.iterate import Iteration, LogDepthAndDepth, Watch
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.geometry import log_depth_gradient
from persfs_cl.surface.outcome import Status
from persfs_cl.told import concerning
from persfs_cl.wording import keyword

ROUNDS = 10
"""At most so many runs of the sweeps."""

SETTLED, LOST = 3e-5, 1e-3
"""Mean |ΔZ| between two runs below which no further one is worth it, and above which the last is not to be trusted."""

_DIMMEST = 0.1
"""Where the light gives less than this share of what the equation has, the share is not used: the surface turns its
back to the lamp, or nearly."""

_DARKEST = 1e-9
_SMOOTHINGS = 16
"""Of the share, over about 3 pixels. It depends on the slopes, in which rounding and the steps of pixels show; where
the surface faces the camera these would come back larger from every round."""


def solve_corrected(
    device: Device,
    problems: Sequence[Problem],
    surfaces: list[LogDepthAndDepth],
    run: Iteration,
    options: Options,
    watch: Watch | None,
    numbers: Sequence[int],
) -> list[int]:
    """Correct the images by the surfaces that a run found, and solve again, until that changes little.

    `surfaces` becomes that of the last rounds; `run` gets the statuses of an image's last round, and the changes of all
    rounds, but no distances. `numbers` are those of the images that warnings concern.

    Returns
    -------
    rounds : list of int
        Runs of each image, the first included.

    Warns
    -----
    UserWarning
        When the surface does not settle, or part of it turns its back to the lamp.
    """
    rounds = [1] * len(problems)
    # That of a round is not that of the rounds.
    run.distances = [math.nan] * len(problems)
    active = list(range(len(problems)))
    while active:
        if watch and watch.stopped:
            for place in active:
                run.statuses[place] = Status.STOPPED
            break
        again, dim = zip(*(corrected(problems[place], surfaces[place][1]) for place in active), strict=True)
        if watch:
            watch.before = max(len(run.changes[place]) for place in active)
        latest = Iteration.of(device, again, options, watch)
        run.kernel_seconds += latest.kernel_seconds
        run.build_seconds += latest.build_seconds
        going = []
        for number, (place, surface) in enumerate(zip(active, latest.surfaces(again), strict=True)):
            rounds[place] += 1
            run.statuses[place] = latest.statuses[number]
            run.changes[place] += latest.changes[number]
            change = float(np.nanmean(np.abs(surface[0] - surfaces[place][0])))
            surfaces[place] = surface
            if change > SETTLED and rounds[place] < ROUNDS:
                going.append(place)
                continue
            if change > LOST and run.statuses[place] is Status.CONVERGED:
                run.statuses[place] = Status.MAX_ITERATIONS
            with concerning(numbers[place]):
                if change > LOST:
                    warn(
                        f"{keyword('light', problems[place].model.light)} is too far from the camera: after "
                        f"{rounds[place]} rounds the depth still changes by {100 * change:.2g} % on average. Do not "
                        "rely on it."
                    )
                if shaded := int(dim[number].sum()):
                    warn(
                        f"{shaded} pixels turn their back to the lamp, or nearly: their depth is a guess. Mask them "
                        "out."
                    )
        active = going
    if watch:
        watch.before = 0
    return rounds


def corrected(problem: Problem, depth: Array) -> tuple[Problem, NDArray[np.bool_]]:
    """Give the equation the image that belongs to it, as far as a surface tells.

    Parameters
    ----------
    problem : Problem
        Of a model whose equation has not all of the light.
    depth : ndarray of float64, shape (height, width)
        What the surface is thought to be; NaN where it is not known.

    Returns
    -------
    problem : Problem
        The same with another image.
    dim : ndarray of bool, shape (height, width)
        Pixels that the lamp hardly reaches, where the image tells little.
    """
    grid = problem.grid
    had, given = problem.model.brightness_of_equation(
        np.log(depth), *log_depth_gradient(depth, problem.camera), grid.x, grid.y
    )
    there = np.isfinite(depth)
    dim = there & ~(given >= _DIMMEST * had)
    # Neither is above 0 where the surface is turned away.
    had = np.where(there, np.maximum(had, _DARKEST), 1.0)
    logarithm = np.log(had / np.where(there, np.clip(given, _DIMMEST * had, had / _DIMMEST), 1.0))
    weight = _smoothed(there.astype(np.float64))
    share = np.exp(np.divide(_smoothed(logarithm), weight, out=np.zeros_like(weight), where=there))
    return problem.corrected(problem.image * share), dim


def _smoothed(values: Array) -> Array:
    for _ in range(_SMOOTHINGS):
        padded = np.pad(values, 1)
        rows = padded[:-2] + 2.0 * padded[1:-1] + padded[2:]
        values = (rows[:, :-2] + 2.0 * rows[:, 1:-1] + rows[:, 2:]) / 16.0
    return values
