"""What residuals tell: their noise, their most frequent value, and which cells to trust."""

from __future__ import annotations

import numpy as np
import pytest

from persfs_cl.arrays import Array
from persfs_cl.guide.agreement import LEAST_NOISE, agreeing, distortion_of, drift_of, mode_of, noise_of
from persfs_cl.guide.cells import Cells

SIZE = (30, 40)
RANDOM = np.random.default_rng


def cells_of(values: Array) -> Cells:
    return Cells.of_map(values, np.ones((2 * values.shape[0], 2 * values.shape[1]), bool))


@pytest.mark.parametrize("noise", [0.005, 0.02, 0.1])
def test_noise_is_that_of_neighbours(noise: float) -> None:
    """Whatever their trend, and whatever a few outliers do."""
    residuals = RANDOM(0).normal(0.0, noise, SIZE) + np.add.outer(np.arange(30), np.arange(40)) * 0.01 * noise
    residuals[RANDOM(1).random(SIZE) < 0.05] += 1.0
    cells = cells_of(residuals)
    assert noise_of(cells.values, cells) == pytest.approx(noise, rel=0.15)


def test_noise_is_never_none() -> None:
    smooth = cells_of(np.zeros(SIZE))
    assert noise_of(smooth.values, smooth) == LEAST_NOISE
    few = cells_of(np.zeros((1, 3)))
    assert noise_of(few.values, few) == 0.01


@pytest.mark.parametrize("offset", [-0.7, 0.0, 0.05])
def test_the_mode_ignores_what_is_dragged(offset: float) -> None:
    """A third of the surface is too near, by anything."""
    random = RANDOM(2)
    residuals = random.normal(offset, 0.01, 900)
    residuals[:300] += random.uniform(0.02, 0.5, 300)
    residuals[5] = np.nan
    assert mode_of(residuals, 0.01) == pytest.approx(offset, abs=0.004)
    assert abs(np.nanmedian(residuals) - offset) > 0.004


def test_the_mode_of_one_value_is_that() -> None:
    assert mode_of(np.array([0.25, np.nan]), 0.003) == pytest.approx(0.25, abs=1e-3)


def test_a_drift_is_a_quadratic_through_most() -> None:
    row, column = np.mgrid[-1:1:30j, -1:1:40j]
    bent = 0.1 + 0.05 * column - 0.02 * row + 0.04 * column**2 - 0.03 * column * row
    random = RANDOM(4)
    residuals = bent + random.normal(0.0, 0.003, SIZE)
    residuals[random.random(SIZE) < 0.15] += 0.3
    residuals[3, 4] = np.nan
    cells = cells_of(np.zeros(SIZE))
    found = drift_of(residuals.ravel(), cells, 0.003)
    np.testing.assert_allclose(found, bent.ravel(), atol=0.006)


def test_distortion_is_what_scatters_below_beyond_the_noise() -> None:
    random = RANDOM(5)
    trusted = np.ones(5000, bool)
    assert distortion_of(random.normal(0.0, 0.01, 5000), trusted, 0.01) < 0.004
    wide = np.concatenate([random.normal(0.0, 0.05, 4000), np.full(1000, 2.0)])
    assert distortion_of(wide, trusted, 0.01) == pytest.approx(np.sqrt(0.05**2 - 0.01**2), rel=0.1)
    assert distortion_of(np.full(4, 0.1), trusted[:4], 0.01) == 0.0


def test_cells_agree_with_two_neighbours() -> None:
    values = RANDOM(6).normal(0.0, 0.01, SIZE)
    values[10, 10] += 0.5
    values[20, 20] = np.nan
    cells = cells_of(values)
    trusted = agreeing(cells.values - 0.0, cells, 0.01, 0.0)
    alone = cells.of_pixel[20, 20]
    assert not trusted[alone]
    assert np.count_nonzero(~trusted) <= 3
    # Neighbours of one plate agree in depth, though the residuals of a surface that was dragged do not.
    dragged = np.add.outer(50.0 * np.arange(30.0), np.arange(40.0)).ravel()
    flat = cells_of(np.zeros(SIZE))
    assert agreeing(dragged, flat, 0.01, 0.0).all()
    assert not agreeing(dragged, flat.saying(7.0 * np.arange(dragged.size)), 0.01, 0.0)[1:-1].any()


def test_a_few_points_trust_each_other_as_far_as_they_go() -> None:
    for count in (1, 2):
        points = Cells.of_points(np.linspace(0.0, 3.0, count), np.zeros(count), np.zeros(count), np.ones((4, 9), bool))
        assert agreeing(np.full(count, 0.3), points, 0.01, 0.0).all()
