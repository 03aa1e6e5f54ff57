"""What the reference says of the cases, which takes its time and is kept for the cases after."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from persfs_cl.selftest.cases import FIRST, Case
from persfs_cl.selftest.scenes import LARGE, SMALL, noise
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reference import Reference

TOLERANCES = {"float32": 1e-4, "float64": 1e-10}
"""Of values from those of the reference, as a share of them or of 1: rounding, with room for every device's."""
ENDS = {"float32": 1e-7, "float64": 1e-13}
"""Changes at which the iteration has reached its limit."""


@dataclass
class ReferenceValues:
    """Values of the reference for cases of a device, each computed once."""

    _found: dict[object, NDArray[np.float64]] = field(default_factory=dict)

    def iterated(self, case: Case, count: int, *, coloured: bool) -> NDArray[np.float64]:
        """Values of the reference after so many iterations, in the order of two colours or the lexicographic."""
        key = replace(case, ordering="coloured" if coloured else FIRST, precision="float64")
        if (key, count) not in self._found:
            reference = _reference(case)
            for _ in range(count):
                if not coloured:
                    reference.iterate()
                    continue
                for _ in range(4):
                    reference.sweep_colour(0)
                    reference.sweep_colour(1)
                    reference.renew_boundary()
            self._found[key, count] = reference.log_depth
        return self._found[key, count]

    def limit(self, case: Case) -> NDArray[np.float64]:
        """Values of the reference that no longer change, whatever the order of the cells."""
        key = replace(case, ordering="", precision="float64")
        if key not in self._found:
            reference = _reference(case)
            before = np.full(reference.log_depth.shape, np.inf)
            while (before - reference.log_depth).max() > ENDS["float64"]:
                before = reference.log_depth.copy()
                reference.sweep_colour(0)
                reference.sweep_colour(1)
            self._found[key] = reference.log_depth
        return self._found[key]


def limit_is_near(case: Case) -> bool:
    """Whether the limit of the Lax-Friedrichs scheme is one in any order of the cells, and soon reached."""
    quickly = case.surface == "toward" and case.material == "Lambertian" if case.light_source.flat_rim else True
    return case.boundary == "wall" and quickly


def problem_of(case: Case, shape: tuple[int, int]) -> Problem:
    """The problem that a case solves, on noise of some size."""
    light, material = case.light_source, case.reflectance
    return noise(light, material, case.scheme, case.surface, case.boundary, shape, bounded=case.bounded)


def _reference(case: Case) -> Reference:
    problem = problem_of(case, SMALL if case.kind == "sweeps" else LARGE)
    return Reference.of(problem, linear=case.boundary == "extrapolate")


def distance_from_settled(problem: Problem, values: NDArray[np.floating]) -> float:
    """How far values are from the lowest that the upwind scheme finds for them from their neighbours."""
    reference = Reference.of(problem)
    start, reference.log_depth = reference.log_depth, values.astype(np.float64)
    rows, columns = np.nonzero(problem.domain.solved)
    sides = [(leftwards, upwards) for upwards in (0, 1) for leftwards in (0, 1)]
    lowest = reference.least[rows, columns]
    found = [np.maximum(reference.upwind(rows, columns, *side, both_edges=True), lowest) for side in sides]
    least = np.fmin.reduce([*found, start[rows, columns]])
    known = apart(reference.log_depth[problem.domain.known], start[problem.domain.known])
    return max(known, apart(reference.log_depth[rows, columns], least))


def apart(values: NDArray[np.floating], expected: NDArray[np.float64]) -> float:
    """Largest difference, as a share of what is expected where that is above 1; infinite where one of both is NaN."""
    there = ~(np.isnan(values) & np.isnan(expected))
    scale = np.maximum(1.0, np.abs(expected[there]))
    difference = np.abs(values[there].astype(np.float64) - expected[there]) / scale
    return float(np.where(np.isnan(difference), np.inf, difference).max(initial=0.0))
