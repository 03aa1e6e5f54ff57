"""How the error falls from iteration to iteration, and from millisecond to millisecond."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.workloads import sweeper
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare

ERROR, ELAPSED = "largest error", "elapsed"

_SIZE = 256
_MAX_ITERATIONS = 2000
# Of ln z: a relative error of the depth.
_GOAL = 1e-4
_LIMIT = 1e-9


def convergence(plan: Plan) -> Iterator[list[Record]]:
    """Largest error of ln z after each iteration, against the solution of the same scheme in the limit.

    The time is the device's own, of iterations queued one at a time. An ordering is followed until its error is
    below 0.0001.
    """
    size = plan.size(_SIZE)
    scene = ps.bump((size, size))
    options = complete(
        {
            "light": scene.light,
            "reflectance": scene.reflectance,
            "scheme": "lax-friedrichs",
            "surface": scene.surface,
            "boundary": "fixed",
        }
    )
    problem = prepare(scene.image, scene.camera, None, None, scene.known_depth, options=options)
    limit = _limit(plan, problem)
    for ordering in plan.orderings:
        runs = [_run(plan, problem, ordering, limit) for _ in range(plan.repeats)]
        errors = runs[0][0]
        records = []
        for number, error in enumerate(errors):
            common = {
                "experiment": "convergence",
                "workload": ordering,
                "size": size,
                "images": 1,
                "precision": plan.precision,
                "iteration": number + 1,
            }
            records.append(Record.of([error], quantity=ERROR, unit="ln z", **common))
            elapsed = [1e3 * seconds[number] for _, seconds in runs]
            records.append(Record.of(elapsed, quantity=ELAPSED, unit="ms", **common))
        yield records


def _run(plan: Plan, problem: Problem, ordering: str, limit: NDArray[np.floating]) -> tuple[list[float], list[float]]:
    """Errors, and seconds since the start, after each iteration."""
    sweeps = sweeper(plan.device, problem, ordering, plan.precision)
    errors: list[float] = []
    seconds: list[float] = []
    while len(errors) < _MAX_ITERATIONS and (not errors or errors[-1] > _GOAL):
        sweeps.run(1)
        seconds.append(sweeps.kernel_seconds)
        errors.append(float(np.abs(sweeps.log_depth()[0] - limit).max()))
    return errors, seconds


def _limit(plan: Plan, problem: Problem) -> NDArray[np.floating]:
    """What the iteration tends to, in the best precision that the device has."""
    precision = "float64" if plan.device.has_float64 else "float32"
    sweeps = sweeper(plan.device, problem, "wavefront", precision)
    for _ in range(0, _MAX_ITERATIONS, 10):
        if sweeps.run(10)[-1, 0] <= _LIMIT:
            break
    values: NDArray[np.floating] = sweeps.log_depth()[0]
    return values
