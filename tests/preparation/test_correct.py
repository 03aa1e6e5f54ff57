"""Ambient light and vignetting taken out exactly, and only where the mask is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.preparation.correct import divide_vignetting, subtract_ambient


def random_image(shape: tuple[int, int], seed: int = 0) -> Array:
    return np.random.default_rng(seed).random(shape)


@pytest.mark.parametrize("ambient", [0.25, "map"])
def test_ambient_light_is_subtracted_exactly_and_what_is_darker_is_black(ambient: Any) -> None:
    lit = np.array([[0.5, 0.0, 0.125], [1.0, 2.0, 0.0625]])
    dark = np.full(lit.shape, 0.25) if ambient == 0.25 else np.array([[0.5, 0.0, 0.25], [0.75, 0.125, 0.0]])
    light, below = subtract_ambient(lit + dark, dark if ambient == "map" else ambient)
    np.testing.assert_array_equal(light, lit)
    assert not below.any()
    light, below = subtract_ambient([[0.0, 0.25, 0.5, 0.125]], 0.25)
    np.testing.assert_array_equal(light, [[0.0, 0.0, 0.25, 0.0]])
    np.testing.assert_array_equal(below, [[True, False, False, True]])


def test_a_rounding_error_is_not_below_the_ambient_light() -> None:
    light, below = subtract_ambient([[np.nextafter(0.1, 0), 0.1 - 1e-9]], 0.1)
    np.testing.assert_array_equal(light, [[0.0, 0.0]])
    np.testing.assert_array_equal(below, [[False, True]])


def test_vignetting_is_divided_out() -> None:
    surface = 0.1 + random_image((6, 5))
    lens = 0.2 + random_image((6, 5), 1)
    np.testing.assert_allclose(divide_vignetting(surface * lens, lens), surface, rtol=1e-15)


def test_ambient_light_and_vignetting_outside_the_mask_do_not_matter() -> None:
    image, mask = random_image((4, 3)), np.ones((4, 3), bool)
    for nothing in (np.nan, np.inf, -1.0, 0.0):
        beside = np.full((4, 3), 0.125)
        mask[1, 2], beside[1, 2] = False, nothing
        light, _ = subtract_ambient(image, beside, mask=mask)
        np.testing.assert_array_equal(light[mask], np.maximum(image - 0.125, 0)[mask])
        flat = divide_vignetting(image, beside, mask=mask)
        np.testing.assert_array_equal(flat[mask], 8 * image[mask])
        assert light[1, 2] == flat[1, 2] == image[1, 2]


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (np.ones((4, 5)), r"is float64 of shape \(4, 5\): give an array of numbers of the image's shape \(4, 4\)"),
        (np.ones((4, 4), bool), "is bool of shape"),
        (np.full((4, 4), np.nan), "is nan or so at 16 pixels"),
        (np.full((4, 4), np.inf), "is inf or so at 16 pixels"),
        (np.diag([1.0, 1.0, 1.0, 0.0]) - 1.0, "is -1 or so at 13 pixels"),
    ],
)
def test_impossible_ambient_light_and_vignetting_are_refused(wrong: Any, reason: str) -> None:
    with pytest.raises(InputError, match=f"ambient {reason}"):
        subtract_ambient(np.ones((4, 4)), wrong)
    with pytest.raises(InputError, match=r"^vignetting"):
        divide_vignetting(np.ones((4, 4)), wrong)
    with pytest.raises(InputError, match="vignetting is 0 or so at 16 pixels"):
        divide_vignetting(np.ones((4, 4)), np.zeros((4, 4)))
