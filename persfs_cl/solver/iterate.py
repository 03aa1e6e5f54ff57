"""Iterations of images that share launches, until each has converged."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.image import Image
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.solution import Status

LogDepthAndDepth = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Log depth and depth."""

_FREE_CORRECTIONS = 40
"""Iterations of second order in which values may rise, at least."""

_QUEUE_SECONDS = 0.03
"""Iterations are queued so many at a time as take about this long: few waits, and Ctrl-C is still heard at once."""


@dataclass
class Iteration:
    """What the iteration of some images that share launches came to, one entry an image.

    The values of `images` are those that the iteration has reached.
    """

    images: list[Image]
    changes: list[list[float]]
    statuses: list[Status]
    variant: str
    settles: bool = False
    build_seconds: float = 0.0
    kernel_seconds: float = 0.0

    @classmethod
    def of(cls, device: Device, problems: Sequence[Problem], options: Options, callback: Callback | None) -> Iteration:
        """Iterate to convergence at first order, and from there at second order if that is wanted."""
        images = [problem.kernel_arguments for problem in problems]
        run = cls(images, [[] for _ in images], [Status.CONVERGED] * len(images), "")
        run.settles = problems[0].scheme.settles
        kernels = problems[0].kernels
        run._advance(device, kernels, options, callback)
        if options["accuracy_order"] == 2:
            corrected = [place for place, status in enumerate(run.statuses) if status is Status.CONVERGED]
            first_order = {place: run.images[place].log_depth.copy() for place in corrected}
            for only_lower in (False, True):
                if only_lower:
                    # What does not settle may have gone anywhere.
                    for place in corrected:
                        run.images[place].log_depth[:] = first_order[place]
                run._advance(device, kernels, options, callback, corrected, only_lower=only_lower)
                corrected = [place for place in corrected if run.statuses[place] is Status.MAX_ITERATIONS]
        return run

    def _advance(
        self,
        device: Device,
        kernels: Sequence[str],
        options: Options,
        callback: Callback | None,
        corrected: Sequence[int] | None = None,
        *,
        only_lower: bool = False,
    ) -> None:
        """Iterate from where the images are: all at first order, or some that are `corrected` to second order."""
        places = range(len(self.images)) if corrected is None else corrected
        done = max(map(len, self.changes))
        most = options["max_iterations"]
        if not places or done >= most:
            for place in places:
                self.statuses[place] = Status.MAX_ITERATIONS
            return
        began = time.perf_counter()
        sweeper = Sweeper(
            device,
            [self.images[place] for place in places],
            model=kernels,
            ordering=options["ordering"],
            precision=options["precision"],
            tolerance=options["tolerance"],
            linear=options["boundary"] == "extrapolate",
            second_order=corrected is not None,
            only_lower=only_lower,
            rests=self.settles,
        )
        self.build_seconds += time.perf_counter() - began
        if corrected is not None and not only_lower:
            # Where the surface is smooth this is ample; what still changes is decided one way or the other.
            most = min(most, done + max(_FREE_CORRECTIONS, sweeper.ordering.corrections * done))
        self.variant = sweeper.variant
        changes, statuses = _iterate(sweeper, most, options["tolerance"], callback, done)
        self.kernel_seconds += sweeper.kernel_seconds
        sweeper.copy_log_depth(self.images[place].log_depth for place in places)
        for number, place in enumerate(places):
            self.changes[place] += changes[number]
            self.statuses[place] = statuses[number]

    def surfaces(self, problems: Sequence[Problem]) -> list[LogDepthAndDepth]:
        """Log depth, in the place of the values, and depth of each image."""
        return [
            problem.depth(image.log_depth, converged=status is Status.CONVERGED)
            for problem, image, status in zip(problems, self.images, self.statuses, strict=True)
        ]


@dataclass
class Watch:
    """The user's callback, who may have asked to stop in the iteration that was the last anyway."""

    callback: Callback
    before: int = 0
    stopped: bool = False

    def __call__(self, iteration: int, change: float) -> bool:
        """Count on from the iterations of runs before."""
        self.stopped = bool(self.callback(self.before + iteration, change))
        return self.stopped


def stop_at_once(_iteration: int, _change: float) -> bool:
    """The callback of images that had not begun when the user's callback stopped the run."""
    return True


def _iterate(
    sweeper: Sweeper, max_iterations: int, tolerance: float, callback: Callback | None, done: int
) -> tuple[list[list[float]], list[Status]]:
    """Iterate until every image has converged, and record each one's changes; `done` iterations count already."""
    changes: list[list[float]] = [[] for _ in range(sweeper.count)]
    statuses = [Status.MAX_ITERATIONS] * sweeper.count
    active = set(range(sweeper.count))
    iteration, queued = done, 1 if callback else sweeper.queued_at_least
    while active and iteration < max_iterations:
        began = time.perf_counter()
        rows = sweeper.run(min(queued, max_iterations - iteration))
        for row in rows:
            if not active:
                break
            iteration += 1
            largest = max(float(row[image]) for image in active)
            for image in sorted(active):
                changes[image].append(float(row[image]))
                if row[image] <= tolerance:
                    statuses[image] = Status.CONVERGED
                    active.discard(image)
            if callback is not None and callback(iteration, largest):
                for image in active:
                    statuses[image] = Status.STOPPED
                return changes, statuses
        # A callback may stop the run after any iteration, so that with one none may be queued in advance.
        if callback is None:
            seconds = time.perf_counter() - began
            queued = max(sweeper.queued_at_least, min(4 * queued, int(queued * _QUEUE_SECONDS / seconds)))
    return changes, statuses
