"""The device's smoothing of residuals, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.smoothing import Smoother, reduced_data, reduced_weights
from persfs_cl.selftest.smoothing import noisy_plates, smoothed_from_blocks, smoothed_plainly


@pytest.mark.parametrize("shape", [(23, 38), (1, 9), (7, 1), (2, 2)])
def test_equals_numpy(device: ps.Device, precision: str, shape: tuple[int, int]) -> None:
    given = noisy_plates(shape)
    smoother = Smoother(device, precision, given.right, given.below)
    found = smoother.smoothed(given.start, given.target, given.votes, given.noise)
    np.testing.assert_allclose(found, smoothed_plainly(given), atol=2e-6 if precision == "float32" else 1e-13)
    # The same bits, whatever it smoothed before.
    np.testing.assert_array_equal(smoother.smoothed(given.start, given.target, given.votes, given.noise), found)


@pytest.mark.parametrize("levels", [1, 2])
def test_begins_with_blocks(device: ps.Device, levels: int) -> None:
    given = noisy_plates((23, 38))
    smoother = Smoother(device, "float32", given.right, given.below, levels)
    found = smoother.smoothed(given.start, given.target, given.votes, given.noise)
    np.testing.assert_allclose(found, smoothed_from_blocks(given, levels), atol=2e-6)


def test_blocks_have_the_votes_and_the_edges_of_their_pixels() -> None:
    given = noisy_plates((7, 9))
    start, target, votes = reduced_data(*given[:3])
    assert start.shape == (4, 5)
    assert votes.sum() == pytest.approx(given.votes.sum())
    assert (votes * target).sum() == pytest.approx((given.votes * given.target).sum())
    assert start[3, 4] == given.start[6, 8]
    ones = np.ones((6, 8))
    ones[:, -1] = 0.0
    ones[2, 3] = 0.1
    right, _ = reduced_weights(ones, np.zeros((6, 8)))
    np.testing.assert_allclose(right, np.array([[2.0, 2.0, 2.0, 0.0], [2.0, 1.1, 2.0, 0.0], [2.0, 2.0, 2.0, 0.0]]))
    hole = ones * 0.0
    assert not reduced_weights(hole, hole)[0].any()


def test_smooths_within_parts_and_keeps_the_edge(device: ps.Device) -> None:
    given = noisy_plates((40, 60), seed=1)
    smoother = Smoother(device, "float32", 6.0 * given.right, 6.0 * given.below)
    found = smoother.smoothed(given.target, given.target, given.votes, given.noise)
    left, right = found[15:, 2:28], found[15:, 32:58]
    assert left.mean() == pytest.approx(0.1, abs=0.005)
    assert right.mean() == pytest.approx(-0.1, abs=0.005)
    assert max(left.std(), right.std()) < 0.25 * given.noise
    # What nothing joins keeps what it had.
    np.testing.assert_array_equal(found[:10, :15], given.target[:10, :15].astype(np.float32))


def test_outliers_pull_no_harder_than_others(device: ps.Device) -> None:
    given = noisy_plates((30, 30), seed=2)
    target = given.target.copy()
    target[20, 20] += 1.0
    votes = given.votes.copy()
    votes[20, 20] = 1.0
    smoother = Smoother(device, "float64", 6.0 * given.right, 6.0 * given.below)
    with_outlier = smoother.smoothed(given.start, target, votes, given.noise)
    without = smoother.smoothed(given.start, given.target, votes, given.noise)
    assert np.abs(with_outlier - without).max() < given.noise
