"""HEIC files, as telephones write them, read by the package pillow-heif."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from persfs_cl.errors import InputError
from persfs_cl.io.code_points import CodePoints
from persfs_cl.io.formats.format import Format, Source
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.raster import Header, Raster, unsigned, upright

if TYPE_CHECKING:
    import pillow_heif

_BRANDS = frozenset({b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1"})


class Heic(Format):
    """HEIF of 8, 10 or 12 bits. Its decoder turns the picture upright, and EXIF's orientation says nothing more."""

    name, suffixes = "HEIC", frozenset({".heic", ".heif", ".hif"})

    def claims(self, source: Source) -> bool:
        """By its brands."""
        return bool(source.brands & _BRANDS)

    def header(self, source: Source) -> Header:
        """Without decoding."""
        picture = _picture(source)
        bits = _bits(picture)
        return Header(picture.size[::-1], bits, unsigned(bits))

    def raster(self, source: Source) -> Raster:
        """Decoded at the depth of the file."""
        picture = _picture(source)
        samples = np.asarray(picture)
        samples = samples[..., None] if samples.ndim == 2 else samples
        return Raster(upright(samples, 1), _bits(picture), 1, _bytes(picture, "icc_profile") or _codes(picture))

    def size(self, source: Source) -> tuple[int, int]:
        """By pillow-heif."""
        return _picture(source).size

    def exif(self, source: Source) -> BinaryIO | None:
        """By pillow-heif, which finds them."""
        block = _bytes(_picture(source), "exif").removeprefix(b"Exif\0\0")
        return io.BytesIO(block) if block else None


def _bits(picture: pillow_heif.HeifImage) -> int:
    depth = picture.info.get("bit_depth")
    return depth if isinstance(depth, int) else 8


def _codes(picture: pillow_heif.HeifImage) -> CodePoints | None:
    told = picture.info.get("nclx_profile")
    if not isinstance(told, dict):
        return None
    return CodePoints(int(told["color_primaries"]), int(told["transfer_characteristics"]))


def _bytes(picture: pillow_heif.HeifImage, name: str) -> bytes:
    value = picture.info.get(name)
    return value if isinstance(value, bytes) else b""


def _picture(source: Source) -> pillow_heif.HeifImage:
    """The photo itself, or the picture that is asked for, not yet decoded."""
    try:
        import pillow_heif
    except ImportError as error:
        raise InputError(
            f"{source.path} is a HEIC file, and the package that reads them is missing: pip install 'persfs-cl[heif]'."
        ) from error
    file = pillow_heif.open_heif(source.file(), convert_hdr_to_8bit=False, hdr_to_16bit=False)
    chosen = source.picture(len(file), "pictures", first=True)
    picture = file[file.primary_index if source.page is None else chosen]
    require_pixels(source.path, picture.size[::-1])
    return picture
