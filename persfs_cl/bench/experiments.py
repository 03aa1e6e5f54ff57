"""The experiments: each yields its records group by group, as soon as they are measured."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

from persfs_cl._cl.cache import cache_folders
from persfs_cl._cl.orderings import ordering_for
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.choices import lanes_of_strips
from persfs_cl._cl.orderings.ordering import Ordering, Setup
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl.bench import fresh
from persfs_cl.bench.accuracy import accuracy, ambiguity, lamp, noise, reflectance
from persfs_cl.bench.alternatives import weno
from persfs_cl.bench.calibration import calibration
from persfs_cl.bench.calls import calls, small_image
from persfs_cl.bench.convergence import convergence
from persfs_cl.bench.distance import distance
from persfs_cl.bench.endoscopy import endoscopy
from persfs_cl.bench.flash import flash
from persfs_cl.bench.folder import folder
from persfs_cl.bench.guided import guided
from persfs_cl.bench.masked import masked
from persfs_cl.bench.memory import memory
from persfs_cl.bench.outline import outline
from persfs_cl.bench.painted import painted
from persfs_cl.bench.photograph import photograph
from persfs_cl.bench.plan import SCHEMES, Plan
from persfs_cl.bench.rates import PLAIN_C, RATE, RATE_UNIT, available, measured, numpy_baseline, skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.roofline import roofline
from persfs_cl.bench.tasks import tasks
from persfs_cl.bench.terrain import energy, priors, terrain
from persfs_cl.bench.workloads import Workload, iterations, smooth_problem, sweeper, sweeps_alone

Experiment = Callable[[Plan], Iterator[list[Record]]]

_NUMPY_SIZE = 256
_BATCH_SIZE = 512


def orderings(plan: Plan) -> Iterator[list[Record]]:
    """Orderings and yardsticks side by side, at one size: sweeps alone, and whole iterations."""
    size, precision = plan.size(), plan.precision
    baselines, skipped = available("orderings", (PLAIN_C, "numba"), size, precision)
    workloads = []
    for scheme in plan.schemes_or(SCHEMES):
        problem = smooth_problem(size, scheme)
        for ordering in plan.orderings:
            sweeps = sweeper(plan.device, problem, ordering, precision)
            if sweeps.ordering.single_sweeps:
                workloads.append(sweeps_alone(_named(ordering, scheme), plan.device, sweeps, problem))
            workloads.append(iterations(_named(f"{ordering}, iterations", scheme), sweeps, problem))
    yield measured(plan, "orderings", size, precision, [*workloads, *baselines]) + skipped
    small = plan.size(_NUMPY_SIZE)
    yield measured(plan, "orderings", small, "float64", [numpy_baseline(small)])


def sizes(plan: Plan) -> Iterator[list[Record]]:
    """How the rate of whole iterations depends on the size of the image."""
    for size in plan.edges():
        baselines, skipped = available("sizes", (PLAIN_C,), size, plan.precision)
        workloads = _iterations(plan, size, plan.orderings)
        yield measured(plan, "sizes", size, plan.precision, [*workloads, *baselines]) + skipped


def batch(plan: Plan) -> Iterator[list[Record]]:
    """How the rate of whole iterations depends on the number of images that share launches."""
    size = plan.size(_BATCH_SIZE)
    for images in plan.batch:
        baselines, skipped = available("batch", (PLAIN_C,), size, plan.precision)
        workloads = _iterations(plan, size, plan.parallel_orderings, images=images)
        yield measured(plan, "batch", size, plan.precision, [*workloads, *baselines], images=images) + skipped


def precision(plan: Plan) -> Iterator[list[Record]]:
    """Single and double precision."""
    size = plan.size()
    for real in ("float32", "float64"):
        if real == "float64" and not plan.device.has_float64:
            reason = f"{plan.device} has no double precision."
            yield [skip("precision", name, RATE, RATE_UNIT, size, real, reason) for name in plan.orderings]
            continue
        baselines, skipped = available("precision", (PLAIN_C,), size, real)
        workloads = _iterations(replace(plan, precision=real), size, plan.orderings)
        yield measured(plan, "precision", size, real, [*workloads, *baselines]) + skipped


def tunings(plan: Plan) -> Iterator[list[Record]]:
    """The ways in which a device can be made to do the same sweeps: strips, bands, tiles, vectors, work-groups."""
    size = plan.size()
    for scheme in plan.schemes_or():
        problem = smooth_problem(size, scheme)
        # By what they come to: the one chosen is among the candidates, and a small image has use for few groups.
        workloads: dict[str, Workload] = {}
        setup = Setup(plan.device, plan.precision, (size, size), 1, settles=problem.scheme.settles)
        for ordering, candidates in _candidates(plan, setup).items():
            chosen = ordering_for(ordering, setup)
            for candidate in (chosen, *candidates):
                sweeps = sweeper(plan.device, problem, candidate, plan.precision)
                workload = iterations("", sweeps, problem)
                name, detail = _named(workload.detail, scheme), "chosen" if candidate is chosen else ""
                workloads.setdefault(name, replace(workload, name=name, detail=detail))
        yield measured(plan, "tunings", size, plan.precision, workloads.values())


def _candidates(plan: Plan, setup: Setup) -> dict[str, list[Ordering]]:
    """By name, the orderings asked for that it may have on the device."""
    wide = lanes_of_strips(setup)
    # Few groups of one item suit processors, which run it at full speed.
    groups = plan.groups() if wide > 1 else ()
    strips = product([rows for rows in plan.strip_rows if not rows % wide], groups)
    bands = product(plan.widths(), plan.heights(setup.shape[1]), groups)
    candidates: dict[str, list[Ordering]] = {
        "wavefront": [
            *(WavefrontStrips(wide, vectors=rows // wide, work_groups=count) for rows, count in strips),
            *(WavefrontTiles(tile=tile) for tile in plan.tiles),
        ],
        "checkerboard": [
            *(CheckerboardBands(width, band_rows=rows, work_groups=count) for width, rows, count in bands),
            *(Checkerboard(width) for width in plan.widths()),
        ],
    }
    return {ordering: candidates[ordering] for ordering in plan.orderings if ordering in candidates}


def compilation(plan: Plan) -> Iterator[list[Record]]:
    """What compiling costs: a first reconstruction less the second one, in a process of its own."""
    for ordering in plan.orderings:
        arguments = ("compilation", str(plan.device.index), ordering, plan.precision)
        seconds: dict[str, list[float]] = {"empty caches": [], "filled caches": []}
        for _ in range(max(1, plan.repeats // 2)):
            with tempfile.TemporaryDirectory(prefix="persfs-cl-") as folder:
                caches = cache_folders(Path(folder))
                for values in seconds.values():
                    took = fresh.run_fresh(*arguments, environment=caches)
                    values.append(took["first"] - took["second"])
        yield [
            Record.of(
                values,
                experiment="compilation",
                workload=ordering,
                quantity=f"build, {state}",
                unit="s",
                size=0,
                images=1,
                precision=plan.precision,
            )
            for state, values in seconds.items()
        ]


def _iterations(plan: Plan, size: int, orderings: Sequence[str], *, images: int = 1) -> list[Workload]:
    workloads = []
    for scheme in plan.schemes_or():
        problem = smooth_problem(size, scheme)
        for ordering in orderings:
            sweeps = sweeper(plan.device, problem, ordering, plan.precision, images=images)
            workloads.append(iterations(_named(ordering, scheme), sweeps, problem))
    return workloads


def _named(workload: str, scheme: str) -> str:
    """What a workload is called: the scheme is told where it is not that of the plain C sweep."""
    return workload if scheme == SCHEMES[0] else f"{workload}, {scheme}"


EXPERIMENTS: dict[str, Experiment] = {
    "orderings": orderings,
    "sizes": sizes,
    "batch": batch,
    "precision": precision,
    "tunings": tunings,
    "roofline": roofline,
    "calls": calls,
    "flash": flash,
    "masked": masked,
    "small": small_image,
    "convergence": convergence,
    "distance": distance,
    "accuracy": accuracy,
    "noise": noise,
    "reflectance": reflectance,
    "ambiguity": ambiguity,
    "lamp": lamp,
    "calibration": calibration,
    "guided": guided,
    "endoscopy": endoscopy,
    "weno": weno,
    "terrain": terrain,
    "priors": priors,
    "outline": outline,
    "painted": painted,
    "energy": energy,
    "folder": folder,
    "photograph": photograph,
    "compilation": compilation,
    "memory": memory,
    "tasks": tasks,
}
"""By name, in the order in which they run."""
