"""Iterations of images that share launches, until each has converged."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.image import Image
from persfs_cl._cl.multigrid import Multigrid
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.solver.acceleration import ITERATIONS, Acceleration
from persfs_cl.solver.complete import tolerance_of
from persfs_cl.solver.distance import distance_to_limit
from persfs_cl.solver.multigrid import LEAST_ITERATIONS, ROUNDINGS, Cycles, Descent, Hierarchy, descend
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.outcome import Status

LogDepthAndDepth = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Log depth and depth."""

_FREE_CORRECTIONS = 40
"""Iterations of second order in which values may rise, at least."""

_QUEUE_SECONDS = 0.03
"""Iterations are queued so many at a time as take about this long: few waits, and Ctrl-C is still heard at once."""

_MARGIN = 2.0
"""Of the estimated distance, by which mixtures may have come out too low."""

_DITHER = 2.0
"""By how many spacings of the numbers about 1 values go up and down that have arrived."""

_STEP = math.sqrt(0.5)
"""From one threshold of the change to the next: some iterations too many at most, and few waits."""


@dataclass
class Iteration:
    """What the iteration of some images that share launches came to, one entry an image.

    The values of `images` are those that the iteration has reached, `distances` estimates how far they are from the
    limit. `resting` is the option of that name, or 0 where no block was left alone for it.
    """

    images: list[Image]
    changes: list[list[float]]
    statuses: list[Status]
    distances: list[float]
    variant: str
    build_seconds: float = 0.0
    kernel_seconds: float = 0.0
    resting: float = 0.0

    @classmethod
    def of(cls, device: Device, problems: Sequence[Problem], options: Options, callback: Callback | None) -> Iteration:
        """Iterate to convergence at first order, and from there at second order if that is wanted."""
        images = [problem.kernel_arguments for problem in problems]
        run = cls(images, [[] for _ in images], [Status.CONVERGED] * len(images), [math.nan] * len(images), "")
        kernels = problems[0].kernels
        by_distance = options["acceleration"] and options["stopping"] == "distance"
        accelerated = [place for place, problem in enumerate(problems) if by_distance and problem.accelerates]
        plain = [place for place in range(len(problems)) if place not in accelerated]
        mixed = run._by_multigrid(device, problems, options, callback, accelerated)
        pixels = [min(problems[place].grid.dx, problems[place].grid.dy) for place in mixed]
        mixing = partial(_accelerate, pixels=pixels)
        run._advance(device, kernels, options, run._told(callback), mixed, only_lower=False, by=mixing)
        for place in accelerated:
            if run.statuses[place] is Status.MAX_ITERATIONS and len(run.changes[place]) < options["max_iterations"]:
                run._raise(problems[place], place)
                plain.append(place)
        run._advance(device, kernels, options, run._told(callback), plain)
        if options["accuracy_order"] == 2:
            corrected = [place for place, status in enumerate(run.statuses) if status is Status.CONVERGED]
            first_order = {place: run.images[place].log_depth.copy() for place in corrected}
            for only_lower in (False, True):
                if only_lower:
                    # What does not settle may have gone anywhere.
                    for place in corrected:
                        run.images[place].log_depth[:] = first_order[place]
                run._advance(device, kernels, options, callback, corrected, second_order=True, only_lower=only_lower)
                corrected = [place for place in corrected if run.statuses[place] is Status.MAX_ITERATIONS]
        return run

    def _told(self, callback: Callback | None) -> Callback | None:
        """What images are to be told that come later than others."""
        return stop_at_once if Status.STOPPED in self.statuses else callback

    def _by_multigrid(
        self,
        device: Device,
        problems: Sequence[Problem],
        options: Options,
        callback: Callback | None,
        places: Sequence[int],
    ) -> list[int]:
        """Take those images near their limit for which multigrid is; gives the others, which are as they were.

        The ordering assigns values once more, and so says itself, whichever it is, how much is left to change.
        """
        cycles = self._descend(device, problems, options, callback, places)
        solved = [place for place, own in cycles.items() if not own.failed]
        arrived = [place for place in solved if cycles[place].converged]
        if Status.STOPPED in self.statuses:
            for place in arrived:
                self.statuses[place] = Status.CONVERGED
            arrived = []
        else:
            # Others have no iterations left but one, or go on from where they are.
            last = [place for place in solved if place in arrived or not cycles[place].ended]
            distances, there = [self.distances[place] for place in last], [place in arrived for place in last]
            by = partial(_confirm, distances=distances, arrived=there)
            self._advance(device, problems[0].kernels, options, callback, last, only_lower=False, by=by)
        if cycles:
            self.variant = ", ".join(filter(None, ["multigrid", self.variant]))
        strayed = [place for place in arrived if self.statuses[place] is Status.MAX_ITERATIONS]
        for place in strayed:
            self.images[place] = problems[place].kernel_arguments
        left = [place for place in places if place not in solved or place in strayed]
        # Of what was stopped in vain the start is left, and no iteration more is asked for.
        return [place for place in left if not (self.statuses[place] is Status.STOPPED and self.changes[place])]

    def _descend(
        self,
        device: Device,
        problems: Sequence[Problem],
        options: Options,
        callback: Callback | None,
        places: Sequence[int],
    ) -> dict[int, Cycles]:
        """The cycles of each of those images for which multigrid is; one iteration is left to come after them."""
        began = time.perf_counter()
        if options["max_iterations"] < LEAST_ITERATIONS:
            return {}
        hierarchies = {place: found for place in places if (found := Hierarchy.of(problems[place]))}
        if not hierarchies:
            return {}
        stop = _Stop(options, dithers=False)
        descents: dict[int, Descent] = {}
        for place, hierarchy in hierarchies.items():
            grids = Multigrid(
                device,
                self.images[place],
                hierarchy.levels,
                part=hierarchy.part,
                model=problems[place].kernels,
                precision=options["precision"],
            )
            cycles = Cycles(stop.rounding, stop.tolerance)
            descents[place] = Descent(grids, cycles, options["max_iterations"] - 1)
        self.build_seconds += time.perf_counter() - began
        stopped = descend(list(descents.values()), callback)
        for place, descent in descents.items():
            self.changes[place] += descent.changes
            self.kernel_seconds += descent.grids.kernel_seconds
            self.statuses[place] = Status.STOPPED if stopped else Status.MAX_ITERATIONS
            if not descent.cycles.failed:
                self.distances[place] = descent.cycles.distance
                part = hierarchies[place].part
                values, solved = self.images[place].log_depth, problems[place].domain.solved[part]
                values[part] = np.where(solved, descent.grids.log_depth(), values[part])
        return {place: descent.cycles for place, descent in descents.items()}

    def _advance(
        self,
        device: Device,
        kernels: Sequence[str],
        options: Options,
        callback: Callback | None,
        places: Sequence[int],
        *,
        second_order: bool = False,
        only_lower: bool = True,
        by: Callable[[_Iterations, Sweeper, _Stop], _Ends] | None = None,
    ) -> None:
        """Iterate some images from where they are, until they have converged or as a function says.

        Of that function nothing is known, so that every cell is computed in every sweep: it may change values between.
        """
        most = options["max_iterations"]
        for place in places:
            self.statuses[place] = Status.MAX_ITERATIONS
        places = [place for place in places if len(self.changes[place]) < most]
        if not places:
            return
        began = time.perf_counter()
        stop = _Stop(options, dithers=second_order and not only_lower)
        sweeper = Sweeper(
            device,
            [self.images[place] for place in places],
            model=kernels,
            ordering=options["ordering"],
            precision=options["precision"],
            tolerance=stop.tolerance,
            linear=options["boundary"] == "extrapolate",
            second_order=second_order,
            only_lower=only_lower,
            rests=by is None,
            resting=options["resting"],
        )
        self.build_seconds += time.perf_counter() - began
        done = [len(self.changes[place]) for place in places]
        limits = [most - count for count in done]
        if second_order and not only_lower:
            # Where the surface is smooth this is ample; what still changes is decided one way or the other.
            ample = [max(_FREE_CORRECTIONS, sweeper.ordering.corrections * count) for count in done]
            limits = [min(pair) for pair in zip(limits, ample, strict=True)]
        self.variant = sweeper.variant
        if sweeper.ordering.drifts:
            stop.resting = self.resting = options["resting"]
        iterations = _Iterations(sweeper, limits, callback, max(done))
        ends = (by or _iterate)(iterations, sweeper, stop)
        self.kernel_seconds += sweeper.kernel_seconds
        sweeper.copy_log_depth(self.images[place].log_depth for place in places)
        for number, place in enumerate(places):
            self.changes[place] += iterations.changes[number]
            self.statuses[place] = ends.statuses[number]
            self.distances[place] = ends.distances[number]

    def _raise(self, problem: Problem, place: int) -> None:
        """Put an image above its limit, whatever mixtures have made of it, so that values that only fall reach that."""
        self.images[place].log_depth[problem.domain.solved] += _MARGIN * self.distances[place]

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
            Iteration([image], [changes], [status], [distance], self.variant, build, kernels, self.resting)
            for image, changes, status, distance in zip(
                self.images, self.changes, self.statuses, self.distances, strict=True
            )
        ]


@dataclass
class Watch:
    """The user's callback, who may have asked to stop in the iteration that was the last anyway."""

    callback: Callback
    before: int = 0
    last: int = 0
    stopped: bool = False

    def __call__(self, iteration: int, change: float) -> bool:
        """Count on from the iterations of runs before."""
        self.last = self.before + iteration
        self.stopped = bool(self.callback(self.last, change)) or self.stopped
        return self.stopped

    def go_on(self) -> None:
        """Let the next run count on from the last iteration, whichever image of several that was of."""
        self.before = self.last

    def begin(self) -> None:
        """Let the next run count from 1."""
        self.before = self.last = 0


def stop_at_once(_iteration: int, _change: float) -> bool:
    """The callback of images that had not begun when the user's callback stopped the run."""
    return True


class _Stop:
    """When an image has converged: by the distance to its limit, or by the change of an iteration alone.

    An image rests on the device once its change meets a threshold, and goes on at a lower one if its distance is not
    small enough then. So all that is decided of an image depends on its own changes, whatever shares its launches, and
    iterations may be queued many at a time. Values that may rise as well as fall dither in the end, by rounding: then
    they have arrived.
    """

    def __init__(self, options: Options, *, dithers: bool) -> None:
        self._by_distance = options["stopping"] == "distance"
        self.rounding = float(np.finfo(options["precision"]).eps)
        self._nothing = _DITHER * self.rounding if dithers else 0.0
        self.tolerance = max(tolerance_of(options), self._nothing)
        self.resting = 0.0

    def distance(self, changes: Sequence[float]) -> float:
        """See :func:`persfs_cl.solver.distance.distance_to_limit`; and what blocks that rest leave."""
        return distance_to_limit(changes, self.rounding) + self.resting

    def met(self, changes: Sequence[float]) -> bool:
        """Whether an image has converged that rests."""
        return not self._by_distance or changes[-1] <= self._nothing or self.distance(changes) <= self.tolerance

    def lower(self, threshold: float, change: float) -> float:
        """The next threshold below a change that was not small enough."""
        steps = math.floor(math.log(change / threshold) / math.log(_STEP)) + 1
        return threshold * _STEP ** max(1, steps)


class _Iterations:
    """Those of a sweeper, and the changes of each image.

    `limits` says how many there may be of each image; `done` is what the callback counts on from.
    """

    def __init__(self, sweeper: Sweeper, limits: Sequence[int], callback: Callback | None, done: int) -> None:
        self.changes: list[list[float]] = [[] for _ in range(sweeper.count)]
        self.done = done
        self.stopped = False
        self._sweeper, self._limits, self._callback = sweeper, limits, callback
        # A callback may stop the run after any iteration, so that with one none may be queued in advance.
        self._queued = 1 if callback else sweeper.queued_at_least

    def left(self, image: int) -> int:
        """How many there may still be."""
        return self._limits[image] - len(self.changes[image])

    def run(self, going: Set[int], threshold: float, most: int | None = None) -> set[int]:
        """Some iterations of images, at `most` so many; gives those of which the last met the threshold, and rest."""
        began = time.perf_counter()
        counts = [self._queued, *([] if most is None else [most]), *map(self.left, going)]
        resting: set[int] = set()
        for row in self._sweeper.run(min(counts)):
            active = sorted(going - resting)
            if not active or self.stopped:
                break
            self.done += 1
            for image in active:
                self.changes[image].append(float(row[image]))
                if row[image] <= threshold:
                    resting.add(image)
            if self._callback is not None:
                self.stopped = bool(self._callback(self.done, max(float(row[image]) for image in active)))
        if self._callback is None:
            seconds = time.perf_counter() - began
            least, most_useful = self._sweeper.queued_at_least, int(min(counts) * _QUEUE_SECONDS / seconds)
            self._queued = max(least, min(4 * self._queued, most_useful))
        return resting


@dataclass
class _Ends:
    """How the iteration of each image ended, and how far it is from its limit."""

    statuses: list[Status]
    distances: list[float]

    @classmethod
    def of(cls, count: int) -> _Ends:
        """As long as they go on."""
        return cls([Status.MAX_ITERATIONS] * count, [math.nan] * count)

    def stop(self, images: Iterable[int]) -> None:
        """Those that still went on."""
        for image in images:
            self.statuses[image] = Status.STOPPED


def _iterate(iterations: _Iterations, sweeper: Sweeper, stop: _Stop) -> _Ends:
    """Iterate until every image has converged."""
    ends = _Ends.of(sweeper.count)
    changes = iterations.changes
    thresholds = dict.fromkeys(range(sweeper.count), stop.tolerance)
    while thresholds and not iterations.stopped:
        threshold = max(thresholds.values())
        going = {image for image, own in thresholds.items() if own == threshold}
        resting: set[int] = set()
        while going and not iterations.stopped:
            sweeper.go_on(going, threshold)
            resting |= iterations.run(going, threshold)
            for image in going - resting:
                if not iterations.left(image):
                    del thresholds[image]
            going -= resting
            going &= thresholds.keys()
        for image in resting:
            if stop.met(changes[image]):
                ends.statuses[image] = Status.CONVERGED
            if ends.statuses[image] is Status.CONVERGED or not iterations.left(image):
                del thresholds[image]
            else:
                thresholds[image] = stop.lower(threshold, changes[image][-1])
    ends.distances = [stop.distance(own) for own in changes]
    if iterations.stopped:
        ends.stop(thresholds)
    return ends


def _confirm(
    iterations: _Iterations, sweeper: Sweeper, stop: _Stop, distances: Sequence[float], arrived: Sequence[bool]
) -> _Ends:
    """An iteration of images of which some have arrived, that far from their limit; NaN is for not known."""
    ends = _Ends(_Ends.of(sweeper.count).statuses, list(distances))
    everyone = set(range(sweeper.count))
    sweeper.go_on(everyone, 0.0)
    iterations.run(everyone, 0.0, 1)
    # Were the values wrong the scheme would have more to change.
    enough = max(stop.tolerance, ROUNDINGS * stop.rounding)
    for image, is_there in enumerate(arrived):
        if is_there and iterations.changes[image][-1] <= enough:
            ends.statuses[image] = Status.CONVERGED
    if iterations.stopped:
        ends.stop(image for image in everyone if ends.statuses[image] is not Status.CONVERGED)
    return ends


def _accelerate(iterations: _Iterations, sweeper: Sweeper, stop: _Stop, pixels: Sequence[float]) -> _Ends:
    """Iterate with mixtures in between, until each image has converged or mixtures help no more.

    `pixels` are the smaller sides of the pixels of each image, at unit distance.
    """
    ends = _Ends.of(sweeper.count)
    mixer = sweeper.mixer()
    images = [Acceleration(stop.rounding, pixel) for pixel in pixels]
    going = set(range(sweeper.count))
    while going and not iterations.stopped:
        sweeper.go_on(going, 0.0)
        until = iterations.done + ITERATIONS
        while going and iterations.done < until and not iterations.stopped:
            for image in iterations.run(going, 0.0, until - iterations.done):
                ends.statuses[image] = Status.CONVERGED
                images[image].distance = stop.distance(iterations.changes[image])
                going.remove(image)
            going = {image for image in going if iterations.left(image)}
        due = [image for image in sorted(going) if images[image].is_due(iterations.changes[image][-1])]
        if due and not iterations.stopped:
            found = dict(zip(due, mixer.products(due), strict=True))
            mixer.mix({image: images[image].weights(products) for image, products in found.items()})
            for image in due:
                if images[image].is_astray:
                    mixer.begin_again(image)
                elif images[image].distance <= stop.tolerance or (images[image].is_rounding and stop.tolerance > 0.0):
                    ends.statuses[image] = Status.CONVERGED
            going -= {image for image in due if images[image].gives_up}
            going = {image for image in going if ends.statuses[image] is not Status.CONVERGED}
    ends.distances = [image.distance for image in images]
    if iterations.stopped:
        ends.stop(going)
    return ends
