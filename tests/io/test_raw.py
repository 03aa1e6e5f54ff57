"""Camera raw files are named for what they are, and never taken for their previews."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.maps import read_mask
from persfs_cl.io.photos import read_photo

PREVIEW, SENSOR = np.full((16, 24, 3), 128, np.uint8), np.zeros((64, 96), np.uint16)
DNG = [(50706, "B", 4, (1, 4, 0, 0), True)]


def raw(path: Path, *, maker: str = "", tags: Any = (), reduced: bool = True, sensor: Any = "cfa") -> Path:
    """A preview with the sensor's image below it, as raw files of the TIFF kind have it."""
    made = [(271, "s", 0, maker, True)] if maker else []
    pattern = {"cfa": [(33421, "H", 2, (2, 2), True), (33422, "B", 4, (0, 1, 1, 2), True)]}.get(sensor, [])
    with tifffile.TiffWriter(path) as writer:
        writer.write(PREVIEW, photometric="rgb", subfiletype=int(reduced), subifds=1, extratags=[*made, *tags])
        writer.write(SENSOR, photometric=sensor, extratags=pattern)
    return path


@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"tags": DNG, "reduced": False}, "Adobe DNG"),
        ({"tags": DNG, "sensor": "minisblack"}, "Adobe DNG"),
        ({"maker": "NIKON CORPORATION"}, "Nikon NEF"),
        ({"maker": "SONY", "reduced": False}, "Sony ARW"),
        ({"maker": "Nobody", "sensor": "minisblack"}, "of Nobody"),
        ({"sensor": "cfa"}, "of a colour filter array"),
    ],
)
def test_raw_files_of_the_tiff_kind_are_named(tmp_path: Path, options: dict[str, Any], kind: str) -> None:
    path = raw(tmp_path / "photo.tif", **options)
    for read in (read_photo, Camera.from_exif, lambda path: read_mask(path, (16, 24))):
        with pytest.raises(InputError, match=rf"photo\.tif is a camera raw file \({kind}\).*16-bit TIFF.*'linear'"):
            read(path)


@pytest.mark.parametrize(
    ("head", "kind"),
    [
        (b"II*\0\x10\0\0\0CR\x02\0", "Canon CR2"),
        (b"\0\0\0\x18ftypcrx \0\0\0\1", "Canon CR3"),
        (b"II\x1a\0\0\0HEAPCCDR", "Canon CRW"),
        (b"IIRO\x08\0\0\0", "Olympus ORF"),
        (b"IIRS\x08\0\0\0", "Olympus ORF"),
        (b"MMOR\0\0\0\x08", "Olympus ORF"),
        (b"FUJIFILMCCD-RAW 0201", "Fujifilm RAF"),
        (b"IIU\0\x18\0\0\0", "Panasonic RW2"),
    ],
)
def test_other_raw_files_are_named_by_their_first_bytes(tmp_path: Path, head: bytes, kind: str) -> None:
    (tmp_path / "photo").write_bytes(head + bytes(200))
    for read in (read_photo, Camera.from_exif):
        with pytest.raises(InputError, match=rf"photo is a camera raw file \({kind}\)"):
            read(tmp_path / "photo")


def test_a_reduced_copy_below_a_photo_does_not_make_it_raw(tmp_path: Path) -> None:
    with tifffile.TiffWriter(tmp_path / "a.tif") as writer:
        writer.write(PREVIEW, photometric="rgb", subifds=1, extratags=[(271, "s", 0, "Canon", True)])
        writer.write(PREVIEW[::2, ::2], photometric="rgb", subfiletype=1)
    assert read_photo(tmp_path / "a.tif").image.shape == (16, 24)
