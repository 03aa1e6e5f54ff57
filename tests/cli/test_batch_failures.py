"""A folder in which some photos cannot be used."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
from batches import FOCAL, SHAPE, lines, photos, require_whole
from command import run
from PIL import Image


def test_broken_photos_are_named_and_all_others_done(tmp_path: Path) -> None:
    folder, out, masks = tmp_path / "in", tmp_path / "out", tmp_path / "masks"
    names = photos(folder, 100)
    masks.mkdir()
    white = np.full(SHAPE, 255, np.uint8)
    for name in names:
        Image.fromarray(white).save(masks / f"{name}.png")
    whole = (folder / names[0]).read_bytes()
    with Image.open(folder / names[0]) as image:
        image.save(folder / "torn.jpg")
    jpeg = (folder / "torn.jpg").read_bytes()
    broken = {
        "00010.png": "is empty (0 bytes)",
        "00020.png": "is broken or not supported",
        "00030.png": "is no image of a format that is read",
        "torn.jpg": "is broken or not supported",
        "00040.png": "the photo is constant",
        "00050.png": "every pixel to solve is black",
        "00060.png": "has no mask",
        "00070.png": f"has shape (5, 5), but the image has {SHAPE}",
        "00080.png": "has no camera in",
        "00090.png": "no pixel is left to solve",
    }
    (folder / "00010.png").write_bytes(b"")
    (folder / "00020.png").write_bytes(whole[: len(whole) // 2])
    (folder / "00030.png").write_text("This is a text.")
    (folder / "torn.jpg").write_bytes(jpeg[: len(jpeg) // 2])
    Image.fromarray(white // 2).save(folder / "00040.png")
    Image.fromarray(0 * white).save(folder / "00050.png")
    (masks / "00060.png.png").unlink()
    Image.fromarray(np.full((5, 5), 255, np.uint8)).save(masks / "00070.png.png")
    Image.fromarray(0 * white).save(masks / "00090.png.png")
    Image.fromarray(white).save(masks / "torn.jpg.png")
    rows = [f"{name},{FOCAL}\n" for name in [*names, "torn.jpg"] if name != "00080.png"]
    (tmp_path / "cameras.csv").write_text("path,focal_length\n" + "".join(rows))
    arguments = ("batch", folder, "-o", out, "--light=flash", "--masks", masks, "--save=depth.npy")
    outcome = run(*arguments, "--cameras", tmp_path / "cameras.csv")
    assert outcome.status == 1
    good = sorted({*names} - {*broken})
    assert len(good) == 91
    assert {Path(line).relative_to(out).as_posix() for line in outcome.stdout.splitlines()} == {*good}
    require_whole(out, good)
    failed = {record.name: record for record in lines(out) if record.status == "failed"}
    assert set(failed) == set(broken)
    with (out / "summary.csv").open(newline="") as file:
        table = {row["name"]: row for row in csv.DictReader(file)}
    assert set(table) == {*good, *broken}
    for name, why in broken.items():
        message = (failed[name].error or {})["message"]
        assert why in message, name
        # With the name of the photo before it, unless it begins with the path.
        assert re.search(rf"persfs-cl: (\S+: )?{re.escape(' '.join(message.split()))}", outcome.stderr), name
        assert table[name]["status"] == "failed"
        assert message in table[name].values()
    assert "91 done" in outcome.stderr
    assert "10 failed" in outcome.stderr
