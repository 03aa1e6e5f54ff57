"""The cases on a device, compared with what the reference says of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.multigrid import Multigrid
from persfs_cl._cl.orderings import ordering_for
from persfs_cl._cl.orderings.ordering import Setup
from persfs_cl._cl.probes import copier, device_seconds
from persfs_cl._cl.selftest import explain
from persfs_cl._cl.smoothing import Smoother
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.bench.workloads import iterations, smooth_problem
from persfs_cl.bench.workloads import sweeper as sweeper_that_never_rests
from persfs_cl.scenes.framed import bumps
from persfs_cl.selftest.cases import FIRST, Case
from persfs_cl.selftest.energy import PAINTED, PLAIN, derivative, descent_of, multiplied, rough
from persfs_cl.selftest.outcome import Outcome
from persfs_cl.selftest.references import (
    ENDS,
    TOLERANCES,
    ReferenceValues,
    apart,
    distance_from_settled,
    limit_is_near,
    problem_of,
)
from persfs_cl.selftest.scenes import LARGE, SMALL, framed, smooth
from persfs_cl.selftest.smoothing import noisy_plates, smoothed_from_blocks
from persfs_cl.solver.multigrid import Cycles, Descent, Hierarchy, descend
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reference import Reference
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.surface.geometry import log_depth_gradient
from persfs_cl.surface.render import render

_Result = TypeVar("_Result")

_STEPS, _LARGE_STEPS = 4, 2
"""Iterations after which values are compared: by then all kinds of updates have been done."""
_ITERATIONS_AT_A_TIME, _MOST_ITERATIONS = 50, 2000
_SETTLED = 0.03
"""Of a tolerance, what an iteration may change in the limit."""
_SECOND_ORDER_SHARE = 0.6
"""Of the error at first order, which the correction must undercut."""

_RENDERED = (23, 31)
_SMOOTHED, _LEVELS = (23, 38), 2
_WHITE, _DAMPING, _LENGTH = 0.1, 1e-3, 0.25
_DIRECTIONS, _OF_DIFFERENCES = 3, 1e-5
_MOST_STEPS, _REDUCTIONS, _SOLVED = 300, {"float32": 1e-6, "float64": 1e-9}, 1e-3
"""Steps of conjugate gradients, where they end, and what may be left of the equations."""
_RATE_SIZES = {"cpu": 512, "gpu": 2048, "other": 512}
_SERIAL_SIZE = 96
"""The lexicographic ordering has one work-item, which on a GPU is slow."""
_COPIED = {"cpu": 2**26, "gpu": 2**28, "other": 2**26}
_LEAST_SECONDS = 0.1


@dataclass
class Checks:
    """The cases of one device, with what several of them need.

    Attributes
    ----------
    device : Device
    compiled : callable
        Called when the kernels of a case have run for the first time.
    """

    device: Device
    compiled: Callable[[], None] = lambda: None
    _reference: ReferenceValues = field(default_factory=ReferenceValues)
    _limits: dict[object, NDArray[np.float64]] = field(default_factory=dict)
    _serial: dict[object, tuple[NDArray[np.float64], NDArray[np.floating]]] = field(default_factory=dict)

    def run(self, case: Case) -> Outcome:
        """Do one case."""
        work: Callable[[Case, Outcome], None] = {
            "sweeps": self._sweeps,
            "shared image": self._shared_image,
            "second order": self._second_order,
            "multigrid": self._multigrid,
            "render": self._render,
            "smoothing": self._smoothing,
            "energy": self._energy,
            "rate": self._rate,
            "copy": self._copy,
        }[case.kind]
        outcome = Outcome()
        work(case, outcome)
        return outcome

    def _sweeps(self, case: Case, outcome: Outcome) -> None:
        """Some iterations and, where that can be had in good time, the limit."""
        problem = problem_of(case, SMALL)
        tolerance = TOLERANCES[case.precision]
        sweeper = self._sweeper(case, problem, outcome)
        changes = [self._first_runs(sweeper, outcome), sweeper.run(_STEPS - 2)]
        same_iterates = SCHEMES[case.scheme].same_iterates
        if same_iterates:
            values = sweeper.log_depth()[0]
            expected = self._reference.iterated(case, _STEPS, coloured=sweeper.ordering.coloured)
            outcome.compare(f"values after {_STEPS} iterations", apart(values, expected), tolerance)
        if not same_iterates or limit_is_near(case):
            changes += self._to_the_limit(sweeper, case)
            values = sweeper.log_depth()[0]
            if same_iterates:
                outcome.compare("values in the limit", apart(values, self._reference.limit(case)), tolerance)
            else:
                self._compare_upwind_limit(case, outcome, problem, values)
        self._compare_bits(case, outcome, np.concatenate(changes), sweeper)

    def _shared_image(self, case: Case, outcome: Outcome) -> None:
        """An image that several work-groups share."""
        problem = problem_of(case, LARGE)
        sweeper = self._sweeper(case, problem, outcome)
        changes = self._first_runs(sweeper, outcome)
        values = sweeper.log_depth()[0]
        if sweeper.ordering.coloured:
            # The reference takes its time for the others, of which the one has the bits of the other.
            expected = self._reference.iterated(case, _LARGE_STEPS, coloured=True)
            # Rounded as the start values are, which in a large image are in the thousands.
            rounding = 4.0 * float(np.finfo(case.precision).eps) * float(problem.start.max())
            tolerance = max(TOLERANCES[case.precision], rounding)
            outcome.compare(f"values after {_LARGE_STEPS} iterations", apart(values, expected), tolerance)
        self._compare_bits(case, outcome, changes, sweeper)

    def _second_order(self, case: Case, outcome: Outcome) -> None:
        """From the limit of first order to that of second, which must lie nearer to the true surface."""
        scene, problem = smooth(case.light_source, case.reflectance)
        truth, errors, start = np.log(scene.depth), [], problem
        for second_order in (False, True):
            sweeper = self._sweeper(case, start, outcome, second_order=second_order)
            changes = [self._first_runs(sweeper, outcome)]
            changes += self._to_the_limit(sweeper, case, most=4 * _ITERATIONS_AT_A_TIME)
            values = sweeper.log_depth()[0]
            reached = values.astype(np.float64)
            start = replace(problem, first=reached.copy())
            log_depth, _ = problem.depth(reached, converged=True)
            errors.append(float(np.abs(log_depth - truth)[problem.domain.solved].mean()))
        outcome.compare("ln z and that of the true surface", errors[1], _SECOND_ORDER_SHARE * errors[0])
        self._compare_bits(case, outcome, np.concatenate(changes), sweeper)

    def _multigrid(self, case: Case, outcome: Outcome) -> None:
        """From coarse grids to the limit of the scheme, which the reference must find nothing to change in."""
        problem = framed(case.light_source)
        hierarchy = Hierarchy.of(problem)
        if hierarchy is None:
            outcome.fail("there are no coarser grids")
            return

        def built() -> Multigrid:
            return Multigrid(
                self.device,
                problem.kernel_arguments,
                hierarchy.levels,
                part=hierarchy.part,
                model=problem.kernels,
                precision=case.precision,
            )

        grids, seconds = _timed(built)
        self.compiled()
        _, again = _timed(built)
        outcome.compile_seconds = max(0.0, seconds - again)
        cycles = Cycles(float(np.finfo(case.precision).eps), ENDS[case.precision])
        descend([Descent(grids, cycles, _MOST_ITERATIONS)], None)
        if not cycles.converged:
            outcome.fail("the cycles come to no end")
        reference = Reference.of(problem)
        reference.log_depth[hierarchy.part] = grids.log_depth()
        rows, columns = np.nonzero(problem.domain.solved)
        values, expected = reference.log_depth[rows, columns], reference.lax_friedrichs(rows, columns)
        # Slow errors change little at a time.
        outcome.compare(
            "values and what follows from those around them",
            apart(values, expected),
            _SETTLED * TOLERANCES[case.precision],
        )

    def _render(self, case: Case, outcome: Outcome) -> None:
        """The forward model against its formula."""
        scene = bumps(shape=_RENDERED)
        depth = 0.7 * scene.depth
        depth[5:9, 11:20] = np.nan
        p, q = log_depth_gradient(depth, scene.camera)
        grid = scene.camera.grid(_RENDERED)
        light, material = case.light_source, case.reflectance
        expected = light.brightness(np.log(depth), p, q, grid.x, grid.y, material)

        def rendered() -> NDArray[np.float64]:
            return render(
                depth, scene.camera, light=light, reflectance=material, device=self.device, precision=case.precision
            )

        image, seconds = _timed(rendered)
        self.compiled()
        _, again = _timed(rendered)
        outcome.compile_seconds = max(0.0, seconds - again)
        if (np.isnan(image) != np.isnan(expected)).any():
            outcome.fail("pixels are rendered that show no surface, or are not that do")
        outcome.compare("brightnesses", apart(image, expected), TOLERANCES[case.precision])

    def _smoothing(self, case: Case, outcome: Outcome) -> None:
        """Residuals smoothed along edges, on one grid and on blocks first, against NumPy."""
        given = noisy_plates(_SMOOTHED)
        for levels in (0, _LEVELS):
            smoother = Smoother(self.device, case.precision, given.right, given.below, levels)

            def smoothed(smoother: Smoother = smoother) -> NDArray[np.float64]:
                return smoother.smoothed(given.start, given.target, given.votes, given.noise)

            found, seconds = _timed(smoothed)
            self.compiled()
            _, again = _timed(smoothed)
            outcome.compile_seconds += max(0.0, seconds - again)
            what = f"residuals smoothed on {levels + 1} grids" if levels else "residuals"
            outcome.compare(what, apart(found, smoothed_from_blocks(given, levels)), TOLERANCES[case.precision])

    def _energy(self, case: Case, outcome: Outcome) -> None:
        """An energy, its slopes, its least along a step, and that a step goes there."""
        weights = PAINTED if case.painted else PLAIN
        light = case.light_source.of_unit_gain
        reference, first = rough(light, case.reflectance, weights, bounded=case.bounded)
        solved = reference.view.solved
        descent, seconds = _timed(lambda: descent_of(reference, first, self.device, case.precision))
        found, more = _timed(lambda: descent.linearise(_WHITE))
        self.compiled()
        _, again = _timed(lambda: descent.linearise(_WHITE))
        outcome.compile_seconds = max(0.0, seconds + more - again)
        tolerance = TOLERANCES[case.precision]
        energy = reference.energy(first, _WHITE)
        outcome.compare("energies", abs(found.energy - energy) / energy, tolerance)

        descent.assemble(_DAMPING)
        downhill = descent.read("remainder")[0].astype(np.float64)
        held = descent.read("inverse_diagonal")[0] == 0.0
        size = float(np.abs(downhill).sum())
        # Differences of energies tell slopes less well than the kernels do.
        least = max(tolerance, _OF_DIFFERENCES)
        for seed in range(_DIRECTIONS):
            along = np.random.default_rng(seed).normal(size=first.shape) * (solved & ~held)
            slope = -derivative(reference, first, along, _WHITE)
            outcome.compare("slopes", abs(float((downhill * along).sum()) - slope) / size, least)

        descent.solve(_MOST_STEPS, _REDUCTIONS[case.precision])
        step, matrix = (descent.read(name).astype(np.float64) for name in ("step", "matrix"))
        left = np.where(held, 0.0, downhill - multiplied(matrix, step[0]))
        outcome.compare("the sides of a step's equations", float(np.abs(left).max() / np.abs(downhill).max()), _SOLVED)

        fall = descent.turn(afresh=True)
        outcome.compare("slopes along the step", abs(float((downhill * step[0]).sum()) / fall - 1.0), least)
        descent.move(_LENGTH)
        expected = first + _LENGTH * step[0]
        if reference.view.limits is not None:
            expected = np.fmin(np.fmax(expected, reference.view.limits[0]), reference.view.limits[1])
        moved = descent.log_depth()
        outcome.compare("values after a step", apart(moved, expected), tolerance)
        energy = reference.energy(moved.astype(np.float64), _WHITE)
        outcome.compare("energies after a step", abs(descent.linearise(_WHITE).energy - energy) / energy, tolerance)

    def _rate(self, case: Case, outcome: Outcome) -> None:
        """Cell updates a second, over whole iterations."""
        size = _RATE_SIZES[self.device.kind]
        if ordering_for(case.ordering, Setup(self.device, case.precision, (size, size), 1)).serial:
            size = _SERIAL_SIZE
        problem = smooth_problem(size)

        def built() -> Sweeper:
            return sweeper_that_never_rests(self.device, problem, case.ordering, case.precision)

        sweeper, seconds = _timed(built)
        self._describe(sweeper, outcome)
        outcome.compile_seconds = seconds
        self._first_runs(sweeper, outcome)
        workload = iterations(case.ordering, sweeper, problem)
        outcome.rate, outcome.unit = 1e-6 * workload.cells / _seconds_each(workload.work, workload.step), "Mc/s"

    def _copy(self, _case: Case, outcome: Outcome) -> None:
        """Bytes read and written a second by a copy within the device's memory."""
        size = min(_COPIED[self.device.kind], self.device.memory // 1024 * 64)
        copy = copier(self.device, size)

        def copied(count: int) -> float:
            return device_seconds(self.device, lambda: copy(count))

        _, seconds = _timed(lambda: copied(1))
        self.compiled()
        _, again = _timed(lambda: copied(1))
        outcome.compile_seconds = max(0.0, seconds - again)
        outcome.rate, outcome.unit = 2e-9 * size / _seconds_each(copied, 1), "GB/s"

    def _sweeper(self, case: Case, problem: Problem, outcome: Outcome, *, second_order: bool = False) -> Sweeper:
        def built() -> Sweeper:
            return Sweeper(
                self.device,
                [problem.kernel_arguments],
                model=problem.kernels,
                ordering=case.ordering,
                precision=case.precision,
                linear=case.boundary == "extrapolate",
                second_order=second_order,
                only_lower=not second_order,
            )

        sweeper, seconds = _timed(built)
        outcome.compile_seconds += seconds
        self._describe(sweeper, outcome)
        return sweeper

    def _describe(self, sweeper: Sweeper, outcome: Outcome) -> None:
        outcome.kernel, outcome.reason = str(sweeper.ordering), explain(self.device, sweeper.ordering)

    def _first_runs(self, sweeper: Sweeper, outcome: Outcome) -> NDArray[np.float64]:
        """Two iterations. Some drivers compile a kernel when it is launched: the first tells how long that took."""
        one, seconds = _timed(lambda: sweeper.run(1))
        self.compiled()
        other, again = _timed(lambda: sweeper.run(1))
        outcome.compile_seconds += max(0.0, seconds - again)
        return np.concatenate([one, other])

    def _to_the_limit(self, sweeper: Sweeper, case: Case, *, most: int = _MOST_ITERATIONS) -> list[NDArray[np.float64]]:
        changes: list[NDArray[np.float64]] = []
        while not changes or (
            changes[-1][-1, 0] > ENDS[case.precision] and len(changes) * _ITERATIONS_AT_A_TIME < most
        ):
            changes.append(sweeper.run(_ITERATIONS_AT_A_TIME))
        return changes

    def _compare_bits(self, case: Case, outcome: Outcome, changes: NDArray[np.float64], sweeper: Sweeper) -> None:
        """Values and changes with those of the lexicographic case before, where that was done."""
        values = sweeper.log_depth()[0]
        key = replace(case, ordering=FIRST)
        if case == key:
            self._serial[key] = (changes, values)
        elif not sweeper.ordering.coloured and key in self._serial:
            serial_changes, serial_values = self._serial[key]
            if not (np.array_equal(changes, serial_changes) and np.array_equal(values, serial_values)):
                count = np.count_nonzero(values != serial_values)
                outcome.fail(f"{case.ordering} and {FIRST} do not give the same bits: {count} values differ")

    def _compare_upwind_limit(
        self, case: Case, outcome: Outcome, problem: Problem, values: NDArray[np.floating]
    ) -> None:
        """With what the scheme makes of each value's neighbours, or with a limit that was found to be right so."""
        key = replace(case, ordering="")
        tolerance = TOLERANCES[case.precision]
        if key in self._limits:
            outcome.compare("values in the limit", apart(values, self._limits[key]), tolerance)
            return
        unsettled = distance_from_settled(problem, values)
        outcome.compare("values in the limit and those that their neighbours allow", unsettled, tolerance)
        if unsettled <= tolerance:
            self._limits[key] = values.astype(np.float64)


def _timed(work: Callable[[], _Result]) -> tuple[_Result, float]:
    began = time.perf_counter()
    result = work()
    return result, time.perf_counter() - began


def _seconds_each(work: Callable[[int], float | None], step: int) -> float:
    """Seconds of a unit of some work, which is done until it takes long enough to tell."""
    count = step
    while True:
        _, seconds = _timed(lambda count=count: work(count))  # type: ignore[misc] # mypy wants no default here
        if seconds >= _LEAST_SECONDS:
            return seconds / count
        count = max(2 * count, round(min(16.0, 1.2 * _LEAST_SECONDS / max(seconds, 1e-9)) * count / step) * step)
