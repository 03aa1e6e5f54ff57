"""Solutions of scenes, and how long they take from call to return."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import persfs_cl as ps
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.timing import Timing, take_turns
from persfs_cl.scenes.scene import Scene

TIME, TIME_UNIT = "time", "ms"

Solve = Callable[[], float | None]
"""Solves once, and returns the device's own seconds where there are any."""


def solved(plan: Plan, scene: Scene, **keywords: Any) -> ps.Solution:
    """What the solver makes of the photograph; under a parallel light it is told the known depths."""
    given: dict[str, Any] = {"light": scene.light, "reflectance": scene.reflectance}
    if scene.light.flat_rim:
        given |= {"known_depth": scene.known_depth, "surface": scene.surface}
    options = {**given, "device": plan.device, "precision": plan.precision, **keywords}
    return ps.reconstruct(scene.image, scene.camera, **options)


def in_kernels(call: Callable[[], ps.Solution]) -> Solve:
    """The call as something to be timed."""
    return lambda: call().elapsed.kernels


def timed(
    plan: Plan, solvers: Mapping[str, Solve], *, repeats: int | None = None, least_seconds: float | None = None
) -> dict[str, Timing]:
    """Seconds of each of several that take turns, as often and as long as planned unless told otherwise."""
    works = {name: partial(_repeat, solve) for name, solve in solvers.items()}
    return take_turns(
        works,
        repeats=plan.repeats if repeats is None else repeats,
        least_seconds=plan.least_seconds if least_seconds is None else least_seconds,
    )


def time_record(timing: Timing, **others: Any) -> Record:
    """Milliseconds from call to return; `others` are the remaining attributes of the record."""
    return Record.of(
        [1e3 * seconds for seconds in timing.wall],
        quantity=TIME,
        unit=TIME_UNIT,
        by_device=1e3 * statistics.median(timing.device) if timing.device else None,
        **others,
    )


def _repeat(solve: Solve, count: int) -> float | None:
    seconds = [solve() for _ in range(count)]
    return None if None in seconds else sum(seconds)  # type: ignore[arg-type]
