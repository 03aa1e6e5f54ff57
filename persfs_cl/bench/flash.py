"""How fast flash photographs become surfaces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import persfs_cl as ps
from persfs_cl.bench.accuracy import FLASH, scanned
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import RATE, RATE_UNIT, skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import TIME, TIME_UNIT, in_kernels, solved, time_record, timed
from persfs_cl.errors import InputError
from persfs_cl.scenes.framed import bumps
from persfs_cl.scenes.meshes import stanford_bunny
from persfs_cl.scenes.scene import Scene

PIXELS, PIXELS_UNIT = "pixels", "Mpx/s"
BUNNY = "bunny"

_SIZES = (512, 1024)


def flash(plan: Plan) -> Iterator[list[Record]]:
    """Time from call to return until flash photographs have converged by the upwind scheme, which is their default.

    The rate is that of the kernels: four sweeps of the pixels of the object an iteration, by the device's own clock.
    """
    sizes = plan.edges_up_to(_SIZES, _SIZES[-1])
    photographs: dict[str, Callable[[int], Scene]] = {"bump": _bump, "bump, 2 % noise": _noisy, "bumps": _bumps}
    try:
        photographs[BUNNY] = partial(scanned, stanford_bunny())
    except InputError as reason:
        yield [skip("flash", BUNNY, TIME, TIME_UNIT, size, plan.precision, str(reason)) for size in sizes]
    for name, make in photographs.items():
        for size in sizes:
            yield _measured(plan, name, make(size))


def _bump(size: int) -> Scene:
    return ps.bump((size, size), light=FLASH)


def _noisy(size: int) -> Scene:
    return ps.bump((size, size), light=FLASH, noise=0.02)


def _bumps(size: int) -> Scene:
    return bumps((size, size), light=FLASH)


def _measured(plan: Plan, photograph: str, scene: Scene) -> list[Record]:
    calls = {
        ordering: partial(solved, plan, scene, mask=scene.mask, ordering=ordering)
        for ordering in plan.parallel_orderings
    }
    solutions = {ordering: call() for ordering, call in calls.items()}
    timings = timed(plan, {ordering: in_kernels(call) for ordering, call in calls.items()})
    records = []
    for ordering, solution in solutions.items():
        timing, megapixels = timings[ordering], 1e-6 * float(solution.solved.sum())
        cells = 4 * solution.iterations * megapixels
        common: dict[str, Any] = {
            "experiment": "flash",
            "workload": f"{photograph}: {ordering}",
            "size": scene.image.shape[0],
            "images": 1,
            "precision": plan.precision,
            "iteration": solution.iterations,
            "detail": "converged" if solution.status is ps.Status.CONVERGED else "not converged",
        }
        records += [
            time_record(timing, **common),
            Record.of(timing.rates(megapixels), quantity=PIXELS, unit=PIXELS_UNIT, **common),
            Record.of(timing.device_rates(cells), quantity=RATE, unit=RATE_UNIT, **common),
        ]
    return records
