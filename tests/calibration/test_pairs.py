"""Photographs with their truth, as a fit takes them."""

from __future__ import annotations

import numpy as np
import pytest
from lenses import depth, flashed, places

import persfs_cl as ps


@pytest.mark.parametrize("dense", [False, True])
def test_a_lens_that_bends_lines_is_straightened_first(dense: bool) -> None:
    lens = ps.Camera(150.0, distortion=(-0.25, 0.06, 0.002, -0.001))
    shape = (96, 128)
    truth = depth(*places(lens, shape))
    rows, columns = np.indices(shape)[:, 8:-8:11, 8:-8:11].reshape(2, -1)
    points = np.stack([columns, rows, truth[rows, columns]], axis=1)
    calibration = ps.calibrate(
        [(0.7 * flashed(lens, shape), truth if dense else points)], lens, light=ps.FlashLight(), fit="gain"
    )
    assert calibration.values["gain"] == pytest.approx(0.7, rel=0.01)
