"""Every kernel against its plain NumPy reference, and the orderings against each other, on every device."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from problems import (
    LAX_FRIEDRICHS,
    OBLIQUE,
    OTHER_MATERIALS,
    UPWIND,
    fitted,
    in_turn,
    one_material_in_turn,
    random_problem,
    sweeper,
)

from persfs_cl import Device, DeviceError, FlashLight, OrenNayar, ParallelLight, bump, reconstruct
from persfs_cl._cl.kernel import Kernel, in_row_groups
from persfs_cl._cl.orderings import checkerboard_bands
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.lexicographic import Lexicographic
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.orderings.strips import Strips
from persfs_cl._cl.orderings.three_colours import ThreeColours
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.program import kernel_names, kernel_source
from persfs_cl._cl.run import DIRECTIONS
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.choices import Boundary, Surface
from persfs_cl.shading.equations import ParallelEquation
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reference import Reference

BOUNDARIES: tuple[Boundary, ...] = ("outflow", "wall", "extrapolate")
SIZES = [(3, 3), (3, 4), (1, 9), (9, 1), (2, 2), (7, 5), (13, 31), (31, 33), (32, 64), (37, 129), (70, 65)]
TOLERANCE = {"float32": 1e-4, "float64": 1e-12}
SETUPS = LAX_FRIEDRICHS | UPWIND
HEADLIGHT = {
    "upwind headlight": {
        "light": FlashLight(gain=2.0, falloff=False),
        "reflectance": OrenNayar(0.3),
        "scheme": "upwind",
    }
}
# Those with kernels of their own: the sign of the surface and the direction of a parallel light are numbers.
KERNELS = ["upwind oblique toward", *list(UPWIND)[4:], "flash on a shiny surface"]

LAMPS = [name for name in UPWIND if name.startswith("upwind lamp")]

both_ways = pytest.mark.parametrize("surface", ["away", "toward"])
thorough = pytest.mark.thorough
kernels_take_turns = pytest.mark.quick_where(holds=one_material_in_turn)


def assert_close(device_values: np.ndarray, expected: np.ndarray, precision: str) -> None:
    """Equal up to rounding of values as large as the start value, which is large."""
    scale = np.maximum(1.0, np.abs(expected))
    np.testing.assert_array_less(np.abs(device_values - expected) / scale, TOLERANCE[precision])


def assert_a_sweep(device_values: np.ndarray, expected: np.ndarray, precision: str, name: str) -> None:
    """The reference's values; under a flash the upwind kernels come down to them from above, in several sweeps."""
    if name.startswith(("upwind flash", "upwind lamp")):
        expected = np.maximum(device_values, expected)
    assert_close(device_values, expected, precision)


@functools.cache
def four_sweeps_of_the_reference(name: str, shape: tuple[int, int]) -> list[np.ndarray]:
    """Values after each; the reference takes its time."""
    reference = Reference.of(random_problem(7, shape, boundary="wall", **SETUPS[name]))
    values = []
    for direction in DIRECTIONS:
        reference.sweep(*direction)
        values.append(reference.log_depth.copy())
    return values


def shapes_for_the_reference(name: str) -> list[tuple[int, int]]:
    """Small ones: of a lamp beside the camera it takes up to 70 ms for a cell and sweep."""
    if name in LAMPS:
        return [(1, 3), (3, 1), (3, 3)]
    return [(1, 5), (5, 1), (5, 4)] if name in UPWIND else [(3, 3), (1, 9), (9, 1), (13, 31), (21, 44)]


def compared_with_the_reference(name: str) -> list[str]:
    """Orderings; of other materials the one, too, that compiles fastest, whose bits the wavefront has: see below."""
    return ["wavefront", *(["lexicographic"] if name in OTHER_MATERIALS else [])]


def quickly_compared(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters is a quick one.

    By the upwind scheme all go by the last shape, and a row and a column by two of them: the reference takes its time.
    """
    name, last = parameters["name"], shapes_for_the_reference(parameters["name"])[-1]
    by_lines = [*LAX_FRIEDRICHS, "upwind oblique toward", "upwind flash"]
    shown = parameters["shape"] == last or (name in by_lines and name not in OTHER_MATERIALS)
    # The slowest: the lamp and the rough surface each have a test.
    return (
        shown
        and name != "upwind lamp beside a rough surface"
        and in_turn(parameters)
        and parameters["ordering"] == compared_with_the_reference(name)[-1]
    )


@pytest.mark.quick_where(holds=quickly_compared)
@pytest.mark.parametrize(
    ("name", "ordering", "shape"),
    [
        (name, ordering, shape)
        for name in SETUPS
        for ordering in compared_with_the_reference(name)
        for shape in shapes_for_the_reference(name)
    ],
)
def test_each_sweep_equals_the_reference(
    device: Device, precision: str, name: str, ordering: str, shape: tuple[int, int]
) -> None:
    problem = random_problem(7, shape, boundary="wall", **SETUPS[name])
    expected = four_sweeps_of_the_reference(name, shape)
    kernel = sweeper(problem, device, precision, ordering)
    for number, values in enumerate(expected):
        kernel.sweep(number)
        assert_a_sweep(kernel.log_depth()[0], values, precision, name)
    assert (kernel.log_depth()[0] < problem.start).any(), "something must have moved"


def coloured_problem(name: str) -> Problem:
    # The reference of a lamp beside the camera takes its time here too.
    shape = (7, 8) if name in LAMPS else (13, 18) if name in UPWIND else (23, 38)
    return random_problem(3, shape, boundary="wall", **SETUPS[name])


@functools.cache
def two_sweeps_of_the_coloured_reference(name: str) -> list[np.ndarray]:
    reference = Reference.of(coloured_problem(name))
    values = []
    for _ in range(2):
        reference.sweep_colour(0)
        reference.sweep_colour(1)
        values.append(reference.log_depth.copy())
    return values


@kernels_take_turns
@pytest.mark.parametrize("name", SETUPS)
def test_each_checkerboard_sweep_equals_the_reference(device: Device, precision: str, name: str) -> None:
    kernel = sweeper(coloured_problem(name), device, precision, "checkerboard")
    for number, values in enumerate(two_sweeps_of_the_coloured_reference(name)):
        kernel.sweep(number)
        assert_a_sweep(kernel.log_depth()[0], values, precision, name)


@pytest.mark.quick_where(holds=lambda given: given["name"] not in OTHER_MATERIALS)
@pytest.mark.parametrize("name", UPWIND)
def test_the_limit_is_that_of_the_full_scheme(device: Device, name: str) -> None:
    """The value of each cell is its lowest candidate, unless it kept the start value."""
    assert_the_limit(random_problem(5, (12, 17), boundary="wall", **UPWIND[name]), device, name)


@pytest.mark.parametrize("max_slope", [0.2, 0.5, 1.0])
def test_so_it_is_where_the_slope_may_be_but_small(device: Device, max_slope: float) -> None:
    problem = random_problem(6, (12, 17), boundary="wall", **UPWIND["upwind flash"])
    assert_the_limit(replace(problem, max_slope=max_slope), device, "upwind flash")


def assert_the_limit(problem: Problem, device: Device, name: str) -> None:
    # The bits of the wavefront, see below, by programs that are compiled in half the time.
    kernel = sweeper(problem, device, "float64", "lexicographic")
    assert kernel.run(100)[-1] <= 1e-13
    reference = Reference.of(problem)
    reference.log_depth = kernel.log_depth()[0].astype(np.float64)
    rows, columns = np.nonzero(problem.domain.solved)
    found = [reference.upwind(rows, columns, *direction, both_edges=True) for direction in DIRECTIONS]
    least = np.fmin.reduce([*found, problem.start[rows, columns]])
    values = kernel.log_depth()[0][rows, columns]
    # A lamp beside the camera may leave dark pixels no value at the largest slope: E is the cosine at their own.
    tells = reference.equation(rows, columns, 30.0).at(values).brightness > (0.02 if "beside" in name else 0.0)
    assert tells.mean() > 0.9
    assert_close(values[tells], least[tells], "float64")


@pytest.mark.parametrize("boundary", ["outflow", "extrapolate"])
@pytest.mark.parametrize("shape", [(3, 3), (3, 12), (26, 17)])
def test_boundary_renewal_equals_the_reference(
    device: Device, precision: str, shape: tuple[int, int], boundary: Boundary
) -> None:
    problem = random_problem(11, shape, boundary=boundary, holes=0.05)
    values = np.random.default_rng(5).uniform(0.0, 1.0, shape)
    values.ravel()[problem.domain.boundary.cells] += 1.0
    linear = boundary == "extrapolate"
    reference, kernel = Reference.of(problem, linear=linear), None
    reference.log_depth = values.copy()
    problem = replace(problem, first=values, known_values=values[problem.domain.known] + problem.level)
    kernel = sweeper(problem, device, precision, "wavefront", linear=linear)
    kernel.renew_boundary()
    reference.renew_boundary()
    assert_close(kernel.log_depth()[0], reference.log_depth, precision)
    if len(problem.domain.boundary.cells):
        assert (reference.log_depth != values).any()


@functools.cache
def twelve_iterations_of_the_reference() -> tuple[np.ndarray, float]:
    """Values after them, and the change of the last."""
    reference = Reference.of(random_problem(2, (9, 12), light=OBLIQUE))
    changes = [reference.iterate() for _ in range(12)]
    return reference.log_depth, changes[-1]


@pytest.mark.parametrize("ordering", ["lexicographic", "wavefront"])
def test_iterations_equal_the_reference(device: Device, precision: str, ordering: str) -> None:
    kernel = sweeper(random_problem(2, (9, 12), light=OBLIQUE), device, precision, ordering)
    change = float(kernel.run(12)[-1, 0])
    values, expected = twelve_iterations_of_the_reference()
    assert_close(kernel.log_depth()[0], values, precision)
    assert change == pytest.approx(expected, rel=1e-2 if precision == "float32" else 1e-6)


def assert_same_bits(problem: Problem, device: Device, precision: str, *, linear: bool = False) -> None:
    one = sweeper(problem, device, precision, "lexicographic", linear=linear)
    other = sweeper(problem, device, precision, "wavefront", linear=linear)
    for number in range(8):
        for kernel in (one, other):
            kernel.sweep(number % 4)
            kernel.renew_boundary()
        np.testing.assert_array_equal(one.log_depth()[0], other.log_depth()[0])


# Which way the surface goes is a number to the kernels.
@pytest.mark.quick_where(holds=lambda given: (given["precision"] == "float64") == (given["surface"] == "toward"))
@both_ways
@pytest.mark.parametrize("shape", SIZES)
def test_wavefront_gives_the_bits_of_lexicographic(
    device: Device, precision: str, shape: tuple[int, int], surface: Surface
) -> None:
    for seed in range(3):
        boundary = BOUNDARIES[seed]
        light = (ParallelLight(), OBLIQUE, ParallelLight(-0.5, 0.1))[seed]
        problem = random_problem(seed, shape, surface=surface, light=light, boundary=boundary)
        assert_same_bits(problem, device, precision, linear=boundary == "extrapolate")


@kernels_take_turns
@pytest.mark.parametrize("name", ["upwind frontal away", *KERNELS])
def test_wavefront_gives_the_bits_of_lexicographic_by_any_kernels(device: Device, precision: str, name: str) -> None:
    for seed, shape in enumerate([(1, 9), (9, 1), (2, 2), (13, 31), (37, 70)]):
        assert_same_bits(random_problem(seed, shape, boundary="wall", **SETUPS[name]), device, precision)


# Each height is a program of its own: the lowest, and what CPUs get.
STRIPS = {
    (vectors, groups): WavefrontStrips(8, vectors=vectors, work_groups=groups)
    for vectors in (1, 3)
    for groups in (1, 2, 3, 4)
}
IMAGES = {
    (vectors, groups): WavefrontImages(8, vectors=vectors, work_groups=groups)
    for vectors in (1, 3)
    for groups in (1, 3)
}
BANDS = [
    CheckerboardBands(8, band_rows=rows, work_groups=groups, polls=polls)
    for rows, groups, polls in ((1, 1, 4000), (2, 2, 4000), (1, 3, 4000), (5, 4, 4000), (3, 2, 1))
]
# What processors with narrower registers get.
NARROW_STRIPS: list[Strips] = [
    WavefrontStrips(2, vectors=3, work_groups=2),
    WavefrontStrips(4, vectors=3, work_groups=2),
    WavefrontImages(2, vectors=1, work_groups=2),
    WavefrontImages(4, vectors=3, work_groups=2),
]
NARROW_BANDS = [CheckerboardBands(lanes, band_rows=3, work_groups=2) for lanes in (2, 4)]
# What those with wider ones get, strips for the upwind scheme.
WIDE_STRIPS: list[Strips] = [
    WavefrontStrips(16, vectors=1, work_groups=2),
    WavefrontImages(16, vectors=3, work_groups=3),
]
WIDE_BANDS = CheckerboardBands(16, band_rows=3, work_groups=2)
TILES, CHECKERBOARD, LEXICOGRAPHIC = WavefrontTiles(), Checkerboard(), Lexicographic()


SMALL_TILES = WavefrontTiles(tile=(8, 16))
IN_ONE_PRECISION: dict[Ordering, str] = {
    # In the other precision their cells are those of the lexicographic order, by the same function.
    TILES: "float32",
    # As large ones on images of several.
    SMALL_TILES: "",
    # What several vectors have to do with each other is in the file that strips and images have in common.
    **{ordering: "" for (vectors, _), ordering in STRIPS.items() if vectors == 3},
    # Their cells are those of strips, which run in both.
    **{ordering: "float32" for (vectors, _), ordering in IMAGES.items() if vectors == 1},
    # Which the processes of a batch have: see test_numbers_are_those_of_one_by_one_to_the_bit.
    **{ordering: "" for (vectors, _), ordering in IMAGES.items() if vectors == 3},
    NARROW_STRIPS[0]: "",
    NARROW_STRIPS[1]: "",
    # Double precision has fewer lanes than single precision.
    NARROW_STRIPS[2]: "",
    NARROW_STRIPS[3]: "",
    # Narrow bands, below, update their cells by the same function.
    Checkerboard(2): "",
    Checkerboard(4): "",
    Checkerboard(8): "float32",
    BANDS[0]: "float32",
    BANDS[3]: "float32",
    Checkerboard(16): "",
    WIDE_BANDS: "float32",
    NARROW_BANDS[0]: "float32",
    NARROW_BANDS[1]: "",
}
"""Of orderings that are a program for their sizes alone: in which precision the quick tests run them, if in any."""


def needed(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters, `ordering` and `precision`, is a quick one."""
    return IN_ONE_PRECISION.get(parameters["ordering"]) in (parameters["precision"], None)


@pytest.mark.quick_where(holds=needed)
@pytest.mark.parametrize(
    "ordering",
    [TILES, SMALL_TILES, *STRIPS.values(), *IMAGES.values(), *NARROW_STRIPS],
    ids=str,
)
def test_all_sizes_give_the_bits_of_lexicographic(device: Device, precision: str, ordering: Ordering) -> None:
    """Over random sizes, masks and lights, and often enough for a race between work-groups to show."""
    for name in ("frontal away", "frontal toward"):
        assert_lexicographic_bits(device, precision, ordering, name, largest=140)


def quick_variant(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters, `name` and `ordering`, is a quick one.

    Tiles update a cell by the lexicographic order's own function, and go by one light. A material under the
    Lax-Friedrichs scheme goes by strips, which share their loop with whole images.
    """
    name = parameters["name"]
    return name == "upwind oblique toward" or (name == "upwind flash" and isinstance(parameters["ordering"], Strips))


# Both precisions of these kernels go through strips, above, and of these variants through the test before.
@pytest.mark.quick_where(holds=quick_variant)
@pytest.mark.parametrize(
    "ordering", [TILES, IMAGES[1, 3], WIDE_STRIPS[1], pytest.param(IMAGES[3, 3], marks=thorough)], ids=str
)
@pytest.mark.parametrize("name", KERNELS)
def test_every_variant_gives_the_bits_of_lexicographic_by_any_kernels(
    device: Device, ordering: Ordering, name: str
) -> None:
    assert_lexicographic_bits(device, "float32", ordering, name, largest=60)


# Each height is a program of its own, which takes long to compile. Double precision at second order follows below.
@pytest.mark.quick_where(holds=lambda parameters: parameters["precision"] == "float32")
@pytest.mark.parametrize(
    "ordering",
    [
        # Which take their cells from the lexicographic order.
        pytest.param(TILES, marks=thorough),
        # Which share their loop with strips.
        *(pytest.param(IMAGES[vectors, 3], marks=thorough) for vectors in (1, 3)),
        *(STRIPS[1, groups] for groups in (1, 2, 3, 4)),
        *(pytest.param(STRIPS[3, groups], marks=thorough) for groups in (1, 2, 3, 4)),
        pytest.param(NARROW_STRIPS[0], marks=thorough),
        WIDE_STRIPS[0],
    ],
    ids=str,
)
def test_tunings_give_the_bits_of_lexicographic_at_second_order(
    device: Device, precision: str, ordering: Ordering
) -> None:
    ordering = replace(ordering, second_order=True, only_lower=False)
    assert_lexicographic_bits(device, precision, ordering, "upwind oblique toward", largest=140)


# Under other lights the surfaces of second order are as exact as they should be, and those before have these programs.
@pytest.mark.quick_where(holds=lambda given: given["name"] in list(UPWIND)[:4] and given["real"] == "float32")
@pytest.mark.parametrize(("real", "only_lower"), [("float32", False), ("float64", True)])
@pytest.mark.parametrize("name", [*UPWIND, *HEADLIGHT])
def test_second_order_gives_the_bits_of_lexicographic_by_any_kernels(
    device: Device, name: str, real: str, only_lower: bool
) -> None:
    if real == "float64" and not device.has_float64:
        pytest.skip(f"{device} has no double precision")
    corrected = replace(STRIPS[1, 2], second_order=True, only_lower=only_lower)
    assert_lexicographic_bits(device, real, corrected, name, largest=60)


def assert_lexicographic_bits(device: Device, precision: str, ordering: Ordering, name: str, *, largest: int) -> None:
    plain = replace(LEXICOGRAPHIC, second_order=ordering.second_order, only_lower=ordering.only_lower)
    random = np.random.default_rng(sum(map(ord, str(ordering))))
    for seed in range(2):
        height, width = random.integers(1, largest, 2)
        shape = (int(height), int(width) + 1)
        problem = random_problem(seed, shape, boundary="wall", holes=0.05 * seed, **(SETUPS | HEADLIGHT)[name])
        if ordering.second_order:
            problem = with_first_order(problem, device, precision)
        one = sweeper(problem, device, precision, plain)
        expected_changes = one.run(3)
        assert expected_changes.any() or not problem.domain.solved.any(), "something must have moved"
        for _ in range(3):
            other = sweeper(problem, device, precision, ordering)
            np.testing.assert_array_equal(other.run(3), expected_changes)
            np.testing.assert_array_equal(other.log_depth(), one.log_depth())


def rests_quickly(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters is a quick one.

    An account of changes does not know by which kernels they came. By each ordering in single precision, under a
    parallel light and a flash; all else by one ordering.
    """
    by_each = parameters["name"] in ("upwind frontal away", "upwind oblique toward", "upwind flash")
    by_each &= parameters["precision"] == "float32"
    return one_material_in_turn(parameters) and (by_each or parameters["ordering"] is STRIPS[1, 2])


# Parts as small as an image of a test has several of.
THAT_REST = [STRIPS[1, 2], WIDE_STRIPS[0], IMAGES[1, 1], BANDS[1], WIDE_BANDS, Checkerboard(group=8)]


@pytest.mark.quick_where(holds=rests_quickly)
@pytest.mark.parametrize("ordering", THAT_REST, ids=str)
@pytest.mark.parametrize("name", ["upwind frontal away", "oblique away", *KERNELS])
def test_what_rests_has_the_bits_of_what_is_swept_again(
    device: Device, precision: str, ordering: Ordering, name: str
) -> None:
    """From the first sweep to the last: single sweeps, unmeasured ones and iterations in between.

    By the Lax-Friedrichs scheme where much is not swept.
    """
    cell_by_cell = CHECKERBOARD if ordering.coloured else LEXICOGRAPHIC
    for seed, shape in enumerate([(9, 40), (70, 61)]):
        holes = 0.03 * seed if "scheme" in SETUPS[name] else 0.4
        problem = random_problem(seed, shape, boundary="wall", holes=holes, **SETUPS[name])
        records = []
        for each, rests in ((ordering, True), (cell_by_cell, False)):
            kernel = sweeper(problem, device, precision, each, rests=rests)
            assert kernel.ordering.rests == rests
            record = [kernel.run(2)]
            if ordering.single_sweeps:
                for number in range(4):
                    kernel.sweep(number)
            record += [kernel.run(3), kernel.run(40)]
            records.append((np.concatenate(record), kernel.log_depth()))
        np.testing.assert_array_equal(records[0][0], records[1][0])
        np.testing.assert_array_equal(records[0][1], records[1][1])


# The account does not know which way values go.
@pytest.mark.quick_where(holds=lambda given: given["only_lower"] == isinstance(given["ordering"], ThreeColours))
@pytest.mark.parametrize("ordering", [STRIPS[1, 2], ThreeColours(group=8)], ids=str)
@pytest.mark.parametrize("only_lower", [False, True])
def test_what_rests_has_the_bits_of_what_is_swept_again_at_second_order(
    device: Device, ordering: Ordering, *, only_lower: bool
) -> None:
    ordering = replace(ordering, second_order=True, only_lower=only_lower)
    for seed, shape in enumerate([(9, 40), (70, 61)]):
        problem = random_problem(seed, shape, boundary="wall", holes=0.03 * seed, **SETUPS["upwind oblique toward"])
        problem = with_first_order(problem, device, "float32")
        records = []
        for rests in (True, False):
            kernel = sweeper(problem, device, "float32", ordering, rests=rests)
            assert kernel.ordering.rests == rests
            records.append((np.concatenate([kernel.run(3), kernel.run(20)]), kernel.log_depth()))
        np.testing.assert_array_equal(records[0][0], records[1][0])
        np.testing.assert_array_equal(records[0][1], records[1][1])


@pytest.mark.parametrize("ordering", THAT_REST, ids=str)
def test_what_rests_has_the_bits_of_what_is_swept_again_when_images_go_on(device: Device, ordering: Ordering) -> None:
    """At a lower tolerance, each from where it had come to rest, early or late."""
    problems = [random_problem(seed, (40, 45), boundary="wall", **SETUPS["upwind flash"]) for seed in range(3)]
    results = []
    for each, rests in ((ordering, True), (CHECKERBOARD if ordering.coloured else LEXICOGRAPHIC, False)):
        kernel = Sweeper(
            device,
            [problem.kernel_arguments for problem in problems],
            model=problems[0].kernels,
            ordering=fitted(each, device, "float32"),
            precision="float32",
            tolerance=0.5,
            rests=rests,
        )
        record = [kernel.run(8)]
        for images, tolerance in (([0], 0.1), ([1, 2], 0.1), ([0, 1, 2], 0.0)):
            kernel.go_on(images, tolerance)
            record.append(kernel.run(12))
        results.append((np.concatenate(record), kernel.log_depth()))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])
    assert (results[0][0][8:] > 0.0).any()


def test_an_account_is_kept_where_it_pays(device: Device) -> None:
    """By the Lax-Friedrichs scheme where much is not swept, and no boundary is renewed."""

    def rests(scheme: str, **keywords: Any) -> bool:
        given = {"boundary": "wall", "holes": 0.0, "scheme": scheme, **keywords}
        return sweeper(random_problem(1, (20, 30), **given), device, "float32", LEXICOGRAPHIC).ordering.rests

    assert rests("upwind")
    assert not rests("lax-friedrichs")
    assert rests("lax-friedrichs", holes=0.4)
    assert not rests("lax-friedrichs", holes=0.4, boundary="outflow")


@pytest.mark.quick_where(
    holds=lambda parameters: parameters["name"] == "upwind flash" and parameters["ordering"] == STRIPS[1, 2]
)
@pytest.mark.parametrize("ordering", [STRIPS[1, 2], IMAGES[1, 1]], ids=str)
@pytest.mark.parametrize("name", ["upwind frontal away", "upwind oblique toward", "upwind flash"])
def test_what_rests_is_within_so_much_of_what_the_reference_makes_of_it(
    device: Device, name: str, ordering: Ordering
) -> None:
    """And of what it would be without, by less than ten times as much; the same bits whenever it is asked."""
    if not device.has_float64:
        pytest.skip(f"{device} has no double precision")
    resting = 1e-3
    for seed, shape in enumerate([(9, 40), (48, 45)]):
        problem = random_problem(seed, shape, boundary="wall", holes=0.03, **SETUPS[name])
        values = []
        for allowed in (0.0, resting, resting):
            kernel = sweeper(problem, device, "float64", ordering, resting=allowed)
            assert kernel.run(60)[-1, 0] <= resting
            values.append(kernel.log_depth()[0])
        exact, found, again = values
        np.testing.assert_array_equal(found, again)
        assert (found >= exact - 1e-12).all()
        assert (found - exact).max() <= 10 * resting
        reference = Reference.of(problem)
        for colour in range(2):
            reference.log_depth[:] = found
            reference.sweep_colour(colour)
            # Under a flash the kernels leave a hundredth of a change to the next sweep.
            assert (found - reference.log_depth).max() <= 1.02 * resting


@pytest.mark.parametrize("rests", [True, pytest.param(False, marks=thorough)])
@pytest.mark.parametrize("ordering", THAT_REST, ids=str)
def test_what_has_come_to_rest_is_left_alone(device: Device, ordering: Ordering, rests: bool) -> None:
    """Not even values that have been raised since, of which no sweep knows, fall again."""
    problem = random_problem(3, (40, 45), boundary="wall", **SETUPS["upwind frontal away"])
    kernel = sweeper(problem, device, "float32", ordering, tolerance=-1.0, rests=rests)
    # A change that is met at last, and one round more of all four directions, or of both colours.
    while kernel.run(1)[-1, 0] > 0.0:
        pass
    kernel.run(1)
    held = kernel._run.values["log_depth"]
    raised = np.empty(held.size // 4, np.float32)
    cl.enqueue_copy(device.queue, raised, held)
    raised[::3] += 1.0
    cl.enqueue_copy(device.queue, held, raised)
    before = kernel.log_depth()
    kernel.run(1)
    assert np.array_equal(kernel.log_depth(), before) == rests


def with_first_order(problem: Problem, device: Device, precision: str) -> Problem:
    """The problem, to be gone on with from values of first order."""
    kernel = sweeper(problem, device, precision, "wavefront")
    kernel.run(6)
    return replace(problem, first=kernel.log_depth()[0].astype(np.float64))


SHAPES = dict(enumerate([(1, 2), (2, 1), (3, 3), (8, 16), (17, 31), (40, 45), (33, 130), (130, 21)]))


@pytest.mark.quick_where(holds=needed)
@pytest.mark.parametrize(
    "seeds", [(0, 3, 4, 7), pytest.param((1, 2, 5, 6), marks=thorough)], ids=["shapes", "other shapes"]
)
@pytest.mark.parametrize("ordering", [*map(Checkerboard, (2, 4, 8, 16)), *BANDS, *NARROW_BANDS, WIDE_BANDS], ids=str)
def test_checkerboard_is_the_same_by_cells_by_vectors_and_by_bands(
    device: Device, precision: str, ordering: Ordering, seeds: tuple[int, ...]
) -> None:
    """Some groups give up at once, as if the others had lost their processors."""
    for seed in seeds:
        shape = SHAPES[seed]
        problem = random_problem(seed, shape, light=OBLIQUE, boundary=("outflow", "wall")[seed % 2])
        assert_checkerboard_gives_the_bits_of_cells(problem, device, precision, ordering)


# What bands add to cells does not know the kernels: by two of them, in the precision of the other tests.
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")
@pytest.mark.quick_where(holds=lambda given: given["name"] in ("upwind oblique toward", "upwind flash"))
@pytest.mark.parametrize("name", KERNELS)
def test_checkerboard_is_the_same_by_any_kernels(device: Device, precision: str, name: str) -> None:
    for seed, shape in enumerate([(1, 2), (17, 31), (17, 31)]):
        problem = random_problem(seed, shape, boundary="wall", **SETUPS[name])
        assert_checkerboard_gives_the_bits_of_cells(problem, device, precision, BANDS[1])


def assert_checkerboard_gives_the_bits_of_cells(
    problem: Problem, device: Device, precision: str, ordering: Ordering
) -> None:
    by_cells = sweeper(problem, device, precision, CHECKERBOARD)
    # A whole iteration, single sweeps, and iterations of which several share a launch.
    expected = [by_cells.run(1)]
    for number in range(4):
        by_cells.sweep(number)
    expected.append(by_cells.run(7))
    for _ in range(3):
        other = sweeper(problem, device, precision, ordering)
        changes = [other.run(1)]
        for number in range(4):
            other.sweep(number)
        changes.append(other.run(7))
        np.testing.assert_array_equal(np.concatenate(changes), np.concatenate(expected))
        np.testing.assert_array_equal(other.log_depth(), by_cells.log_depth())


@pytest.mark.parametrize(
    ("ordering", "name"),
    [
        *[
            (ordering, "frontal away")
            for ordering in (TILES, STRIPS[1, 3], IMAGES[1, 1], CHECKERBOARD, *BANDS[2:], LEXICOGRAPHIC)
        ],
        *[pytest.param(ordering, "frontal away", marks=thorough) for ordering in BANDS[:2]],
        *[(ordering, "upwind flash") for ordering in BANDS[:2]],
        *[pytest.param(ordering, "upwind flash", marks=thorough) for ordering in (*BANDS[2:], TILES)],
        (TILES, "upwind frontal away"),
        *[(IMAGES[1, 3], name) for name in ("upwind frontal away", "upwind flash")],
        *[pytest.param(IMAGES[3, 3], name, marks=thorough) for name in ("upwind frontal away", "upwind flash")],
        (STRIPS[1, 2], "upwind frontal away"),
        pytest.param(STRIPS[3, 2], "upwind frontal away", marks=thorough),
    ],
    ids=str,
)
def test_images_that_share_launches_do_not_touch_each_other(device: Device, ordering: Ordering, name: str) -> None:
    """Each has its own mask, boundary, known values, start and end."""
    boundary: Boundary = "wall" if name in UPWIND else "outflow"
    problems = [
        random_problem(seed, (29, 22), boundary=boundary, holes=0.03 * seed, **SETUPS[name]) for seed in (0, 2, 4)
    ]

    def run(members: list[Problem]) -> tuple[np.ndarray, np.ndarray]:
        shared = Sweeper(
            device,
            [problem.kernel_arguments for problem in members],
            model=members[0].kernels,
            ordering=fitted(ordering, device, "float32"),
            precision="float32",
            tolerance=1e-3,
        )
        changes = np.concatenate([shared.run(count) for count in (1, 7, 60, 60, 60, 60)])
        return changes, shared.log_depth()

    changes, values = run(problems)
    ends = set()
    for number, problem in enumerate(problems):
        alone_changes, alone = run([problem])
        np.testing.assert_array_equal(changes[:, number], alone_changes[:, 0])
        np.testing.assert_array_equal(values[number], alone[0])
        ends.add(int(np.argmax(changes[:, number] <= 1e-3)))
    assert len(ends) > 1, "the images must end at different times"


@pytest.mark.quick_where(holds=needed)
@pytest.mark.parametrize("ordering", ["wavefront", *BANDS], ids=str)
def test_an_image_rests_from_the_iteration_that_met_the_tolerance(
    device: Device, precision: str, ordering: str | Ordering
) -> None:
    problem = random_problem(1, (30, 30), boundary="wall")
    stepwise, queued = (sweeper(problem, device, precision, ordering, tolerance=0.01) for _ in range(2))
    changes: list[float] = []
    while not changes or changes[-1] > 0.01:
        changes.append(float(stepwise.run(1)[0, 0]))
    expected = stepwise.log_depth()
    record = queued.run(len(changes) + 20)[:, 0]
    np.testing.assert_array_equal(record[: len(changes)], changes)
    assert (record[len(changes) :] == 0).all()
    np.testing.assert_array_equal(queued.log_depth(), expected)
    stepwise.run(5)
    np.testing.assert_array_equal(stepwise.log_depth(), expected)


@pytest.mark.parametrize("ordering", BANDS[1:3], ids=str)
def test_an_image_that_rests_does_so_in_the_launches_that_follow(
    device: Device, ordering: Ordering, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = random_problem(1, (30, 30), boundary="wall")
    one, several = (sweeper(problem, device, "float32", ordering, tolerance=0.01) for _ in range(2))
    expected = one.run(100)
    rests_after = int(np.argmax(expected <= 0.01)) + 1
    assert 3 < rests_after < 90
    monkeypatch.setattr(checkerboard_bands, "_LAUNCHED_CELLS", 3 * problem.shading.size)
    np.testing.assert_array_equal(several.run(100), expected)
    np.testing.assert_array_equal(several.log_depth(), one.log_depth())


@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
def test_runs_that_share_kernels_do_not_touch_each_other(device: Device, ordering: str) -> None:
    problems = [random_problem(seed, (30, 37), boundary="wall") for seed in range(3)]
    alone, in_turns = ([sweeper(problem, device, "float32", ordering) for problem in problems] for _ in range(2))
    for kernel in alone:
        for _ in range(5):
            kernel.run(2)
    for _ in range(5):
        for kernel in in_turns:
            kernel.run(2)
    for one, other in zip(alone, in_turns, strict=True):
        np.testing.assert_array_equal(one.log_depth(), other.log_depth())


@pytest.mark.parametrize(
    "second_order", [False, pytest.param(True, marks=thorough)], ids=["first order", "second order"]
)
@pytest.mark.parametrize("work_groups", [1, 2, 3, 4])
def test_strips_handed_back_are_taken_up_again(device: Device, work_groups: int, second_order: bool) -> None:
    """A group that gives up at its first vain look at the strip before, as if that had lost its processor."""
    setup = SETUPS["upwind oblique toward" if second_order else "frontal away"]
    problems = [random_problem(seed, (150, 90 + seed), boundary="wall", **setup) for seed in range(3)]
    if second_order:
        problems = [with_first_order(problem, device, "float32") for problem in problems]
    impatient = WavefrontStrips(
        8, vectors=1, work_groups=work_groups, polls=1, second_order=second_order, only_lower=not second_order
    )
    plain = replace(LEXICOGRAPHIC, second_order=second_order, only_lower=not second_order)
    for problem in problems:
        one = sweeper(problem, device, "float32", plain)
        expected_changes = one.run(4)
        for _ in range(3):
            other = sweeper(problem, device, "float32", impatient)
            np.testing.assert_array_equal(other.run(4), expected_changes)
            np.testing.assert_array_equal(other.log_depth(), one.log_depth())


@pytest.mark.parametrize("ordering", [STRIPS[1, 2], BANDS[1]], ids=str)
def test_work_left_undone_is_an_error(device: Device, ordering: Ordering) -> None:
    problem = random_problem(1, (40, 40), boundary="wall")
    kernel = sweeper(problem, device, "float32", ordering)
    sync = kernel._run.values["sync"]
    wrong = np.full(sync.size // 4, 7, np.int32)
    wrong[0] = 0
    cl.enqueue_copy(device.queue, sync, wrong)
    with pytest.raises(DeviceError, match="left parts of the image undone"):
        kernel.run(1)


@kernels_take_turns
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
@pytest.mark.parametrize(
    ("boundary", "name"),
    [*[(boundary, "frontal away") for boundary in ("outflow", "extrapolate")], *[("wall", name) for name in SETUPS]],
)
def test_values_never_rise(device: Device, precision: str, ordering: str, boundary: Boundary, name: str) -> None:
    problem = random_problem(4, (33, 47), boundary=boundary, **SETUPS[name])
    kernel = sweeper(problem, device, precision, ordering, linear=boundary == "extrapolate")
    before = kernel.log_depth()[0]
    for number in range(16):
        kernel.sweep(number % 4)
        swept = kernel.log_depth()[0]
        assert (swept <= before).all()
        kernel.renew_boundary()
        after = kernel.log_depth()[0]
        assert (after <= swept).all()
        assert (after < before).any() or number > 3
        before = after


@kernels_take_turns
@pytest.mark.parametrize("name", ["oblique away", "oblique toward", "flash on a shiny surface", *UPWIND])
def test_checkerboard_has_the_fixed_point_of_the_wavefront(device: Device, precision: str, name: str) -> None:
    # State constraints keep the scheme monotone; eq. (12) does not, and its limit may depend on the order of the cells.
    problem = random_problem(8, (40, 45), boundary="wall", **SETUPS[name])
    limits = []
    for ordering in ("wavefront", "checkerboard"):
        kernel = sweeper(problem, device, precision, ordering)
        change = np.inf
        for _ in range(60):
            if (change := float(kernel.run(50)[-1, 0])) == 0.0:
                break
        assert change <= (2e-7 if precision == "float32" else 1e-15)
        limits.append(kernel.log_depth()[0])
    np.testing.assert_allclose(limits[0], limits[1], atol=1e-4 if precision == "float32" else 1e-11)


@pytest.mark.parametrize("light", [ParallelLight(), OBLIQUE], ids=["frontal", "oblique"])
def test_least_slope_is_where_the_hamiltonian_is_least(light: ParallelLight) -> None:
    slopes = np.linspace(-30.0, 30.0, 600_001)
    for numbers in ((0.9, 0.2, 0.3, -0.1), (0.5, -1.5, -0.4, 0.2), (0.35, 0.0, 0.5, 0.5)):
        brightness, given, x, y = (np.array(number) for number in numbers)
        equation = ParallelEquation(brightness, x, y, light, 30.0)
        expected_p = slopes[equation.hamiltonian(slopes, given).argmin()]
        expected_q = slopes[equation.hamiltonian(given, slopes).argmin()]
        assert equation.argmin_p(given) == pytest.approx(expected_p, abs=2e-4)
        assert equation.argmin_q(given) == pytest.approx(expected_q, abs=2e-4)


def test_change_is_the_largest_over_the_iteration(device: Device, precision: str) -> None:
    problem = random_problem(6, (61, 83))
    kernel = sweeper(problem, device, precision, "wavefront")
    before = kernel.log_depth()[0]
    for _ in range(4):
        change = float(kernel.run(1)[0, 0])
        after = kernel.log_depth()[0]
        assert change == pytest.approx(float((before - after).max()), rel=1e-6)
        before = after


def test_known_values_stay(device: Device, precision: str) -> None:
    problem = random_problem(9, (20, 20))
    kernel = sweeper(problem, device, precision, "checkerboard")
    for _ in range(5):
        float(kernel.run(1)[0, 0])
    known = problem.domain.known
    np.testing.assert_array_equal(kernel.log_depth()[0][known], problem.start[known].astype(precision))


@pytest.mark.parametrize("name", kernel_names())
def test_the_library_is_given_no_vectors(name: str) -> None:
    """Its functions may be compiled for wider registers than the kernels: PoCL's then end the process."""
    code = re.sub(r"/\*.*?\*/", "", kernel_source(name), flags=re.DOTALL)
    assert not re.search(r"\b(convert_|vload|vstore|native_|half_\w+\()", code)


SCHEMES: dict[str, dict[str, Any]] = {
    "upwind": {},
    "second order": {"accuracy_order": 2},
    "upwind, checkerboard": {"ordering": "checkerboard"},
    "accelerated": {"scheme": "lax-friedrichs"},
    "guided": {"guide": np.full((3, 4), 1.0)},
    "regularised": {"scheme": "regularised"},
}


@pytest.mark.parametrize("name", SCHEMES)
def test_groups_are_of_one_size_for_images_of_all_sizes(
    device: Device, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Drivers for processors compile a kernel anew for each, which takes longer than a photograph."""
    groups: dict[str, set[tuple[int, ...] | None]] = {}
    prepared = Kernel.prepared

    def noted(kernel: Kernel, device: Device, size: Any, group: Any, values: Any) -> Any:
        groups.setdefault(kernel._where.split()[2], set()).add(group)
        return prepared(kernel, device, size, group, values)

    monkeypatch.setattr(Kernel, "prepared", noted)
    for shape in ((21, 30), (34, 75)):
        # Only where the limit is one is the iteration accelerated.
        scene = bump(shape, light=ParallelLight() if name == "accelerated" else FlashLight())
        known = scene.known_depth if name == "accelerated" else None
        given = {"light": scene.light, "known_depth": known, "device": device, **SCHEMES[name]}
        reconstruct(scene.image, scene.camera, **given).render()
    own = {"accelerated": "mix_values", "guided": "relax", "regularised": "correct_small_grids"}
    assert {"render", own.get(name, "render")} < groups.keys()
    assert {where: len(sizes) for where, sizes in groups.items()} == dict.fromkeys(groups, 1)
    assert all(None not in sizes for sizes in groups.values())


def test_rows_of_all_lengths_are_taken_by_groups_of_one_size() -> None:
    sizes, groups = zip(*(in_row_groups(64, width, 3, 2) for width in (2, 63, 64, 65, 1000)), strict=True)
    assert len(set(groups)) == 1
    assert [size[1:] for size in sizes] == [(3, 2)] * 5
    for size, width in zip(sizes, (2, 63, 64, 65, 1000), strict=True):
        assert size[0] % groups[0][0] == 0
        assert width <= size[0] < width + groups[0][0]
    assert in_row_groups(1, 1, 3, 2) == ((1, 3, 2), (1, 1, 1)), "vectors of a whole row"
