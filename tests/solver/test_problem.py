"""What becomes of the values of a run: which of them no known value can have brought about."""

from __future__ import annotations

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.masks import steps_from
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare


def problem_of(shape: tuple[int, int], *, known_share: float, holes: float) -> Problem:
    random = np.random.default_rng(shape[1])
    image, inside = random.uniform(0.5, 1.0, shape), random.random(shape) >= holes
    known = np.full(shape, np.nan)
    known[random.random(shape) < known_share] = 2.0
    known[shape[0] // 3, shape[1] // 2] = 3.0
    options = complete({"light": ps.ParallelLight(), "scheme": "lax-friedrichs", "max_slope": 2.0})
    return prepare(image, ps.Camera(float(shape[1])), inside, None, known, options=options)


@pytest.mark.parametrize("shape", [(1, 90), (140, 75), (200, 330)])
@pytest.mark.parametrize("known_share", [0.0, 0.0005, 0.2])
@pytest.mark.parametrize("holes", [0.0, 0.3])
@pytest.mark.parametrize("height", ["low", "front", "high", "any"])
def test_what_lies_higher_than_the_steps_climb_has_no_depth(
    shape: tuple[int, int], known_share: float, holes: float, height: str
) -> None:
    problem = problem_of(shape, known_share=known_share, holes=holes)
    known, solved = problem.domain.known, problem.domain.solved
    steps = steps_from(known, known | solved)
    climbed = problem.highest_known + 2.0 * problem.grid.dx * steps
    random = np.random.default_rng(5)
    values = {
        "low": climbed * 0.9,
        "front": np.where(np.indices(shape).sum(axis=0) < 60, climbed * 0.5, climbed + 40.0),
        "high": climbed + 1.0,
        "any": climbed + random.normal(size=shape) * random.choice([1e-3, 1.0, 10.0], shape),
    }[height]
    values[known] = problem.known_values - problem.level
    if height == "front":
        # One that has come to nothing tells nothing of those around it.
        values.flat[random.choice(np.flatnonzero(solved))] = np.nan
    expected = solved & ~(values <= climbed * (1.0 + 1e-5) + 1e-6)
    # What is neither solved nor known has the value that it began with.
    values[~(known | solved)] = 1e30
    _, depth = problem.depth(values, converged=False)
    np.testing.assert_array_equal(np.isnan(depth), expected | ~(known | solved))


def test_known_depths_that_reach_nothing_are_refused_where_a_guide_has_no_scale() -> None:
    rows, columns = np.indices((20, 20))
    mask, known = np.zeros((20, 20), bool), np.full((20, 20), np.nan)
    mask[8:14, 5:12], known[0] = True, 1.0
    with pytest.raises(
        ps.InputError, match=r"None of the 20 known depths can reach the 42 pixels to solve: give"
    ) as told:
        ps.reconstruct(
            0.8 + 0.005 * rows,
            ps.Camera(30.0),
            mask=mask,
            known_depth=known,
            guide=1.0 + 0.01 * columns,
            guide_scale="fit",
            scheme="regularised",
        )
    assert told.value.argument == "known_depth"
