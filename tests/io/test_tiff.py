"""Directories of TIFF files: walked to their end, and refused where they have none."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.maps import read_depth, read_mask
from persfs_cl.io.photos import read_photo
from persfs_cl.io.tiff import DNG_VERSION, IMAGE_LENGTH, IMAGE_WIDTH, MAKE, read_directories

Entry = tuple[int, int, int, bytes]

READERS: dict[str, Callable[[Path], object]] = {
    "read_photo": read_photo,
    "read_mask": lambda path: read_mask(path, (4, 6)),
    "read_depth": read_depth,
    "from_exif": Camera.from_exif,
}


def directory(entries: Sequence[Entry], following: int = 0, order: str = "<") -> bytes:
    """Tags as they lie in a classic TIFF file, each with its type, count, and value or offset."""
    body = b"".join(
        struct.pack(order + "HHI", tag, kind, count) + value.ljust(4, b"\0") for tag, kind, count, value in entries
    )
    return struct.pack(order + "H", len(entries)) + body + struct.pack(order + "I", following)


def pointer(tag: int, place: int) -> Entry:
    return tag, 4, 1, struct.pack("<I", place)


def tiff(*parts: bytes, first: int = 8) -> bytes:
    return b"II*\0" + struct.pack("<I", first) + b"".join(parts)


LOOPS = {
    "a page to itself": (tiff(directory([], 8)), "its page at byte 8 points back"),
    "two pages in a circle": (tiff(directory([], 14), directory([], 8)), "its page at byte 8 points back"),
    "the second page to itself": (tiff(directory([], 14), directory([], 14)), "its page at byte 14 points back"),
    "a sub-directory to its page": (tiff(directory([pointer(330, 8)])), "its sub-directory at byte 8 points back"),
    "a sub-directory to itself": (
        tiff(directory([pointer(330, 26)]), directory([pointer(330, 26)])),
        "its sub-directory at byte 26 points back",
    ),
    "EXIF to its page": (tiff(directory([pointer(34665, 8)])), "its EXIF directory at byte 8 points back"),
    "EXIF to itself": (
        tiff(directory([pointer(34665, 26)]), directory([pointer(40965, 26)])),
        "its EXIF directory at byte 26 points back",
    ),
    "big TIFF": (b"II+\0\x08\0\0\0" + struct.pack("<QQQ", 16, 0, 16), "its page at byte 16 points back"),
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
@pytest.mark.parametrize(("data", "reason"), LOOPS.values(), ids=LOOPS)
def test_directories_that_lead_back_to_themselves_are_refused(
    tmp_path: Path, data: bytes, reason: str, read: Callable[[Path], object]
) -> None:
    (tmp_path / "loop.tif").write_bytes(data)
    with pytest.raises(InputError, match=rf"loop\.tif is broken: {reason} to itself, in a loop without end\. Save"):
        read(tmp_path / "loop.tif")


def test_exif_data_of_a_jpeg_that_lead_back_to_themselves_are_refused(tmp_path: Path) -> None:
    exif = b"Exif\0\0" + tiff(directory([pointer(34665, 8)]))
    Image.new("L", (8, 8)).save(tmp_path / "a.jpg", exif=exif)
    with pytest.raises(InputError, match=r"a\.jpg is broken: its EXIF directory at byte 8 points back to itself"):
        Camera.from_exif(tmp_path / "a.jpg")
    assert read_photo(tmp_path / "a.jpg").image.shape == (8, 8)


def test_a_part_that_two_pages_share_is_no_loop() -> None:
    shared = tiff(directory([pointer(34665, 44)], 26), directory([pointer(34665, 44)]), directory([(271, 2, 2, b"X")]))
    first, second = read_directories("a.tif", shared)
    assert [part.text(MAKE) for part in (*first.parts, *second.parts)] == ["X", "X"]


def test_impossibly_many_tags_pages_and_values_are_refused() -> None:
    with pytest.raises(InputError, match=r"its directory at byte 8 promises 65535 tags"):
        read_directories("a.tif", tiff(b"\xff\xff") + bytes(100))
    chain = b"".join(directory([], 8 + 6 * (index + 1)) for index in range(1100))
    with pytest.raises(InputError, match="has more than 1000 directories"):
        read_directories("a.tif", tiff(chain))
    greedy = [(40000 + index, 1, 1000, struct.pack("<I", 8)) for index in range(90)]
    with pytest.raises(InputError, match="its tags promise more values than it holds"):
        read_directories("a.tif", tiff(directory(greedy)))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_tags_are_read_in_both_orders_and_sizes(tmp_path: Path, order: str, big: bool) -> None:
    path = tmp_path / "a.tif"
    extra = [(MAKE, "s", 0, "A maker of cameras", True), (DNG_VERSION, "B", 4, (1, 4, 0, 0), True)]
    with tifffile.TiffWriter(path, byteorder=order, bigtiff=big) as writer:  # type: ignore[arg-type]
        writer.write(np.zeros((3, 5), np.uint8), photometric="minisblack", extratags=extra, subifds=1)
        writer.write(np.zeros((6, 9), np.uint8), photometric="minisblack", subfiletype=1)
    (page,) = read_directories(path, path.read_bytes())
    assert (page.number(IMAGE_LENGTH), page.number(IMAGE_WIDTH), page.reduced) == (3, 5, False)
    assert (page.text(MAKE), page.tags[DNG_VERSION]) == ("A maker of cameras", (1, 4, 0, 0))
    (part,) = page.parts
    assert (part.number(IMAGE_LENGTH), part.number(IMAGE_WIDTH), part.reduced) == (6, 9, True)
    assert list(page.walk()) == [page, part]


def test_what_lies_outside_the_file_is_no_tag() -> None:
    assert read_directories("a.tif", b"II*\0") == []
    assert read_directories("a.tif", tiff(first=1000)) == []
    (page,) = read_directories("a.tif", tiff(directory([(256, 4, 9, struct.pack("<I", 5000)), (257, 99, 1, b"\1")])))
    assert not page.tags
