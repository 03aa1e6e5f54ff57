"""Launches between iterations that are accelerated, against NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from problems import fitted, random_problem

import persfs_cl as ps
from persfs_cl._cl.anderson import DEPTH, Mixer
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.sweeper import Sweeper

SHAPES = ((9, 14), (1, 2), (6, 5))
LAUNCHES = DEPTH + 4
"""More than are kept."""


def started(device: ps.Device, precision: str, ordering: Ordering | str) -> tuple[Sweeper, list[tuple[int, int]]]:
    problems = [random_problem(seed, shape, boundary="wall", holes=0.1) for seed, shape in enumerate(SHAPES)]
    images = [problem.kernel_arguments for problem in problems]
    ordering = ordering if isinstance(ordering, str) else fitted(ordering, device, precision)
    kernels = problems[0].kernels
    one = Sweeper(device, images, model=kernels, ordering=ordering, precision=precision, only_lower=False)
    return one, list(SHAPES)


def values_of(one: Sweeper) -> list[NDArray[np.float64]]:
    values = [np.empty(shape) for shape in SHAPES]
    one.copy_log_depth(values)
    return values


# Of an ordering only the padding of its images matters.
@pytest.mark.quick_where(
    holds=lambda given: (
        (given["ordering"], given["precision"]) in (("wavefront", "float32"), ("lexicographic", "float64"))
    )
)
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard", "lexicographic"])
def test_products_and_mixtures_are_those_of_numpy(device: ps.Device, precision: str, ordering: str) -> None:
    one, shapes = started(device, precision, ordering)
    mixer, random = one.mixer(), np.random.default_rng(1)
    images = [0, 2]
    base: dict[int, NDArray[np.float64]] = {}
    ceiling: dict[int, NDArray[np.float64]] = {}
    values: dict[int, list[NDArray[np.float64]]] = {image: [] for image in images}
    residuals: dict[int, list[NDArray[np.float64]]] = {image: [] for image in images}
    rounding = 50.0 * float(np.finfo(precision).eps)
    for launch in range(LAUNCHES):
        one.run(1)
        reached = values_of(one)
        products = mixer.products(images)
        weights = {}
        for image, found in zip(images, products, strict=True):
            values[image].insert(0, reached[image])
            rise = float((reached[image] - ceiling.setdefault(image, reached[image])).max())
            assert found.rise == pytest.approx(max(rise, 0.0), rel=rounding)
            if launch:
                residuals[image].insert(0, reached[image] - base[image])
            count = max(0, min(len(residuals[image]) - 1, DEPTH))
            if count:
                latest = residuals[image]
                steps = [latest[age] - latest[age + 1] for age in range(count)]
                moved = values[image][0] - values[image][1]
                scale = float(np.sum(latest[0] ** 2)) + 1.0
                expected = [np.sum(steps[0] * step) for step in steps]
                np.testing.assert_allclose(found.of_steps[:count], expected, rtol=rounding, atol=rounding * scale)
                expected = [np.sum(latest[0] * step) for step in steps]
                np.testing.assert_allclose(found.of_residual[:count], expected, rtol=rounding, atol=rounding * scale)
                assert found.squares == pytest.approx(np.sum(latest[0] ** 2), rel=rounding)
                assert found.value_squares == pytest.approx(np.sum(moved**2), rel=rounding)
                assert found.across == pytest.approx(np.sum(moved * steps[0]), rel=rounding, abs=rounding * scale)
                assert found.largest == pytest.approx(np.abs(latest[0]).max(), rel=rounding)
            weights[image] = random.uniform(-0.5, 0.5, count)
        mixer.mix(weights)
        mixed = values_of(one)
        np.testing.assert_array_equal(mixed[1], reached[1])
        for image, own in weights.items():
            kept = values[image]
            correction = sum(
                (weight * (kept[age] - kept[age + 1]) for age, weight in enumerate(own)), np.zeros(shapes[image])
            )
            np.testing.assert_allclose(mixed[image], kept[0] - correction, rtol=rounding, atol=rounding)
            base[image] = mixed[image]
    mixer.begin_again(2)
    restored = values_of(one)
    np.testing.assert_array_equal(restored[2], ceiling[2])
    np.testing.assert_array_equal(restored[0], base[0])


def test_what_a_mixture_changes_is_no_change_of_the_next_iteration(device: ps.Device) -> None:
    one, _ = started(device, "float32", "wavefront")
    mixer = one.mixer()
    for _ in range(4):
        one.run(2)
        mixer.products([0])
        before = values_of(one)[0]
        mixer.mix({0: np.zeros(0)})
    mixer.products([0])
    mixer.mix({0: np.full(1, -3.0)})
    mixed = values_of(one)[0]
    assert np.abs(mixed - before).max() >= 0.0
    (change,) = one.run(1)[:, 0]
    assert change == pytest.approx(np.abs(values_of(one)[0] - mixed).max(), rel=1e-6)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (WavefrontImages(8, vectors=1, work_groups=1), WavefrontImages(2, vectors=1, work_groups=1)),
        pytest.param(
            CheckerboardBands(8, band_rows=8, work_groups=1),
            CheckerboardBands(2, band_rows=8, work_groups=1),
            marks=pytest.mark.thorough,
        ),
    ],
    ids=["wavefront", "checkerboard"],
)
def test_bits_of_products_do_not_depend_on_the_vectors(device: ps.Device, one: Ordering, other: Ordering) -> None:
    sums = []
    for ordering in (one, other):
        sweeping, _ = started(device, "float32", replace(ordering, only_lower=False))
        mixer: Mixer = sweeping.mixer()
        for _ in range(3):
            sweeping.run(2)
            products = mixer.products([0, 1, 2])
            mixer.mix({image: np.zeros(0) for image in range(3)})
        sums.append(
            [(tuple(found.of_steps[:1]), found.squares, found.across, found.largest, found.rise) for found in products]
        )
    assert sums[0] == sums[1]
