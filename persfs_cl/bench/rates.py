"""Sweeps in cell updates per second, beside the plain C sweep of the same rounds."""

from __future__ import annotations

import statistics
from collections.abc import Iterable

from persfs_cl.bench.peers import Peer, numba_loop, numpy_diagonals, plain_c
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.subjects import Subject, smooth_problem, swept_cells
from persfs_cl.bench.timing import Timing, take_turns
from persfs_cl.errors import UnavailableError

PLAIN_C = "plain C"
RATE = "rate"
RATE_UNIT = "Mc/s"
"""Million cell updates a second."""

_MAKERS = {PLAIN_C: plain_c, "numba": numba_loop}
_NUMPY = "NumPy twin"
YARDSTICKS = (*_MAKERS, _NUMPY)


def measured(
    plan: Plan, experiment: str, size: int, precision: str, subjects: Iterable[Subject], *, images: int = 1
) -> list[Record]:
    """Rates of subjects that take turns; beside that of the plain C sweep, if that is among them and does the same."""
    listed = list(subjects)
    timings = timed(plan, listed)
    baseline = timings.get(PLAIN_C)
    cells = {subject.name: subject.cells for subject in listed}
    records = []
    for subject in listed:
        timing = timings[subject.name]
        rates = timing.rates(1e-6 * subject.cells)
        on_device = timing.device_rates(1e-6 * subject.cells)
        factor = None
        if baseline and subject.like_plain_c:
            pairs = zip(rates, baseline.rates(1e-6 * cells[PLAIN_C]), strict=True)
            factor = statistics.median(rate / plain for rate, plain in pairs)
        records.append(
            Record.of(
                rates,
                experiment=experiment,
                subject=subject.name,
                quantity=RATE,
                unit=RATE_UNIT,
                size=size,
                images=1 if subject.name in _MAKERS else images,
                precision=precision,
                by_device=statistics.median(on_device) if on_device else None,
                factor=factor,
                detail=subject.detail,
            )
        )
    return records


def timed(plan: Plan, subjects: Iterable[Subject]) -> dict[str, Timing]:
    """Seconds of one sweep of each subject."""
    subjects = list(subjects)
    works = {subject.name: subject.work for subject in subjects}
    steps = {subject.name: subject.step for subject in subjects}
    return take_turns(works, repeats=plan.repeats, least_seconds=plan.least_seconds, steps=steps)


def peer(name: str, size: int, precision: str) -> Subject:
    """A yardstick by its name, on an image of a size.

    Raises
    ------
    UnavailableError
        When it cannot be had here.
    """
    problem = smooth_problem(size)
    made: Peer = _MAKERS[name](problem.numbers, precision)
    return Subject(name, made.work, swept_cells(problem), made.detail)


def numpy_peer(size: int) -> Subject:
    """The twin in NumPy, which judges the kernels and is not made for speed."""
    problem = smooth_problem(size)
    made = numpy_diagonals(problem)
    return Subject(_NUMPY, made.work, swept_cells(problem), made.detail)


def available(experiment: str, names: Iterable[str], size: int, precision: str) -> tuple[list[Subject], list[Record]]:
    """Those yardsticks that can be had, and for the others records that say why not."""
    found, skipped = [], []
    for name in names:
        try:
            found.append(peer(name, size, precision))
        except UnavailableError as reason:
            skipped.append(skip(experiment, name, RATE, RATE_UNIT, size, precision, str(reason)))
    return found, skipped


def skip(experiment: str, subject: str, quantity: str, unit: str, size: int, precision: str, reason: str) -> Record:
    """The record of what was not measured, and why."""
    return Record(experiment, subject, quantity, unit, size, 1, precision, detail=f"skipped: {reason}")
