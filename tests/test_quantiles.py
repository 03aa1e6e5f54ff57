"""Tests of medians and percentiles: they are NumPy's, whatever the size and the order."""

import numpy as np
import pytest

from persfs_cl.quantiles import median, quantile, sampled

LARGE = 600, 1000


def noisy(shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng(3).standard_normal(shape)


def slanted() -> np.ndarray:
    return np.add.outer(np.linspace(0.0, 1.0, LARGE[0]), np.linspace(0.0, 9.0, LARGE[1]))


def with_holes() -> np.ndarray:
    values = noisy(LARGE)
    values[:300, 2:] = np.nan
    return values


ARRAYS = {
    **{f"{size} numbers": noisy((size,)) for size in (1, 2, 3, 10)},
    "large": noisy(LARGE),
    "one more": noisy((LARGE[0] * LARGE[1] + 1,)),
    "in order": np.sort(noisy(LARGE), axis=None),
    "slanted": slanted(),
    "with holes": with_holes(),
    "of one value": np.ones(LARGE),
    "of two values": (noisy(LARGE) > 0).astype(float),
    # No sample is likely to meet any of them.
    "nearly empty": np.where(np.arange(LARGE[1]) == 7, slanted(), np.nan),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_quantiles_are_those_of_numpy(name: str) -> None:
    values = ARRAYS[name]
    given = values.copy()
    assert median(values) == np.nanmedian(values)
    for share in (0.0, 0.005, 0.9, 0.95, 1.0):
        assert quantile(values, share) == np.nanquantile(values, share)
    np.testing.assert_array_equal(values, given)


def test_nothing_has_no_quantile() -> None:
    assert np.isnan(median(np.full(3, np.nan)))
    assert np.isnan(quantile(np.empty(0), 0.5))


@pytest.mark.parametrize("size", [2, 99, 100, 101, 250, 12_345])
def test_samples_are_spread_over_all(size: int) -> None:
    places = sampled(np.zeros(size), 100)
    assert len(places) == min(size, 100)
    assert (np.diff([-1, *places, size]) > 0).all()
    assert np.diff(places).max() <= 2 * max(size // 100, 1) + 1
