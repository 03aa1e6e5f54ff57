"""Bounds of the values: every ordering keeps to them as the reference does, and without them nothing is read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import OTHER_MATERIALS, UPWIND, random_problem, sweeper

from persfs_cl import Device, ParallelLight
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.run import DIRECTIONS
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.arrays import Array
from persfs_cl.choices import Boundary, Surface
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reference import Reference

TOLERANCE = {"float32": 1e-4, "float64": 1e-12}
STRIPS = WavefrontStrips(8, vectors=1, work_groups=2)
ORDERINGS = [
    STRIPS,
    WavefrontImages(8, vectors=1, work_groups=1),
    pytest.param(WavefrontStrips(8, vectors=3, work_groups=2), marks=pytest.mark.thorough),
    WavefrontTiles(),
]


def assert_close(values: np.ndarray, expected: np.ndarray, precision: str) -> None:
    scale = np.maximum(1.0, np.abs(expected))
    np.testing.assert_array_less(np.abs(values - expected) / scale, TOLERANCE[precision])


def assert_bounded(problem: Problem, values: np.ndarray) -> None:
    """Nowhere beyond a bound; on one of them somewhere, and somewhere not."""
    assert problem.limits is not None
    lower, upper = problem.limits.astype(values.dtype)
    assert not ((values < lower) | (values > upper)).any()
    assert (values == lower).any()
    assert ((values > lower) & (values < upper)).any()


# Of double precision, below, by the upwind scheme. Which way the surface goes is a number to the kernels.
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")
@pytest.mark.quick_where(holds=lambda given: (given["boundary"] == "outflow") == (given["surface"] == "away"))
@pytest.mark.parametrize("surface", ["away", "toward"])
@pytest.mark.parametrize(
    ("boundary", "light"), [("outflow", ParallelLight()), ("extrapolate", ParallelLight(0.3, -0.2))]
)
# Whose bits the other has, see below.
@pytest.mark.parametrize("ordering", ["lexicographic", pytest.param("wavefront", marks=pytest.mark.thorough)])
def test_iterations_equal_the_reference(
    device: Device, precision: str, surface: Surface, boundary: Boundary, light: ParallelLight, ordering: str
) -> None:
    """The paper's scheme has the values of the reference after each iteration, boundary cells included."""
    linear = boundary == "extrapolate"
    problem = random_problem(2, (11, 14), light=light, surface=surface, boundary=boundary, bounded=True)
    reference = Reference.of(problem, linear=linear)
    assert len(problem.domain.boundary.cells)
    kernel = sweeper(problem, device, precision, ordering, linear=linear)
    for _ in range(4):
        reference.iterate()
        kernel.run(1)
        assert_close(kernel.log_depth()[0], reference.log_depth, precision)
    assert_bounded(problem, kernel.log_depth()[0])
    free = Reference.of(replace(problem, depth_range=None), linear=linear)
    for _ in range(4):
        free.iterate()
    assert np.abs(free.log_depth - reference.log_depth)[problem.domain.solved].max() > 0.01


# The bounds of double precision are those of other orderings.
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")
def test_colours_equal_the_reference(device: Device, precision: str) -> None:
    problem = random_problem(3, (23, 38), boundary="wall", light=ParallelLight(0.3, -0.2), bounded=True)
    reference, kernel = Reference.of(problem), sweeper(problem, device, precision, "checkerboard")
    alone = sweeper(problem, device, precision, Checkerboard())
    for number in range(3):
        for colour in (0, 1):
            reference.sweep_colour(colour)
        for each in (kernel, alone):
            each.sweep(number)
            assert_close(each.log_depth()[0], reference.log_depth, precision)
    assert_bounded(problem, kernel.log_depth()[0])


# Of double precision, by programs that other tests have too.
@pytest.mark.quick_where(holds=lambda given: given["name"] not in [*OTHER_MATERIALS, "upwind flash"])
@pytest.mark.parametrize("name", UPWIND)
def test_the_limit_is_that_of_the_obstacle_problem(device: Device, name: str) -> None:
    """Each value is the larger of its bound and its lowest candidate by the reference, unless it kept the start."""
    problem = random_problem(5, (12, 17), boundary="wall", bounded=True, **UPWIND[name])
    # The bits of the wavefront, see below, by programs that are compiled in half the time.
    kernel = sweeper(problem, device, "float64", "lexicographic")
    assert kernel.run(200)[-1] <= 1e-13
    values = kernel.log_depth()[0].astype(np.float64)
    assert_bounded(problem, values)
    reference = Reference.of(problem)
    reference.log_depth = values
    rows, columns = np.nonzero(problem.domain.solved)
    found = [reference.upwind(rows, columns, *direction, both_edges=True) for direction in DIRECTIONS]
    bounded = [np.maximum(each, reference.least[rows, columns]) for each in found]
    expected = np.fmin.reduce([*bounded, problem.start[rows, columns]])
    tells = np.ones(rows.size, bool)
    if "beside" in name:
        # A lamp beside the camera may leave dark pixels no value at the largest slope.
        tells = reference.equation(rows, columns, 30.0).at(values[rows, columns]).brightness > 0.1
    assert tells.mean() > 0.7
    assert_close(values[rows, columns][tells], expected[tells], "float64")


# Each ordering by the kernels of one scheme: how it reads the bounds does not depend on them. Images have the loop of
# strips.
@pytest.mark.quick_where(
    holds=lambda given: given["precision"] == "float32" and not isinstance(given["ordering"], WavefrontImages)
)
@pytest.mark.quick_where(
    holds=lambda given: given["name"] == ("upwind flash" if given["ordering"] == STRIPS else "frontal away")
)
# Under the Lax-Friedrichs scheme nothing rests on a full frame.
@pytest.mark.parametrize("rests", [True, pytest.param(False, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("ordering", ORDERINGS, ids=str)
@pytest.mark.parametrize("name", ["upwind oblique toward", "upwind flash", "frontal away"])
def test_all_orderings_give_the_bits_of_lexicographic(
    device: Device, precision: str, ordering: Ordering, name: str, rests: bool
) -> None:
    given = {"surface": "away"} if name == "frontal away" else UPWIND[name]
    for seed, shape in enumerate([(1, 9), (9, 2), (37, 70)]):
        problem = random_problem(seed, shape, boundary="wall", bounded=True, **given)
        one = sweeper(problem, device, precision, "lexicographic")
        other = sweeper(problem, device, precision, ordering, rests=rests)
        for _ in range(4):
            np.testing.assert_array_equal(other.run(3), one.run(3))
            np.testing.assert_array_equal(other.log_depth(), one.log_depth())


@pytest.mark.quick_where(holds=lambda given: not given["only_lower"])
@pytest.mark.parametrize("ordering", ["lexicographic", "wavefront", "checkerboard"])
@pytest.mark.parametrize("only_lower", [False, True])
def test_second_order_keeps_to_both_bounds(device: Device, ordering: str, only_lower: bool) -> None:
    """Values that may rise come to the upper bound too, with the same bits by the wavefront."""
    problem = random_problem(4, (25, 30), boundary="wall", bounded=True, holes=0.03, **UPWIND["upwind oblique away"])
    first = sweeper(problem, device, "float32", "lexicographic")
    first.run(60)
    start = first.log_depth()[0].astype(np.float64)
    assert problem.limits is not None
    lower, upper = problem.limits
    # Lower than they belong: all must rise, if they may.
    lowered: Array = np.where(problem.domain.solved, np.fmax(start - 0.05, lower), start)
    image = replace(problem.kernel_arguments, log_depth=lowered)

    def corrected(name: str) -> np.ndarray:
        kernel = Sweeper(
            device,
            [image],
            model=problem.kernels,
            ordering=name,
            precision="float32",
            second_order=True,
            only_lower=only_lower,
        )
        kernel.run(12)
        return np.asarray(kernel.log_depth()[0])

    values = corrected(ordering)
    assert_bounded(problem, values)
    if not only_lower:
        assert (values == upper.astype(values.dtype)).any()
        assert (values > lowered.astype(np.float32)).sum() > 100
    if ordering == "wavefront":
        np.testing.assert_array_equal(values, corrected("lexicographic"))


def test_images_without_bounds_are_as_they_are_alone(device: Device) -> None:
    """In shared launches with one that has bounds; and bounds that are none change no bit."""
    given = UPWIND["upwind oblique toward"]
    bounded, free = (random_problem(seed, (19, 27), boundary="wall", bounded=not seed, **given) for seed in (0, 1))
    unbounded = replace(free.kernel_arguments, limits=np.full((2, 19, 27), np.nan))
    images = [free.kernel_arguments, bounded.kernel_arguments, unbounded]
    together = Sweeper(device, images, model=free.kernels, ordering="lexicographic", precision="float32")
    together.run(9)
    for problem, values in zip((free, bounded, free), together.log_depth(), strict=True):
        alone = Sweeper(
            device, [problem.kernel_arguments], model=free.kernels, ordering="lexicographic", precision="float32"
        )
        alone.run(9)
        np.testing.assert_array_equal(values, alone.log_depth()[0])
    assert_bounded(bounded, together.log_depth()[1])
