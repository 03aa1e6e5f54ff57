"""Camera raw files: what the sensor measured, as linear light, developed by LibRaw."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.colour import LUMINANCE, ColourSpace, Three, three
from persfs_cl.errors import InputError
from persfs_cl.io.formats.format import Format, Source
from persfs_cl.io.formats.jpeg import Jpeg
from persfs_cl.io.formats.linear_dng import half_shape, halved, linear_header, linear_page, linear_samples
from persfs_cl.io.formats.tiff import require_directories
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.makers import SENSORS, SUFFIXES, raw_kind
from persfs_cl.io.raster import Header, Raster, upright, upright_shape
from persfs_cl.io.remarks import heard_on_standard_error
from persfs_cl.io.tiff import PHOTOMETRIC
from persfs_cl.wording import keyword

if TYPE_CHECKING:
    import rawpy

_WHITE = 65535
# EXIF's orientation by LibRaw's number, whose bits are transposed, upside down and mirrored.
_ORIENTATIONS = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7}
_PARTS = ((273, 279), (324, 325))
"""Tags of places and sizes of strips, and of tiles."""
_FUJIFILM, _FUJIFILM_PREVIEW = b"FUJIFILMCCD-RAW", 84
_CANON_EXIF = b"CMT2"
_BOXES = 2**20
"""Bytes within which a CR3 file has its EXIF data."""


class Raw(Format):
    """What LibRaw reads, and DNG files in JPEG XL, which it does not: linear by construction.

    The black level is subtracted, and the sensor's white level becomes 65535 in each of its channels: nothing else is
    done to its numbers but to interpolate the colours. Neither gamma nor tone curve, no brightening, and no matrix.
    """

    name, suffixes, sensor = "camera raw", SUFFIXES, True

    def claims(self, source: Source) -> bool:
        """By its maker's signature, or by what its directories hold."""
        return raw_kind(source.head, source.directories) is not None

    def header(self, source: Source) -> Header:
        """Without decoding."""
        if (page := linear_page(source)) is not None:
            return linear_header(source, page)
        with _opened(source) as file:
            orientation = _ORIENTATIONS.get(file.sizes.flip, 1)
            return Header(upright_shape(_shape(source, file), orientation), 16, np.dtype(np.uint16), orientation)

    def raster(self, source: Source) -> Raster:
        """Developed."""
        if linear_page(source) is not None:
            samples, balance, matrix, orientation = linear_samples(source)
            return Raster(upright(samples, orientation), 16, orientation, _space(balance, matrix))
        with _opened(source) as file:
            orientation = _ORIENTATIONS.get(file.sizes.flip, 1)
            shape = _shape(source, file)  # which changes when it is developed
            with heard_on_standard_error():
                file.unpack()
            balance = _daylight(file.daylight_whitebalance)
            samples = _developed(source, file, shape, balance)
            return Raster(upright(samples, orientation), 16, orientation, _space(balance, file.color_matrix))

    def size(self, source: Source) -> tuple[int, int]:
        """By LibRaw, which knows the margins of sensors."""
        height, width = self.header(source).shape
        return width, height

    def exif(self, source: Source) -> BinaryIO | None:
        """The file itself where it is of the TIFF kind; else what is in its preview, or in the boxes of a CR3 file."""
        if source.head[:2] in (b"II", b"MM"):
            return source.file()
        if source.head.startswith(_FUJIFILM):
            place, size = struct.unpack_from(">II", source.data, _FUJIFILM_PREVIEW)
            return Jpeg().exif(Source(source.path, bytes(source.data[place : place + size])))
        boxes = bytes(source.data[:_BOXES])
        place = boxes.find(_CANON_EXIF)
        # A box says its size before its name.
        end = place - 4 + int.from_bytes(boxes[place - 4 : place], "big")
        return io.BytesIO(boxes[place + 4 : end]) if place > 3 else None


@contextmanager
def _opened(source: Source) -> Iterator[rawpy.RawPy]:
    """A block that has the file open, not yet decoded, and says what LibRaw cannot do with it."""
    kind = raw_kind(source.head, source.directories)
    try:
        import rawpy
    except ImportError as error:
        raise InputError(
            f"{source.path} is a camera raw file ({kind}), and the package that reads them is missing: pip install "
            f"'persfs-cl[raw]'. Or {_developing()}"
        ) from error
    require_directories(source)
    _require_data(source)
    try:
        with rawpy.RawPy() as file:
            with heard_on_standard_error():
                if source.stream is None:
                    file.open_buffer(source.file())
                else:
                    file.open_file(str(source.path))
            yield file
    except rawpy.LibRawError as error:
        reason = error.args[0].decode("latin-1") if error.args and isinstance(error.args[0], bytes) else str(error)
        raise InputError(
            f"{source.path} is a camera raw file ({kind}) that cannot be read ({reason}); its preview is no photo: "
            f"{_developing()}"
        ) from error


def _require_data(source: Source) -> None:
    """Refuse a file of the TIFF kind that ends before the sensor's image does: LibRaw may take what lacks for black."""
    for directory in (part for page in source.directories for part in page.walk()):
        if directory.number(PHOTOMETRIC) not in SENSORS:
            continue
        for places, counts in _PARTS:
            pairs = zip(directory.tags.get(places, ()), directory.tags.get(counts, ()), strict=False)
            end = max((int(place) + int(count) for place, count in pairs), default=0)
            if end > len(source.data):
                raise InputError(
                    f"{source.path} lacks data: its sensor's image ends at byte {end}, and the file has "
                    f"{len(source.data)}. Copy it again."
                )


def _developing() -> str:
    return (
        "develop it in a raw developer, linearly and without a tone curve, to a 16-bit TIFF file, and give that with "
        f"{keyword('encoding', 'linear')}."
    )


def _shape(source: Source, file: rawpy.RawPy) -> tuple[int, int]:
    """(height, width) as it is read, but not yet turned; too many pixels are refused."""
    sizes = file.sizes
    require_pixels(source.path, (max(sizes.raw_height, sizes.height), max(sizes.raw_width, sizes.width)))
    return half_shape((sizes.height, sizes.width)) if source.half_size else (sizes.height, sizes.width)


def _daylight(multipliers: Sequence[float]) -> Three:
    """What makes daylight grey in the three channels, at most 1.

    It is the camera's, and not that of the shot: dark frames and flat fields must mean the same as the photo.
    """
    found = np.asarray(multipliers[:3], np.float64)
    if not (np.isfinite(found).all() and (found > 0).all()):
        found = np.ones(3)
    red, green, blue = (found / found.max()).tolist()
    return red, green, blue


def _developed(source: Source, file: rawpy.RawPy, shape: tuple[int, int], balance: Three) -> NDArray[Any]:
    """(H, W, 1) or (H, W, 3): as a share of the sensor's white level, of 65535."""
    import rawpy

    # Some makers say from where on the sensor is not linear, which lies below the largest number that they write.
    linear = [level for level in file.camera_white_level_per_channel or () if 0 < level < (file.white_level or 0)]
    red, green, blue = balance
    samples = file.postprocess(
        half_size=source.half_size,
        gamma=(1, 1),
        no_auto_bright=True,
        adjust_maximum_thr=0.0,  # or the white level would follow the picture
        user_sat=min(linear) if linear else None,
        output_bps=16,
        output_color=rawpy.ColorSpace.raw,
        # Colours are interpolated between channels that are alike, of which none is cut, and scaled back below.
        user_wb=[red, green, blue, green],
        highlight_mode=rawpy.HighlightMode.Ignore,
        user_flip=0,
    )
    if samples.ndim == 2:
        samples = samples[..., None]
    if source.half_size:
        if samples.shape[0] > shape[0] + 1:
            samples = halved(samples)  # whose sensor has all colours at each place, and LibRaw leaves it as it is
        samples = samples[: shape[0], : shape[1]]  # squares that are cut off lack colours
    if samples.shape[2] not in (1, 3):
        raise InputError(f"{source.path} has {samples.shape[2]} colours of the sensor, and not three: {_developing()}")
    if samples.shape[2] == 3:
        for channel, gain in enumerate(balance):
            if gain != 1:
                scaled = samples[..., channel] / np.float32(gain)
                samples[..., channel] = np.rint(scaled, out=scaled).clip(0, _WHITE)
    return samples


def _space(balance: Three, matrix: NDArray[Any] | None) -> ColourSpace:
    """What the channels of the sensor mean, which are 1 where it is saturated."""
    gains = np.array(balance)
    shares = np.array(LUMINANCE) * gains
    to_srgb = np.eye(3) if matrix is None or not np.any(matrix[:3, :3]) else np.asarray(matrix[:3, :3], np.float64)
    rows: Array = to_srgb * gains / shares.sum()
    return ColourSpace(
        "linear",
        "camera",
        luminance=three(shares / shares.sum()),
        mean=three(gains / gains.sum()),
        gains=balance,
        to_srgb=(three(rows[0]), three(rows[1]), three(rows[2])),
    )
