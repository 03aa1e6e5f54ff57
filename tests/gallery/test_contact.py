from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import HOSTILE, failure, opened, record
from numpy.typing import NDArray
from PIL import Image

from persfs_cl.errors import InputError
from persfs_cl.gallery.chosen import evenly_chosen
from persfs_cl.gallery.contact import write_contact_sheet

RED, BLUE = (200, 20, 20), (20, 40, 200)


def write_pictures(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (80, 60), RED).save(folder / "photo.jpg")
    Image.new("RGB", (80, 60), BLUE).save(folder / "preview.jpg")


def share(pixels: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    """Pixels of a colour, counted."""
    return int((np.abs(pixels.astype(int) - colour).max(axis=-1) < 25).sum())


def sheet(output: Path, records: list[dict[str, Any]], **keywords: Any) -> NDArray[np.uint8]:
    path = write_contact_sheet(output, iter(records), **keywords)
    assert path == output / "contact.jpg"
    return opened(path)


def test_photograph_and_surface_of_each_image(tmp_path: Path) -> None:
    names = ["a/b.png", "c.png", "", *(name for name in HOSTILE if "\udcff" not in name)]
    for name in names:
        write_pictures(tmp_path / name)
    pixels = sheet(tmp_path, [*map(record, names), failure("d.png")], title="Some")
    # Each is 132 wide and 99 high on the sheet.
    for colour in (RED, BLUE):
        assert share(pixels, colour) == pytest.approx(len(names) * 132 * 99, rel=0.05)


def test_bytes_of_names_that_are_no_text(tmp_path: Path) -> None:
    name = "not text \udcff.png"
    try:
        write_pictures(tmp_path / name)
    except OSError:
        pytest.skip("this file system takes text only")
    assert share(sheet(tmp_path, [record(name)]), RED) > 132 * 90


def test_names_are_drawn_and_too_long_ones_cut(tmp_path: Path) -> None:
    for name in ("a.png", "b" * 200 + ".png"):
        write_pictures(tmp_path / name)
        pixels = sheet(tmp_path, [record(name)])
        label = pixels[34 + 132 : 34 + 132 + 18]
        columns = np.flatnonzero((label.max(axis=2) > 90).any(axis=0))
        assert columns.min() >= 14
        assert columns.max() < 14 + 2 * 132 + 2


def test_of_many_an_even_choice_is_shown_and_the_picture_says_so(tmp_path: Path) -> None:
    for number in range(60):
        write_pictures(tmp_path / f"{number}.png")
    records = [record(f"{number}.png") for number in range(60)]
    every, some = sheet(tmp_path, records), sheet(tmp_path, records, most=7)
    assert share(every, RED) == pytest.approx(60 * 132 * 99, rel=0.05)
    assert share(some, RED) == pytest.approx(7 * 132 * 99, rel=0.05)
    # "60 images" is shorter than "7 of 60 images, evenly chosen".
    ends = [np.flatnonzero((pixels[:30].max(axis=2) > 120).any(axis=0)).max() for pixels in (every, some)]
    assert ends[1] > 2 * ends[0]


def test_pictures_that_are_gone_or_damaged_leave_their_place_empty(tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "c.png"):
        write_pictures(tmp_path / name)
    (tmp_path / "b.png" / "photo.jpg").unlink()
    whole = (tmp_path / "c.png" / "preview.jpg").read_bytes()
    (tmp_path / "c.png" / "preview.jpg").write_bytes(whole[: len(whole) // 2])
    pixels = sheet(tmp_path, [record(name) for name in ("a.png", "b.png", "c.png")])
    assert share(pixels, RED) == pytest.approx(2 * 132 * 99, rel=0.05)
    assert share(pixels, BLUE) == pytest.approx(2 * 132 * 99, rel=0.05)


def test_nothing_to_show_makes_no_file(tmp_path: Path) -> None:
    records = [failure("a.png"), record("b.png", files=["depth.npy"])]
    assert write_contact_sheet(tmp_path, records) is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("count", [0, 1, 6, 7, 8, 14, 15, 16, 100, 12345])
def test_choice_is_even_and_in_order(count: int) -> None:
    chosen, counted = evenly_chosen(iter(range(count)), 7)
    assert counted == count
    assert len(chosen) == min(count, 7)
    assert chosen == sorted(set(chosen))
    if count > 7:
        gaps = np.diff([-1, *chosen, count])
        assert gaps.max() <= 3 * count / 7
        assert gaps[1:-1].min() >= count / 7 / 2.5


def test_folder_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"contact\.jpg cannot be written"):
        write_contact_sheet(tmp_path / "gone", [record("a.png")])
