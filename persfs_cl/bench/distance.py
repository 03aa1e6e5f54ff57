"""How far from its limit a solver says that it has ended, and how far it has."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import Any

import numpy as np

import persfs_cl as ps
from persfs_cl.bench.accuracy import FLASH, SCENES
from persfs_cl.bench.plan import SCHEMES, Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import solved
from persfs_cl.scenes.framed import bumps
from persfs_cl.scenes.scene import Scene

ESTIMATE, TRUE, RATIO = "estimated distance", "true distance", "estimate over truth"
UNIT = "ln z"
NOT_TOLD = "not told"


def _noisy(size: int) -> Scene:
    return bumps((size, size), light=FLASH, noise=0.02)


PHOTOGRAPHS: dict[str, Callable[[int], Scene]] = {
    **{name: SCENES[name] for name in ("bump, frontal, away", "bump, oblique, toward", "hill, flash")},
    "bumps, flash, 2 % noise": _noisy,
}

_SIZES = (192, 768)
_MAX_ITERATIONS = 20_000


def distance(plan: Plan) -> Iterator[list[Record]]:
    """`Solution.distance` with the default tolerance, compared with max |Z - limit|.

    The limit is that of the scheme, in double precision, iterated until nothing changes; both orderings have the same.
    At second order there is none to compare with: rounding decides at some pixels which neighbours are taken.
    """
    sizes = plan.edges_up_to(_SIZES, _SIZES[-1])
    for (photograph, make), size, scheme in product(PHOTOGRAPHS.items(), sizes, plan.schemes_or(SCHEMES)):
        names = {ordering: f"{photograph}: {scheme}, {ordering}" for ordering in plan.parallel_orderings}
        if not plan.device.has_float64:
            reason = f"{plan.device} has no double precision."
            yield [skip("distance", name, TRUE, UNIT, size, plan.precision, reason) for name in names.values()]
            continue
        solve = partial(solved, plan, make(size), scheme=scheme, max_iterations=_MAX_ITERATIONS)
        limit = solve(precision="float64", tolerance=0.0)
        yield [
            record
            for ordering, name in names.items()
            for record in _compared(plan, name, solve(ordering=ordering), limit)
        ]


def _compared(plan: Plan, name: str, solution: ps.Solution, limit: ps.Solution) -> list[Record]:
    true = float(np.nanmax(np.abs(solution.log_depth - limit.log_depth)))
    ends = [f"tolerance {solution.parameters['tolerance']:g}"]
    if solution.status is not ps.Status.CONVERGED:
        ends.append("not converged")
    if limit.status is not ps.Status.CONVERGED:
        ends.append("the limit not at rest")
    common: dict[str, Any] = {
        "experiment": "distance",
        "workload": name,
        "size": solution.depth.shape[0],
        "images": 1,
        "precision": plan.precision,
        "iteration": solution.iterations,
    }
    detail = ", ".join(ends)
    records = [Record.of([true], quantity=TRUE, unit=UNIT, detail=detail, **common)]
    estimate = float(solution.distance)
    if math.isnan(estimate):
        records.append(Record(quantity=ESTIMATE, unit=UNIT, detail=NOT_TOLD, **common))
    else:
        records.append(Record.of([estimate], quantity=ESTIMATE, unit=UNIT, detail=detail, **common))
        if true > 0.0:
            records.append(Record.of([estimate / true], quantity=RATIO, unit="", detail=detail, **common))
    return records
