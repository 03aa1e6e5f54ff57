"""Iterations of images that share launches, until each has converged."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.image import Image
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.solver.distance import distance_to_limit
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.solution import Status

LogDepthAndDepth = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Log depth and depth."""

_FREE_CORRECTIONS = 40
"""Iterations of second order in which values may rise, at least."""

_QUEUE_SECONDS = 0.03
"""Iterations are queued so many at a time as take about this long: few waits, and Ctrl-C is still heard at once."""

_STEP = math.sqrt(0.5)
"""From one threshold of the change to the next: some iterations too many at most, and few waits."""


@dataclass
class Iteration:
    """What the iteration of some images that share launches came to, one entry an image.

    The values of `images` are those that the iteration has reached, `distances` estimates how far they are from the
    limit.
    """

    images: list[Image]
    changes: list[list[float]]
    statuses: list[Status]
    distances: list[float]
    variant: str
    build_seconds: float = 0.0
    kernel_seconds: float = 0.0

    @classmethod
    def of(cls, device: Device, problems: Sequence[Problem], options: Options, callback: Callback | None) -> Iteration:
        """Iterate to convergence at first order, and from there at second order if that is wanted."""
        images = [problem.kernel_arguments for problem in problems]
        run = cls(images, [[] for _ in images], [Status.CONVERGED] * len(images), [math.nan] * len(images), "")
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
        most = options["max_iterations"]
        for place in places:
            self.statuses[place] = Status.MAX_ITERATIONS
        places = [place for place in places if len(self.changes[place]) < most]
        if not places:
            return
        began = time.perf_counter()
        stop = _Stop(options)
        sweeper = Sweeper(
            device,
            [self.images[place] for place in places],
            model=kernels,
            ordering=options["ordering"],
            precision=options["precision"],
            tolerance=stop.tolerance,
            linear=options["boundary"] == "extrapolate",
            second_order=corrected is not None,
            only_lower=only_lower,
        )
        self.build_seconds += time.perf_counter() - began
        done = [len(self.changes[place]) for place in places]
        limits = [most - count for count in done]
        if corrected is not None and not only_lower:
            # Where the surface is smooth this is ample; what still changes is decided one way or the other.
            ample = [max(_FREE_CORRECTIONS, sweeper.ordering.corrections * count) for count in done]
            limits = [min(pair) for pair in zip(limits, ample, strict=True)]
        self.variant = sweeper.variant
        changes, statuses = _iterate(sweeper, limits, stop, callback, max(done))
        self.kernel_seconds += sweeper.kernel_seconds
        sweeper.copy_log_depth(self.images[place].log_depth for place in places)
        for number, place in enumerate(places):
            self.changes[place] += changes[number]
            self.statuses[place] = statuses[number]
            self.distances[place] = stop.distance(changes[number])

    def surfaces(self, problems: Sequence[Problem]) -> list[LogDepthAndDepth]:
        """Log depth, in the place of the values, and depth of each image."""
        return [
            problem.depth(image.log_depth, converged=status is Status.CONVERGED)
            for problem, image, status in zip(problems, self.images, self.statuses, strict=True)
        ]

    def split(self) -> list[Iteration]:
        """One for each image, with its share of the time, so that none holds the others."""
        build, kernels = (seconds / len(self.images) for seconds in (self.build_seconds, self.kernel_seconds))
        return [
            Iteration([image], [changes], [status], [distance], self.variant, build, kernels)
            for image, changes, status, distance in zip(
                self.images, self.changes, self.statuses, self.distances, strict=True
            )
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


class _Stop:
    """When an image has converged: by the distance to its limit, or by the change of an iteration alone.

    An image rests on the device once its change meets a threshold, and goes on at a lower one if its distance is not
    small enough then. So all that is decided of an image depends on its own changes, whatever shares its launches, and
    iterations may be queued many at a time.
    """

    def __init__(self, options: Options) -> None:
        self.tolerance = options["tolerance"]
        self._by_distance = options["stopping"] == "distance"
        self._rounding = float(np.finfo(options["precision"]).eps)

    def distance(self, changes: Sequence[float]) -> float:
        """See :func:`persfs_cl.solver.distance.distance_to_limit`."""
        return distance_to_limit(changes, self._rounding)

    def met(self, changes: Sequence[float]) -> bool:
        """Whether an image has converged that rests."""
        return not self._by_distance or changes[-1] == 0.0 or self.distance(changes) <= self.tolerance

    def lower(self, threshold: float, change: float) -> float:
        """The next threshold below a change that was not small enough."""
        steps = math.floor(math.log(change / threshold) / math.log(_STEP)) + 1
        return threshold * _STEP ** max(1, steps)


def _iterate(
    sweeper: Sweeper, limits: Sequence[int], stop: _Stop, callback: Callback | None, done: int
) -> tuple[list[list[float]], list[Status]]:
    """Iterate until every image has converged, and record each one's changes.

    `limits` says how many iterations of each image there may be; `done` is what the callback counts on from.
    """
    changes: list[list[float]] = [[] for _ in range(sweeper.count)]
    statuses = [Status.MAX_ITERATIONS] * sweeper.count
    thresholds = dict.fromkeys(range(sweeper.count), stop.tolerance)
    queued = 1 if callback else sweeper.queued_at_least
    while thresholds:
        threshold = max(thresholds.values())
        going = {image for image, own in thresholds.items() if own == threshold}
        resting: set[int] = set()
        stopped = False
        while going and not stopped:
            sweeper.go_on(going, threshold)
            began = time.perf_counter()
            rows = sweeper.run(min(queued, *(limits[image] - len(changes[image]) for image in going)))
            for row in rows:
                if not going or stopped:
                    break
                done += 1
                largest = max(float(row[image]) for image in going)
                for image in sorted(going):
                    changes[image].append(float(row[image]))
                    if row[image] <= threshold:
                        resting.add(image)
                    elif len(changes[image]) == limits[image]:
                        del thresholds[image]
                going -= resting
                going &= thresholds.keys()
                stopped = callback is not None and bool(callback(done, largest))
            # A callback may stop the run after any iteration, so that with one none may be queued in advance.
            if callback is None:
                seconds = time.perf_counter() - began
                queued = max(sweeper.queued_at_least, min(4 * queued, int(queued * _QUEUE_SECONDS / seconds)))
        for image in resting:
            if stop.met(changes[image]):
                statuses[image] = Status.CONVERGED
            if statuses[image] is Status.CONVERGED or len(changes[image]) == limits[image]:
                del thresholds[image]
            else:
                thresholds[image] = stop.lower(threshold, changes[image][-1])
        if stopped:
            for image in thresholds:
                statuses[image] = Status.STOPPED
            break
    return changes, statuses
