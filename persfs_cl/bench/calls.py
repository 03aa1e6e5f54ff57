"""Whole calls: everything that a user waits for between an image and its depth, except compilation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.plan import SCHEMES, Plan
from persfs_cl.bench.rates import PLAIN_C, available, measured, skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import TIME, TIME_UNIT, Solve, in_kernels, solved, time_record, timed
from persfs_cl.bench.workloads import LIGHT, Workload, smooth_frame, smooth_image, smooth_problem, swept_cells
from persfs_cl.errors import UnavailableError
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.upwind import Upwind

FAST_MARCHING = "scikit-fmm"
SPEED = f"speed over {FAST_MARCHING}"
LIGHTS = {"parallel light": ps.ParallelLight(), "flash": ps.FlashLight()}

_ITERATIONS = 25
_VASE_ITERATIONS = 30
_BATCH_SIZE = 512
_CONVERGED_SIZES = (512, 2048)
# Where the surface is flat, fast marching would arrive at once from everywhere.
_FLATTEST = 1e-3


def calls(plan: Plan) -> Iterator[list[Record]]:
    """Calls of `reconstruct` and `reconstruct_batch`, over plain C and over the fast marching of scikit-fmm.

    Of Lax-Friedrichs so many iterations as would do the same sweeps in plain C. By the upwind scheme until the surface
    has converged, and beside that scikit-fmm, which does not solve the shading equation: it is given the true |grad Z|
    and the depth of the frame, and recovers the same surface.
    """
    schemes = plan.schemes_or(SCHEMES)
    if LaxFriedrichs.name in schemes:
        yield _over_plain_c(plan, plan.size(), 1)
        yield _over_plain_c(plan, plan.size(_BATCH_SIZE), max(plan.batch))
    if Upwind.name in schemes:
        for light, size in product(LIGHTS, plan.edges_up_to(_CONVERGED_SIZES, _CONVERGED_SIZES[-1])):
            yield _over_fast_marching(plan, light, size)


def small_image(plan: Plan) -> Iterator[list[Record]]:
    """The paper's vase of 100 × 100 pixels and its 30 iterations, from call to return."""
    scene = ps.vase()
    exactly = {
        "scheme": LaxFriedrichs.name,
        "max_iterations": _VASE_ITERATIONS,
        "tolerance": 0.0,
        "acceleration": False,
    }
    solve = {
        ordering: partial(solved, plan, scene, mask=scene.mask, ordering=ordering, **exactly)
        for ordering in plan.orderings
    }
    # Single calls, and many: the median is what a user sees.
    solvers = {name: in_kernels(call) for name, call in solve.items()}
    timings = timed(plan, solvers, repeats=10 * plan.repeats, least_seconds=0.0)
    common: dict[str, Any] = {"experiment": "small", "size": scene.image.shape[0], "images": 1}
    yield [
        time_record(
            timings[name], workload=name, precision=plan.precision, detail=f"{call().iterations} iterations", **common
        )
        for name, call in solve.items()
    ]


def _over_plain_c(plan: Plan, size: int, images: int) -> list[Record]:
    """Rates of whole calls, as if they were sweeps and nothing else, and the rate of plain sweeps."""
    baselines, skipped = available("calls", (PLAIN_C,), size, plan.precision)
    # The yardstick of the kernels' own is in other experiments, and here it would take most of the time.
    wholes = [_whole(plan, size, images, ordering) for ordering in plan.parallel_orderings]
    return measured(plan, "calls", size, plan.precision, [*wholes, *baselines], images=images) + skipped


def _whole(plan: Plan, size: int, images: int, ordering: str) -> Workload:
    """Whole calls, whose units are the sweeps that they do."""
    camera, frame = ps.Camera(float(size)), smooth_frame(size)
    # Each image another one, as in life.
    photographs = [smooth_image(size) * (1.0 - 0.2 * number / images) for number in range(images)]
    options: dict[str, Any] = {
        "light": LIGHT,
        "scheme": LaxFriedrichs.name,
        "boundary": "fixed",
        "ordering": ordering,
        "max_iterations": _ITERATIONS,
        "tolerance": 0.0,
        "acceleration": False,
        "device": plan.device,
        "precision": plan.precision,
    }

    def solve() -> Sequence[ps.Solution]:
        if images == 1:
            return [ps.reconstruct(photographs[0], camera, known_depth=frame, **options)]
        return ps.reconstruct_batch(photographs, camera, known_depth=[frame] * images, **options)

    # A tiny image may be at rest before.
    iterations = max(solution.iterations for solution in solve())

    def work(count: int) -> float:
        return sum(solution.elapsed.kernels for _ in range(count // (4 * iterations)) for solution in solve())

    name = "reconstruct" if images == 1 else "reconstruct_batch"
    cells = images * swept_cells(smooth_problem(size))
    return Workload(f"{name}, {ordering}", work, cells, f"{iterations} iterations", step=4 * iterations)


def _over_fast_marching(plan: Plan, light: str, size: int) -> list[Record]:
    """Times to a converged surface, and how many times the speed of scikit-fmm the upwind scheme has."""
    scene = ps.bump((size, size), light=LIGHTS[light])
    call = partial(solved, plan, scene, scheme=Upwind.name)
    solution = call()
    how = f"{solution.iterations} iterations, {'' if solution.status is ps.Status.CONVERGED else 'not '}converged"
    solvers: dict[str, Solve] = {Upwind.name: in_kernels(call)}
    details = {Upwind.name: f"{how}, {_error(solution.depth, scene)}"}
    common: dict[str, Any] = {"experiment": "calls", "size": size, "images": 1}
    skipped = []
    try:
        march = _fast_marching(scene)
    except UnavailableError as reason:
        name = f"{light}, {FAST_MARCHING}"
        skipped.append(skip("calls", name, TIME, TIME_UNIT, size, "float64", str(reason)))
    else:
        details[FAST_MARCHING] = f"the true slope given, {_error(march(), scene)}"
        solvers[FAST_MARCHING] = partial(_without_device, march)
    timings = timed(plan, solvers)
    records = [
        time_record(
            timings[name],
            workload=f"{light}, {name}",
            precision="float64" if name == FAST_MARCHING else plan.precision,
            detail=detail,
            **common,
        )
        for name, detail in details.items()
    ]
    if FAST_MARCHING in timings:
        speeds = timings[FAST_MARCHING].over(timings[Upwind.name])
        name = f"{light}, {Upwind.name}"
        records.append(Record.of(speeds, workload=name, quantity=SPEED, unit="×", precision=plan.precision, **common))
    return records + skipped


def _fast_marching(scene: Scene) -> Callable[[], NDArray[np.float64]]:
    """What finds the depth from the true slopes.

    Raises
    ------
    UnavailableError
        When scikit-fmm is not installed.
    """
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

    def depth() -> NDArray[np.float64]:
        travelled = np.asarray(skfmm.travel_time(front, speed, dx=[grid.dy, grid.dx]))
        return np.exp(level + sign * travelled)

    return depth


def _without_device(march: Callable[[], NDArray[np.float64]]) -> None:
    march()


def _error(depth: NDArray[np.float64], scene: Scene) -> str:
    share = 100.0 * ps.compare(depth, scene.depth).mean / float(np.ptp(scene.depth))
    return f"mean error {share:.2g} % of the relief"
