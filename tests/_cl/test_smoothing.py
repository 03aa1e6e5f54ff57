"""The device's smoothing of residuals, against NumPy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.smoothing import (
    COARSEST,
    FINER,
    HUBER,
    LEAST,
    RELAXATION,
    Smoother,
    reduced_data,
    reduced_weights,
    refined,
)
from persfs_cl.arrays import Array


class Data(NamedTuple):
    start: Array
    target: Array
    votes: Array
    right: Array
    below: Array
    noise: float


def data(shape: tuple[int, int], seed: int = 0) -> Data:
    """Noisy values of two plates at some pixels, an edge between them, and a hole that nothing joins."""
    random = np.random.default_rng(seed)
    height, width = shape
    plate = np.where(np.arange(width) < width / 2, 0.1, -0.1) + np.zeros(shape)
    target = plate + random.normal(0.0, 0.02, shape)
    votes = np.where(random.random(shape) < 0.5, random.random(shape), 0.0)
    right, below = random.uniform(0.5, 1.0, (2, *shape))
    right[:, width // 2 - 1 : width // 2] = 0.01
    hole = np.zeros(shape, bool)
    hole[: height // 4, : width // 4] = True
    for weights, axis in ((right, 1), (below, 0)):
        weights[hole | np.roll(hole, -1, axis)] = 0.0
        weights[(slice(None), -1) if axis else (-1, slice(None))] = 0.0
    votes[hole] = 0.0
    return Data(np.where(votes > 0, target, 0.0), target, votes, right, below, 0.02)


def plainly(given: Data, times: tuple[int, int] = COARSEST) -> Array:
    """The same in NumPy: shifted arrays, in double precision."""
    reweighings, sweeps = times
    map_ = given.start.copy()
    colours = np.add.outer(np.arange(map_.shape[0]), np.arange(map_.shape[1])) % 2

    def shifted(values: Array, step: int, axis: int) -> Array:
        moved = np.roll(values, step, axis)
        moved[(slice(None),) * axis + (0 if step > 0 else -1,)] = 0.0
        return moved

    for _ in range(reweighings):
        error = np.abs(given.target - map_) / given.noise
        pull = given.votes * np.where(error > HUBER, HUBER / np.maximum(error, 1e-300), 1.0)
        weights = [
            side / (np.abs(np.diff(map_, axis=axis, append=np.take(map_, [-1], axis))) / given.noise + LEAST)
            for side, axis in ((given.right, 1), (given.below, 0))
        ]
        before = [shifted(weight, 1, axis) for weight, axis in zip(weights, (1, 0), strict=True)]
        total = pull + sum(weights) + sum(before)
        for _ in range(sweeps):
            for colour in range(2):
                pulled = pull * given.target
                for weight, earlier, axis in zip(weights, before, (1, 0), strict=True):
                    pulled = pulled + weight * shifted(map_, -1, axis) + earlier * shifted(map_, 1, axis)
                change = RELAXATION * (pulled / np.where(total > 0, total, 1.0) - map_)
                map_ = np.where((colours == colour) & (total > 0), map_ + change, map_)
    return map_


@pytest.mark.parametrize("shape", [(23, 38), (1, 9), (7, 1), (2, 2)])
def test_equals_numpy(device: ps.Device, precision: str, shape: tuple[int, int]) -> None:
    given = data(shape)
    smoother = Smoother(device, precision, given.right, given.below)
    found = smoother.smoothed(given.start, given.target, given.votes, given.noise)
    np.testing.assert_allclose(found, plainly(given), atol=2e-6 if precision == "float32" else 1e-13)
    # The same bits, whatever it smoothed before.
    np.testing.assert_array_equal(smoother.smoothed(given.start, given.target, given.votes, given.noise), found)


def test_begins_with_blocks(device: ps.Device) -> None:
    given = data((23, 38))
    start, target, votes = reduced_data(given.start, given.target, given.votes)
    coarse = Data(start, target, votes, *reduced_weights(given.right, given.below), given.noise)
    begun = refined(plainly(coarse), given.start.shape)
    expected = plainly(given._replace(start=begun), FINER)
    smoother = Smoother(device, "float32", given.right, given.below, levels=1)
    found = smoother.smoothed(given.start, given.target, given.votes, given.noise)
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_blocks_have_the_votes_and_the_edges_of_their_pixels() -> None:
    given = data((7, 9))
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
    given = data((40, 60), seed=1)
    smoother = Smoother(device, "float32", 6.0 * given.right, 6.0 * given.below)
    found = smoother.smoothed(given.target, given.target, given.votes, given.noise)
    left, right = found[15:, 2:28], found[15:, 32:58]
    assert left.mean() == pytest.approx(0.1, abs=0.005)
    assert right.mean() == pytest.approx(-0.1, abs=0.005)
    assert max(left.std(), right.std()) < 0.25 * given.noise
    # What nothing joins keeps what it had.
    np.testing.assert_array_equal(found[:10, :15], given.target[:10, :15].astype(np.float32))


def test_outliers_pull_no_harder_than_others(device: ps.Device) -> None:
    given = data((30, 30), seed=2)
    target = given.target.copy()
    target[20, 20] += 1.0
    votes = given.votes.copy()
    votes[20, 20] = 1.0
    smoother = Smoother(device, "float64", 6.0 * given.right, 6.0 * given.below)
    with_outlier = smoother.smoothed(given.start, target, votes, given.noise)
    without = smoother.smoothed(given.start, given.target, votes, given.noise)
    assert np.abs(with_outlier - without).max() < given.noise
