"""Values that hold arrays: compared and hashed by what they are, and said in one line."""

from __future__ import annotations

import copy
from dataclasses import fields, is_dataclass
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.scenes import MeshView

SHAPE = (20, 30)


@pytest.fixture(scope="module")
def values() -> dict[str, Any]:
    scene = ps.bump(SHAPE, light=ps.FlashLight())
    walls = np.zeros(SHAPE, bool)
    walls[10, 5:15] = True
    solution = ps.reconstruct(scene.image, scene.camera, light=scene.light, walls=walls)
    photo = ps.read_photo(str(files("persfs_cl") / "data" / "coin.png"))
    preparation = ps.Preparation(ambient=np.zeros(photo.image.shape), vignetting=np.ones(photo.image.shape))
    prepared = ps.prepare_photo(photo, ps.Camera(576.0), preparation)
    jumps = np.zeros((20, 29), bool), np.zeros((19, 30), bool)
    return {
        "Scene": scene,
        "Solution": solution,
        "Discontinuities": solution.discontinuities,
        "Confidence": solution.confidence(),
        "Photo": photo,
        "Preparation": preparation,
        "PreparedPhoto": prepared,
        "NormalisedPhoto": prepared.normalised(),
        "MeshView": MeshView(scene.depth, *jumps),
        "PixelGrid": scene.camera.grid(SHAPE),
        "Points": ps.Points([3.0, 9.0], [4.0, 8.0], [1.0, 1.1]),
        "GuideFit": ps.reconstruct(scene.image, scene.camera, light=scene.light, guide=scene.depth[::4, ::5]).guide,
    }


SAID = {
    "Scene": ("'bump'", "30 x 20", "depth 1 to 1.", "FlashLight"),
    "Solution": ("CONVERGED", "600 of 30 x 20", "iteration"),
    "Discontinuities": ("30 x 20", "below"),
    "Confidence": ("30 x 20", "median slope error 0.", "10 unreliable"),
    "Photo": ("'coin.png'", "72 x 72", "8 bits", "srgb", "luminance"),
    "Preparation": ("Preparation(ambient=<array>, vignetting=<array>)",),
    "PreparedPhoto": ("5184 of 72 x 72", "light 0"),
    "NormalisedPhoto": ("72 x 72", "linear", "black=0", "white=0."),
    "MeshView": ("600 of 30 x 20", "0 jumps"),
    "PixelGrid": ("30 x 20", "dx=0.0333"),
    "Points": ("2 of them",),
    "GuideFit": ("of 30 values used", "% of the depth"),
}


@pytest.mark.parametrize("name", SAID)
def test_values_are_equal_to_themselves_alone(name: str, values: dict[str, Any]) -> None:
    value = values[name]
    assert type(value).__name__ == name
    assert any(isinstance(getattr(value, field.name), np.ndarray) for field in fields(value))
    other = copy.copy(value)
    assert value == value
    assert value != other
    assert len({value, other, value}) == 2


@pytest.mark.parametrize("name", SAID)
def test_values_say_what_they_are_in_a_line(name: str, values: dict[str, Any]) -> None:
    said = repr(values[name])
    assert len(said) <= 160
    assert "\n" not in said
    assert "array(" not in said
    for part in SAID[name]:
        assert part in said


def test_no_public_value_with_arrays_is_missing() -> None:
    kinds = {name: getattr(ps, name) for name in ps.__all__}
    holding = {name for name, kind in kinds.items() if is_dataclass(kind) and _holds_arrays(kind)}
    assert holding
    assert holding <= SAID.keys()


def _holds_arrays(kind: Any) -> bool:
    return any("Array" in str(field.type) or "Mask" in str(field.type) for field in fields(kind))
