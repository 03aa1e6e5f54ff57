"""Numbers that stand for blocks of pixels."""

from __future__ import annotations

import numpy as np
import pytest

from persfs_cl.surface.plots.blocks import Blocks


@pytest.mark.parametrize("shape", [(2, 3001), (3999, 2), (2000, 1999), (1, 1), (5, 7)])
@pytest.mark.parametrize("holes", [False, True])
def test_they_are_those_of_each_block(shape: tuple[int, int], holes: bool) -> None:
    random = np.random.default_rng(0)
    values = random.random(shape)
    if holes:
        values[random.random(shape) < 0.3] = np.nan
    blocks = Blocks(shape)
    means = blocks.collected(lambda rows: blocks.means(values[rows]))
    least = blocks.collected(lambda rows: blocks.combined(np.fmin, values[rows]))
    assert means.shape == least.shape == (-(-shape[0] // blocks.down), -(-shape[1] // blocks.right))
    for row, column in random.integers(0, means.shape, (50, 2)):
        block = values[row * blocks.down :, column * blocks.right :][: blocks.down, : blocks.right]
        known = block[~np.isnan(block)]
        if known.size:
            assert means[row, column] == pytest.approx(known.mean(), rel=1e-12)
            assert least[row, column] == known.min()
        else:
            assert np.isnan(means[row, column])
            assert np.isnan(least[row, column])


def test_they_end_where_the_last_block_does() -> None:
    blocks = Blocks((2500, 3001))
    assert (blocks.down, blocks.right) == (2, 3)
    assert blocks.extent == (-0.5, 3002.5, 2499.5, -0.5)
    assert [rows.start for rows in blocks.rows()][1:] == [rows.stop for rows in blocks.rows()][:-1]
    assert all(rows.start % 2 == 0 for rows in blocks.rows())
