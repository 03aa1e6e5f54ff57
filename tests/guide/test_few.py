"""What few points say of what lies between them."""

from __future__ import annotations

import numpy as np
import pytest

from persfs_cl.guide.agreement import noise_of
from persfs_cl.guide.cells import Cells
from persfs_cl.guide.few import are_few, kriged

SHAPE = (120, 150)
WANTED = np.ones(SHAPE, bool)


def points(count: int, values: float | np.ndarray = 0.0) -> Cells:
    random = np.random.default_rng(3)
    rows, columns = (random.permutation(size)[:count].astype(np.float64) for size in SHAPE)
    return Cells.of_points(columns, rows, np.broadcast_to(values, count).astype(np.float64), WANTED)


def test_few_points_are_told_from_many_and_from_maps() -> None:
    assert are_few(points(24))
    assert not are_few(points(25))
    assert not are_few(Cells.of_map(np.ones((4, 4)), WANTED))


def test_their_noise_is_not_what_the_surface_errs_between_them() -> None:
    smooth = np.sin(np.arange(20.0))
    assert noise_of(smooth, points(20, np.log(np.linspace(1.0, 2.0, 20)))) == 0.01


def test_residuals_fade_away_from_the_points() -> None:
    cells = points(2)
    (row, column), other = cells.middles.astype(int)
    found = kriged(np.array([0.1, np.nan]), cells, 0.001)
    # One point does not tell what it has in common with its neighbours: half, by all that is known.
    assert 0.03 < found[row, column] < 0.08
    assert found[row, column] == found.max()
    np.testing.assert_allclose(kriged(np.array([0.1, np.nan]), cells, 0.001, doubted=True), found / 5, rtol=1e-12)
    assert abs(found[tuple(other)]) < 1e-3
    assert np.isfinite(found).all()


def test_neighbours_that_agree_count_more_than_such_as_do_not() -> None:
    cells = points(24)
    row, column = (cells.middles / 40.0).T
    smooth, random = np.sin(row) * np.cos(column), np.random.default_rng(0).permutation(np.sin(row) * np.cos(column))
    at = tuple(cells.middles.astype(int).T)
    kept = [np.mean(kriged(0.1 * each, cells, 0.001)[at] / (0.1 * each)) for each in (smooth, random)]
    assert kept[0] > 0.6 > kept[1]


def test_noise_that_is_told_is_not_followed() -> None:
    cells = points(12)
    residuals = np.random.default_rng(1).normal(0.0, 0.05, 12)
    assert np.abs(kriged(residuals, cells, 0.5)).max() < 0.1 * np.abs(kriged(residuals, cells, 0.001)).max()


@pytest.mark.parametrize("value", [0.0, 0.05])
def test_residuals_that_are_all_alike(value: float) -> None:
    found = kriged(np.full(10, value), points(10), 0.01)
    assert 0.0 <= found.min() <= found.max() <= value
