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
from persfs_cl.solver.schemes import SCHEMES as SCHEMES_BY_NAME

ESTIMATE, TRUE, RATIO = "estimated distance", "true distance", "estimate over truth"
UNIT = "ln z"
NOT_TOLD = "not told"
NOT_ACCELERATED = "not accelerated"


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
        scene = make(size)
        runs = {f"{photograph}: {name}": keywords for name, keywords in _runs(plan, scheme, scene)}
        if not plan.device.has_float64:
            reason = f"{plan.device} has no double precision."
            yield [skip("distance", name, TRUE, UNIT, size, plan.precision, reason) for name in runs]
            continue
        solve = partial(solved, plan, scene, scheme=scheme, max_iterations=_MAX_ITERATIONS)
        limit = solve(precision="float64", tolerance=0.0, acceleration=False)
        yield [record for name, keywords in runs.items() for record in _compared(plan, name, solve(**keywords), limit)]


def _runs(plan: Plan, scheme: str, scene: Scene) -> Iterator[tuple[str, dict[str, Any]]]:
    """What is compared, by the name of the solver: where a run is accelerated, one too that is not."""
    for ordering in plan.parallel_orderings:
        yield f"{scheme}, {ordering}", {"ordering": ordering}
        if SCHEMES_BY_NAME[scheme].accelerates and not scene.light.determines_depth:
            yield f"{scheme}, {ordering}, {NOT_ACCELERATED}", {"ordering": ordering, "acceleration": False}


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
