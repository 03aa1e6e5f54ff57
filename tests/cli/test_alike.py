"""What is said of many photos, each reason once."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from batches import photos, pretend

from persfs_cl.cli.alike import Alike
from persfs_cl.cli.batch_progress import Tally
from persfs_cl.errors import PersfsWarning
from persfs_cl.pipeline.manifest import Record
from persfs_cl.pipeline.run import BatchResult
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.surface.saving import Saving


def said(count: int, *, every_name: bool) -> Alike:
    """Photos without a mask, and one that is none."""
    alike = Alike(every_name=every_name)
    for number in range(count):
        name = f"{number:03}.png"
        alike.add(name, Path("in") / name, f"in/{name} has no mask: masks/{name}.png does not exist.")
        if number == 1:
            alike.add("text.png", Path("in/text.png"), "in/text.png is no image.")
    return alike


def test_a_reason_that_many_share_is_told_once_and_each_is_named() -> None:
    alike = said(5, every_name=True)
    why = "in/000.png has no mask: masks/000.png.png does not exist."
    assert list(alike.lines()) == [
        f"persfs-cl: 5 photos, 000.png, 001.png, 002.png and others: of the first, {why}",
        "persfs-cl: the same of 003.png, 004.png.",
        "persfs-cl: in/text.png is no image.",
    ]
    assert alike.more == 0
    three = next(said(3, every_name=True).lines())
    assert three.startswith("persfs-cl: 3 photos, 000.png, 001.png, 002.png: of the first, in/000")


def test_paths_of_a_list_that_are_not_there_are_alike() -> None:
    alike = Alike(every_name=True)
    for number, name in enumerate(("brick.png", "gravel.png"), 1):
        place = f"x.txt, line {number}: {name}"
        alike.add(place, Path(place), f"sub/{name} does not exist.")
    listed = "x.txt, line 1: brick.png, x.txt, line 2: gravel.png"
    assert list(alike.lines()) == [f"persfs-cl: 2 photos, {listed}: of the first, sub/brick.png does not exist."]


def test_other_reasons_are_others() -> None:
    alike = Alike(every_name=True)
    for name, size in (("a.png", 5), ("b.png", 6)):
        alike.add(name, Path(name), f"{name} has {size} pixels.")
    assert list(alike.lines()) == ["persfs-cl: a.png has 5 pixels.", "persfs-cl: b.png has 6 pixels."]


def test_of_very_many_a_hundred_are_named_and_all_are_counted() -> None:
    alike = said(250, every_name=True)
    lines = list(alike.lines())
    assert len(lines) == 3
    assert (lines[1].count(".png"), lines[1][-8:]) == (99 - 3, "098.png.")
    assert lines[0].startswith("persfs-cl: 250 photos, ")
    assert alike.more == 250 - 99
    few = said(250, every_name=False)
    assert len(list(few.lines())) == 2
    assert few.more == 0, "three names are enough of a warning"


def test_reasons_without_end_are_counted() -> None:
    alike = Alike(every_name=False)
    for number in range(120):
        alike.add(f"{number}.png", Path(f"{number}.png"), f"{number + 1000} is odd.")
    assert len(list(alike.lines())) == 100
    assert alike.more == 20


def test_warnings_that_photos_share_are_told_once_with_their_number() -> None:
    tally = Tally(str, Saving.of("depth"))
    for name in ("a.png", "b.png", "c.png"):
        texts = ("White is a guess.", "White is a guess.", f"{name} was resized.") + ("Odd.",) * (name == "b.png")
        record = Record(name=name, path=name, status="done", converged="CONVERGED")
        tally.add(BatchResult(Path(name), name, record, warnings=tuple(map(PersfsWarning, texts))))
    assert tally.told().splitlines() == [
        "persfs-cl: 3 photos, a.png, b.png, c.png: warning: White is a guess.",
        "persfs-cl: 3 photos, a.png, b.png, c.png: warning: of the first, a.png was resized.",
        "persfs-cl: b.png: warning: Odd.",
    ]
    assert "3 with warnings" in tally.summary()


def test_a_table_on_a_terminal_has_a_row_for_a_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = photos(tmp_path / "in", 4)
    _, results, _ = pretend(tmp_path / "in", FolderStore(tmp_path / "out"), bad=names[1:])
    tally = Tally(str, Saving.of("depth"))
    for result in results:
        tally.add(result)
    assert [line.partition(": ")[2] for line in tally.told().splitlines()] == [
        "3 photos, 00001.png, 00002.png, 00003.png: of the first, 00001.png is bad."
    ]

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr("sys.stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "100")
    table = tally.told()
    assert "3 failed" in table
    assert table.count("is bad.") == 1
    assert "3 photos: of the first, 00001.png is bad." in table
    assert all(f" {name} " in table for name in names[1:])
