"""Every format is read to the light that was written, by its header and by its pixels alike."""

from __future__ import annotations

import io
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pillow_heif
import pytest
import tifffile
from numpy.typing import NDArray
from PIL import ExifTags, Image
from samples import SHAPE, Samples, light, random_samples, turned_upright

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.decode import SUFFIXES, read_header
from persfs_cl.io.formats import FORMATS
from persfs_cl.io.maps import read_light
from persfs_cl.io.photos import read_photo


def stored(bits: int, channels: int, shape: tuple[int, int] = SHAPE) -> Samples:
    """Samples of any depth, to the largest."""
    samples = random_samples(channels, 8 if bits == 8 else 16, shape)
    return samples if bits == 8 else samples >> (16 - bits)


def by_pillow(samples: Samples, form: str, **options: Any) -> bytes:
    written = io.BytesIO()
    Image.fromarray(samples).save(written, form, **options)
    return written.getvalue()


def heic(samples: Samples, bits: int, exif: bytes | None = None) -> bytes:
    height, width = samples.shape[:2]
    grey = samples.ndim == 2
    alpha = samples.ndim == 3 and samples.shape[2] == 4
    mode = "L" if grey else "RGBA" if alpha else "RGB"
    pillow_heif.options.SAVE_HDR_TO_12_BIT = bits == 12
    data = samples if bits == 8 else samples << (16 - bits)
    picture = pillow_heif.from_bytes(mode if bits == 8 else f"{mode};16", (width, height), data.tobytes())
    written = io.BytesIO()
    picture.save(written, quality=-1, chroma=444, matrix_coefficients=0, exif=exif)
    return written.getvalue()


def avif(samples: Samples, bits: int) -> bytes:
    return bytes(imagecodecs.avif_encode(samples, level=100, speed=8, bitspersample=bits))


def jpeg2000(samples: Samples, bits: int, codecformat: str = "jp2") -> bytes:
    return bytes(imagecodecs.jpeg2k_encode(samples, level=0, bitspersample=bits, codecformat=codecformat))


WRITTEN: dict[str, tuple[str, int, int, Callable[[Samples, int], bytes]]] = {
    "WebP": (".webp", 8, 3, lambda samples, _: by_pillow(samples, "WEBP", lossless=True)),
    "WebP with alpha": (".webp", 8, 4, lambda samples, _: by_pillow(samples, "WEBP", lossless=True, exact=True)),
    "BMP": (".bmp", 8, 3, lambda samples, _: by_pillow(samples, "BMP")),
    "grey BMP": (".bmp", 8, 1, lambda samples, _: by_pillow(samples, "BMP")),
    "AVIF": (".avif", 8, 3, avif),
    "AVIF of 10 bits": (".avif", 10, 3, avif),
    "AVIF of 12 bits": (".avif", 12, 3, avif),
    "HEIC": (".heic", 8, 3, heic),
    "HEIC with alpha": (".heic", 8, 4, heic),
    "HEIC of 10 bits": (".heic", 10, 3, heic),
    "HEIC of 12 bits": (".heif", 12, 3, heic),
    "JPEG 2000": (".jp2", 8, 3, jpeg2000),
    "grey JPEG 2000": (".jp2", 8, 1, jpeg2000),
    "JPEG 2000 of 10 bits": (".jp2", 10, 3, jpeg2000),
    "JPEG 2000 of 12 bits": (".jp2", 12, 1, jpeg2000),
    "JPEG 2000 of 16 bits": (".jp2", 16, 3, jpeg2000),
    "codestream of JPEG 2000": (".j2k", 16, 1, lambda samples, bits: jpeg2000(samples, bits, "j2k")),
}


@pytest.mark.parametrize("name", WRITTEN)
def test_each_format_is_read_to_the_last_bit(tmp_path: Path, name: str) -> None:
    suffix, bits, channels, write = WRITTEN[name]
    samples = stored(bits, channels, (16, 24))
    path = tmp_path / f"a{suffix}"
    path.write_bytes(write(samples, bits))
    photo, header = read_photo(path), read_header(path)
    np.testing.assert_allclose(photo.image, light(samples, bits), rtol=1e-13, atol=1e-15)
    assert (photo.bits, photo.encoding, photo.white) == (bits, "srgb", 2**bits - 1)
    assert (header.shape, header.bits) == ((16, 24), bits)
    assert header.dtype == photo.largest_sample.dtype
    assert suffix in SUFFIXES
    if channels == 4:
        np.testing.assert_array_equal(photo.mask, samples[..., 3] > 127)
    else:
        assert photo.mask is None


EXIF_FORMATS: dict[str, Callable[[NDArray[np.uint8], Image.Exif, Path], object]] = {
    "a.webp": lambda samples, exif, path: Image.fromarray(samples).save(path, exif=exif, lossless=True),
    "a.avif": lambda samples, exif, path: Image.fromarray(samples).save(
        path, exif=exif, quality=100, subsampling="4:4:4"
    ),
    "a.heic": lambda samples, exif, path: path.write_bytes(heic(samples, 8, exif.tobytes())),
    "a.jpg": lambda samples, exif, path: Image.fromarray(samples).save(path, exif=exif, quality=100, subsampling=0),
}


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("name", EXIF_FORMATS)
def test_exif_data_are_heeded_in_every_format_that_has_them(tmp_path: Path, name: str, orientation: int) -> None:
    samples = np.zeros((16, 24, 3), np.uint8)
    samples[:8, :8], samples[:8, 16:], samples[8:, :8] = 250, 150, 80
    exif = Image.Exif()
    exif[ExifTags.Base.Make] = "Nobody"  # or Pillow writes none into AVIF files
    exif[ExifTags.Base.Orientation] = orientation
    exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FocalLengthIn35mmFilm] = 26
    EXIF_FORMATS[name](samples, exif, tmp_path / name)
    photo = read_photo(tmp_path / name)
    np.testing.assert_allclose(photo.colour.astype(int), turned_upright(samples, orientation), atol=4)
    assert read_header(tmp_path / name).shape == photo.image.shape
    assert Camera.from_exif(tmp_path / name).fx == pytest.approx(26 * math.hypot(16, 24) / math.hypot(36, 24))


@pytest.mark.parametrize("name", ["a.webp", "a.png", "a.mpo", "a.heic", "a.tif", "a.avif"])
def test_one_picture_of_several_is_chosen(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    values = (40, 120, 240)
    pictures = [np.full((16, 24, 3), value, np.uint8) for value in values]
    frames = [Image.fromarray(picture) for picture in pictures]
    if name == "a.tif":
        tifffile.imwrite(path, np.stack(pictures), photometric="rgb")
    elif name == "a.heic":
        file = pillow_heif.from_pillow(frames[0])
        for frame in frames[1:]:
            file.add_from_pillow(frame)
        file.save(path, quality=-1, chroma=444, matrix_coefficients=0)
    else:
        lossless: dict[str, Any] = {"lossless": True} if name == "a.webp" else {}
        frames[0].save(path, save_all=True, append_images=frames[1:], **lossless)
    for page, value in enumerate(values, 1):
        np.testing.assert_allclose(read_photo(path, page=page).colour.astype(int), value, atol=4)
        assert read_header(path, page=page).shape == (16, 24)
    for read in (read_photo, read_header):
        with pytest.raises(InputError, match=r"has 3 .*there is no page 4: give page from 1 to 3") as refused:
            read(path, page=4)
        if name in ("a.mpo", "a.heic"):  # whose first is the photo
            continue
        with pytest.raises(InputError, match=r"has 3 p.*: choose one by page, from 1 to 3, or save the one you want"):
            read(path)
        assert name in str(refused.value)
    if name in ("a.mpo", "a.heic"):
        np.testing.assert_allclose(read_photo(path).colour.astype(int), values[0], atol=4)


def test_a_single_picture_has_one_page(tmp_path: Path) -> None:
    Image.new("L", (8, 8), 100).save(tmp_path / "a.png")
    assert read_photo(tmp_path / "a.png", page=1).image.shape == (8, 8)
    with pytest.raises(InputError, match=r"a\.png has 1 picture, there is no page 2: leave page out"):
        read_photo(tmp_path / "a.png", page=2)
    with pytest.raises(InputError, match=r"page=0 is not possible: give a whole number, 1 or more"):
        read_photo(tmp_path / "a.png", page=0)


def test_without_its_package_a_heic_file_is_refused_with_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.heic").write_bytes(heic(stored(8, 3, (16, 24)), 8))
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    for read in (read_photo, read_header, Camera.from_exif):
        with pytest.raises(InputError, match=r"a\.heic is a HEIC file.*pip install 'persfs-cl\[heif\]'"):
            read(tmp_path / "a.heic")


@pytest.mark.filterwarnings("ignore:.*was read, but is damaged or odd:UserWarning")
@pytest.mark.parametrize("name", ["WebP", "BMP", "AVIF of 10 bits", "HEIC", "JPEG 2000", "JPEG 2000 of 16 bits"])
def test_damaged_files_of_each_format_are_read_or_refused(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    suffix, bits, channels, write = WRITTEN[name]
    path = tmp_path / f"a{suffix}"
    data = np.frombuffer(write(stored(bits, channels, (16, 24)), bits), np.uint8)
    random = np.random.default_rng(0)
    refusals = []
    for number in range(60):
        damaged = data.copy()
        damaged[random.integers(0, min(400, len(data)), 3)] = random.integers(0, 256, 3)
        path.write_bytes(damaged[: len(data) if number % 3 else random.integers(1, len(data))].tobytes())
        for read in (read_header, read_photo):
            try:
                read(path)
            except InputError as error:
                refusals.append(str(error))
    assert refusals
    assert all(path.name in refusal for refusal in refusals)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["WebP", "BMP", "AVIF", "HEIC", "JPEG 2000", "JPEG 2000 of 16 bits"])
def test_pixels_are_counted_before_they_are_decoded(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    suffix, bits, channels, write = WRITTEN[name]
    path = tmp_path / f"a{suffix}"
    path.write_bytes(write(stored(bits, channels, (16, 24)), bits))
    monkeypatch.setenv("PERSFS_CL_MAX_PIXELS", "383")
    for read in (read_photo, read_header):
        with pytest.raises(InputError, match="is too large: 16 × 24 pixels are 384, and the limit here is 383"):
            read(path)


@pytest.mark.parametrize("bits", [10, 12, 14])
def test_fewer_bits_in_a_file_of_sixteen_are_warned_of_and_not_rescaled(tmp_path: Path, bits: int) -> None:
    samples = stored(bits, 1)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="minisblack")
    told = rf"a\.tif has 16 bits, but no number above {2**bits - 1}: .* {bits} bits.*saturation={2**bits - 1}"
    with pytest.warns(UserWarning, match=told):
        photo = read_photo(tmp_path / "a.tif", encoding="linear")
    np.testing.assert_allclose(photo.image, samples / 65535, rtol=1e-14)
    # A photo without the lamp may well be dark.
    assert read_light(tmp_path / "a.tif", SHAPE, encoding="linear").max() < 0.3


def test_bright_numbers_of_sixteen_bits_are_not_warned_of(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.full(SHAPE, 2**14, np.uint16), photometric="minisblack")
    assert read_photo(tmp_path / "a.tif").image.shape == SHAPE


def test_no_two_formats_claim_a_suffix() -> None:
    suffixes = [suffix for form in FORMATS for suffix in form.suffixes]
    assert len(suffixes) == len(set(suffixes)) == len(SUFFIXES)
