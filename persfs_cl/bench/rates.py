"""Sweeps in cell updates per second, compared with the plain C sweep of the same rounds."""

from __future__ import annotations

import statistics
from collections.abc import Iterable

from persfs_cl.bench.baselines import Baseline, numba_loop, numpy_diagonals, plain_c
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.timing import Timing, take_turns
from persfs_cl.bench.workloads import Workload, smooth_problem, swept_cells
from persfs_cl.errors import UnavailableError

PLAIN_C = "plain C"
RATE = "rate"
RATE_UNIT = "Mc/s"
"""Million cell updates a second."""

_MAKERS = {PLAIN_C: plain_c, "numba": numba_loop}
_NUMPY = "NumPy reference"
YARDSTICKS = (*_MAKERS, _NUMPY)


def measured(
    plan: Plan, experiment: str, size: int, precision: str, workloads: Iterable[Workload], *, images: int = 1
) -> list[Record]:
    """Rates of workloads that take turns; as factors of plain C's too, if that is among them and does the same."""
    listed = list(workloads)
    timings = timed(plan, listed)
    baseline = timings.get(PLAIN_C)
    cells = {workload.name: workload.cells for workload in listed}
    records = []
    for workload in listed:
        timing = timings[workload.name]
        rates = timing.rates(1e-6 * workload.cells)
        on_device = timing.device_rates(1e-6 * workload.cells)
        factor = None
        if baseline and workload.like_plain_c:
            pairs = zip(rates, baseline.rates(1e-6 * cells[PLAIN_C]), strict=True)
            factor = statistics.median(rate / plain for rate, plain in pairs)
        records.append(
            Record.of(
                rates,
                experiment=experiment,
                workload=workload.name,
                quantity=RATE,
                unit=RATE_UNIT,
                size=size,
                images=1 if workload.name in _MAKERS else images,
                precision=precision,
                by_device=statistics.median(on_device) if on_device else None,
                factor=factor,
                detail=workload.detail,
            )
        )
    return records


def timed(plan: Plan, workloads: Iterable[Workload]) -> dict[str, Timing]:
    """Seconds of one sweep of each workload."""
    workloads = list(workloads)
    works = {workload.name: workload.work for workload in workloads}
    steps = {workload.name: workload.step for workload in workloads}
    return take_turns(works, repeats=plan.repeats, least_seconds=plan.least_seconds, steps=steps)


def baseline(name: str, size: int, precision: str) -> Workload:
    """A yardstick by its name, on an image of a size.

    Raises
    ------
    UnavailableError
        When it cannot be had here.
    """
    problem = smooth_problem(size)
    made: Baseline = _MAKERS[name](problem.kernel_arguments, precision)
    return Workload(name, made.work, swept_cells(problem), made.detail)


def numpy_baseline(size: int) -> Workload:
    """The reference in NumPy, which the kernels are tested against, and which is not made for speed."""
    problem = smooth_problem(size)
    made = numpy_diagonals(problem)
    return Workload(_NUMPY, made.work, swept_cells(problem), made.detail)


def available(experiment: str, names: Iterable[str], size: int, precision: str) -> tuple[list[Workload], list[Record]]:
    """Those yardsticks that can be had, and for the others records that say why not."""
    found, skipped = [], []
    for name in names:
        try:
            found.append(baseline(name, size, precision))
        except UnavailableError as reason:
            skipped.append(skip(experiment, name, RATE, RATE_UNIT, size, precision, str(reason)))
    return found, skipped


def skip(experiment: str, workload: str, quantity: str, unit: str, size: int, precision: str, reason: str) -> Record:
    """The record of what was not measured, and why."""
    return Record(experiment, workload, quantity, unit, size, 1, precision, detail=f"skipped: {reason}")
