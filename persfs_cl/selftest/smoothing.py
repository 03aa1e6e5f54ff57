"""Smoothing along edges in plain NumPy, for the reference, and data for it: see kernels/shared/smooth.cl."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from persfs_cl._cl.smoothing import (
    COARSEST,
    FINER,
    HUBER,
    LEAST,
    RELAXATION,
    reduced_data,
    reduced_weights,
    refined,
)
from persfs_cl.arrays import Array


class Data(NamedTuple):
    """What :class:`persfs_cl._cl.smoothing.Smoother` is given."""

    start: Array
    target: Array
    votes: Array
    right: Array
    below: Array
    noise: float


def noisy_plates(shape: tuple[int, int], seed: int = 0) -> Data:
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


def smoothed_plainly(given: Data, times: tuple[int, int] = COARSEST) -> Array:
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


def smoothed_from_blocks(given: Data, levels: int) -> Array:
    """The same, begun on blocks of 2 x 2 pixels, and these on blocks of blocks, so many times."""
    if not levels:
        return smoothed_plainly(given)
    data = reduced_data(given.start, given.target, given.votes)
    coarse = Data(*data, *reduced_weights(given.right, given.below), given.noise)
    return _continued(given, smoothed_from_blocks(coarse, levels - 1))


def _continued(given: Data, coarse: Array) -> Array:
    return smoothed_plainly(given._replace(start=refined(coarse, given.start.shape)), FINER)
