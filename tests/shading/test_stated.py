"""Lights and materials as plain values, and again."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest

import persfs_cl as ps
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.shading.stated import light_from, reflectance_from, stated


@pytest.mark.parametrize(
    "light", [ps.ParallelLight(0.1, -1 / 3), ps.FlashLight(), ps.FlashLight(gain=None, offset=(0.1, 0.2, 1 / 3))]
)
def test_a_light_comes_back_from_json(light: Any) -> None:
    assert light_from(json.loads(json.dumps(stated(light)))) == light


@pytest.mark.parametrize("material", [ps.Lambertian(), ps.OrenNayar(1 / 3), ps.Phong(0.6, 1 / 3, 20.0)])
def test_a_material_comes_back_from_json(material: Any) -> None:
    assert reflectance_from(json.loads(json.dumps(stated(material)))) == material


def test_a_new_material_needs_its_line_in_the_table_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Chalk(ps.OrenNayar):
        dust: float = 0.5

    says = stated(Chalk(0.3, dust=0.25))
    with pytest.raises(ps.InputError, match="reflectance='Chalk' is none that there is: give one of Lambertian, "):
        reflectance_from(says)
    monkeypatch.setitem(MATERIALS, "chalk", Chalk)
    assert reflectance_from(says) == Chalk(0.3, dust=0.25)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (None, "has no kind and numbers"),
        ({"kind": "OrenNayar"}, "does not have the numbers roughness and no others"),
        ({"kind": "OrenNayar", "roughness": 0.1, "dust": 1.0}, "does not have the numbers roughness and no others"),
        ({"kind": "OrenNayar", "roughness": None}, "roughness=None is not an angle"),
    ],
)
def test_what_is_no_material_is_refused(values: Any, message: str) -> None:
    with pytest.raises(ps.InputError, match=message):
        reflectance_from(values)
