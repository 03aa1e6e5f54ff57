"""Every format to the last bit, and every bad file named with its reason."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
import tifffile
from PIL import Image
from samples import SHAPE, Samples, light, random_samples, save, turned_upright

from persfs_cl.camera import Camera
from persfs_cl.colour import decode_srgb, encode_srgb
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_depth
from persfs_cl.io.maps import read_depth, read_mask
from persfs_cl.io.photos import read_image, read_photo


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 4), (4, 3)])
@pytest.mark.parametrize("suffix", [".png", ".tiff"])
def test_small_images_keep_their_axes(tmp_path: Path, shape: tuple[int, int], suffix: str) -> None:
    for channels in (1, 3):
        samples = random_samples(channels, 8, shape)
        assert read_image(save(tmp_path / f"a{suffix}", samples)).shape == shape


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
    expected = turned_upright(samples, orientation)
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
    tifffile.imwrite(tmp_path / "a.tif", random_samples(3, 8), photometric="rgb", compression="jpegxr")
    with pytest.raises(InputError, match=r"a\.tif has the compression JPEGXR: save it uncompressed"):
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
    with pytest.raises(
        InputError, match=r"text\.png is no image of a format that is read \(PNG, .* and BMP\): convert it"
    ):
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
    with pytest.raises(
        InputError, match=r"animated\.png has 2 pictures, an animation: choose one by page, from 1 to 2, or save"
    ):
        read(tmp_path / "animated.png")
    with pytest.raises(
        InputError, match=r"pages\.tif has 3 pages: choose one by page, from 1 to 3, or save the one you want"
    ):
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
    with pytest.raises(InputError, match=r"a\.gif is no image of a format that is read"):
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
