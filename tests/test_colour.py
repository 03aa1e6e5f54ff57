"""The curve of sRGB, and whole levels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from persfs_cl.colour import decode_srgb, encode_srgb, to_display


def test_to_display_is_srgb_of_the_same_shape() -> None:
    np.testing.assert_array_equal(to_display([0.0, 1.0, np.nan, 7.0, -1.0]), [0, 255, 0, 255, 0])
    assert to_display(np.full((2, 3, 3), decode_srgb(100 / 255))).tolist() == np.full((2, 3, 3), 100).tolist()


def test_levels_change_where_those_of_the_curve_do() -> None:
    # Half-way between two levels, and next to it on both sides.
    changes = decode_srgb((np.arange(255) + 0.5) / 255)
    light = np.concatenate([changes * (1.0 - 1e-12), changes * (1.0 + 1e-12), np.linspace(0.0, 1.0, 9999)])
    np.testing.assert_array_equal(to_display(light), np.rint(255.0 * encode_srgb(light)))


def test_srgb_has_its_published_values() -> None:
    # IEC 61966-2-1: the two pieces meet at 0.04045, and middle grey 0.5 is 0.21404 in linear light.
    np.testing.assert_allclose(decode_srgb([0.0, 0.04045, 0.5, 1.0]), [0.0, 0.04045 / 12.92, 0.2140411, 1.0], 1e-6)


@given(st.floats(0, 4))
def test_encode_undoes_decode(value: float) -> None:
    assert encode_srgb(decode_srgb(value)) == pytest.approx(value, abs=1e-6)


def test_decoding_rises_and_keeps_the_ends() -> None:
    light = decode_srgb(np.arange(256) / 255)
    assert (np.diff(light) > 0).all()
    assert (light[0], light[-1]) == (0.0, 1.0)
