"""Time to a solution: everything that a user waits for, except compilation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.plan import SCHEMES, Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.timing import Timing, take_turns
from persfs_cl.errors import UnavailableError
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.upwind import Upwind

TIME = "time"
FAST_MARCHING = "scikit-fmm"

_UNIT = "ms"
_VASE_ITERATIONS = 30
_LARGEST_SIZE = 2048
# Beyond it Lax-Friedrichs takes minutes.
_LARGEST_LAX_FRIEDRICHS = 512
# Where the surface is flat, fast marching would arrive at once from everywhere.
_FLATTEST = 1e-3


@dataclass(frozen=True)
class Outcome:
    """A surface, how it was found, and the seconds that the device says it took."""

    depth: NDArray[np.float64]
    detail: str
    device_seconds: float | None


Solver = Callable[[], Outcome]


def small_image(plan: Plan) -> Iterator[list[Record]]:
    """The paper's vase of 100 × 100 pixels and its 30 iterations, from call to return."""
    scene = ps.vase()
    exactly = {"scheme": LaxFriedrichs.name, "max_iterations": _VASE_ITERATIONS, "tolerance": 0.0}
    solvers: dict[str, Solver] = {
        ordering: partial(_reconstruct, plan, scene, ordering, **exactly) for ordering in plan.orderings
    }
    # Single calls, and many: the median is what a user sees.
    timings = _timed(solvers, 10 * plan.repeats, 0.0)
    size = scene.image.shape[0]
    yield [_record(plan, "small", size, name, timings[name], solve().detail) for name, solve in solvers.items()]


def solutions(plan: Plan) -> Iterator[list[Record]]:
    """Time to a converged surface, compared with the fast marching of scikit-fmm on the same grid.

    scikit-fmm does not solve the shading equation: it is given the true |grad Z|, and recovers the same surface.
    """
    for size in [size for size in plan.edges() if size <= plan.size(_LARGEST_SIZE)]:
        scene = ps.bump((size, size))
        solvers: dict[str, Solver] = {}
        schemes = plan.schemes_or(SCHEMES)
        if Upwind.name in schemes:
            solvers[Upwind.name] = partial(_reconstruct, plan, scene, "wavefront", scheme=Upwind.name)
        if LaxFriedrichs.name in schemes and size <= plan.size(_LARGEST_LAX_FRIEDRICHS):
            solvers |= {
                ordering: partial(_reconstruct, plan, scene, ordering, scheme=LaxFriedrichs.name)
                for ordering in plan.orderings
                if ordering != "lexicographic"
            }
        skipped = []
        try:
            solvers[FAST_MARCHING] = _fast_marching(scene)
        except UnavailableError as reason:
            skipped.append(skip("solutions", FAST_MARCHING, TIME, _UNIT, size, "float64", str(reason)))
        timings = _timed(solvers, plan.repeats, plan.least_seconds)
        records = []
        for name, solve in solvers.items():
            outcome = solve()
            error = ps.compare(outcome.depth, scene.depth).mean / np.ptp(scene.depth)
            detail = f"{outcome.detail}, mean error {100.0 * error:.2g} % of the relief"
            if name != FAST_MARCHING and FAST_MARCHING in timings:
                pairs = zip(timings[FAST_MARCHING].wall, timings[name].wall, strict=True)
                detail += f", {np.median([other / own for other, own in pairs]):.2g} × scikit-fmm's speed"
            records.append(_record(plan, "solutions", size, name, timings[name], detail))
        yield records + skipped


def _reconstruct(plan: Plan, scene: ps.Scene, ordering: str, **keywords: Any) -> Outcome:
    solution = ps.reconstruct(
        scene.image,
        scene.camera,
        mask=scene.mask,
        known_depth=scene.known_depth,
        surface=scene.surface,
        ordering=ordering,
        device=plan.device,
        precision=plan.precision,
        **keywords,
    )
    converged = ", converged" if solution.status is ps.Status.CONVERGED else ""
    scheme = {"lax-friedrichs": "Lax-Friedrichs"}.get(solution.parameters["scheme"], solution.parameters["scheme"])
    detail = f"{scheme}, {solution.iterations} iterations{converged}"
    return Outcome(solution.depth, detail, solution.elapsed.kernels)


def _fast_marching(scene: ps.Scene) -> Solver:
    try:
        import skfmm
    except ImportError as error:
        raise UnavailableError(f"scikit-fmm cannot be imported ({error}): pip install 'persfs-cl[bench]'.") from error
    known = np.isfinite(scene.known_depth)
    grid = scene.camera.grid((scene.depth.shape[0], scene.depth.shape[1]))
    speed = 1.0 / np.maximum(np.hypot(*scene.log_depth_gradient), _FLATTEST)
    front = np.where(known, 0.0, 1.0)
    level = float(np.log(scene.depth[known].mean()))
    sign = 1.0 if scene.surface == "away" else -1.0

    def solve() -> Outcome:
        travelled = np.asarray(skfmm.travel_time(front, speed, dx=[grid.dy, grid.dx]))
        return Outcome(np.exp(level + sign * travelled), "the true slope given", None)

    return solve


def _timed(solvers: Mapping[str, Solver], repeats: int, least_seconds: float) -> dict[str, Timing]:
    works = {name: partial(_repeat, solve) for name, solve in solvers.items()}
    return take_turns(works, repeats=repeats, least_seconds=least_seconds)


def _repeat(solve: Solver, count: int) -> float | None:
    seconds = [solve().device_seconds for _ in range(count)]
    return None if None in seconds else sum(seconds)  # type: ignore[arg-type]


def _record(plan: Plan, experiment: str, size: int, name: str, timing: Timing, detail: str) -> Record:
    return Record.of(
        [1e3 * seconds for seconds in timing.wall],
        experiment=experiment,
        workload=name,
        quantity=TIME,
        unit=_UNIT,
        size=size,
        images=1,
        precision="float64" if name == FAST_MARCHING else plan.precision,
        by_device=1e3 * float(np.median(timing.device)) if timing.device else None,
        detail=detail,
    )
