"""Cells of maps of any size, and points, on the pixels of an image."""

from __future__ import annotations

import numpy as np
import pytest

from persfs_cl.guide.cells import NEIGHBOURS, Cells, medians

EVERYWHERE = np.ones((12, 18), bool)


def test_cells_of_a_coarse_map_are_blocks() -> None:
    coarse = np.arange(24.0).reshape(4, 6)
    cells = Cells.of_map(coarse, EVERYWHERE)
    assert (cells.count, cells.spacing) == (24, 3.0)
    np.testing.assert_array_equal(cells.on_pixels(cells.values, -1.0), np.kron(coarse, np.ones((3, 3))))
    np.testing.assert_array_equal(cells.middles[7], [4.0, 4.0])
    assert set(cells.neighbours[7]) == {0, 1, 2, 6, 8, 12, 13, 14}
    assert sorted(cells.neighbours[0]) == [-1] * 5 + [1, 6, 7]
    assert (cells.pixels == 9).all()


@pytest.mark.parametrize("shape", [(5, 7), (1, 1), (12, 18), (12, 5), (1, 18)])
def test_sizes_that_do_not_divide_share_the_pixels_evenly(shape: tuple[int, int]) -> None:
    cells = Cells.of_map(np.random.default_rng(0).random(shape), EVERYWHERE)
    assert cells.count == shape[0] * shape[1]
    assert cells.pixels.sum() == EVERYWHERE.size
    per_side = [length / count for length, count in zip(EVERYWHERE.shape, shape, strict=True)]
    assert cells.pixels.min() >= np.floor(per_side[0]) * np.floor(per_side[1])
    assert cells.pixels.max() <= np.ceil(per_side[0]) * np.ceil(per_side[1])


def test_a_finer_map_is_reduced_by_medians() -> None:
    fine = np.kron(np.arange(216.0).reshape(12, 18), np.ones((5, 3)))
    fine[::5, ::3] = 1e6
    fine[1, 1] = np.nan
    cells = Cells.of_map(fine, EVERYWHERE)
    np.testing.assert_array_equal(cells.values, np.arange(216.0))
    assert cells.spacing == 1.0


@pytest.mark.parametrize("shape", [(2000, 1500), (3000, 70), (450, 450)])
def test_a_map_of_very_many_cells_has_fewer(shape: tuple[int, int]) -> None:
    row, column = np.indices(shape) / shape[0]
    guide = 1.0 + row + column
    guide[0, 0] = np.nan
    cells = Cells.of_map(guide, np.ones(shape, bool))
    assert 200_000 / 5 < cells.count <= 200_000
    assert cells.neighbours.size == 8 * cells.count
    np.testing.assert_allclose(cells.values, cells.of_surface(guide))
    assert (cells.of_pixel >= 0).all()
    assert cells.spacing == pytest.approx(np.sqrt(guide.size / cells.count), rel=0.01)


def test_a_map_of_many_cells_has_all_of_them() -> None:
    guide = np.random.default_rng(0).uniform(1.0, 2.0, (400, 500))
    cells = Cells.of_map(guide, np.ones((400, 500), bool))
    np.testing.assert_array_equal(cells.values, guide.ravel())
    assert cells.spacing == 1.0


def test_what_says_nothing_and_what_is_not_wanted_is_left_out() -> None:
    coarse = np.arange(24.0).reshape(4, 6)
    coarse[0, 0] = np.nan
    wanted = EVERYWHERE.copy()
    wanted[:, 12:] = False
    cells = Cells.of_map(coarse, wanted)
    np.testing.assert_array_equal(cells.values, [1, 2, 3, 6, 7, 8, 9, 12, 13, 14, 15, 18, 19, 20, 21])
    assert (cells.of_pixel[:, 12:] == -1).all()
    assert (cells.of_pixel[:3, :3] == -1).all()
    assert cells.neighbours.max() < cells.count


def test_points_lie_on_pixels() -> None:
    wanted = EVERYWHERE.copy()
    wanted[0] = False
    columns = np.array([2.4, 1.6, 17.0, 18.2, -3.0, 5.0, 7.0, 8.0])
    rows = np.array([3.0, 3.4, 11.4, 2.0, 1.0, 0.0, 5.0, 5.0])
    values = np.array([1.0, 3.0, 5.0, 7.0, 7.0, 7.0, 9.0, np.nan])
    cells = Cells.of_points(columns, rows, values, wanted)
    # Two in one pixel are one; others lie outside the image or the mask, or say nothing.
    np.testing.assert_array_equal(cells.values, [2.0, 9.0, 5.0])
    np.testing.assert_array_equal(cells.middles, [[3.0, 2.0], [5.0, 7.0], [11.0, 17.0]])
    assert cells.spacing == pytest.approx(np.sqrt(11 * 18 / 3))
    assert cells.neighbours.shape == (3, NEIGHBOURS)
    assert sorted(cells.neighbours[0, :2]) == [1, 2]
    assert (cells.neighbours[:, 2:] == -1).all()
    lonely = Cells.of_points(columns[:1], rows[:1], values[:1], wanted)
    assert (lonely.neighbours == -1).all()


def test_a_surface_is_known_by_the_median_of_its_cell() -> None:
    cells = Cells.of_map(np.zeros((4, 6)), EVERYWHERE)
    surface = np.arange(216.0).reshape(12, 18)
    surface[:3, :3] = np.nan
    surface[4, 4] = np.nan
    found = cells.of_surface(surface)
    assert np.isnan(found[0])
    assert found[1] == np.median(surface[:3, 3:6])
    assert found[7] == np.nanmedian(surface[3:6, 3:6])


def test_a_median_is_of_the_pixels_near_to_it() -> None:
    """Of a cell with a jump inside, those of the larger part; of a point its pixel; of none where nothing is known."""
    cells = Cells.of_map(np.zeros((4, 6)), EVERYWHERE)
    surface = np.zeros(EVERYWHERE.shape)
    surface[:3, 2] = 1.0
    surface[3, 3] = np.nan
    near = cells.near_median(surface, cells.of_surface(surface))
    np.testing.assert_array_equal(near[:3, :3], [[True, True, False]] * 3)
    assert not near[3, 3]
    assert near[4:6, 3:6].all()
    point = Cells.of_points(np.array([4.0]), np.array([2.0]), np.zeros(1), EVERYWHERE)
    assert np.argwhere(point.near_median(surface, point.of_surface(surface))).tolist() == [[2, 4]]


def test_nearest_and_interpolated_maps() -> None:
    coarse = np.add.outer(np.arange(4.0), 10.0 * np.arange(6.0))
    cells = Cells.of_map(coarse, EVERYWHERE)
    values = cells.values.copy()
    values[7] = np.nan
    nearest, _ = cells.nearest(values)
    assert nearest[4, 4] in coarse
    assert nearest[4, 4] != coarse[1, 1]
    np.testing.assert_array_equal(nearest[6:], np.kron(coarse, np.ones((3, 3)))[6:])
    linear = cells.interpolated(values)
    inside = np.add.outer((np.arange(1, 11) - 1) / 3, 10.0 * (np.arange(1, 17) - 1) / 3)
    np.testing.assert_allclose(linear[1:-1, 1:-1], inside, atol=1e-9)
    assert not np.isnan(linear).any()
    for few in (1, 2):
        row = Cells.of_points(np.arange(few, dtype=float), np.zeros(few), np.ones(few), EVERYWHERE)
        np.testing.assert_array_equal(row.interpolated(row.values), np.ones((12, 18)))


def test_medians_of_groups() -> None:
    random = np.random.default_rng(3)
    values, groups = random.random(300), random.integers(0, 7, 300)
    found = medians(values, groups, 9)
    for group in range(7):
        assert found[group] == pytest.approx(np.median(values[groups == group]), abs=1e-15)
    assert np.isnan(found[7:]).all()
    assert np.isnan(medians(np.empty(0), np.empty(0, np.int64), 2)).all()
