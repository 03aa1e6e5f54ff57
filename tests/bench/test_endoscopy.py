"""The experiment on an endoscope's frame, on a folder of the same form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import run
from PIL import Image

import persfs_cl as ps
from persfs_cl.bench.endoscopy import ALONE, CONSTANT, FADING, FRAME, GUIDED, MASK, POINTS, endoscopy
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents
from persfs_cl.colour import encode_srgb
from persfs_cl.environment import environment

SIZE = 96


def write(folder: Path, *, points: int = 80, **camera: Any) -> Path:
    """A hill whose far half is darker, as by another tissue."""
    scene = ps.hillside((SIZE, SIZE), light=ps.FlashLight(gain=0.4), surface="toward", relief=0.4)
    paint = np.where(np.arange(SIZE) < SIZE // 2, 1.0, 0.7)
    levels = np.round(255.0 * encode_srgb(paint * scene.image / scene.image.max())).astype(np.uint8)
    Image.fromarray(np.stack([levels, levels // 3, levels // 4], axis=2)).save(folder / FRAME, quality=98)
    Image.fromarray(np.full((SIZE, SIZE), 255, np.uint8)).save(folder / MASK)
    rows, columns = np.random.default_rng(0).integers(4, SIZE - 4, (2, points))
    (x, y), length = scene.camera.centre((SIZE, SIZE)), scene.camera.fx
    own = {"fx": length, "fy": length, "cx": x, "cy": y, "width": SIZE, "height": SIZE, **camera}
    known = [
        {"column": int(column), "row": int(row), "depth": float(scene.depth[row, column])}
        for row, column in zip(rows, columns, strict=True)
    ]
    (folder / POINTS).write_text(json.dumps({"camera": own, "points": known}))
    return folder


def measured(plan: Plan) -> dict[str, Record]:
    return {record.workload: record for group in endoscopy(plan) for record in group}


def test_the_frame_alone_and_with_a_tenth_of_its_points(device: ps.Device, tmp_path: Path) -> None:
    found = measured(Plan(device, endoscopy=write(tmp_path)))
    assert list(found) == [CONSTANT, FADING, ALONE, GUIDED]
    errors = {way: record.median or np.nan for way, record in found.items()}
    assert errors[GUIDED] < 0.9 * errors[ALONE]
    assert errors[ALONE] < errors[CONSTANT]
    table = contents(environment(device, ""), list(found.values()))["endoscopy"]
    assert [row.split("|")[1].strip() for row in table.splitlines()[2:]] == list(found)
    assert "mean of 10 folds" in table


def test_without_a_folder_it_says_what_it_wants(device: ps.Device, tmp_path: Path) -> None:
    (record,) = measured(Plan(device)).values()
    assert record.median is None
    assert "--endoscopy" in record.detail
    assert record.detail in contents(environment(device, ""), [record])["endoscopy"]
    outcome = run("bench", "--experiment", "endoscopy", "-o", tmp_path)
    assert outcome.status == 2
    assert "give the folder of frame.jpg, mask.png and points.json" in " ".join(outcome.stderr.split())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"points": 19}, "19 points: give 20"),
        ({"width": 100}, "frame.jpg has shape"),
        ({"fx": "wide"}, "focal_length"),
    ],
)
def test_a_folder_of_another_form_is_named(
    device: ps.Device, tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(ps.PersfsError, match=message):
        measured(Plan(device, endoscopy=write(tmp_path, **change)))


def test_files_that_are_missing_are_named(device: ps.Device, tmp_path: Path) -> None:
    plan = Plan(device, endoscopy=tmp_path)
    with pytest.raises(ps.InputError, match=r"points\.json"):
        measured(plan)
    (tmp_path / POINTS).write_text("[]")
    with pytest.raises(ps.InputError, match='has no "camera"'):
        measured(plan)
