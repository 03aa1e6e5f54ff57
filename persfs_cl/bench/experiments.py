"""The experiments: each yields its records group by group, as soon as they are measured."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from persfs_cl._cl.tuning import Tuning
from persfs_cl.bench import fresh
from persfs_cl.bench.accuracy import accuracy, ambiguity, flash, reflectance
from persfs_cl.bench.convergence import convergence
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import PLAIN_C, RATE, RATE_UNIT, available, measured, numpy_peer, skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.roofline import roofline
from persfs_cl.bench.solutions import small_image, solutions
from persfs_cl.bench.subjects import (
    Subject,
    iterations,
    smooth_problem,
    steps_by_sweeps,
    sweeper,
    sweeps_alone,
    swept_cells,
)

Experiment = Callable[[Plan], Iterator[list[Record]]]

_NUMPY_SIZE = 256
_BATCH_SIZE = 512
_BANDS = (1, 2, 3, 4)
_BAND_PIXELS = (2**11, 2**12, 2**13, 2**14)
_MEMORY_SIZE = 4096


def orderings(plan: Plan) -> Iterator[list[Record]]:
    """Orderings and yardsticks side by side, at one size: sweeps alone, and whole iterations."""
    size, precision = plan.size(), plan.precision
    peers, skipped = available("orderings", (PLAIN_C, "numba"), size, precision)
    problem = smooth_problem(size)
    grid, cells = problem.numbers, swept_cells(problem)
    subjects = []
    for ordering in plan.orderings:
        sweeps = sweeper(plan.device, [grid], ordering, precision)
        if steps_by_sweeps(sweeps):
            subjects.append(sweeps_alone(ordering, plan.device, sweeps, cells))
        subjects.append(iterations(f"{ordering}, iterations", sweeps, cells))
    yield measured(plan, "orderings", size, precision, [*subjects, *peers]) + skipped
    small = plan.size(_NUMPY_SIZE)
    yield measured(plan, "orderings", small, "float64", [numpy_peer(small)])


def sizes(plan: Plan) -> Iterator[list[Record]]:
    """How the rate of whole iterations depends on the size of the image."""
    for size in plan.edges():
        peers, skipped = available("sizes", (PLAIN_C,), size, plan.precision)
        yield measured(plan, "sizes", size, plan.precision, [*_iterations(plan, size), *peers]) + skipped


def batch(plan: Plan) -> Iterator[list[Record]]:
    """How the rate of whole iterations depends on the number of images that share launches."""
    size = plan.size(_BATCH_SIZE)
    problem = smooth_problem(size)
    grid, cells = problem.numbers, swept_cells(problem)
    for images in plan.batch:
        peers, skipped = available("batch", (PLAIN_C,), size, plan.precision)
        subjects = [
            iterations(ordering, sweeper(plan.device, [grid] * images, ordering, plan.precision), cells)
            for ordering in plan.orderings
            if ordering != "lexicographic"
        ]
        yield measured(plan, "batch", size, plan.precision, [*subjects, *peers], images=images) + skipped


def precision(plan: Plan) -> Iterator[list[Record]]:
    """Single and double precision."""
    size = plan.size()
    for real in ("float32", "float64"):
        if real == "float64" and not plan.device.has_float64:
            reason = f"{plan.device} has no double precision."
            yield [skip("precision", name, RATE, RATE_UNIT, size, real, reason) for name in plan.orderings]
            continue
        peers, skipped = available("precision", (PLAIN_C,), size, real)
        subjects = _iterations(replace(plan, precision=real), size)
        yield measured(plan, "precision", size, real, [*subjects, *peers]) + skipped


def tunings(plan: Plan) -> Iterator[list[Record]]:
    """The ways in which a device can be made to do the same sweeps: strips, tiles, vectors, work-groups."""
    size, units = plan.size(), plan.device.compute_units
    problem = smooth_problem(size)
    grid, cells = problem.numbers, swept_cells(problem)
    groups = sorted({1, max(1, units // 2), units})
    strips = [Tuning("wavefront_strips", 8, bands, count) for bands in _BANDS for count in groups]
    bands = [
        Tuning("checkerboard_bands", 8, work_groups=count, band_rows=max(1, pixels // size))
        for pixels in _BAND_PIXELS
        for count in groups
    ]
    # These are for processors that run a work-group's single item at full speed.
    vectors = {"wavefront": strips, "checkerboard": bands} if plan.device.kind == "cpu" else {}
    items = {"wavefront": [Tuning("wavefront_tiles")], "checkerboard": [Tuning("checkerboard", n) for n in (1, 8)]}
    # By what they come to: the one chosen is among the candidates, and a small image has use for few groups.
    subjects: dict[str, Subject] = {}
    for ordering, others in items.items():
        chosen = Tuning.of(plan.device, ordering, (size, size), 1)
        for tuning in (chosen, *vectors.get(ordering, ()), *others):
            subject = iterations("", sweeper(plan.device, [grid], ordering, plan.precision, tuning), cells)
            detail = "chosen" if tuning is chosen else ""
            subjects.setdefault(subject.detail, replace(subject, name=subject.detail, detail=detail))
    yield measured(plan, "tunings", size, plan.precision, subjects.values())


def compilation(plan: Plan) -> Iterator[list[Record]]:
    """What compiling costs: a first reconstruction less the second one, in a process of its own."""
    for ordering in plan.orderings:
        arguments = ("compilation", str(plan.device.index), ordering, plan.precision)
        seconds: dict[str, list[float]] = {"empty caches": [], "filled caches": []}
        for _ in range(max(1, plan.repeats // 2)):
            with tempfile.TemporaryDirectory(prefix="persfs-cl-") as folder:
                caches = fresh.cache_folders(Path(folder))
                for values in seconds.values():
                    took = fresh.run_fresh(*arguments, environment=caches)
                    values.append(took["first"] - took["second"])
        yield [
            Record.of(
                values,
                experiment="compilation",
                subject=ordering,
                quantity=f"build, {state}",
                unit="s",
                size=0,
                images=1,
                precision=plan.precision,
            )
            for state, values in seconds.items()
        ]


def memory(plan: Plan) -> Iterator[list[Record]]:
    """Peak memory of a process that reconstructs one image."""
    size = plan.size(_MEMORY_SIZE)
    used = fresh.run_fresh("memory", str(plan.device.index), str(size), plan.precision)
    on_host = " and its device's arrays, which are memory of the host too" if plan.device.kind == "cpu" else ""
    values = {
        "peak memory": (used["peak"] / 2**20, "MiB", f"of the process{on_host}"),
        "before the image": (used["before"] / 2**20, "MiB", "interpreter, libraries and driver"),
        "memory a pixel": ((used["peak"] - used["before"]) / size**2, "B", "what the image adds"),
    }
    yield [
        Record.of(
            [value],
            experiment="memory",
            subject="wavefront",
            quantity=quantity,
            unit=unit,
            size=size,
            images=1,
            precision=plan.precision,
            detail=detail,
        )
        for quantity, (value, unit, detail) in values.items()
    ]


def _iterations(plan: Plan, size: int) -> list[Subject]:
    problem = smooth_problem(size)
    grid, cells = problem.numbers, swept_cells(problem)
    return [
        iterations(ordering, sweeper(plan.device, [grid], ordering, plan.precision), cells)
        for ordering in plan.orderings
    ]


EXPERIMENTS: dict[str, Experiment] = {
    "orderings": orderings,
    "sizes": sizes,
    "batch": batch,
    "precision": precision,
    "tunings": tunings,
    "roofline": roofline,
    "small": small_image,
    "convergence": convergence,
    "solutions": solutions,
    "accuracy": accuracy,
    "flash": flash,
    "reflectance": reflectance,
    "ambiguity": ambiguity,
    "compilation": compilation,
    "memory": memory,
}
"""By name, in the order in which they run."""
