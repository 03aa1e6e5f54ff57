"""Camera raw files are read to the light on the sensor, and never taken for their previews."""

from __future__ import annotations

import io
import math
import struct
import sys
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
import tifffile
from dng import BLACK, GAINS, WHITE, X_TRANS, mosaic, smooth_light, write_dng, write_grey_dng
from numpy.typing import NDArray
from PIL import ExifTags, Image
from samples import WEIGHTS, turned_upright

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.decode import read_header
from persfs_cl.io.exif import exif_focal_length
from persfs_cl.io.maps import read_light
from persfs_cl.io.photos import Channel, read_photo

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


KINDS = pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"tags": DNG, "reduced": False}, "Adobe DNG"),
        ({"maker": "NIKON CORPORATION"}, "Nikon NEF"),
        ({"maker": "SONY", "reduced": False}, "Sony ARW"),
        ({"maker": "Nobody", "sensor": "minisblack"}, "of Nobody"),
        ({"sensor": "cfa"}, "of a colour filter array"),
    ],
)


@KINDS
def test_the_preview_is_not_the_photo(tmp_path: Path, options: dict[str, Any], kind: str) -> None:
    path = raw(tmp_path / "photo.tif", **options)
    assert kind
    assert read_header(path).shape == SENSOR.shape
    photo = read_photo(path)
    assert photo.image.shape == SENSOR.shape
    assert not photo.image.any()


@KINDS
def test_raw_files_of_the_tiff_kind_are_named_where_they_cannot_be_read(
    tmp_path: Path, options: dict[str, Any], kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = raw(tmp_path / "photo.tif", **options)
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(InputError, match=rf"photo\.tif is a camera raw file \({kind}\).*16-bit TIFF.*'linear'"):
        read_photo(path)


def test_a_dng_without_a_sensor_is_refused(tmp_path: Path) -> None:
    path = raw(tmp_path / "photo.tif", tags=DNG, sensor="minisblack")
    for read in (read_photo, read_header, Camera.from_exif):
        with pytest.raises(
            InputError, match=r"\(Adobe DNG\) that cannot be read .*its preview is no photo: develop it"
        ):
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


SHAPE = (64, 97)
CHANNELS: tuple[Channel, Channel, Channel] = ("red", "green", "blue")


def test_a_mosaic_is_read_to_its_linear_light_with_the_black_level_taken_out(tmp_path: Path) -> None:
    light = smooth_light(SHAPE)
    path = write_dng(tmp_path / "a.dng", mosaic(light))
    photo = read_photo(path, channel="green")
    assert (photo.encoding, photo.bits, photo.white, photo.profile) == ("linear", 16, 65535, "camera")
    # Between its pixels of a colour the sensor saw nothing: they are interpolated.
    np.testing.assert_allclose(photo.image[4:-4, 4:-4], light[4:-4, 4:-4], rtol=5e-3)
    channels: list[tuple[Channel, float]] = [("red", GAINS[0]), ("blue", GAINS[2])]
    for channel, gain in channels:
        image = read_photo(path, channel=channel).image
        np.testing.assert_allclose(image[4:-4, 4:-4], gain * light[4:-4, 4:-4], rtol=8e-3)


def test_a_sensor_without_colours_is_read_to_its_light(tmp_path: Path) -> None:
    light = smooth_light(SHAPE)
    path = write_grey_dng(tmp_path / "a.dng", np.rint(BLACK + (WHITE - BLACK) * light).astype(np.uint16))
    photo = read_photo(path)
    assert (photo.encoding, photo.white, photo.profile) == ("linear", 65535, "camera")
    np.testing.assert_allclose(photo.image, light, atol=1e-4)
    half = read_photo(path, half_size=True).image
    np.testing.assert_allclose(half, light[:, :96].reshape(32, 2, 48, 2).mean(axis=(1, 3)), atol=1e-4)


@pytest.mark.parametrize("half_size", [False, True])
def test_the_pattern_of_six_by_six_is_read_to_its_light(tmp_path: Path, half_size: bool) -> None:
    light = smooth_light((516, 522))  # LibRaw wants 512 of them
    path = write_dng(tmp_path / "a.dng", mosaic(light, pattern=X_TRANS), pattern=X_TRANS)
    photo = read_photo(path, channel="green", half_size=half_size)
    expected = light.reshape(258, 2, 261, 2).mean(axis=(1, 3)) if half_size else light
    np.testing.assert_allclose(photo.image[8:-8, 8:-8], expected[8:-8, 8:-8], rtol=6e-3)
    red = read_photo(path, channel="red", half_size=half_size).image
    np.testing.assert_allclose(red[8:-8, 8:-8], GAINS[0] * expected[8:-8, 8:-8], rtol=1.5e-2)


def test_channels_are_weighted_by_the_balance_of_the_camera(tmp_path: Path) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light(SHAPE)))
    red, green, blue = (read_photo(path, channel=name).image for name in CHANNELS)
    weighted: list[tuple[Channel, NDArray[np.float64]]] = [("luminance", WEIGHTS), ("mean", np.ones(3) / 3)]
    for channel, shares in weighted:
        weights = shares / GAINS / (shares / GAINS).sum()
        expected = weights[0] * red + weights[1] * green + weights[2] * blue
        np.testing.assert_allclose(read_photo(path, channel=channel).image, expected, rtol=1e-3)
    gains = GAINS.min() / GAINS
    expected = np.maximum.reduce([gains[0] * red, gains[1] * green, gains[2] * blue])
    np.testing.assert_allclose(read_photo(path, channel="max").image, expected, rtol=1e-3)
    colour = read_photo(path).colour
    assert int(np.ptp(colour[4:-4, 4:-4].astype(int), axis=2).max()) <= 2, "white light is grey"


@pytest.mark.parametrize("shape", [(64, 96), (63, 97)])
def test_in_half_the_size_squares_of_four_are_a_pixel(tmp_path: Path, shape: tuple[int, int]) -> None:
    light = smooth_light(shape)
    path = write_dng(tmp_path / "a.dng", mosaic(light))
    photo = read_photo(path, channel="green", half_size=True)
    assert read_header(path, half_size=True).shape == photo.image.shape == (shape[0] // 2, shape[1] // 2)
    even = light[: shape[0] // 2 * 2, : shape[1] // 2 * 2]
    # The two green pixels of a square.
    expected = (even[::2, 1::2] + even[1::2, ::2]) / 2
    np.testing.assert_allclose(photo.image, expected, atol=2e-4)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("half_size", [False, True])
def test_the_orientation_is_undone_once(tmp_path: Path, orientation: int, half_size: bool) -> None:
    light = smooth_light(SHAPE)
    light[8:16, 8:16] = 0.05
    upright = read_photo(write_dng(tmp_path / "a.dng", mosaic(light)), half_size=half_size)
    path = write_dng(tmp_path / "b.dng", mosaic(light), orientation=orientation)
    photo, header = read_photo(path, half_size=half_size), read_header(path, half_size=half_size)
    assert photo.orientation == header.orientation == orientation
    assert photo.image.shape == header.shape
    np.testing.assert_array_equal(photo.image, turned_upright(upright.image, orientation))


def test_what_the_sensor_clips_is_saturated_and_nothing_else_is(tmp_path: Path) -> None:
    light = np.full(SHAPE, 0.4)
    light[20:40, 20:40] = 3.0
    photo = read_photo(write_dng(tmp_path / "a.dng", mosaic(light)))
    assert photo.white is not None
    saturated = photo.largest_sample >= 0.98 * photo.white
    assert saturated[22:38, 22:38].all()
    saturated[18:42, 18:42] = False
    assert not saturated.any()
    # Nothing is as bright as the sensor can count, and the scale does not follow the picture.
    dark = read_photo(write_dng(tmp_path / "b.dng", mosaic(np.full(SHAPE, 0.1))), channel="green")
    np.testing.assert_allclose(dark.image, 0.1, rtol=1e-3)


@pytest.mark.parametrize("compression", [None, "jpegxl"])
@pytest.mark.parametrize("half_size", [False, True])
def test_linear_colours_are_read_with_and_without_jpeg_xl(tmp_path: Path, compression: Any, half_size: bool) -> None:
    light = smooth_light((64, 96))[..., None] * GAINS
    samples = np.rint(BLACK + (WHITE - BLACK) * light).astype(np.uint16)
    path = write_dng(tmp_path / "a.dng", samples, compression=compression, orientation=3)
    expected = light[::-1, ::-1]
    if half_size:
        expected = expected.reshape(32, 2, 48, 2, 3).mean(axis=(1, 3))
    for index, channel in enumerate(CHANNELS):
        photo = read_photo(path, channel=channel, half_size=half_size)
        np.testing.assert_allclose(photo.image, expected[..., index], atol=2e-4)
    weights = WEIGHTS / GAINS / (WEIGHTS / GAINS).sum()
    np.testing.assert_allclose(read_photo(path, half_size=half_size).image, expected @ weights, atol=4e-4)
    header = read_header(path, half_size=half_size)
    assert (header.shape, header.orientation) == (expected.shape[:2], 3)


def test_a_jpeg_xl_picture_larger_than_its_tile_is_refused(tmp_path: Path) -> None:
    large = bytes(imagecodecs.jpegxl_encode(np.full((300, 300, 3), 100, np.uint16), level=100))
    path = write_dng(
        tmp_path / "a.dng", iter((large,)), shape=(64, 96, 3), dtype=np.uint16, compression="jpegxl", rowsperstrip=64
    )
    with pytest.raises(InputError, match=r"a\.dng is broken: a part of it, 64 × 96 pixels, holds a picture of 300"):
        read_photo(path)


def test_the_focal_length_is_of_the_size_that_is_read(tmp_path: Path) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light((64, 96))), focal_length_35mm=26)
    expected = 26 * math.hypot(64, 96) / math.hypot(36, 24)
    assert Camera.from_exif(path).fx == pytest.approx(expected)
    assert exif_focal_length(path, read_photo(path, half_size=True).image.shape)[0] == pytest.approx(expected / 2)


def test_a_dark_frame_and_a_flat_field_are_of_the_photo_s_scale(tmp_path: Path) -> None:
    light, lens = smooth_light(SHAPE), 1 - 0.4 * smooth_light(SHAPE)
    photo = read_photo(write_dng(tmp_path / "photo.dng", mosaic(lens * light + 0.05)))
    dark = read_light(write_dng(tmp_path / "dark.dng", mosaic(np.full(SHAPE, 0.05))), SHAPE)
    flat = read_light(write_dng(tmp_path / "flat.dng", mosaic(lens)), SHAPE)
    corrected = (photo.image - dark) / flat
    ratio = corrected[4:-4, 4:-4] / light[4:-4, 4:-4]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.02)
    half = read_light(tmp_path / "dark.dng", (32, 48), half_size=True)
    np.testing.assert_allclose(half, np.median(dark), rtol=1e-2)


def test_a_raw_file_is_no_other_than_linear_and_others_have_no_half_size(tmp_path: Path) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light(SHAPE)))
    with pytest.raises(InputError, match=r"encoding='srgb' is not that of .*a\.dng, a camera raw file: leave it out"):
        read_photo(path, encoding="srgb")
    Image.new("L", (8, 8), 100).save(tmp_path / "a.png")
    with pytest.raises(InputError, match=r"half_size=True is for camera raw files, and .*a\.png is none: leave it out"):
        read_photo(tmp_path / "a.png", half_size=True)
    assert read_light(tmp_path / "a.png", (8, 8), half_size=True).shape == (8, 8)


def test_without_its_package_a_raw_file_is_refused_with_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light(SHAPE)))
    monkeypatch.setitem(sys.modules, "rawpy", None)
    for read in (read_photo, read_header, Camera.from_exif):
        with pytest.raises(
            InputError, match=r"camera raw file \(Adobe DNG\).* pip install 'persfs-cl\[raw\]'.*'linear'"
        ):
            read(path)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_a_raw_file_that_breaks_off_is_refused_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], share: float
) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light(SHAPE)))
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    for read in (read_photo, read_header):
        with pytest.raises(
            InputError, match=r"a\.dng lacks data: its sensor's image ends at byte \d+, and the file has"
        ):
            read(path)
    assert capfd.readouterr() == ("", "")


def test_pixels_of_a_raw_file_are_counted_before_it_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_dng(tmp_path / "a.dng", mosaic(smooth_light((64, 96))))
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "6000")
    for read in (read_photo, read_header):
        with pytest.raises(InputError, match=r"a\.dng is too large: 64 × 96 pixels are 6,144"):
            read(path)


def lens(length: int) -> bytes:
    """EXIF's own directory as a TIFF file: the 35 mm equivalent."""
    return b"II*\0" + struct.pack("<IHHHIII", 8, 1, 41989, 3, 1, length, 0)


def test_the_lens_is_found_in_raw_files_that_are_no_tiff(tmp_path: Path) -> None:
    preview = io.BytesIO()
    exif = Image.Exif()
    exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FocalLengthIn35mmFilm] = 26
    Image.new("L", (24, 16)).save(preview, "JPEG", exif=exif)
    head = b"FUJIFILMCCD-RAW 0201".ljust(84, b"\0") + struct.pack(">II", 200, len(preview.getvalue()))
    (tmp_path / "a.raf").write_bytes(head.ljust(200, b"\0") + preview.getvalue())
    box = struct.pack(">I", 8 + len(lens(26))) + b"CMT2" + lens(26)
    (tmp_path / "a.cr3").write_bytes(b"\0\0\0\x18ftypcrx " + bytes(8) + b"crx isom" + box + bytes(99))
    # Neither has a sensor's image, which tells the size.
    for name in ("a.raf", "a.cr3"):
        found = exif_focal_length(tmp_path / name, (40, 60))
        assert found[0] == pytest.approx(26 * math.hypot(40, 60) / math.hypot(36, 24))
        assert found[1] == "FocalLengthIn35mmFilm"
        with pytest.raises(InputError, match="that cannot be read"):
            Camera.from_exif(tmp_path / name)
