"""Sets of pixels: rims, missing neighbours, what is connected, and how far apart."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from persfs_cl.arrays import Mask
from persfs_cl.masks import (
    StraightSteps,
    connected,
    in_square_blocks,
    missing_neighbours,
    of_blocks,
    rim,
    steps_from,
    steps_to_blocks,
    straight_steps_from,
    stretches_of_blocks,
)


def flood_by_steps(seeds: Mask, passable: Mask) -> Mask:
    """The definition of `connected`, one step of one pixel at a time."""
    reached = seeds & passable
    while True:
        padded = np.pad(reached, 1)
        beside = padded[1:-1, :-2] | padded[1:-1, 2:] | padded[:-2, 1:-1] | padded[2:, 1:-1]
        grown = reached | (beside & passable)
        if (grown == reached).all():
            return reached
        reached = grown


@given(st.integers(0, 10_000), st.integers(1, 17), st.integers(1, 17), st.floats(0.3, 1.0))
def test_connected_is_the_flood(seed: int, height: int, width: int, share: float) -> None:
    random = np.random.default_rng(seed)
    passable = random.uniform(size=(height, width)) < share
    seeds = random.uniform(size=(height, width)) < 0.05
    np.testing.assert_array_equal(connected(seeds, passable), flood_by_steps(seeds, passable))


def test_connected_follows_a_spiral() -> None:
    picture = ["########", "       #", "###### #", "#    # #", "# ## # #", "# #### #", "#      #", "########"]
    passable = np.array([[character == "#" for character in line] for line in picture])
    seeds = np.zeros(passable.shape, bool)
    seeds[0, 0] = True
    assert connected(seeds, passable)[4, 2], "the innermost pixel lies on the one path"


def test_rim_of_a_rectangle_and_of_a_hole() -> None:
    pixels = np.ones((5, 6), bool)
    pixels[2, 3] = False
    edge = np.zeros((5, 6), bool)
    edge[[0, -1]] = edge[:, [0, -1]] = True
    edge[1, 3] = edge[3, 3] = edge[2, 2] = edge[2, 4] = True
    np.testing.assert_array_equal(rim(pixels), edge & pixels)


def test_missing_neighbours_of_a_row() -> None:
    assert missing_neighbours(np.array([[True, True, False, True]])).tolist() == [[2 + 8 + 16, 4 + 8 + 16, 24, 30]]


def test_steps_from_counts_the_shortest_way() -> None:
    passable = np.array([[1, 1, 1], [0, 0, 1], [1, 1, 1]], bool)
    seeds = np.zeros((3, 3), bool)
    seeds[0, 0] = True
    assert steps_from(seeds, passable).tolist() == [[0, 1, 2], [-1, -1, 3], [6, 5, 4]]


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (7, 12)])
def test_straight_steps_from_go_through_everything(shape: tuple[int, int]) -> None:
    seeds = np.random.default_rng(sum(shape)).uniform(size=shape) > 0.8
    seeds.ravel()[3] = True
    np.testing.assert_array_equal(straight_steps_from(seeds), steps_from(seeds, np.ones(shape, bool)))


@pytest.mark.parametrize("shape", [(1, 1), (5, 70), (33, 64), (70, 41)])
def test_straight_steps_to_a_part_are_those_to_its_pixels(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(1)
    seeds = random.random(shape) < 0.01
    seeds.flat[random.integers(seeds.size)] = True
    steps = StraightSteps(seeds)
    expected = straight_steps_from(seeds)
    for part in stretches_of_blocks(random.random((-(-shape[0] // 8), -(-shape[1] // 8))) < 0.5, 8):
        np.testing.assert_array_equal(steps.to(*part), expected[part])
        np.testing.assert_array_equal(steps.to(*part, int(expected[part].max())), expected[part])


@pytest.mark.parametrize("shape", [(1, 1), (5, 70), (33, 64), (70, 41)])
def test_steps_to_blocks_are_bounds_of_those_to_their_pixels(shape: tuple[int, int]) -> None:
    random = np.random.default_rng(0)
    for seeds in (random.random(shape) < 0.01, np.zeros(shape, bool)):
        seeds.flat[random.integers(seeds.size)] = True
        steps = straight_steps_from(seeds)
        for side in (1, 8, 32):
            fewest, most = (in_square_blocks(of, steps, side) for of in (np.minimum, np.maximum))
            least_bound, most_bound = steps_to_blocks(seeds, side)
            assert least_bound.shape == most_bound.shape == (-(-shape[0] // side), -(-shape[1] // side))
            assert (least_bound <= fewest).all()
            assert (fewest - least_bound < 2 * side).all()
            assert (most <= most_bound).all()
            assert (most_bound - most < 4 * side).all()


def test_stretches_of_blocks_are_the_pixels_of_the_blocks() -> None:
    blocks = np.array([[1, 1, 0, 1], [0, 0, 0, 0], [0, 1, 1, 1]], bool)
    found = np.zeros((8, 10), int)
    for part in stretches_of_blocks(blocks, 3):
        found[part] += 1
    np.testing.assert_array_equal(found, of_blocks(blocks, 3, found.shape))
    assert found[:3].tolist() == [[1, 1, 1, 1, 1, 1, 0, 0, 0, 1]] * 3
