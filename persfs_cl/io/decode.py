"""PNG, JPEG and TIFF files decoded: the samples as they stand in the file, upright."""

from __future__ import annotations

import io
import math
import mmap
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, SupportsFloat

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, opened, read_bytes
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.raw import refuse_raw
from persfs_cl.io.remarks import decoding
from persfs_cl.io.tiff import (
    BITS_PER_SAMPLE,
    IMAGE_DEPTH,
    IMAGE_LENGTH,
    IMAGE_WIDTH,
    SAMPLES_PER_PIXEL,
    SIGNATURES,
    TILE_DEPTH,
    TILE_LENGTH,
    TILE_WIDTH,
    Directory,
    read_directories,
)

if TYPE_CHECKING:
    import PIL.Image
    import tifffile

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".tif", ".tiff"})
"""Of files that :func:`read_raster` reads, in small letters; it goes by what is in them, not by these."""

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_SIGNATURE = b"\xff\xd8\xff"
_EXIF_ORIENTATION = 274
_HEAD = 64
"""Bytes that tell the formats apart."""
_JPEG_BLOCK = 16
# Of the compressions that say their own size, those whose header is looked at: JPEG, JPEG 2000, PNG and WebP.
_LOOKED_INTO = (6, 7, 33003, 33004, 33005, 33007, 34712, 34892, 34933, 50001)
# What each EXIF orientation but 1, upright, has done to the photo.
ON_A_SIDE = (5, 6, 7, 8)
"""EXIF orientations that exchange height and width."""
_ROWS_BACKWARDS, _COLUMNS_BACKWARDS = (3, 4, 7, 8), (2, 3, 6, 7)
"""After that."""
TURNED = {2: "mirrored", 3: "turned by 180°", 4: "flipped", 5: "transposed", 6: "turned", 7: "transposed", 8: "turned"}


@dataclass(frozen=True, eq=False)
class Raster:
    """Samples as the file holds them, upright: (H, W, C) with C = grey, grey + alpha, RGB or RGB + alpha."""

    samples: NDArray[Any]
    bits: int
    orientation: int

    @property
    def white(self) -> float:
        """The sample of full brightness."""
        return 1.0 if self.samples.dtype.kind == "f" else float(2**self.bits - 1)

    @property
    def colours(self) -> NDArray[Any]:
        """(H, W, 1) or (H, W, 3): the samples without alpha."""
        return self.samples[..., : 3 if self.samples.shape[2] > 2 else 1]

    @property
    def opaque(self) -> NDArray[np.bool_] | None:
        """(H, W), True where alpha is above one half; None without alpha."""
        has_alpha = self.samples.shape[2] in (2, 4)
        return np.asarray(self.samples[..., -1] > self.white / 2) if has_alpha else None


@dataclass(frozen=True)
class Header:
    """What a file says of its samples before they are decoded.

    Attributes
    ----------
    shape : tuple of int
        (height, width) of the upright image; of a NumPy file whatever it holds.
    bits : int
        Of a sample.
    dtype : dtype
    orientation : int
        By EXIF.
    """

    shape: tuple[int, ...]
    bits: int
    dtype: np.dtype[Any]
    orientation: int = 1


def read_header(path: Path) -> Header:
    """What a PNG, JPEG or TIFF file says of its samples; refused for what :func:`read_raster` would refuse it so far.

    Only its beginning is read, or the directories of a TIFF file. So what is wrong behind these is not found, and an
    orientation that a PNG file has behind its pixels is not heeded.
    """
    from PIL import Image

    with opened(path) as file, decoding(path):
        if file.read(4) in SIGNATURES:
            import tifffile

            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                _require_directories(path, data)
                file.seek(0)
                with tifffile.TiffFile(file) as tiff:
                    page = _tiff_page(path, data, tiff)
                orientation = _orientation(page.tags.valueof(_EXIF_ORIENTATION))
                size, bits, dtype = (page.imagelength, page.imagewidth), page.bitspersample, page.dtype
                if dtype is None:
                    raise tifffile.TiffFileError(f"samples of {bits} bits")  # for the block to word
        else:
            with open_png_or_jpeg(path, file) as photo:
                bits = _flat_form(path, photo, file)[1]
                # Without its pixels: Pillow's own way decodes a PNG file for what may follow them.
                orientation = _orientation(Image.Image.getexif(photo).get(_EXIF_ORIENTATION))
                size, dtype = (photo.height, photo.width), np.dtype(np.uint16 if bits == 16 else np.uint8)
    return Header(size[::-1] if orientation in ON_A_SIDE else size, bits, dtype, orientation)


def read_raster(path: Path) -> Raster:
    """The samples of a PNG, JPEG or TIFF file; InputError when it is no single image of them."""
    data = read_bytes(path)
    with decoding(path):
        samples, bits, orientation = (
            _decode_tiff(path, data) if data.startswith(SIGNATURES) else _decode_png_or_jpeg(path, data)
        )
        if samples.ndim == 2:
            samples = samples[..., None]
        if samples.ndim != 3 or samples.size == 0 or samples.shape[2] > 4:
            raise InputError(f"{path} holds an array of shape {samples.shape}: save one grey or RGB image.")
        return Raster(upright(samples, orientation), bits, orientation)


def open_png_or_jpeg(path: FilePath, file: BinaryIO) -> PIL.Image.Image:
    """The file as Pillow opens it, its pixels not yet decoded.

    Pillow's own errors are let through.

    Raises
    ------
    InputError
        When it is neither, or has too many pixels.
    """
    from PIL import JpegImagePlugin, PngImagePlugin

    file.seek(0)
    head = file.read(_HEAD)
    file.seek(0)
    # Not by PIL.Image.open, whose own limit on pixels, warned of and then enforced, is the same on every machine.
    if head.startswith(_PNG_SIGNATURE):
        photo: PIL.Image.Image = PngImagePlugin.PngImageFile(file)
    elif head.startswith(_JPEG_SIGNATURE):
        photo = JpegImagePlugin.jpeg_factory(file)
    else:
        refuse_raw(path, head)
        raise InputError(f"{path} is not a PNG, JPEG or TIFF image: convert it to one of these.")
    require_pixels(path, (photo.height, photo.width))
    return photo


def require_brightness(path: Path, raster: Raster, *, keep_nan: bool = False) -> None:
    """Refuse samples that are no brightness: negative, infinite, NaN unless it is kept, or of another type."""
    samples = raster.colours
    require_type(path, samples.dtype, raster.bits)
    if samples.dtype.kind == "f":
        bad = np.count_nonzero(np.isinf(samples) if keep_nan else ~np.isfinite(samples))
        if bad:
            raise InputError(f"{path} has {bad} NaN or infinite samples: replace them, and save it again.")
        negative = np.count_nonzero(samples < 0)
        if negative:
            raise InputError(
                f"{path} has {negative} negative samples, the lowest {np.nanmin(samples):g}: brightness cannot be "
                "negative. Cut them to 0, and save it again."
            )


def require_type(path: Path, dtype: np.dtype[Any], bits: int) -> None:
    """Refuse samples of a type that is not taken for brightness."""
    if dtype.kind != "f" and (dtype.kind not in "ub" or bits > 16):
        raise InputError(f"{path} holds samples of type {dtype}: save it as floats or unsigned 8 or 16 bits.")


def exif_number(value: object) -> float | None:
    """An EXIF value as a number, whatever type it was written with; None when it is none, or several."""
    # Bytes are EXIF's BYTE, of which one is a number.
    values = tuple(value) if isinstance(value, bytes | tuple | list) else (value,)
    if len(values) != 1 or not isinstance(values[0], SupportsFloat | str):
        return None
    try:
        number = float(values[0])
    except (TypeError, ValueError, ArithmeticError):  # a fraction over 0 is one of these
        return None
    return number if math.isfinite(number) else None


def _decode_png_or_jpeg(path: Path, data: bytes) -> tuple[NDArray[Any], int, int]:
    file = io.BytesIO(data)
    with open_png_or_jpeg(path, file) as photo:
        mode, bits = _flat_form(path, photo, file)
        orientation = _orientation(photo.getexif().get(_EXIF_ORIENTATION))
        if bits == 16:
            import imagecodecs

            return imagecodecs.png_decode(data), bits, orientation
        return np.asarray(photo.convert(mode)), bits, orientation


def _flat_form(path: Path, photo: PIL.Image.Image, file: BinaryIO) -> tuple[str, int]:
    """The mode to convert a PNG or JPEG file to, and its bits; refused if it is no single grey or RGB image."""
    # A multi-picture JPEG holds the photo first, then its preview or gain map.
    pictures = 1 if photo.format == "MPO" else getattr(photo, "n_frames", 1)
    if pictures != 1:
        raise InputError(f"{path} is an animation of {pictures} pictures: save the one you want alone.")
    if photo.format == "PNG":
        here = file.tell()
        # The bit depth has this place in every PNG. Pillow would drop the lower half of 16-bit colours.
        file.seek(24)
        bits = file.read(1)[0]
        file.seek(here)
        if bits == 16:
            return "", 16
    if photo.has_transparency_data:
        return "LA" if photo.mode in ("1", "L", "LA") else "RGBA", 8
    if photo.mode in ("1", "L"):
        return "L", 8
    if photo.mode in ("P", "RGB"):
        return "RGB", 8
    raise InputError(f"{path} has the colour model {photo.mode}: save it as grey or RGB.")


def _decode_tiff(path: Path, data: bytes) -> tuple[NDArray[Any], int, int]:
    import tifffile

    _require_directories(path, data)
    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        page = _tiff_page(path, data, tiff)
        samples = page.asarray()
    bits = page.bitspersample
    model = tifffile.PHOTOMETRIC(page.photometric)
    if page.axes == "SYX":
        samples = np.moveaxis(samples, 0, -1)
    if samples.dtype == np.bool_:
        samples = samples.astype(np.uint8)
    if model == tifffile.PHOTOMETRIC.PALETTE and page.colormap is not None:
        # The colours are bytes, kept in the upper half of 16 bits.
        samples, bits = np.moveaxis(page.colormap[:, samples] >> 8, 0, -1), 8
    elif model == tifffile.PHOTOMETRIC.MINISWHITE:
        if samples.dtype.kind != "u":
            raise InputError(
                f"{path} holds samples of type {samples.dtype} of which 0 is white, and none is said to be black: save "
                "it with 0 as black (MINISBLACK)."
            )
        samples = 2**bits - 1 - samples
    if samples.ndim == 3:
        extra = [tifffile.EXTRASAMPLE(kind) for kind in page.extrasamples]
        associated = extra[:1] == [tifffile.EXTRASAMPLE.ASSOCALPHA]
        alpha = associated or extra[:1] == [tifffile.EXTRASAMPLE.UNASSALPHA]
        samples = samples[..., : samples.shape[2] - len(extra) + alpha]
        if associated and samples.dtype.kind in "uf":
            samples = _unmultiplied(samples, bits)
    return samples, bits, _orientation(page.tags.valueof(_EXIF_ORIENTATION))


def _require_directories(path: Path, data: bytes | mmap.mmap) -> None:
    """Refuse a TIFF file that no decoder should be let near."""
    directories = read_directories(path, data)
    refuse_raw(path, data[:_HEAD], directories)
    for directory in directories:
        _require_tiff_pixels(path, directory)


def _tiff_page(path: Path, data: bytes | mmap.mmap, tiff: tifffile.TiffFile) -> tifffile.TiffPage:
    """The page of a TIFF file that is the image, not yet decoded; refused if there is none, or it cannot be read."""
    import tifffile

    pages = [page for page in tiff.pages if isinstance(page, tifffile.TiffPage) and not page.is_reduced]
    if not pages:
        raise tifffile.TiffFileError("it holds no image")
    if len(pages) != 1:
        raise InputError(f"{path} has {len(pages)} pages: save the one you want alone.")
    page = pages[0]
    _require_whole(path, page, data)
    if page.axes not in ("YX", "YXS", "SYX"):
        raise InputError(f"{path} has the axes {page.axes}: save one flat image, height × width.")
    model = tifffile.PHOTOMETRIC(page.photometric)
    flat = (model.MINISWHITE, model.MINISBLACK, model.RGB)
    palette = model == model.PALETTE and page.colormap is not None
    jpeg = model == model.YCBCR and page.compression == tifffile.COMPRESSION.JPEG  # which is decoded to RGB
    if model not in flat and not palette and not jpeg:
        raise InputError(f"{path} has the colour model {model.name}: save it as grey or RGB.")
    return page


def _require_tiff_pixels(path: Path, directory: Directory) -> None:
    """Refuse a page for what its decoder would make room for: whole tiles, and all samples of a pixel."""
    shape = []
    for whole, part in ((IMAGE_DEPTH, TILE_DEPTH), (IMAGE_LENGTH, TILE_LENGTH), (IMAGE_WIDTH, TILE_WIDTH)):
        size, tile = directory.number(whole, 1), directory.number(part, 1)
        shape.append(-(-size // tile) * tile if tile > 0 else size)
    # Four samples of up to 16 bits are a pixel; floats of 32 bits take the room of two such samples.
    samples = directory.number(SAMPLES_PER_PIXEL, 1) * max(1, directory.number(BITS_PER_SAMPLE, 8) // 16)
    require_pixels(path, tuple(shape if shape[0] > 1 else shape[1:]), weight=max(1, -(-samples // 4)))


def _require_whole(path: Path, page: tifffile.TiffPage, data: bytes | mmap.mmap) -> None:
    """Refuse strips and tiles that are missing, or that unpack to more than their page says."""
    import tifffile

    parts = math.prod(page.chunked)
    present = sum(1 for place, size in zip(page.dataoffsets, page.databytecounts, strict=False) if place and size)
    if present < parts:
        kind = "tiles" if page.is_tiled else "strips"
        raise InputError(f"{path} lacks data: of {parts} {kind}, {parts - present} are missing. Save or copy it again.")
    if page.compression not in tifffile.TIFF.IMAGE_COMPRESSIONS:
        return  # unpacked to the size that the page says
    if page.compression not in _LOOKED_INTO:
        raise InputError(
            f"{path} has the compression {tifffile.COMPRESSION(page.compression).name}: save it uncompressed, or with "
            "LZW or Deflate."
        )
    height, width = (page.tilelength, page.tilewidth) if page.is_tiled else (page.rowsperstrip, page.imagewidth)
    for place, size in zip(page.dataoffsets, page.databytecounts, strict=False):
        rows, columns = _coded_shape(data[place : place + size])
        # JPEG may fill up its blocks.
        if rows > height + _JPEG_BLOCK or columns > width + _JPEG_BLOCK:
            raise InputError(
                f"{path} is broken: a part of it, {height} × {width} pixels, holds a picture of {rows} × {columns}. "
                "Save or copy it again."
            )


def _coded_shape(data: bytes) -> tuple[int, int]:
    """Height and width that a picture inside a TIFF file says of itself; (0, 0) where it says nothing."""
    from PIL import Jpeg2KImagePlugin, WebPImagePlugin

    if data.startswith(_JPEG_SIGNATURE[:2]):
        return _jpeg_shape(data)  # Pillow refuses those of 12 and 16 bits
    if data.startswith(_PNG_SIGNATURE):
        width, height = struct.unpack_from(">II", data, 16)
        return height, width
    codec = WebPImagePlugin.WebPImageFile if data.startswith(b"RIFF") else Jpeg2KImagePlugin.Jpeg2KImageFile
    with codec(io.BytesIO(data)) as picture:
        return picture.height, picture.width


def _jpeg_shape(data: bytes) -> tuple[int, int]:
    place = 2
    while place + 9 <= len(data):
        marker = data[place + 1]
        if data[place] != 0xFF or marker == 0xFF:
            place += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # a frame of any kind, not tables
            height, width = struct.unpack_from(">HH", data, place + 5)
            return height, width
        else:
            place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    return 0, 0


def _unmultiplied(samples: NDArray[Any], bits: int) -> NDArray[Any]:
    """Samples whose colours were multiplied by alpha, the last channel, without that; black where alpha is 0."""
    white = 1.0 if samples.dtype.kind == "f" else 2.0**bits - 1
    alpha = samples[..., -1:].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        colours = np.divide(samples[..., :-1] * white, alpha, out=np.zeros(samples[..., :-1].shape), where=alpha > 0)
        if samples.dtype.kind == "u":
            colours = np.rint(colours.clip(0, white))
        return np.concatenate([colours.astype(samples.dtype), samples[..., -1:]], axis=-1)


def _orientation(value: object) -> int:
    """EXIF's orientation; 1, upright, for what EXIF does not know, such as the 0 of some cameras."""
    number = value if isinstance(value, int) else exif_number(value)
    return int(number) if number in TURNED else 1


def upright(samples: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Undo EXIF's orientation: 1 is upright, 3 upside down, 6 and 8 on a side, the others mirrored."""
    if orientation in ON_A_SIDE:
        samples = samples.swapaxes(0, 1)
    if orientation in _ROWS_BACKWARDS:
        samples = samples[::-1]
    if orientation in _COLUMNS_BACKWARDS:
        samples = samples[:, ::-1]
    return np.ascontiguousarray(samples)


def upright_places(places: Array, size: tuple[int, int], orientation: int) -> Array:
    """Where points of a photo of some height and width lie once :func:`upright` has turned it.

    Columns and rows, shape (points, 2), are counted from the outer edges of the first pixel.
    """
    columns, rows = places.T
    height, width = size
    if orientation in ON_A_SIDE:
        columns, rows, height, width = rows, columns, width, height
    if orientation in _ROWS_BACKWARDS:
        rows = height - rows
    if orientation in _COLUMNS_BACKWARDS:
        columns = width - columns
    return np.stack([columns, rows], axis=1)
