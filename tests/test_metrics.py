from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from persfs_cl.errors import InputError
from persfs_cl.metrics import Errors, compare

NAN = np.nan


def test_hand_computed_errors() -> None:
    # Differences 3, 1, 0, 2: mean 1.5, squares 9 + 1 + 0 + 4 = 14, median between 1 and 2.
    errors = compare([[4.0, 1.0], [5.0, 4.0]], [[1.0, 2.0], [5.0, 6.0]])
    assert errors == Errors(mean=1.5, root_mean_square=np.sqrt(3.5), maximum=3.0, median=1.5, count=4)


def test_nan_in_either_and_the_mask_leave_pixels_out() -> None:
    estimate = [1.0, NAN, 3.0, 90.0, 7.0]
    truth = [2.0, 2.0, NAN, 4.0, 5.0]
    assert compare(estimate, truth).count == 3
    errors = compare(estimate, truth, mask=[True, True, True, False, True])
    assert errors == Errors(mean=1.5, root_mean_square=np.sqrt(2.5), maximum=2.0, median=1.5, count=2)


def test_scale_is_the_median_ratio() -> None:
    # Ratios truth / estimate are 2, 2, 5: one outlier does not move the scale.
    errors = compare([1.0, 2.0, 3.0], [2.0, 4.0, 15.0], align="scale")
    assert errors == Errors(mean=3.0, root_mean_square=np.sqrt(27.0), maximum=9.0, median=0.0, count=3)


def test_scale_looks_at_compared_pixels_only() -> None:
    estimate, truth = np.array([1.0, 2.0, -5.0]), np.array([3.0, 6.0, 1.0])
    assert compare(estimate, truth, mask=[True, True, False], align="scale").maximum == 0.0


def test_range_maps_both_to_the_unit_interval() -> None:
    # Estimate becomes 0, ½, 1 and truth 0, ¼, 1.
    errors = compare([5.0, 6.0, 7.0], [-4.0, 0.0, 12.0], align="range")
    assert errors == Errors(mean=0.25 / 3, root_mean_square=np.sqrt(0.0625 / 3), maximum=0.25, median=0.0, count=3)


def test_range_looks_at_compared_pixels_only() -> None:
    assert compare([0.0, 1.0, 100.0], [2.0, 3.0, NAN], align="range").maximum == 0.0


@pytest.mark.parametrize("unit", [2.0**-1000, 2.0**1000])
def test_squares_neither_overflow_nor_vanish(unit: float) -> None:
    errors = compare([3 * unit, 5 * unit], [0.0, unit])
    assert errors == Errors(3.5 * unit, np.sqrt(12.5) * unit, 4 * unit, 3.5 * unit, 2)


@pytest.mark.parametrize("align", [None, "scale", "range"])
def test_inputs_stay_as_they_were(align: Any) -> None:
    estimate, truth = np.array([1.0, 2.0, NAN]), np.array([2.0, 5.0, 1.0])
    before = estimate.copy(), truth.copy()
    compare(estimate, truth, align=align)
    np.testing.assert_array_equal(estimate, before[0])
    np.testing.assert_array_equal(truth, before[1])


@pytest.mark.parametrize("align", [None, "scale", "range"])
def test_an_array_equals_itself(align: Any) -> None:
    depth = np.linspace(1.0, 2.0, 12).reshape(3, 4)
    assert compare(depth, depth, align=align) == Errors(0.0, 0.0, 0.0, 0.0, 12)


@pytest.mark.parametrize(
    ("estimate", "truth", "keywords", "message"),
    [
        ([1.0, 2.0], [1.0], {}, r"shape \(2,\) but truth has \(1,\)"),
        ([1.0, 2.0], [1.0, 2.0], {"mask": [True]}, r"mask is bool of shape \(1,\)"),
        ([NAN, 2.0], [1.0, NAN], {}, "none of 2 pixels"),
        ([1.0, 2.0], [1.0, 2.0], {"mask": [False, False]}, "none of 2 pixels"),
        ([], [], {}, "none of 0 pixels"),
        ([np.inf, 2.0], [1.0, 2.0], {}, "estimate is infinite at 1"),
        ([1.0, 2.0], [1.0, 2.0], {"align": "offset"}, r"align='offset'.*None, \"scale\" or \"range\""),
        ([0.0, 2.0], [1.0, 2.0], {"align": "scale"}, "estimate goes down to 0"),
        ([1.0, 2.0], [-1.0, 2.0], {"align": "scale"}, "truth goes down to -1"),
        ([3.0, 3.0], [1.0, 2.0], {"align": "range"}, "estimate is 3 at every"),
        ([1.0, 2.0], [4.0, 4.0], {"align": "range"}, "truth is 4 at every"),
        ("a", [1.0], {}, "estimate='a' is no array"),
        (["a"], [1.0], {}, "estimate holds <U1, not numbers"),
        ([1.0], np.ma.masked_array([1.0], [True]), {}, "truth is a masked array"),
        ([1.0], [2.0], {"align": np.array(["scale"])}, "align=array.* is unknown"),
        ([1e308], [-1e308], {}, "go up to 1e\\+308, are too far apart"),
        ([1e308, -1e308], [1.0, 2.0], {"align": "range"}, "too far apart"),
        ([5e-324], [1e308], {"align": "scale"}, "too far apart"),
        ([1.0], [None], {}, "truth holds object, not numbers"),
        ([1.0], [[1.0], [1.0, 2.0]], {}, "truth is no array"),
        ([1.0, 2.0], [1.0, 2.0], {"mask": [0, 255]}, "mask is int64 of shape"),
    ],
)
def test_wrong_inputs_are_named(estimate: Any, truth: Any, keywords: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        compare(estimate, truth, **keywords)
