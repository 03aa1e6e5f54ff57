"""How the errors of a method go down with its iterations, and how long these take."""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.metrics import Errors
from persfs_cl.paper import tankus
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.reconstruct import reconstruct

Measure = Callable[[Array], Errors]
"""Tells the errors of a depth map."""

PAPERS_OWN: dict[str, Any] = {"scheme": "lax-friedrichs", "stopping": "change", "acceleration": False}
"""What the paper's method is, as keywords of :func:`persfs_cl.reconstruct`."""


@dataclass(frozen=True)
class History:
    """Errors and times after some numbers of iterations.

    Attributes
    ----------
    iterations : tuple of int
        Ascending.
    mean, root_mean_square : tuple of float
        ME and RS after each of them.
    seconds : tuple of float, or None
        From the start; None where the time means nothing.
    """

    iterations: tuple[int, ...]
    mean: tuple[float, ...]
    root_mean_square: tuple[float, ...]
    seconds: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Outcome:
    """A history, and the depth map at its end."""

    history: History
    depth: Array


def told(scene: Scene) -> dict[str, Any]:
    """What both methods are told of a scene, as keywords."""
    return {"mask": scene.mask, "known_depth": scene.known_depth, "surface": scene.surface}


def followed(depths: Iterable[Array], measure: Measure, iterations: Sequence[int]) -> Outcome:
    """Errors of the depth maps after some numbers of iterations, the first map being that after one."""
    errors = []
    for number, depth in enumerate(itertools.islice(depths, iterations[-1]), 1):
        if number in iterations:
            errors.append(measure(depth))
    return Outcome(_history(iterations, errors), depth)


def sweeping(
    image: Array, camera: Camera, measure: Measure, iterations: Sequence[int], *, repeats: int = 0, **keywords: Any
) -> Outcome:
    """The history of :func:`persfs_cl.reconstruct`, run anew for each number of iterations.

    Parameters
    ----------
    image, camera
        As for :func:`persfs_cl.reconstruct`.
    measure : callable
    iterations : sequence of int
        Ascending. A run that has come to rest before stays as it is.
    repeats : int
        Each time is the median of so many, after one run that is not timed; 0 measures none.
    **keywords
        As for :func:`persfs_cl.reconstruct`; those not given are the paper's.
    """
    errors, times = [], []
    for number in iterations:
        options = {**PAPERS_OWN, **keywords, "max_iterations": number, "tolerance": 0.0}
        run = partial(reconstruct, image, camera, **options)
        depth = run().depth
        errors.append(measure(depth))
        times.append([_seconds(run) for _ in range(repeats)])
    return Outcome(_history(iterations, errors, times if repeats else None), depth)


def marching(
    image: Array, camera: Camera, measure: Measure, iterations: Sequence[int], *, repeats: int = 0, **keywords: Any
) -> Outcome:
    """The history of :func:`persfs_cl.paper.tankus.iterations`, with parameters as for :func:`sweeping`."""

    def depths() -> Iterator[Array]:
        for iterate in tankus.iterations(image, camera, **keywords):
            yield iterate.depth

    outcome = followed(depths(), measure, iterations)
    if not repeats:
        return outcome
    times: list[list[float]] = [[] for _ in iterations]
    for _ in range(repeats):
        began = time.perf_counter()
        for number, _depth in enumerate(itertools.islice(depths(), iterations[-1]), 1):
            if number in iterations:
                times[iterations.index(number)].append(time.perf_counter() - began)
    return replace(outcome, history=replace(outcome.history, seconds=_medians(times)))


def _history(
    iterations: Sequence[int], errors: Sequence[Errors], times: Sequence[list[float]] | None = None
) -> History:
    return History(
        tuple(iterations),
        tuple(error.mean for error in errors),
        tuple(error.root_mean_square for error in errors),
        None if times is None else _medians(times),
    )


def _medians(times: Sequence[list[float]]) -> tuple[float, ...]:
    return tuple(statistics.median(values) for values in times)


def _seconds(work: Callable[[], Any]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
