"""Photos, masks and depth maps: every format to the last bit, and every bad file named with its reason."""

from __future__ import annotations

import io
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import imagecodecs
import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray
from PIL import Image

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.photos import (
    read_depth,
    read_image,
    read_light,
    read_mask,
    read_photo,
    to_display,
    write_depth,
    write_grey,
)
from persfs_cl.preparation.normalise import decode_srgb, encode_srgb

Samples = NDArray[Any]
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
SHAPE = (7, 5)


def random_samples(channels: int, bits: int, shape: tuple[int, int] = SHAPE) -> Samples:
    size = (*shape, channels) if channels > 1 else shape
    samples = np.random.default_rng(channels).integers(0, 2**bits, size, dtype=np.uint8 if bits == 8 else np.uint16)
    samples.flat[:2] = 0, 2**bits - 1
    return samples


def save(path: Path, samples: Samples) -> Path:
    """Write samples without loss, not through the code under test."""
    if path.suffix == ".png":
        path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(samples)))
    else:
        colour = samples.ndim == 3 and samples.shape[2] > 2
        extra = ["unassalpha"] if samples.ndim == 3 and samples.shape[2] in (2, 4) else None
        tifffile.imwrite(
            path,
            samples,
            photometric="rgb" if colour else "minisblack",
            planarconfig="contig" if samples.ndim == 3 else None,
            extrasamples=extra,
        )
    return path


def light(samples: Samples, bits: int) -> NDArray[np.float64]:
    """The luminance of sRGB samples, as its definition says."""
    linear = decode_srgb(samples / (2**bits - 1))
    if samples.ndim == 2:
        return linear
    return linear[..., 0] if samples.shape[2] == 2 else np.asarray(linear[..., :3] @ WEIGHTS)


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_integers_are_read_to_the_last_bit(tmp_path: Path, suffix: str, bits: int, channels: int) -> None:
    samples = random_samples(channels, bits)
    photo = read_photo(save(tmp_path / f"a{suffix}", samples))
    assert photo.image.dtype == np.float64
    assert photo.image.shape == SHAPE
    # One step of 16 bits is 1.5e-5 of the range, and decoding makes it 1e-6 at the dark end.
    np.testing.assert_allclose(photo.image, light(samples, bits), rtol=1e-13, atol=1e-15)
    assert (photo.bits, photo.encoding, photo.path) == (bits, "srgb", tmp_path / f"a{suffix}")
    if channels in (1, 3):
        assert photo.mask is None
    else:
        np.testing.assert_array_equal(photo.mask, samples[..., -1] > (2**bits - 1) / 2)
    shown = samples[..., :3] if channels > 2 else np.stack([samples.reshape(*SHAPE, -1)[..., 0]] * 3, axis=-1)
    assert photo.colour.dtype == np.uint8
    np.testing.assert_array_equal(photo.colour, np.rint(shown / (2**bits - 1) * 255))


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 4), (4, 3)])
@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_small_images_keep_their_axes(tmp_path: Path, shape: tuple[int, int], suffix: str) -> None:
    for channels in (1, 3):
        samples = random_samples(channels, 8, shape)
        assert read_image(save(tmp_path / f"a{suffix}", samples)).shape == shape


def test_jpeg_grey_and_colour(tmp_path: Path) -> None:
    flat = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    Image.fromarray(flat).save(tmp_path / "a.jpg", quality=100, subsampling=0)
    decoded = np.asarray(Image.open(tmp_path / "a.jpg"))
    photo = read_photo(tmp_path / "a.jpg")
    np.testing.assert_allclose(photo.image, light(decoded, 8), rtol=1e-13)
    np.testing.assert_array_equal(photo.colour, decoded)
    Image.fromarray(flat[..., 0]).save(tmp_path / "grey.jpg", quality=100)
    np.testing.assert_allclose(read_image(tmp_path / "grey.jpg"), decode_srgb(200 / 255), rtol=1e-13)


@pytest.mark.parametrize(
    ("channel", "weights"),
    [
        ("luminance", WEIGHTS),
        ("red", (1, 0, 0)),
        ("green", (0, 1, 0)),
        ("blue", (0, 0, 1)),
        ("mean", (1 / 3, 1 / 3, 1 / 3)),
    ],
)
def test_a_channel_is_a_weighted_sum_of_linear_light(tmp_path: Path, channel: Any, weights: Any) -> None:
    samples = random_samples(3, 8)
    path = save(tmp_path / "a.png", samples)
    expected = decode_srgb(samples / 255) @ np.array(weights, dtype=float)
    np.testing.assert_allclose(read_image(path, channel=channel), expected, rtol=1e-13, atol=1e-15)
    grey = save(tmp_path / "grey.png", samples[..., 0])
    np.testing.assert_array_equal(read_image(grey, channel=channel), decode_srgb(samples[..., 0] / 255))


def test_the_channel_max_is_the_largest_linear_light(tmp_path: Path) -> None:
    samples = random_samples(3, 8)
    photo = read_photo(save(tmp_path / "a.png", samples), channel="max")
    np.testing.assert_allclose(photo.image, decode_srgb(samples / 255).max(axis=2), rtol=1e-13)
    assert photo.channel == "max"
    floats: Samples = (samples / 100).astype(np.float32)
    floats[0, 1, 2] = np.nan
    tifffile.imwrite(tmp_path / "a.tif", floats, photometric="rgb")
    image = read_photo(tmp_path / "a.tif", channel="max", keep_nan=True).image
    np.testing.assert_array_equal(image, floats.max(axis=2).astype(float))
    grey = save(tmp_path / "grey.png", samples[..., 0])
    np.testing.assert_array_equal(read_image(grey, channel="max"), read_image(grey))
    wrong: Any = "maximum"
    with pytest.raises(InputError, match=r"channel='maximum' is unknown: choose \"luminance\", .* or \"max\""):
        read_image(grey, channel=wrong)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(
    ("channel", "used"), [("red", [0]), ("green", [1]), ("blue", [2]), ("luminance", [0, 1, 2]), ("max", [0, 1, 2])]
)
def test_a_photo_keeps_its_extreme_samples(tmp_path: Path, bits: int, channel: Any, used: list[int]) -> None:
    samples = random_samples(4, bits)
    photo = read_photo(save(tmp_path / "a.png", samples), channel=channel)
    np.testing.assert_array_equal(photo.largest_sample, samples[..., used].max(axis=2))
    np.testing.assert_array_equal(photo.smallest_sample, samples[..., :3].min(axis=2))
    assert photo.white == 2**bits - 1


def test_numbers_of_a_file_become_light_as_its_pixels_do(tmp_path: Path) -> None:
    samples = random_samples(1, 8)
    for encoding in ("srgb", "linear"):
        photo = read_photo(save(tmp_path / "a.png", samples), encoding=encoding)
        np.testing.assert_allclose(photo.linear(samples), photo.image, rtol=1e-14)
    tifffile.imwrite(tmp_path / "a.tif", samples.astype(np.float32))
    photo = read_photo(tmp_path / "a.tif")
    assert photo.white is None
    np.testing.assert_array_equal(photo.linear(samples), photo.image)


def test_light_is_read_from_images_and_arrays(tmp_path: Path) -> None:
    samples = random_samples(3, 8)
    picture = save(tmp_path / "a.png", samples)
    for options in ({}, {"channel": "green", "encoding": "linear"}):
        expected = read_image(picture, **options)  # type: ignore[arg-type]
        np.testing.assert_array_equal(read_light(picture, SHAPE, **options), expected)  # type: ignore[arg-type]
    stored = np.where(samples[..., 0] > 9, samples[..., 0] / 7, np.nan)
    np.save(tmp_path / "a.npy", stored)
    np.testing.assert_array_equal(read_light(tmp_path / "a.npy", SHAPE), stored)
    for name in ("a.png", "a.npy"):
        with pytest.raises(InputError, match=rf"{name} has shape \(7, 5\), but the image has \(5, 7\)"):
            read_light(tmp_path / name, (5, 7))
    np.save(tmp_path / "a.npy", np.ones(SHAPE, bool))
    with pytest.raises(InputError, match="holds bool, not numbers"):
        read_light(tmp_path / "a.npy", SHAPE)


def test_integers_can_be_taken_as_linear(tmp_path: Path) -> None:
    samples = random_samples(1, 8)
    photo = read_photo(save(tmp_path / "a.png", samples), encoding="linear")
    np.testing.assert_allclose(photo.image, samples / 255, rtol=1e-15)
    np.testing.assert_array_equal(photo.colour[..., 1], np.rint(255 * encode_srgb(samples / 255)))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_floats_are_linear_and_keep_their_scale(tmp_path: Path, dtype: type) -> None:
    samples: Samples = (random_samples(3, 8) / 100).astype(dtype)
    photo = read_photo(save(tmp_path / "a.tiff", samples))
    assert photo.encoding == "linear"
    assert photo.image.max() > 1
    np.testing.assert_allclose(photo.image, samples.astype(float) @ WEIGHTS, rtol=1e-14)
    np.testing.assert_array_equal(photo.colour, np.rint(255 * encode_srgb(samples.clip(0, 1))))
    decoded = read_image(tmp_path / "a.tiff", encoding="srgb")
    np.testing.assert_allclose(decoded, decode_srgb(samples.astype(float)) @ WEIGHTS, rtol=1e-13)


@pytest.mark.parametrize("bits", [1, 8])
def test_black_and_white_images(tmp_path: Path, bits: int) -> None:
    black = np.random.default_rng(0).random(SHAPE) > 0.5
    picture = Image.fromarray(np.where(black, 0, 255).astype(np.uint8))
    for name in ("a.png", "a.tiff"):
        (picture.convert("1", dither=Image.Dither.NONE) if bits == 1 else picture).save(tmp_path / name)
        np.testing.assert_array_equal(read_image(tmp_path / name), ~black)


@pytest.mark.parametrize("name", ["a.png", "a.tiff"])
def test_palettes_are_looked_up(tmp_path: Path, name: str) -> None:
    colours = np.array([[0, 0, 0], [255, 255, 255], [200, 100, 50]], np.uint8)
    index = np.random.default_rng(0).integers(0, 3, SHAPE).astype(np.uint8)
    picture = Image.fromarray(index).convert("P")
    picture.putpalette(colours.tobytes())
    picture.save(tmp_path / name)
    photo = read_photo(tmp_path / name)
    np.testing.assert_array_equal(photo.colour, colours[index])
    assert photo.mask is None


def test_a_transparent_palette_entry_or_grey_value_becomes_the_mask(tmp_path: Path) -> None:
    index = np.random.default_rng(0).integers(0, 3, SHAPE).astype(np.uint8)
    picture = Image.fromarray(index).convert("P")
    picture.putpalette(bytes(range(9)))
    picture.save(tmp_path / "palette.png", transparency=1)
    Image.fromarray(index).save(tmp_path / "grey.png", transparency=1)
    for name in ("palette.png", "grey.png"):
        np.testing.assert_array_equal(read_photo(tmp_path / name).mask, index != 1)


def test_alpha_of_exactly_one_half_is_transparent(tmp_path: Path) -> None:
    samples = np.full((1, 2, 2), 100, np.uint8)
    samples[0, :, 1] = 127, 128
    np.testing.assert_array_equal(read_photo(save(tmp_path / "a.png", samples)).mask, [[False, True]])


@pytest.mark.parametrize("orientation", range(10))
@pytest.mark.parametrize("kind", ["a.jpg", "a.png", "16 bits.png", "a.tiff"])
def test_every_orientation_is_turned_upright(tmp_path: Path, kind: str, orientation: int) -> None:
    path = tmp_path / kind
    # The corner blocks tell all eight apart, also after JPEG compression.
    samples = np.zeros((16, 24), np.uint8)
    samples[:8, :8], samples[:8, 16:], samples[8:, :8] = 250, 150, 80
    exif = Image.Exif()
    exif[0x0112] = orientation
    if kind == "a.tiff":
        tifffile.imwrite(path, samples, photometric="minisblack", extratags=[(274, "H", 1, orientation, True)])
    elif kind == "16 bits.png":
        png = imagecodecs.png_encode(np.repeat(samples.astype(np.uint16)[..., None] * 257, 3, axis=2))
        stub = io.BytesIO()
        Image.new("L", (1, 1)).save(stub, "PNG", exif=exif)
        start = stub.getvalue().index(b"eXIf") - 4
        size = int.from_bytes(stub.getvalue()[start : start + 4], "big") + 12
        path.write_bytes(png[:33] + stub.getvalue()[start : start + size] + png[33:])
    else:
        Image.fromarray(samples).save(path, exif=exif, quality=100)
    # Where row 0 and column 0 of the file belong, as the EXIF standard words it.
    upright: dict[int, Callable[[Samples], Samples]] = {
        2: np.fliplr,
        3: lambda a: np.rot90(a, 2),
        4: np.flipud,
        5: np.transpose,
        6: lambda a: np.rot90(a, -1),
        7: lambda a: np.rot90(a, 2).T,
        8: np.rot90,
    }
    expected = upright[orientation](samples) if orientation in upright else samples
    photo = read_photo(path)
    np.testing.assert_allclose(photo.colour[..., 0].astype(int), expected, atol=3)
    assert photo.image.flags.c_contiguous


def test_phone_jpegs_with_a_second_picture_give_the_first(tmp_path: Path) -> None:
    first, second = (Image.new("L", (16, 8), value) for value in (200, 20))
    first.save(tmp_path / "a.jpg", "MPO", save_all=True, append_images=[second])
    with Image.open(tmp_path / "a.jpg") as picture:
        assert picture.format == "MPO"
    np.testing.assert_array_equal(read_photo(tmp_path / "a.jpg").colour, 200)


@pytest.mark.parametrize(
    "options", [{"compression": "zlib"}, {"compression": "lzw"}, {"byteorder": ">"}, {"bigtiff": True}]
)
def test_compressed_and_exotic_tiffs(tmp_path: Path, options: dict[str, Any]) -> None:
    samples = random_samples(3, 16)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", **options)
    np.testing.assert_allclose(read_image(tmp_path / "a.tif"), light(samples, 16), rtol=1e-13, atol=1e-15)


def test_planar_tiffs_and_tiffs_where_zero_is_white(tmp_path: Path) -> None:
    samples = random_samples(4, 8)
    tifffile.imwrite(
        tmp_path / "planar.tif",
        np.moveaxis(samples, -1, 0),
        photometric="rgb",
        planarconfig="separate",
        extrasamples=[2],
    )
    photo = read_photo(tmp_path / "planar.tif")
    np.testing.assert_array_equal(photo.colour, samples[..., :3])
    np.testing.assert_array_equal(photo.mask, samples[..., 3] > 127)
    tifffile.imwrite(tmp_path / "white.tif", samples[..., 0], photometric="miniswhite")
    np.testing.assert_array_equal(read_photo(tmp_path / "white.tif").colour[..., 0], 255 - samples[..., 0])


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.int16])
def test_floats_of_which_zero_is_white_are_refused(tmp_path: Path, dtype: type) -> None:
    samples: Samples = np.ones(SHAPE, dtype)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="miniswhite")
    with pytest.raises(
        InputError, match=rf"a\.tif holds samples of type {samples.dtype} of which 0 is white.*MINISBLACK"
    ):
        read_photo(tmp_path / "a.tif")


@pytest.mark.parametrize("channels", [2, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_colours_that_alpha_was_multiplied_into_are_divided_by_it_before_they_are_decoded(
    tmp_path: Path, dtype: type, channels: int
) -> None:
    white = 1.0 if dtype == np.float32 else float(np.iinfo(dtype).max)
    alpha = np.array([[255, 160, 128, 0]]) / 255
    colour = np.full((1, 4), 188 / 255)
    stored = np.repeat((colour * alpha)[..., None], channels, axis=2)
    stored[..., -1] = alpha
    samples: Samples = (stored * white).astype(dtype) if dtype == np.float32 else np.rint(stored * white).astype(dtype)
    photometric = "rgb" if channels == 4 else "minisblack"
    tifffile.imwrite(
        tmp_path / "a.tif", samples, photometric=photometric, planarconfig="contig", extrasamples=["assocalpha"]
    )
    photo = read_photo(tmp_path / "a.tif", encoding="srgb")
    # Half a level of the file, doubled by the division, is what the file itself does not tell.
    tolerance = 1e-6 if dtype == np.float32 else 1 / white
    np.testing.assert_allclose(encode_srgb(photo.image[0, :3]), 188 / 255, atol=tolerance)
    assert photo.image[0, 3] == 0
    np.testing.assert_array_equal(photo.mask, [[True, True, True, False]])


def test_alpha_that_was_multiplied_in_as_an_editor_writes_it(tmp_path: Path) -> None:
    samples = np.empty((10, 10, 4), np.uint8)
    samples[:] = 118, 118, 118, 160
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", extrasamples=["assocalpha"])
    photo = read_photo(tmp_path / "a.tif")
    np.testing.assert_array_equal(photo.colour, 188)
    np.testing.assert_allclose(photo.image, decode_srgb(188 / 255), rtol=1e-12)


def test_strips_that_are_missing_are_no_black(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, random_samples(1, 8, (64, 64)), photometric="minisblack", rowsperstrip=16)
    data = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        counts = file.pages.first.tags["StripByteCounts"]
    assert (counts.count, counts.dtype) == (4, tifffile.DATATYPE.SHORT)
    data[counts.valueoffset : counts.valueoffset + 2] = bytes(2)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.tif lacks data: of 4 strips, 1 are missing\. Save or copy it again"):
        read_photo(path)


@pytest.mark.parametrize("compression", ["jpeg", "jpeg2000", "png", "webp"])
def test_a_picture_larger_than_the_strip_that_holds_it_is_refused(tmp_path: Path, compression: Any) -> None:
    encode: dict[str, Callable[..., bytes | bytearray]] = {
        "jpeg": imagecodecs.jpeg_encode,
        "jpeg2000": imagecodecs.jpeg2k_encode,
        "png": imagecodecs.png_encode,
        "webp": imagecodecs.webp_encode,
    }
    for side in (16, 300):
        strip = bytes(encode[compression](np.full((side, side, 3), 100, np.uint8)))
        tifffile.imwrite(
            tmp_path / "a.tif",
            iter([strip]),
            shape=(16, 16, 3),
            dtype=np.uint8,
            photometric="rgb",
            compression=compression,
            rowsperstrip=16,
        )
        if side == 16:
            np.testing.assert_allclose(read_photo(tmp_path / "a.tif").colour.astype(int), 100, atol=3)
        else:
            with pytest.raises(
                InputError, match=r"a\.tif is broken: a part of it, 16 × 16 pixels, holds a picture of 300"
            ):
                read_photo(tmp_path / "a.tif")


def test_a_compression_that_tells_its_size_to_nobody_is_refused(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", random_samples(3, 8), photometric="rgb", compression="jpegxl")
    with pytest.raises(InputError, match=r"a\.tif has the compression JPEGXL: save it uncompressed"):
        read_photo(tmp_path / "a.tif")


@pytest.mark.parametrize("kind", ["tiles", "channels", "doubles"])
def test_tiff_pixels_are_counted_by_the_room_they_take(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.tif"
    small: dict[str, tuple[Samples, dict[str, Any]]] = {
        "tiles": (random_samples(1, 8), {"tile": (64, 64), "photometric": "minisblack"}),
        "channels": (np.zeros((*SHAPE, 400), np.uint8), {"planarconfig": "contig", "photometric": "minisblack"}),
        "doubles": (np.zeros((30, 40, 3)), {"photometric": "rgb"}),
    }
    samples, options = small[kind]
    tifffile.imwrite(path, samples, **options)
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "3000")
    with pytest.raises(InputError, match=r"a\.tif is too large: .*and the limit here is 3,000\. Reduce it first"):
        read_photo(path)


def test_a_bomb_is_refused_before_it_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "1e9")
    header = struct.pack(">IIBBBBB", 1 << 20, 1 << 20, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(bytes(100))), (b"IEND", b"")]
    coded = [
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks
    ]
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(coded))
    tifffile.imwrite(
        tmp_path / "a.tif",
        iter([zlib.compress(bytes(100))]),
        shape=(60000, 60000),
        dtype=np.uint8,
        rowsperstrip=60000,
        compression="zlib",
        photometric="minisblack",
    )
    with (tmp_path / "a.npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(
            file, {"descr": "<f8", "fortran_order": False, "shape": (1 << 30, 1 << 30)}
        )
    for name in ("a.png", "a.tif"):
        with pytest.raises(InputError, match=rf"{name} is too large: .* million, .*PERSFS_CL_MAX_PIXELS"):
            read_photo(tmp_path / name)
    with pytest.raises(InputError, match=r"a\.npy is broken: its header promises shape \(1073741824, 1073741824\)"):
        read_depth(tmp_path / "a.npy")


@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0)])
def test_every_version_of_numpy_files_is_read(tmp_path: Path, version: tuple[int, int]) -> None:
    with (tmp_path / "a.npy").open("wb") as file:
        np.lib.format.write_array(file, np.full(SHAPE, 2.5), version=version)
    np.testing.assert_array_equal(read_depth(tmp_path / "a.npy"), 2.5)


def test_damage_that_a_decoder_mends_is_told_of_and_not_printed(tmp_path: Path, capfd: Any) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, random_samples(1, 8), photometric="minisblack")
    with tifffile.TiffFile(path) as file:
        place = file.pages.first.tags["ResolutionUnit"].offset
    data = bytearray(path.read_bytes())
    data[place + 8] = 77
    path.write_bytes(data)
    with pytest.warns(
        UserWarning, match=r"a\.tif was read, but is damaged or odd \(.*77 is not a valid RESUNIT.*look at"
    ):
        photo = read_photo(path)
    np.testing.assert_array_equal(photo.colour[..., 0], random_samples(1, 8))
    assert capfd.readouterr() == ("", "")


def test_an_orientation_that_is_no_number_leaves_the_photo_as_it_is(tmp_path: Path) -> None:
    for kind, count, value in (
        (2, 3, b"6x\0\0"),
        (11, 1, struct.pack("<f", 6.5)),
        (3, 0, bytes(4)),
    ):
        exif = b"II*\0" + struct.pack("<IHHHI4sI", 8, 1, 0x0112, kind, count, value, 0)
        Image.fromarray(random_samples(1, 8)).save(tmp_path / "a.png", exif=exif)
        photo = read_photo(tmp_path / "a.png")
        assert (photo.image.shape, photo.orientation) == (SHAPE, 1)


@pytest.mark.parametrize("name", ["a.png", "a.npy", "a.tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_files_made_without_turning_the_photo_are_told_of(tmp_path: Path, name: str, orientation: int) -> None:
    read: dict[str, Callable[..., Any]] = {"a.png": read_mask, "a.npy": read_light, "a.tif": read_depth}
    on_a_side = orientation > 4

    def check(unturned: tuple[int, int], shape: tuple[int, int]) -> Any:
        samples = np.full(unturned, 255, np.uint8)
        if name == "a.npy":
            np.save(tmp_path / name, samples)
        else:
            save(tmp_path / name, samples)
        return read[name](tmp_path / name, shape, orientation=orientation)

    if on_a_side:
        reason = rf"fits the photo as it lies in its file.*EXIF orientation {orientation}: .*\(4, 6\).* Turn .*{name}"
        with pytest.raises(InputError, match=reason):
            check((6, 4), (4, 6))
        check((4, 6), (4, 6))
    with pytest.raises(InputError, match=r"has shape \(5, 4\), but the image has \(4, 6\)"):
        check((5, 4), (4, 6))
    if orientation == 1:
        check((5, 5), (5, 5))
        return
    for shape in [(5, 5)] if on_a_side else [(5, 5), (4, 6)]:
        with pytest.warns(
            UserWarning, match=rf"orientation {orientation}: .*nobody can tell whether .*{name} was made"
        ):
            check(shape, shape)


def test_a_mask_that_is_turned_as_its_photo_is_fits(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 3
    Image.fromarray(random_samples(1, 8)).save(tmp_path / "a.png", exif=exif)
    photo = read_photo(tmp_path / "a.png")
    assert photo.orientation == 3
    mask = read_mask(tmp_path / "a.png", SHAPE, orientation=photo.orientation)
    np.testing.assert_array_equal(mask, random_samples(1, 8)[::-1, ::-1] > 127)


def test_a_jpeg_inside_a_tiff_comes_out_as_rgb(tmp_path: Path) -> None:
    samples = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", compression="jpeg")
    np.testing.assert_allclose(read_photo(tmp_path / "a.tif").colour.astype(int), samples, atol=2)


def test_extra_samples_that_are_no_alpha_are_no_mask(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", random_samples(4, 8), photometric="rgb", extrasamples=[0])
    photo = read_photo(tmp_path / "a.tif")
    assert photo.mask is None
    np.testing.assert_array_equal(photo.colour, random_samples(4, 8)[..., :3])


def test_a_reduced_copy_inside_a_tiff_is_not_a_second_page(tmp_path: Path) -> None:
    samples = random_samples(1, 8)
    with tifffile.TiffWriter(tmp_path / "a.tif") as tiff:
        tiff.write(samples, photometric="minisblack")
        tiff.write(samples[::2, ::2], photometric="minisblack", subfiletype=1)
    np.testing.assert_array_equal(read_photo(tmp_path / "a.tif").colour[..., 0], samples)


READERS: dict[str, Callable[[Path], Any]] = {
    "read_image": read_image,
    "read_mask": lambda path: read_mask(path, SHAPE),
}
every_reader = pytest.mark.parametrize("read", READERS.values(), ids=READERS)


@every_reader
def test_files_that_are_no_image_are_refused_with_their_name_and_a_remedy(
    tmp_path: Path, read: Callable[[Path], Any]
) -> None:
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("this is no image")
    (tmp_path / "text.tif").write_bytes(b"II*\0this is no image")
    with pytest.raises(InputError, match=r"missing\.png does not exist"):
        read(tmp_path / "missing.png")
    with pytest.raises(InputError, match="is a folder: name a file in it"):
        read(tmp_path)
    with pytest.raises(InputError, match=r"empty\.png is empty"):
        read(tmp_path / "empty.png")
    with pytest.raises(InputError, match=r"text\.png is not a PNG, JPEG or TIFF image: convert it"):
        read(tmp_path / "text.png")
    with pytest.raises(InputError, match=r"text\.tif is broken or not supported \(.*save or copy it again"):
        read(tmp_path / "text.tif")


@every_reader
@pytest.mark.parametrize("name", ["a.png", "16 bits.png", "a.jpg", "a.tif"])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.9])
def test_truncated_files_are_refused(tmp_path: Path, read: Callable[[Path], Any], name: str, share: float) -> None:
    path = tmp_path / name
    samples = random_samples(3, 16 if name.startswith("16") else 8, (64, 64))
    if name == "a.jpg":
        Image.fromarray(samples).save(path)
    else:
        save(path, samples)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=f"{name}.* (save or copy it again|convert it)"):
        read(path)


@pytest.mark.filterwarnings("ignore:.*was read, but is damaged or odd:UserWarning")
@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif", "float.tif"])
def test_damaged_files_are_read_or_refused_and_never_fail_otherwise(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "a.jpg":
        Image.fromarray(random_samples(3, 8)).save(path)
    else:
        save(path, random_samples(3, 8).astype(np.float32 if name == "float.tif" else np.uint8))
    data = np.frombuffer(path.read_bytes(), np.uint8)
    random = np.random.default_rng(0)
    refusals = []
    for _ in range(100):
        damaged = data.copy()
        damaged[random.integers(0, min(300, len(data)), 3)] = random.integers(0, 256, 3)
        path.write_bytes(damaged.tobytes())
        try:
            read_photo(path)
        except InputError as error:
            refusals.append(str(error))
    assert refusals
    assert all(name in refusal for refusal in refusals)


@every_reader
@pytest.mark.parametrize(
    ("samples", "reason"),
    [
        (np.array([[0.5, np.nan, np.inf]]), "has 2 NaN or infinite samples"),
        (np.array([[0.5, -1.0, -2.0]]), "has 2 negative samples, the lowest -2"),
        (np.ones(SHAPE, np.uint32), "samples of type uint32"),
        (np.ones(SHAPE, np.int16), "samples of type int16"),
        (np.ones(SHAPE, np.complex64), "samples of type complex64"),
    ],
)
def test_tiff_samples_that_are_no_brightness_are_refused(
    tmp_path: Path, read: Callable[[Path], Any], samples: Samples, reason: str
) -> None:
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="minisblack")
    with pytest.raises(InputError, match=rf"a\.tif .*{reason}"):
        read(tmp_path / "a.tif")


@every_reader
def test_several_pictures_in_a_file_are_refused(tmp_path: Path, read: Callable[[Path], Any]) -> None:
    frames = [Image.new("L", (5, 7), value) for value in (10, 250)]
    frames[0].save(tmp_path / "animated.png", save_all=True, append_images=frames[1:])
    tifffile.imwrite(tmp_path / "pages.tif", np.zeros((3, 7, 5), np.uint8), photometric="minisblack")
    with pytest.raises(InputError, match=r"animated\.png is an animation of 2 pictures: save the one you want"):
        read(tmp_path / "animated.png")
    with pytest.raises(InputError, match=r"pages\.tif has 3 pages: save the one you want"):
        read(tmp_path / "pages.tif")


@every_reader
def test_other_colour_models_and_formats_are_refused(tmp_path: Path, read: Callable[[Path], Any]) -> None:
    Image.new("CMYK", (5, 7)).save(tmp_path / "a.jpg")
    Image.new("CMYK", (5, 7)).save(tmp_path / "a.tif")
    tifffile.imwrite(tmp_path / "raw.tif", random_samples(3, 8), photometric="ycbcr")
    Image.new("L", (5, 7)).save(tmp_path / "a.gif")
    with pytest.raises(InputError, match=r"a\.jpg has the colour model CMYK: save it as grey or RGB"):
        read(tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"a\.tif has the colour model SEPARATED: save it as grey or RGB"):
        read(tmp_path / "a.tif")
    with pytest.raises(InputError, match=r"raw\.tif has the colour model YCBCR: save it as grey or RGB"):
        read(tmp_path / "raw.tif")
    with pytest.raises(InputError, match=r"a\.gif is not a PNG, JPEG or TIFF image"):
        read(tmp_path / "a.gif")


def test_photos_beyond_the_limit_of_pixels_are_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "photo.png"
    Image.fromarray(np.arange(60, dtype=np.uint8).reshape(6, 10)).save(path)
    Image.open(path).save(tmp_path / "photo.jpg")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 20)  # Pillow's own limit, which is the same on every machine
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "60")
    assert read_photo(path).image.shape == (6, 10)
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "59")
    reason = r"is too large: 6 × 10 pixels are 60, and the limit here is 59\. Reduce it.*PERSFS_CL_MAX_PIXELS"
    for read in (read_photo, Camera.from_exif, lambda path: read_mask(path, (6, 10))):
        with pytest.raises(InputError, match=rf"photo\.png {reason}"):
            read(path)
    save(tmp_path / "photo.tif", random_samples(1, 8, (6, 10)))
    write_depth(tmp_path / "photo.npy", np.ones((6, 10)))
    for name, take in (("jpg", read_photo), ("tif", read_photo), ("npy", read_depth)):
        with pytest.raises(InputError, match=rf"photo\.{name} {reason}"):
            take(tmp_path / f"photo.{name}")


def test_an_array_beyond_the_memory_is_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise MemoryError

    np.save(tmp_path / "depth.npy", np.ones((2, 2)))
    monkeypatch.setattr(np.lib.format, "read_array", fail)
    with pytest.raises(InputError, match=r"depth\.npy is too large: the memory"):
        read_depth(tmp_path / "depth.npy")


def test_unknown_options_are_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", random_samples(1, 8))
    wrong: Any = "gamma"
    with pytest.raises(InputError, match=r'channel=.gamma. is unknown: choose "luminance", "red"'):
        read_image(path, channel=wrong)
    with pytest.raises(InputError, match=r"encoding='gamma' is unknown: choose .auto., .srgb. or .linear."):
        read_image(path, encoding=wrong)


def test_a_mask_is_true_above_half_of_the_range(tmp_path: Path) -> None:
    grey = np.array([[0, 127, 128, 255]], np.uint8)
    expected = [[False, False, True, True]]
    np.testing.assert_array_equal(read_mask(save(tmp_path / "8.png", grey), (1, 4)), expected)
    deep = np.array([[0, 32767, 32768, 65535]], np.uint16)
    np.testing.assert_array_equal(read_mask(save(tmp_path / "16.png", deep), (1, 4)), expected)
    real = np.array([[0.0, 0.5, 0.51, 1.0]], np.float32)
    np.testing.assert_array_equal(read_mask(save(tmp_path / "f.tif", real), (1, 4)), expected)
    blue = np.zeros((1, 4, 3), np.uint8)
    blue[..., 2] = grey
    np.testing.assert_array_equal(read_mask(save(tmp_path / "blue.png", blue), (1, 4)), expected)
    alpha = np.full((1, 4, 2), 255, np.uint8)
    alpha[..., 1] = grey
    np.testing.assert_array_equal(read_mask(save(tmp_path / "alpha.png", alpha), (1, 4)), expected)
    np.save(tmp_path / "a.npy", np.array(expected))
    np.testing.assert_array_equal(read_mask(tmp_path / "a.npy", (1, 4)), expected)


def test_a_black_mask_selects_nothing(tmp_path: Path) -> None:
    assert not read_mask(save(tmp_path / "a.png", np.zeros(SHAPE, np.uint8)), SHAPE).any()


def test_a_mask_of_zeros_and_ones_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.eye(5, dtype=np.uint8))
    with pytest.raises(InputError, match=r"selects no pixel: its brightest sample is 1 of 255\. Paint white"):
        read_mask(path, (5, 5))


def test_a_mask_of_another_shape_or_type_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", random_samples(1, 8))
    with pytest.raises(InputError, match=r"a\.png has shape \(7, 5\), but the image has \(5, 7\)"):
        read_mask(path, (5, 7))
    np.save(tmp_path / "a.npy", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"a\.npy holds float64, not bool: save it as mask\.astype\(bool\)"):
        read_mask(tmp_path / "a.npy", SHAPE)


@pytest.mark.parametrize("name", ["a.npy", "a.tif", "a.TIFF"])
def test_a_depth_comes_back_as_it_was_written(tmp_path: Path, name: str) -> None:
    depth = np.random.default_rng(0).random(SHAPE) + 0.1
    depth[2, 3] = np.nan
    write_depth(tmp_path / name, depth)
    expected = depth if name == "a.npy" else depth.astype(np.float32).astype(np.float64)
    again = read_depth(tmp_path / name, SHAPE)
    assert again.dtype == np.float64
    np.testing.assert_array_equal(again, expected)
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (3, 4), (7, 3)])
def test_small_depths_keep_their_axes(tmp_path: Path, shape: tuple[int, int]) -> None:
    for name in ("a.npy", "a.tiff"):
        write_depth(tmp_path / name, np.ones(shape))
        assert read_depth(tmp_path / name).shape == shape


def test_the_depth_tiff_is_plain_float32(tmp_path: Path) -> None:
    write_depth(tmp_path / "a.tiff", np.ones(SHAPE))
    stored = tifffile.imread(tmp_path / "a.tiff")
    assert stored.dtype == np.float32
    assert stored.shape == SHAPE


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.uint32, np.int64])
def test_zero_is_unknown_in_a_depth_of_integers(tmp_path: Path, dtype: type) -> None:
    depth: Samples = np.array([[0, 1, 100]], dtype)
    np.save(tmp_path / "a.npy", depth)
    np.testing.assert_array_equal(read_depth(tmp_path / "a.npy"), [[np.nan, 1, 100]])
    if dtype is not np.int64:
        tifffile.imwrite(tmp_path / "a.tif", depth, photometric="minisblack")
        np.testing.assert_array_equal(read_depth(tmp_path / "a.tif"), [[np.nan, 1, 100]])


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (np.array([[1.0, 0.0, -2.0]]), "2 of 3 values are infinite or not above 0, such as 0: .*with NaN"),
        (np.array([[1.0, np.inf]]), "1 of 2 values are infinite or not above 0, such as inf"),
        (np.array([[1, -1]]), "1 of 2 values are infinite or not above 0, such as -1"),
        (np.ones((2, 3), bool), "holds bool, not numbers"),
        (np.ones((2, 3), complex), "holds complex128, not numbers"),
        (np.ones((2, 3, 3)), r"has shape \(2, 3, 3\): a depth map is \(height, width\)"),
        (np.ones((0, 3)), r"has shape \(0, 3\)"),
        (np.array({"a": 1}), "holds Python objects, which are not read: save an array of numbers"),
    ],
)
def test_arrays_that_are_no_depth_are_refused(tmp_path: Path, depth: Any, reason: str) -> None:
    np.save(tmp_path / "a.npy", depth)
    with pytest.raises(InputError, match=rf"a\.npy.* {reason}"):
        read_depth(tmp_path / "a.npy")


def test_files_that_are_no_depth_are_refused(tmp_path: Path) -> None:
    write_depth(tmp_path / "good.npy", np.ones(SHAPE))
    data = (tmp_path / "good.npy").read_bytes()
    (tmp_path / "short.npy").write_bytes(data[:-8])
    (tmp_path / "text.npy").write_text("this is no array")
    np.savez(tmp_path / "many.npz", a=np.ones(3))
    (tmp_path / "many.npz").rename(tmp_path / "many.npy")
    with pytest.raises(
        InputError, match=r"short\.npy is broken: .* shape \(7, 5\) of float64, 280 bytes, and 272 follow"
    ):
        read_depth(tmp_path / "short.npy")
    for name in ("text.npy", "many.npy"):
        with pytest.raises(InputError, match=f"{name} is broken or not supported"):
            read_depth(tmp_path / name)
    with pytest.raises(InputError, match=r"missing\.npy does not exist"):
        read_depth(tmp_path / "missing.npy")
    with pytest.raises(InputError, match=r"depth\.png is not a depth map by its name: give a \.npy"):
        read_depth(tmp_path / "depth.png")
    with pytest.raises(InputError, match=r"good\.npy has shape \(7, 5\), but the image has \(5, 7\)"):
        read_depth(tmp_path / "good.npy", (5, 7))
    save(tmp_path / "colour.tif", random_samples(3, 8))
    with pytest.raises(InputError, match=r"colour\.tif has shape \(7, 5, 3\)"):
        read_depth(tmp_path / "colour.tif")


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_a_grey_image_comes_back_within_half_a_level(
    tmp_path: Path, name: str, bits: Literal[8, 16], encoding: Literal["srgb", "linear"]
) -> None:
    image = np.linspace(0, 1, 35).reshape(SHAPE)
    write_grey(tmp_path / name, image, bits, encoding=encoding)
    photo = read_photo(tmp_path / name, encoding=encoding)
    assert photo.bits == bits
    given, read = (encode_srgb(values) if encoding == "srgb" else values for values in (image, photo.image))
    np.testing.assert_allclose(read, given, atol=0.5001 / (2**bits - 1))
    assert (photo.image[0, 0], photo.image[-1, -1]) == (0, pytest.approx(1))
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_grey_image_is_cut_to_its_range_and_nan_is_black(tmp_path: Path) -> None:
    write_grey(tmp_path / "a.png", [[-1.0, np.nan, 0.5, 2.0, np.inf, -np.inf]], encoding="linear")
    np.testing.assert_array_equal(Image.open(tmp_path / "a.png"), [[0, 0, 128, 255, 255, 0]])


def test_to_display_is_srgb_of_the_same_shape() -> None:
    np.testing.assert_array_equal(to_display([0.0, 1.0, np.nan, 7.0, -1.0]), [0, 255, 0, 255, 0])
    assert to_display(np.full((2, 3, 3), decode_srgb(100 / 255))).tolist() == np.full((2, 3, 3), 100).tolist()


def test_writers_refuse_what_they_cannot_write(tmp_path: Path) -> None:
    wrong: Any = 12
    with pytest.raises(InputError, match=r"a\.png cannot hold a depth map: give a name that ends in \.npy"):
        write_depth(tmp_path / "a.png", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"The depth has shape \(7,\)"):
        write_depth(tmp_path / "a.npy", np.ones(7))
    with pytest.raises(InputError, match="The depth holds complex128"):
        write_depth(tmp_path / "a.npy", np.ones(SHAPE, complex))
    with pytest.raises(InputError, match=r"a\.jpg cannot hold a grey image: give a name that ends in \.png"):
        write_grey(tmp_path / "a.jpg", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"The image has shape \(7, 5, 3\)"):
        write_grey(tmp_path / "a.png", np.ones((*SHAPE, 3)))
    for write, name, what in ((write_grey, "a.png", "image"), (write_depth, "a.npy", "depth")):
        with pytest.raises(InputError, match=f"{what} is no array .*rows of equal length"):
            write(tmp_path / name, [[1.0], [1.0, 2.0]])
    with pytest.raises(InputError, match="bits=12 is impossible: give 8 or 16"):
        write_grey(tmp_path / "a.png", np.ones(SHAPE), wrong)
    with pytest.raises(InputError, match=r"encoding=12 is unknown: choose .srgb. or .linear."):
        write_grey(tmp_path / "a.png", np.ones(SHAPE), encoding=wrong)
    for write, name in ((write_depth, "a.npy"), (write_depth, "a.tif"), (write_grey, "a.png")):
        with pytest.raises(InputError, match=f"{name} cannot be written: No such file.*Create the folder first"):
            write(tmp_path / "missing" / name, np.ones(SHAPE))
    assert not list(tmp_path.iterdir())


def test_nan_is_kept_when_asked_for_and_black_in_the_colours(tmp_path: Path) -> None:
    light = np.full((4, 5, 3), 0.5, np.float32)
    light[1, 2, 0] = np.nan
    tifffile.imwrite(tmp_path / "a.tif", light, photometric="rgb")
    with pytest.raises(InputError, match="1 NaN"):
        read_photo(tmp_path / "a.tif")
    photo = read_photo(tmp_path / "a.tif", keep_nan=True)
    assert np.argwhere(np.isnan(photo.image)).tolist() == [[1, 2]]
    assert photo.colour[1, 2].tolist() == [0, 188, 188]
    for wrong, reason in ((np.inf, "1 NaN or infinite"), (-1.0, "1 negative samples, the lowest -1")):
        light[0, 0, 0] = wrong
        tifffile.imwrite(tmp_path / "a.tif", light, photometric="rgb")
        with pytest.raises(InputError, match=reason):
            read_photo(tmp_path / "a.tif", keep_nan=True)


@pytest.mark.skipif(os.name != "posix", reason="needs a limit on the size of files")
@pytest.mark.parametrize("write", ["write_grey('a.png', x)", "write_grey('a.tif', x)", "write_depth('a.npy', x)"])
def test_a_file_that_does_not_fit_is_one_clear_error(write: str, tmp_path: Path) -> None:
    code = f"""
import resource, numpy as np
from persfs_cl.errors import InputError
from persfs_cl.io.photos import write_depth, write_grey
x = np.random.default_rng(0).random((100, 100))
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
try:
    {write}
except InputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert "cannot be written" in done.stdout
    assert "disk" in done.stdout
    assert "None" not in done.stdout
    assert not list(tmp_path.iterdir())
