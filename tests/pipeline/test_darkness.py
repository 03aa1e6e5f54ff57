"""Where many pixels are too dark for the light, every way of solving a photo says so, and what may be wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import persfs_cl as ps
from persfs_cl.errors import PersfsWarning
from persfs_cl.pipeline.darkness import too_dark
from persfs_cl.shading.model import Light

SLANTING = ps.ParallelLight(0.0, -1.0)


@pytest.mark.parametrize(
    ("share", "light", "expected"),
    [
        (0.98, ps.ParallelLight(), ("98 %", "p0 and q0 for one from the side", "light=FlashLight() for")),
        (0.98, SLANTING, ("9800 pixels", "normalise='level'", "guide with scheme='regularised'")),
        (0.5, ps.FlashLight(), ("50 %", "offset for one beside", "light=ParallelLight() for")),
    ],
)
def test_the_share_of_pixels_and_what_helps_are_told(share: float, light: Light, expected: tuple[str, ...]) -> None:
    text = str(PersfsWarning(too_dark(round(10_000 * share), 10_000, light, levelled=False)))
    assert not [words for words in expected if words not in text], text


def test_what_was_given_is_not_asked_for() -> None:
    text = str(PersfsWarning(too_dark(98, 100, SLANTING, levelled=True)))
    assert "Check p0 and q0; where" in text
    text = str(PersfsWarning(too_dark(98, 100, ps.FlashLight(falloff=False), levelled=False)))
    assert "Check it: light=ParallelLight() for one far away." in text


def test_few_are_none_of_the_warnings() -> None:
    assert too_dark(25, 100, ps.ParallelLight(), levelled=False) is None


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_tells_of_it_too(tmp_path: Path) -> None:
    rows, columns = np.indices((20, 24)) - np.array([[[9.5]], [[11.5]]])
    moon = np.sqrt(np.clip(1.0 - (rows**2 + columns**2) / 7.0**2, 0.0, 1.0))
    Image.fromarray((255 * moon).astype(np.uint8)).save(tmp_path / "moon.png")
    [result] = ps.batch(tmp_path / "moon.png", tmp_path / "out", camera=ps.Camera(500.0), save="report")
    assert any("% of those with a depth, are too dark for the light" in str(each) for each in result.warnings)
    written = json.loads((tmp_path / "out" / "moon.png" / "report.json").read_text(encoding="utf-8"))["warnings"]
    assert written == [str(each) for each in result.warnings]
