"""Shiny spots: found where they were put, and filled as Laplace's equation says."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from persfs_cl.arrays import Array, Mask
from persfs_cl.errors import InputError
from persfs_cl.preparation import inpaint
from persfs_cl.preparation.highlights import dilate, fill_smoothly, find_specular

ROWS, COLUMNS = np.mgrid[:40, :60].astype(float)
SHADING = 0.2 + 0.001 * ROWS + 0.002 * COLUMNS


def disc(row: float, column: float, radius: float) -> Mask:
    return np.asarray((ROWS - row) ** 2 + (COLUMNS - column) ** 2 <= radius**2)


@pytest.mark.parametrize("scale", [1.0, 1e-3, 255.0])
def test_spots_are_found_at_their_very_pixels(scale: float) -> None:
    spots = disc(12, 20, 3) | disc(30, 45, 1) | disc(5, 50, 0) | (disc(25, 15, 4) & ~disc(25, 15, 2))
    image = scale * np.where(spots, 1.0, SHADING)
    np.testing.assert_array_equal(find_specular(image, size=9), spots)
    assert not find_specular(scale * SHADING).any()


def test_a_spot_may_lie_on_a_slope_of_brightness() -> None:
    slope = 0.02 * 1.05**COLUMNS  # nineteen times as bright at one end as at the other
    spots = disc(15, 30, 2) | disc(25, 50, 2)
    np.testing.assert_array_equal(find_specular(np.where(spots, 3.5 * slope, slope)), spots)


def test_a_bright_surface_beside_a_dark_one_is_no_spot() -> None:
    # Wide on the left and, as long as it is, only one pixel wide on the right.
    bright = (COLUMNS < 20) | ((ROWS == 20) & (COLUMNS < 55))
    image = np.where(bright, 1.0, 0.05)
    assert not find_specular(image, size=9).any()
    cut = bright & (COLUMNS == 30)
    np.testing.assert_array_equal(
        find_specular(np.where(cut, 0.05, image), size=9), bright & (COLUMNS > 30)
    )  # on its own it is one


def test_factor_and_size_are_the_bounds_of_a_spot() -> None:
    square = (abs(ROWS - 20) <= 3) & (abs(COLUMNS - 30) <= 3)
    image = np.where(square, 0.5, 0.25)
    assert not find_specular(image, size=9, factor=2.0).any()
    np.testing.assert_array_equal(find_specular(image, size=9, factor=1.99), square)
    assert not find_specular(image, size=7, factor=1.99).any()
    # By default a tenth of the shorter side, 5 pixels.
    assert not find_specular(np.where(square, 1.0, 0.1)).any()
    np.testing.assert_array_equal(
        find_specular(np.where(square & (ROWS < 21), 1.0, 0.1)[:, :50]), (square & (ROWS < 21))[:, :50]
    )


def test_noise_in_the_dark_is_no_spot() -> None:
    image = np.where(COLUMNS < 30, 0.5, 0.0)
    image[10, 50], image[20, 50] = 0.04, 0.06
    assert np.argwhere(find_specular(image)).tolist() == [[20, 50]]


def test_pixels_outside_the_mask_are_no_surroundings() -> None:
    mask = COLUMNS > 9
    image = np.where(disc(20, 30, 2), 1.0, SHADING)
    spoilt = np.where(mask, image, np.where(ROWS > 20, np.nan, 1e6))
    before = spoilt.copy()
    np.testing.assert_array_equal(find_specular(spoilt, mask=mask), disc(20, 30, 2))
    np.testing.assert_array_equal(spoilt, before)
    # A narrow part of the mask is all there is, and not a spot.
    assert not find_specular(image, mask=disc(20, 30, 1)).any()


@pytest.mark.parametrize("radius", [0, 1, 2, 5])
def test_dilation_is_a_square_around_each_pixel(radius: int) -> None:
    pixels = np.random.default_rng(0).random((13, 17)) > 0.95
    expected = np.zeros_like(pixels)
    for row, column in np.argwhere(pixels):
        expected[max(row - radius, 0) : row + radius + 1, max(column - radius, 0) : column + radius + 1] = True
    np.testing.assert_array_equal(dilate(pixels, radius), expected)


@pytest.mark.parametrize("holes", [disc(20, 30, 8), disc(3, 3, 0), disc(20, 30, 12) & ~disc(20, 30, 6)])
def test_a_linear_ramp_is_filled_exactly(holes: Mask) -> None:
    filled, left = fill_smoothly(np.where(holes, 1e6, SHADING), holes)
    np.testing.assert_allclose(filled, SHADING, rtol=1e-11)
    np.testing.assert_array_equal(filled[~holes], SHADING[~holes])
    assert not left.any()


def test_every_filled_pixel_is_the_mean_of_the_neighbours_that_it_has() -> None:
    random = np.random.default_rng(1)
    image = random.random((15, 12))
    mask, holes = random.random((2, 15, 12)) < [[[0.8]], [[0.6]]]
    filled, left = fill_smoothly(np.where(mask, image, np.nan), holes, mask=mask)
    np.testing.assert_array_equal(filled[mask & ~holes], image[mask & ~holes])
    assert np.isnan(filled[~mask]).all()
    checked = 0
    for row, column in np.argwhere(holes & mask):
        beside = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
        there = [filled[r, c] for r, c in beside if 0 <= r < 15 and 0 <= c < 12 and mask[r, c]]
        if left[row, column]:
            assert filled[row, column] == image[row, column]
        else:
            assert filled[row, column] == pytest.approx(np.mean(there), abs=1e-10)
            checked += 1
    assert checked > 30


def test_a_hole_with_nothing_around_it_is_left() -> None:
    image, holes, mask = np.full((5, 7), 3.0), np.zeros((5, 7), bool), np.ones((5, 7), bool)
    mask[:, 3] = False
    holes[:, 4:] = holes[2, 1] = True
    filled, left = fill_smoothly(image, holes, mask=mask)
    np.testing.assert_array_equal(left, holes & (np.arange(7) > 3))
    np.testing.assert_allclose(filled, image, rtol=1e-14)
    everything = np.ones((5, 7), bool)
    np.testing.assert_array_equal(fill_smoothly(image, everything)[1], everything)
    np.testing.assert_array_equal(fill_smoothly(image, ~everything)[0], image)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"factor": 0.9}, r"factor=0\.9"),
        ({"factor": math.nan}, "factor=nan"),
        ({"size": 4}, "size=4 is not a width: give an odd number"),
        ({"size": 0}, "size=0"),
        ({"size": 3.0}, r"size=3\.0"),
        ({"mask": np.zeros((4, 4), bool)}, "selects no pixel"),
    ],
)
def test_find_specular_refuses_the_impossible(options: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        find_specular(np.ones((4, 4)), **options)
    with pytest.raises(InputError, match="goes down to -1"):
        find_specular([[-1.0, 1.0]])


def test_dilate_and_fill_refuse_what_is_no_set_of_pixels() -> None:
    wrong: Any = 1.5
    with pytest.raises(InputError, match=r"pixels is float64 of shape \(4, 4\): give a bool array"):
        dilate(np.ones((4, 4)), 1)
    for radius in (-1, wrong):
        with pytest.raises(InputError, match=f"radius={radius} is not possible: give a whole number, 0 or more"):
            dilate(np.ones((4, 4), bool), radius)
    with pytest.raises(InputError, match=r"holes is float64 of shape \(4, 4\)"):
        fill_smoothly(np.ones((4, 4)), np.ones((4, 4)))
    with pytest.raises(InputError, match=r"holes is bool of shape \(4, 5\): give a bool array of the image's shape"):
        fill_smoothly(np.ones((4, 4)), np.ones((4, 5), bool))


def test_a_hole_of_any_width_is_filled_in_a_few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    rows, columns = np.mgrid[:150, :200].astype(float)
    harmonic = rows**2 - columns**2 + 3 * rows * columns  # its second differences cancel
    mask = (rows - 75) ** 2 + (columns - 100) ** 2 > 40
    holes = (rows > 0) & (rows < 149) & (columns > 0) & (columns < 199)
    around_the_gap = mask & dilate(~mask, 1)
    holes &= ~around_the_gap
    steps = []
    correction = inpaint._Grid.correction

    def counted(grid: inpaint._Grid, residual: Array) -> Array:
        steps.append(residual.size)
        return correction(grid, residual)

    monkeypatch.setattr(inpaint._Grid, "correction", counted)
    filled, _ = fill_smoothly(np.where(holes, 0.0, harmonic), holes, mask=mask)
    np.testing.assert_allclose(filled[mask], harmonic[mask], atol=1e-9 * np.abs(harmonic).max())
    # Without the coarser grids it would be some 400.
    assert steps.count(max(steps)) < 40
