from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from persfs_cl.errors import InputError
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.parallel_light import ParallelLight


def test_norm_is_the_length_of_the_light_vector() -> None:
    assert ParallelLight(2.0, -2.0).norm == 3.0


def test_flash_is_at_the_camera_and_fades_unless_told_otherwise() -> None:
    assert FlashLight() == FlashLight(falloff=True, gain=1.0, offset=(0.0, 0.0, 0.0))
    assert FlashLight().coaxial
    assert FlashLight(offset=(0, 0, -0.0)).coaxial
    assert not FlashLight(offset=(0.0, 1e-300, 0.0)).coaxial


@pytest.mark.parametrize("offset", [(1, 2, 3), [1, 2, 3], np.array([1, 2, 3])], ids=["tuple", "list", "array"])
def test_flash_holds_plain_numbers(offset: Any) -> None:
    light = FlashLight(falloff=np.True_, gain=np.float32(2), offset=offset)  # type: ignore[arg-type] # as users do
    assert light == FlashLight(True, 2.0, (1.0, 2.0, 3.0))
    assert light.falloff is True
    assert type(light.gain) is float
    assert {type(number) for number in light.offset} == {float}
    assert hash(light) == hash(FlashLight(True, 2.0, (1.0, 2.0, 3.0)))


def test_lights_do_not_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        FlashLight().gain = 2.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"falloff": 2}, "falloff=2 .*give True"),
        ({"falloff": None}, "falloff=None"),
        ({"gain": 0.0}, "gain=0.0 .*above 0"),
        ({"gain": -1.0}, "gain=-1.0"),
        ({"gain": math.inf}, "gain=inf"),
        ({"gain": math.nan}, "gain=nan"),
        ({"gain": 10**400}, "gain=1000"),
        ({"gain": "bright"}, "gain='bright'"),
        ({"gain": None, "falloff": False}, "gain=None without fall-off"),
        ({"offset": (0.0, 0.0)}, r"offset=\(0.0, 0.0\) .*three"),
        ({"offset": (0.0, 0.0, math.nan)}, "offset=.*nan"),
        ({"offset": (0.0, math.inf, 0.0)}, "offset=.*inf"),
        ({"offset": 0.0}, "offset=0.0"),
        ({"offset": np.zeros((3, 2))}, "offset="),
    ],
)
def test_wrong_flashes_are_named(keywords: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        FlashLight(**keywords)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [({"p0": math.nan}, "p0=nan"), ({"q0": 1001}, "q0=1001"), ({"q0": "left"}, "q0='left'")],
)
def test_wrong_parallel_lights_are_named(keywords: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ParallelLight(**keywords)
