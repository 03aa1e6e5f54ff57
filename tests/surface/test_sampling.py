"""Samples that stand for all values around them."""

from __future__ import annotations

import numpy as np
import pytest

from persfs_cl.arrays import Array
from persfs_cl.surface.sampling import fitted_samples

ROW, COLUMN = np.mgrid[:44, :61].astype(float)


def between(samples: Array, step: int) -> Array:
    """Bilinear interpolation at every pixel, from the first sample to the last."""
    for _ in range(2):
        places = np.arange((samples.shape[0] - 1) * step + 1) / step
        before = np.minimum(places.astype(int), len(samples) - 2)
        share = (places - before)[:, None]
        samples = ((1 - share) * samples[before] + share * samples[before + 1]).T
    return samples


@pytest.mark.parametrize("step", [2, 3, 5, 8])
def test_of_a_plane_they_are_its_values(step: int) -> None:
    plane = 3.0 + 0.25 * ROW - 0.5 * COLUMN
    samples = fitted_samples(plane, step)
    assert samples.shape == plane[::step, ::step].shape
    known = ~np.isnan(samples)
    np.testing.assert_allclose(samples[known], plane[::step, ::step][known], atol=1e-12)
    # All are there that are two steps from every edge.
    rows, columns = np.mgrid[: samples.shape[0], : samples.shape[1]] * step
    inner = (np.minimum(rows, columns) >= 2 * step) & (rows + 2 * step <= 43) & (columns + 2 * step <= 60)
    assert (known >= inner).all()


@pytest.mark.parametrize("step", [2, 4, 5])
def test_what_is_drawn_between_them_is_nearer_than_between_single_values(step: int) -> None:
    random = np.random.default_rng(0)
    curved = 0.01 * (ROW - 20) ** 2 + 0.02 * (COLUMN - 30) ** 2 + 0.01 * ROW * COLUMN
    for noise in (0.0, 0.1):
        values = curved + noise * random.standard_normal(curved.shape)
        single = values[::step, ::step]
        errors = []
        for samples in (fitted_samples(values, step), single):
            known = np.where(np.isnan(fitted_samples(values, step)), np.nan, samples)
            drawn = between(known, step)
            errors.append(np.nanmean((drawn - values[: drawn.shape[0], : drawn.shape[1]]) ** 2))
        assert errors[0] < 0.8 * errors[1]


def test_they_do_not_look_across_what_is_missing() -> None:
    values = np.where(COLUMN < 30, 1.0, np.where(COLUMN == 30, np.nan, 9.0))
    samples = fitted_samples(values, 3)
    # Of columns 0, 3, 6 and so on those within two steps of column 30, or of an edge.
    assert np.isnan(samples[:, 9:12]).all()
    np.testing.assert_allclose(samples[2:-2, 2:9], 1.0, rtol=1e-12)
    np.testing.assert_allclose(samples[2:-2, 12:-2], 9.0, rtol=1e-12)


def test_small_images_have_none() -> None:
    assert np.isnan(fitted_samples(np.ones((4, 9)), 2)).all()
