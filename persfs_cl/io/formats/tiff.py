"""TIFF files."""

from __future__ import annotations

import io
import math
import mmap
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.formats.format import Format, Source
from persfs_cl.io.formats.jpeg import SIGNATURE as JPEG
from persfs_cl.io.formats.jpeg_xl import SIGNATURES as JPEG_XL
from persfs_cl.io.formats.jpeg_xl import jpeg_xl_shape
from persfs_cl.io.formats.png import SIGNATURE as PNG
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.raster import Header, Raster, exif_orientation, upright, upright_shape
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
)

if TYPE_CHECKING:
    import tifffile

_EXIF_ORIENTATION, _PROFILE = 274, 34675
_JPEG_BLOCK = 16
# Of the compressions that say their own size, those whose header is looked at: JPEG, JPEG 2000, PNG, WebP
# and JPEG XL.
_LOOKED_INTO = (6, 7, 33003, 33004, 33005, 33007, 34712, 34892, 34933, 50001, 50002, 52546)


class Tiff(Format):
    """TIFF and BigTIFF, of integers or floats."""

    name, suffixes = "TIFF", frozenset({".tif", ".tiff"})

    def claims(self, source: Source) -> bool:
        """By its signature; camera raw files have it too, and are asked first."""
        return source.head.startswith(SIGNATURES)

    def header(self, source: Source) -> Header:
        """By the directories."""
        import tifffile

        require_directories(source)
        with tifffile.TiffFile(source.file()) as tiff:
            page = _page(source, tiff)
        orientation = exif_orientation(page.tags.valueof(_EXIF_ORIENTATION))
        if page.dtype is None:
            raise tifffile.TiffFileError(f"samples of {page.bitspersample} bits")  # for the caller to word
        shape = upright_shape((page.imagelength, page.imagewidth), orientation)
        return Header(shape, page.bitspersample, page.dtype, orientation)

    def raster(self, source: Source) -> Raster:
        """Decoded by tifffile."""
        samples, bits, page = _decoded(source)
        profile = page.tags.valueof(_PROFILE)
        if samples.ndim == 2:
            samples = samples[..., None]
        if samples.ndim != 3:
            raise InputError(f"{source.path} holds an array of shape {samples.shape}: save one grey or RGB image.")
        orientation = exif_orientation(page.tags.valueof(_EXIF_ORIENTATION))
        return Raster(upright(samples, orientation), bits, orientation, profile if isinstance(profile, bytes) else None)

    def size(self, source: Source) -> tuple[int, int]:
        """By the directories."""
        whole = next((page for page in source.directories if not page.reduced), Directory({}))
        size = whole.number(IMAGE_WIDTH), whole.number(IMAGE_LENGTH)
        if min(size) < 1:
            raise InputError(f"{source.path} is broken: it does not say its width and height. Save or copy it again.")
        return size

    def exif(self, source: Source) -> BinaryIO:
        """The file itself."""
        return source.file()


def require_directories(source: Source) -> None:
    """Refuse a TIFF file that no decoder should be let near."""
    for directory in source.directories:
        _require_tiff_pixels(source.path, directory)


def _decoded(source: Source) -> tuple[NDArray[Any], int, tifffile.TiffPage]:
    """The samples of a page, not yet upright; their bits, and the page."""
    import tifffile

    path = source.path
    require_directories(source)
    with tifffile.TiffFile(source.file()) as tiff:
        page = _page(source, tiff)
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
    return samples, bits, page


def _page(source: Source, tiff: tifffile.TiffFile) -> tifffile.TiffPage:
    """The page of a TIFF file that is the image, not yet decoded; refused if there is none, or it cannot be read."""
    import tifffile

    path = source.path
    pages = [page for page in tiff.pages if isinstance(page, tifffile.TiffPage) and not page.is_reduced]
    if not pages:
        raise tifffile.TiffFileError("it holds no image")
    page = pages[source.picture(len(pages), "pages")]
    require_whole(path, page, source.data)
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


def require_whole(path: Path, page: tifffile.TiffPage, data: bytes | mmap.mmap) -> None:
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

    if data.startswith(JPEG[:2]):
        return _jpeg_shape(data)  # Pillow refuses those of 12 and 16 bits
    if data.startswith(PNG):
        width, height = struct.unpack_from(">II", data, 16)
        return height, width
    if data.startswith(JPEG_XL):
        return jpeg_xl_shape(data)
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
