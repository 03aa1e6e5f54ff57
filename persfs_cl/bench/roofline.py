"""How much of what the device can do the sweeps use: its memory, and its multiply-adds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from persfs_cl._cl.probes import copier, device_seconds, multiplier
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.timing import Work, take_turns
from persfs_cl.bench.workloads import Workload, iterations, smooth_problem, sweeper, sweeps_alone

OPERATIONS_A_CELL = 34
"""Additions and multiplications of a Lax-Friedrichs update; its square root and division are not counted."""

_LARGE_COPY = 2**28
_STEP = 4


def roofline(plan: Plan) -> Iterator[list[Record]]:
    """Copy bandwidth and multiply-add rate of the device, and the shares of them that the orderings reach.

    The sweeps are compared with copies of arrays as large as the image, which lie in the same caches; larger copies
    show the memory behind them.
    """
    size, device = plan.size(), plan.device
    itemsize = np.dtype(plan.precision).itemsize
    problem = smooth_problem(size)
    arrays = {
        "copy, as large as the image": -(-size * size * itemsize // 64) * 64,
        "copy, 256 MiB": min(_LARGE_COPY, device.memory // 1024 * 64),
    }
    multiply, operations = multiplier(device, plan.precision)
    works: dict[str, Work] = {name: _on_device(plan, copier(device, length)) for name, length in arrays.items()}
    works["multiply-adds"] = _on_device(plan, multiply)
    workloads: dict[str, Workload] = {}
    moved: dict[str, int] = {}
    for ordering in plan.orderings:
        sweeps = sweeper(device, problem, ordering, plan.precision)
        alone = sweeps.ordering.single_sweeps
        workloads[ordering] = (
            sweeps_alone(ordering, device, sweeps, problem) if alone else iterations(ordering, sweeps, problem)
        )
        works[ordering] = workloads[ordering].work
        moved[ordering] = itemsize * sweeps.ordering.numbers_a_cell
    timings = take_turns(works, repeats=plan.repeats, least_seconds=plan.least_seconds, step=_STEP)

    def record(values: list[float], workload: str, quantity: str, unit: str, detail: str) -> Record:
        return Record.of(
            values,
            experiment="roofline",
            workload=workload,
            quantity=quantity,
            unit=unit,
            size=size if workload in workloads or "image" in workload else 0,
            images=1,
            precision=plan.precision,
            detail=detail,
        )

    bandwidths = {name: timings[name].rates(2e-9 * length) for name, length in arrays.items()}
    arithmetic = timings["multiply-adds"].rates(1e-9 * operations)
    records = [record(rates, name, "bandwidth", "GB/s", "read and written") for name, rates in bandwidths.items()]
    records.append(record(arithmetic, "multiply-adds", "arithmetic", "Gflop/s", "two operations each"))
    nearest = bandwidths["copy, as large as the image"]
    for name, workload in workloads.items():
        for quantity, unit_a_cell, limits, detail in (
            ("share of copy bandwidth", moved[name], nearest, f"{moved[name]} B a cell"),
            ("share of multiply-adds", OPERATIONS_A_CELL, arithmetic, f"{OPERATIONS_A_CELL} operations a cell"),
        ):
            rates = timings[name].rates(1e-9 * unit_a_cell * workload.cells)
            shares = [100.0 * rate / limit for rate, limit in zip(rates, limits, strict=True)]
            records.append(record(shares, name, quantity, "%", detail))
    yield records


def _on_device(plan: Plan, queue: Callable[[int], None]) -> Work:
    return lambda count: device_seconds(plan.device, lambda: queue(count))
