"""Checks of what a user gave: each says what is wrong, and carries the argument and its value."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, Literal

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.checks import (
    as_array,
    as_flag,
    as_floats,
    as_mask,
    as_number,
    as_numbers,
    as_whole_number,
    check_choice,
    check_finite,
    check_positive,
)
from persfs_cl.maps import as_albedo, as_depth, as_image, as_known_depth, as_map

SHAPE = (2, 3)
EVERYWHERE = np.ones(SHAPE, bool)
Words = Literal["up", "down", "left"]


def test_what_is_right_is_returned_as_a_plain_value() -> None:
    for number in (as_number("n", np.float32(2.0)), as_number("n", Fraction(4, 2), least=2.0, most=2.0)):
        assert (type(number), number) == (float, 2.0)
    whole = as_whole_number("n", np.int16(3), least=3, most=3, odd=True)
    assert (type(whole), whole) == (int, 3)
    assert as_numbers("n", np.array([1, 2]), (1, 2), remedy="") == (1.0, 2.0)
    assert as_numbers("n", 5, (1, 2), remedy="") == (5.0,)
    assert as_flag("n", np.True_) is True
    check_choice("n", "up", Words)
    check_choice("n", "up", ("up", "down"))
    check_choice("n", None, Words, optional=True)
    check_finite("n", 1.0, -2)
    check_positive("n", 1e-9)


def test_arrays_that_are_right_are_not_copied() -> None:
    depth, mask = np.full(SHAPE, 2.0), EVERYWHERE
    for same in (as_array("a", depth), as_floats("a", depth), as_image("a", depth), as_depth("a", depth)):
        assert same is depth
    assert as_map("a", depth, SHAPE) is depth
    assert as_mask("a", mask) is mask
    assert as_mask("a", mask, SHAPE) is mask
    depths, known = as_known_depth("a", np.array([[np.nan, 1.0, 2.0]], np.float32), (1, 3))
    np.testing.assert_array_equal(depths, [[np.nan, 1.0, 2.0]])
    np.testing.assert_array_equal(known, [[False, True, True]])
    used = np.array([[True, False, False]])
    np.testing.assert_array_equal(as_albedo("a", np.array([[0.5, 0.0, np.nan]]), used), [[0.5, 1.0, 1.0]])


@pytest.mark.parametrize(
    ("check", "value", "message"),
    [
        (lambda name, value: as_number(name, value, above=0.0), 0, "is not possible: give a finite number above 0."),
        (lambda name, value: as_number(name, value, least=0.0), math.nan, "possible: give a finite number, 0 or more."),
        (lambda name, value: as_number(name, value, least=1.0, most=2.0), 3, "give a finite number from 1 to 2."),
        (lambda name, value: as_number(name, value, above=0.0, most=9.0), "1", "a finite number above 0, at most 9."),
        (lambda name, value: as_number(name, value, most=9.0, what="an age"), 10, "is not an age: .* at most 9."),
        (lambda name, value: as_number(name, value, hint=", or none"), True, "give a finite number, or none."),
        (as_whole_number, 1.0, "is not possible: give a whole number, 0 or more."),
        (as_whole_number, True, "give a whole number"),
        (as_whole_number, -1, "give a whole number"),
        (lambda name, value: as_whole_number(name, value, least=1, most=5), 6, "give a whole number from 1 to 5."),
        (lambda name, value: as_whole_number(name, value, least=1, odd=True), 4, "give an odd number, 1 or more."),
        (lambda name, value: as_numbers(name, value, (2,), remedy="give two"), (1, 2, 3), "is not possible: give two."),
        (lambda name, value: as_numbers(name, value, (2,), most=1, remedy="give two"), (1, 2), "give two."),
        (lambda name, value: as_numbers(name, value, (2,), remedy="give two"), (1, math.inf), "give two."),
        (as_flag, 1, "is no choice: give True or False."),
        (lambda name, value: check_choice(name, value, Words), "in", 'is unknown: choose "up", "down" or "left".'),
        (lambda name, value: check_choice(name, value, ("up",)), 3, 'is unknown: choose "up".'),
        (lambda name, value: check_choice(name, value, ("up",), optional=True), 3, 'choose None or "up".'),
        (check_finite, math.inf, "is not finite"),
        (check_positive, 0.0, "is not a length: give a finite number above 0."),
        (as_array, "a.png", "is no array: read the file first"),
    ],
)
def test_what_is_wrong_is_named_with_its_value(check: Callable[[str, Any], object], value: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message) as raised:
        check("size", value)
    assert str(raised.value).startswith(f"size={value!r} ")
    assert raised.value.argument == "size"
    assert raised.value.value is value


@pytest.mark.parametrize(
    ("check", "value", "message"),
    [
        (as_array, [[1], [2, 3]], "is no array .*: give numbers in rows of equal length."),
        (as_array, np.ma.masked_array([1.0], [True]), r"masked array.*give depth\.filled"),
        (as_floats, [True], "holds bool, not numbers"),
        (as_floats, ps.bump((8, 8)), r"is a Scene, no array: give its \.depth\."),
        (as_image, [1.0], r"has shape \(1,\): give \(height, width\)"),
        (as_depth, [[0.0]], r"^depth\[0, 0\]=0\.0 is not a distance in front of the camera"),
        (as_depth, np.ones((0, 2)), r"has shape \(0, 2\)"),
        (as_mask, [True], r"is bool of shape \(1,\): give a bool array of shape \(height, width\)"),
        (lambda name, value: as_mask(name, value, SHAPE), np.ones(SHAPE), "is float64 of .* of the image's shape"),
        (lambda name, value: as_map(name, value, SHAPE, whose="photo"), EVERYWHERE, "is bool .* of the photo's shape"),
        (lambda name, value: as_known_depth(name, value, SHAPE), np.full(SHAPE, np.nan), "holds no value"),
        (lambda name, value: as_known_depth(name, value, SHAPE), np.full(SHAPE, np.inf), "holds 6 infinite values"),
        (lambda name, value: as_known_depth(name, value, SHAPE), np.full(SHAPE, -1.0), "goes down to -1"),
        (lambda name, value: as_known_depth(name, value, SHAPE), np.full(SHAPE, 1e31), r"holds 1e\+31: give depths"),
        (lambda name, value: as_known_depth(name, value, SHAPE), np.ones(SHAPE, int), "give a float array"),
        (lambda name, value: as_albedo(name, value, EVERYWHERE), np.full(SHAPE, 2.0), r"not in \(0, 1\] at 6 pixels"),
        (lambda name, value: as_albedo(name, value, EVERYWHERE), np.ones((1, 1)), "give a float array"),
    ],
)
def test_arrays_are_named_but_not_shown(check: Callable[[str, Any], object], value: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message) as raised:
        check("depth", value)
    assert str(raised.value).startswith("depth")
    assert raised.value.argument == "depth"
    assert raised.value.value is value


def test_the_error_may_be_another() -> None:
    with pytest.raises(ps.CameraError, match="focal_length=0 is not a length: give a finite number above 0"):
        as_number("focal_length", 0, above=0.0, what="a length", error=ps.CameraError)
    with pytest.raises(ps.CameraError, match="point=3 is not a point: give two numbers"):
        as_numbers("point", 3, (2,), what="a point", remedy="give two numbers", error=ps.CameraError)
