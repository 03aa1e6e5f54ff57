"""The focal length by EXIF data: right, doubted or refused, with the numbers."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import ExifTags, Image

from persfs_cl.camera import Camera
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.photos import read_image

EXIF = {name: tag for tag, name in ExifTags.TAGS.items()}


def photograph(path: Path, size: tuple[int, int], tags: Mapping[str, Any], orientation: int = 1) -> Path:
    """A photo of (width, height) pixels as they lie in the file."""
    exif = Image.Exif()
    exif[EXIF["Orientation"]] = orientation
    inner = exif.get_ifd(ExifTags.IFD.Exif)
    for name, value in tags.items():
        inner[EXIF[name]] = value
    Image.new("L", size, 100).save(path, exif=exif)
    return path


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_35_mm_equivalent_is_one_of_diagonals_however_the_camera_was_held(
    tmp_path: Path, suffix: str, orientation: int
) -> None:
    path = photograph(tmp_path / f"a{suffix}", (40, 30), {"FocalLengthIn35mmFilm": 26}, orientation)
    camera = Camera.from_exif(path)
    shape = read_image(path).shape
    assert shape == ((40, 30) if orientation > 4 else (30, 40))
    grid = camera.grid((shape[0], shape[1]))
    # From corner to corner, the angle is that of a 26 mm lens on 36 mm × 24 mm film.
    corner = math.hypot(grid.x[-1] + grid.dx / 2, grid.y[-1, 0] + grid.dy / 2)
    assert corner == pytest.approx(math.hypot(18, 12) / 26, rel=1e-12)


@pytest.mark.parametrize(("unit", "millimetres"), [(None, 25.4), (2, 25.4), (3, 10.0), (4, 1.0), (5, 0.001)])
def test_exif_focal_length_with_the_resolution_of_the_sensor(
    tmp_path: Path, unit: int | None, millimetres: float
) -> None:
    size = (4000, 3000)
    tags = {
        "FocalLength": 4.25,
        "FocalPlaneXResolution": 800 * millimetres,
        "ExifImageWidth": size[0],
        "ExifImageHeight": size[1],
    }
    if unit is not None:
        tags["FocalPlaneResolutionUnit"] = unit
    camera = Camera.from_exif(photograph(tmp_path / "a.jpg", (40, 30), tags))
    assert camera.fx == camera.fy == pytest.approx(4.25 * 800 / 100, rel=1e-6)
    assert camera.principal_point is None


def test_exif_follows_a_photo_that_was_resized_and_turned_since(tmp_path: Path) -> None:
    taken = {"ExifImageWidth": 4000, "ExifImageHeight": 3000}
    sensor = {"FocalLength": 4.0, "FocalPlaneXResolution": 1000.0, "FocalPlaneResolutionUnit": 4}
    camera = Camera.from_exif(photograph(tmp_path / "a.jpg", (30, 40), {**taken, **sensor}))
    assert camera.fx == pytest.approx(40.0)


def test_exif_of_a_cropped_photo_is_refused(tmp_path: Path) -> None:
    tags = {"ExifImageWidth": 400, "ExifImageHeight": 300, "FocalLengthIn35mmFilm": 50}
    with pytest.raises(CameraError, match=r"40×40 pixels but was taken with 400×300: it was cropped.*focal_length"):
        Camera.from_exif(photograph(tmp_path / "a.jpg", (40, 40), tags))


@pytest.mark.parametrize(
    ("tags", "missing"),
    [
        ({}, "FocalLengthIn35mmFilm and FocalLength:"),
        ({"FocalLengthIn35mmFilm": 0}, "FocalLengthIn35mmFilm and FocalLength:"),
        ({"FocalLength": 35.0}, "FocalPlaneXResolution"),
        ({"FocalLength": 0.0, "FocalPlaneXResolution": 100.0}, "FocalLength:"),
        ({"FocalLength": 35.0, "FocalPlaneXResolution": 0.0}, "FocalPlaneXResolution"),
        (
            {"FocalLength": 35.0, "FocalPlaneXResolution": 100.0, "FocalPlaneResolutionUnit": 1},
            "FocalPlaneResolutionUnit",
        ),
    ],
)
def test_exif_that_does_not_say_is_refused_with_what_is_missing(
    tmp_path: Path, tags: dict[str, Any], missing: str
) -> None:
    path = photograph(tmp_path / "a.jpg", (40, 30), tags)
    with pytest.raises(CameraError, match=rf"EXIF data of .*a\.jpg lack .*{missing}.*Give focal_length, in pixels"):
        Camera.from_exif(path)


def test_a_photo_without_exif_is_refused(tmp_path: Path) -> None:
    Image.new("RGB", (4, 3)).save(tmp_path / "a.png")
    with pytest.raises(CameraError, match=r"a\.png has no EXIF data.*Give focal_length.*Camera\.from_fov"):
        Camera.from_exif(tmp_path / "a.png")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_exif_of_a_tiff_is_read_whatever_its_samples(tmp_path: Path, dtype: type) -> None:
    path = tmp_path / "a.tiff"
    # A private tag becomes the pointer to EXIF's own directory, spelt out byte by byte behind the image.
    tifffile.imwrite(path, np.zeros((30, 40, 3), dtype), photometric="rgb", extratags=[(65000, "I", 1, 0, True)])
    with tifffile.TiffFile(path) as tiff:
        tag = tiff.pages.first.tags[65000]
    data = bytearray(path.read_bytes())
    data[tag.offset : tag.offset + 2] = (34665).to_bytes(2, "little")
    data[tag.valueoffset : tag.valueoffset + 4] = len(data).to_bytes(4, "little")
    entry = b"".join(number.to_bytes(size, "little") for number, size in ((0xA405, 2), (3, 2), (1, 4), (26, 4)))
    path.write_bytes(bytes(data) + (1).to_bytes(2, "little") + entry + bytes(4))
    assert Camera.from_exif(path).fx == pytest.approx(26 * 50 / math.hypot(36, 24))


def test_exif_of_an_unreadable_file_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "text.jpg").write_text("this is no photo")
    (tmp_path / "text.tiff").write_bytes(b"II*\0 no directory here")
    with pytest.raises(InputError, match="does not exist"):
        Camera.from_exif(tmp_path / "missing.jpg")
    with pytest.raises(InputError, match="is a folder"):
        Camera.from_exif(tmp_path)
    with pytest.raises(InputError, match=r"text\.jpg is no image of a format that is read"):
        Camera.from_exif(tmp_path / "text.jpg")
    with pytest.raises(InputError, match=r"text\.tiff is broken: it does not say its width and height"):
        Camera.from_exif(tmp_path / "text.tiff")


@pytest.mark.parametrize("byteorder", ["<", ">"])
def test_a_big_tiff_photo_asks_for_the_camera(byteorder: Any, tmp_path: Path) -> None:
    path = tmp_path / "photo.tif"
    tifffile.imwrite(path, np.full((4, 6), 0.5, np.float32), bigtiff=True, byteorder=byteorder)
    assert read_image(path).shape == (4, 6)
    with pytest.raises(CameraError, match=r"photo\.tif is a BigTIFF.*Give focal_length, in pixels"):
        Camera.from_exif(path)


CANON = {"FocalLength": 50.0, "FocalPlaneXResolution": 4438.356, "FocalPlaneResolutionUnit": 2}


def sized(width: int, height: int) -> dict[str, int]:
    return {"ExifImageWidth": width, "ExifImageHeight": height}


def test_exif_of_a_photo_resized_by_an_editor_that_kept_the_size_when_taken(tmp_path: Path) -> None:
    path = photograph(tmp_path / "a.jpg", (600, 400), CANON | sized(3888, 2592))
    # 22.25 mm of sensor behind 50 mm.
    assert Camera.from_exif(path).fx == pytest.approx(50 * 4438.356 / 25.4 * 600 / 3888, rel=1e-6)


@pytest.mark.parametrize("size", [{}, sized(0, 0), sized(3888, 0), {"ExifImageWidth": 3888}])
def test_the_resolution_of_the_sensor_is_nothing_without_the_size_when_taken(
    tmp_path: Path, size: dict[str, int]
) -> None:
    path = photograph(tmp_path / "a.jpg", (600, 400), CANON | size)
    with pytest.raises(
        CameraError, match=r"lack FocalLengthIn35mmFilm and a usable ExifImageWidth and ExifImageHeight"
    ):
        Camera.from_exif(path)


def test_a_small_photo_that_may_have_been_resized_is_warned_of_with_the_numbers(tmp_path: Path) -> None:
    path = photograph(tmp_path / "a.jpg", (600, 400), CANON | sized(600, 400))
    with pytest.warns(
        UserWarning, match=r"sensor of .* is 3\.4 mm wide behind a lens of 50 mm, a view of 3\.9°"
    ) as said:
        assert Camera.from_exif(path).fx == pytest.approx(50 * 4438.356 / 25.4, rel=1e-6)
    (warning,) = said
    assert all(word in str(warning.message) for word in ("600 × 400", "an editor may have resized it", "focal_length"))


@pytest.mark.parametrize(
    ("name", "text", "editor"),
    [
        ("Software", "Adobe Photoshop CS5 Windows", True),
        ("Software", "GIMP 2.10.8", True),
        ("Software", "paint.net 4.2", True),
        ("ProcessingSoftware", "darktable 4.0", True),
        ("Software", "Firmware Version 1.0.1", False),
        ("Software", "Ver.1.00", False),
    ],
)
def test_an_editors_name_is_warned_of(tmp_path: Path, name: str, text: str, editor: bool) -> None:
    exif = Image.Exif()
    exif[EXIF[name]] = text
    inner = exif.get_ifd(ExifTags.IFD.Exif)
    for tag, value in (CANON | sized(3888, 2592)).items():
        inner[EXIF[tag]] = value
    Image.new("L", (600, 400)).save(tmp_path / "a.jpg", exif=exif)
    if editor:
        with pytest.warns(
            UserWarning, match=rf"22 mm wide behind a lens of 50 mm, a view of 25\.1°.*{name} says '{text}'"
        ):
            Camera.from_exif(tmp_path / "a.jpg")
    else:
        assert Camera.from_exif(tmp_path / "a.jpg").fx == pytest.approx(1348.29, rel=1e-5)


@pytest.mark.parametrize(("width", "sensor"), [(3888, "22.3"), (400, "2.29"), (12000, "68.7")])
def test_a_sensor_that_nobody_makes_is_refused_with_its_width(tmp_path: Path, width: int, sensor: str) -> None:
    path = photograph(tmp_path / "a.jpg", (300, 200), CANON | sized(width, width * 2 // 3))
    if width == 3888:
        assert Camera.from_exif(path).fx == pytest.approx(50 * 4438.356 / 25.4 * 300 / 3888, rel=1e-6)
        return
    with pytest.raises(
        CameraError, match=rf"is {sensor} mm wide behind a lens of 50 mm, and none is under 3 or over 60"
    ):
        Camera.from_exif(path)


@pytest.mark.parametrize(
    ("tags", "numbers"),
    [
        ({"FocalLengthIn35mmFilm": 65535}, r"FocalLengthIn35mmFilm = 65535 .* view of 0\.0315°"),
        ({"FocalLengthIn35mmFilm": 3}, r"FocalLengthIn35mmFilm = 3 .* view of 161°"),
        (CANON | sized(3888, 2592) | {"FocalLength": 2.0}, r"FocalLength and FocalPlaneXResolution .* view of 160°"),
        (CANON | sized(3888, 2592) | {"FocalLength": 5000.0}, r"FocalPlaneXResolution .* view of 0\.255°"),
    ],
)
def test_a_view_that_no_lens_has_is_refused_with_its_angle(tmp_path: Path, tags: dict[str, Any], numbers: str) -> None:
    path = photograph(tmp_path / "a.jpg", (600, 400), tags)
    with pytest.raises(CameraError, match=rf"{numbers}.*none is under 1° or over 150°.*Give focal_length, in pixels"):
        Camera.from_exif(path)


@pytest.mark.parametrize(("film", "agree"), [(81, True), (75, True), (65, False), (100, False)])
def test_two_ways_that_disagree_are_warned_of(tmp_path: Path, film: int, agree: bool) -> None:
    path = photograph(tmp_path / "a.jpg", (600, 400), CANON | sized(3888, 2592) | {"FocalLengthIn35mmFilm": film})
    expected = film * math.hypot(600, 400) / math.hypot(36, 24)
    if agree:
        assert Camera.from_exif(path).fx == pytest.approx(expected)
        return
    reason = rf"disagree: by FocalLengthIn35mmFilm .* is {expected:.5g} pixels, by .* 1348\.3\. The first is taken"
    with pytest.warns(UserWarning, match=reason):
        assert Camera.from_exif(path).fx == pytest.approx(expected)


ODD: dict[str, tuple[int, bytes]] = {
    "byte": (1, b"\x1c"),
    "bytes": (1, b"\x1c\x1c\x1c"),
    "text": (2, b"28\0"),
    "words": (2, b"wide\0"),
    "fraction of 0": (5, bytes(8)),
    "fraction over 0": (5, b"\x1c\0\0\0\0\0\0\0"),
    "two fractions": (5, b"\x1c\0\0\0\x01\0\0\0" * 2),
    "undefined": (7, b"\x1c"),
    "negative": (9, b"\xff\xff\xff\xff"),
    "nan": (12, b"\0\0\0\0\0\0\xf8\x7f"),
    "huge": (12, b"\xff\xff\xff\xff\xff\xff\xef\x7f"),
    "none": (3, b""),
}
SIZES = {1: 1, 2: 1, 3: 2, 5: 8, 7: 1, 9: 4, 12: 8}


@pytest.mark.filterwarnings("ignore:.*was read, but is damaged or odd:UserWarning")
@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize(
    "name",
    ["FocalLengthIn35mmFilm", "FocalLength", "FocalPlaneXResolution", "FocalPlaneResolutionUnit", "ExifImageWidth"],
)
def test_exif_of_odd_types_is_a_number_or_a_camera_error(tmp_path: Path, name: str, odd: str) -> None:
    kind, value = ODD[odd]
    usual = {"FocalLength": 28, "FocalPlaneXResolution": 8000, "FocalPlaneResolutionUnit": 2, "ExifImageWidth": 8000}
    usual |= {"ExifImageHeight": 8000}
    if name == "FocalLengthIn35mmFilm":
        del usual["FocalPlaneXResolution"]
    entries = [(EXIF[tag], 4, 1, number.to_bytes(4, "little")) for tag, number in usual.items() if tag != name]
    entries.append((EXIF[name], kind, len(value) // SIZES[kind], value))
    tail = 26 + 2 + 12 * len(entries) + 4
    body, outside = b"", b""
    for tag, code, count, data in sorted(entries):
        place = data.ljust(4, b"\0") if len(data) <= 4 else (tail + len(outside)).to_bytes(4, "little")
        outside += data if len(data) > 4 else b""
        body += struct.pack("<HHI", tag, code, count) + place
    first = struct.pack("<HHHIII", 1, 34665, 4, 1, 26, 0)
    exif = b"Exif\0\0II*\0" + struct.pack("<I", 8) + first + struct.pack("<H", len(entries)) + body + bytes(4) + outside
    Image.new("L", (1200, 1200)).save(tmp_path / "a.jpg", exif=exif)
    camera = None
    with suppress(CameraError):
        camera = Camera.from_exif(tmp_path / "a.jpg")
    by_sensor = 28 * 8000 / 25.4 * 1200 / 8000
    by_film = 28 * math.hypot(1200, 1200) / math.hypot(36, 24)
    assert camera is None or camera.fx in (pytest.approx(by_sensor), pytest.approx(by_film))
    if name == "FocalLengthIn35mmFilm":
        assert (camera is not None) == (odd in ("byte", "text", "undefined"))


def test_a_tiff_whose_width_has_an_odd_type_is_a_camera_or_a_camera_error(tmp_path: Path) -> None:
    entries = [(256, 1, 2, b"\x20\x20"), (257, 3, 1, b"\x20\0"), (34665, 4, 1, (50).to_bytes(4, "little"))]
    first = struct.pack("<H", 3) + b"".join(
        struct.pack("<HHI", tag, kind, count) + value.ljust(4, b"\0") for tag, kind, count, value in entries
    )
    inner = struct.pack("<HHHIHHI", 1, EXIF["FocalLengthIn35mmFilm"], 3, 1, 28, 0, 0)
    (tmp_path / "a.tif").write_bytes(b"II*\0" + struct.pack("<I", 8) + first + bytes(4) + inner)
    camera = Camera.from_exif(tmp_path / "a.tif")
    assert camera.fx == pytest.approx(28 * math.hypot(32, 32) / math.hypot(36, 24))
    with pytest.raises(InputError, match=r"a\.tif is broken"):
        read_image(tmp_path / "a.tif")
