"""DNG files in JPEG XL, such as ProRAW, which LibRaw does not read: three colours a pixel, decoded by tifffile."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.colour import Three, three
from persfs_cl.errors import InputError
from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.tiff import require_directories, require_whole
from persfs_cl.io.raster import Header, exif_orientation, upright_shape
from persfs_cl.io.tiff import (
    COMPRESSION,
    DNG_VERSION,
    IMAGE_LENGTH,
    IMAGE_WIDTH,
    ORIENTATION,
    PHOTOMETRIC,
    Directory,
)

if TYPE_CHECKING:
    import tifffile

_JPEG_XL = (50002, 52546)
_LINEAR_RAW = 34892
_LINEARISATION, _BLACK, _WHITE, _COLOUR_MATRICES = 50712, 50714, 50717, (50722, 50721)
_D65 = np.array([0.95047, 1.0, 1.08883])
_XYZ_BY_SRGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""X, Y and Z of linear sRGB (IEC 61966-2-1)."""


def linear_page(source: Source) -> Directory | None:
    """Where a DNG file has its picture in JPEG XL; None for all other files."""
    directories = [part for page in source.directories for part in page.walk()]
    if not any(DNG_VERSION in directory.tags for directory in directories):
        return None
    return next((directory for directory in directories if _is_linear(directory)), None)


def linear_header(source: Source, page: Directory) -> Header:
    """By the directories."""
    require_directories(source)
    size = page.number(IMAGE_LENGTH), page.number(IMAGE_WIDTH)
    orientation = exif_orientation(source.directories[0].number(ORIENTATION, 1))
    shape = half_shape(size) if source.half_size else size
    return Header(upright_shape(shape, orientation), 16, np.dtype(np.uint16), orientation)


def linear_samples(source: Source) -> tuple[NDArray[Any], Three, Array, int]:
    """(H, W, 3), 65535 where the sensor is saturated; the camera's daylight balance and matrix; the orientation."""
    import tifffile

    require_directories(source)
    with tifffile.TiffFile(source.file()) as tiff:
        page = next(page for page in _pages(tiff) if _is_linear_page(page))
        require_whole(source.path, page, source.data)
        stored = page.asarray()
        main = tiff.pages.first
        if stored.ndim != 3 or stored.shape[2] != 3 or stored.dtype.kind not in "uf":
            raise InputError(
                f"{source.path} is a DNG file of shape {stored.shape} of {stored.dtype}: save three colours a pixel."
            )
        white = _numbers(page, _WHITE, [1.0 if stored.dtype.kind == "f" else 2.0**page.bitspersample - 1])
        black = _numbers(page, _BLACK, [0.0])
        # Given for each cell of a pattern, of which one is left where each pixel has all colours.
        black = black[:3] if black.size in (3, 6, 12) else black[:1]
        table = page.tags.valueof(_LINEARISATION)
        if table is not None and stored.dtype.kind == "u":
            levels = np.asarray(table)
            stored = levels[np.minimum(stored, len(levels) - 1)]
        light = (stored.astype(np.float32) - black.astype(np.float32)) / (white - black).astype(np.float32)
        samples = np.rint(np.nan_to_num(light.clip(0.0, 1.0)) * 65535).astype(np.uint16)
        balance, matrix = _camera(next((main.tags.valueof(tag) for tag in _COLOUR_MATRICES if tag in main.tags), None))
        orientation = exif_orientation(main.tags.valueof(ORIENTATION))
    return halved(samples) if source.half_size else samples, balance, matrix, orientation


def half_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """(height, width) in whole squares of four; what is left over is cut off."""
    return max(shape[0] // 2, 1), max(shape[1] // 2, 1)


def halved(samples: NDArray[Any]) -> NDArray[Any]:
    """The means of squares of four."""
    height, width = (2 * side for side in half_shape((samples.shape[0], samples.shape[1])))
    whole = samples[:height, :width].astype(np.uint32)
    total = whole[::2, ::2] + whole[::2, 1::2] + whole[1::2, ::2] + whole[1::2, 1::2]
    return np.asarray((total + 2) // 4, samples.dtype)


def _camera(colour_matrix: Any) -> tuple[Three, Array]:
    """Balance and linear sRGB by balanced camera colours, by DNG's ColorMatrix, which makes these of X, Y and Z."""
    found = np.ones(0) if colour_matrix is None else np.asarray(colour_matrix, np.float64)
    found = found[0::2] / found[1::2] if found.size == 18 else found
    if found.size == 9 and np.isfinite(found).all():
        by_xyz = found.reshape(3, 3)
        neutral = by_xyz @ _D65
        if (neutral > 0).all() and np.linalg.det(by_xyz):
            gains = 1 / neutral
            by_srgb = by_xyz @ _XYZ_BY_SRGB
            return three(gains / gains.max()), np.linalg.inv(by_srgb / by_srgb.sum(axis=1, keepdims=True))
    return (1.0, 1.0, 1.0), np.eye(3)


def _numbers(page: tifffile.TiffPage, tag: int, otherwise: list[float]) -> Array:
    """A tag's numbers; fractions are pairs."""
    value = page.tags.valueof(tag)
    if value is None:
        return np.array(otherwise)
    found = np.atleast_1d(np.asarray(value, np.float64))
    return found[0::2] / found[1::2] if page.tags[tag].dtype in (5, 10) else found


def _is_linear(directory: Directory) -> bool:
    raw = directory.number(PHOTOMETRIC) == _LINEAR_RAW
    return raw and directory.number(COMPRESSION) in _JPEG_XL and not directory.reduced


def _is_linear_page(page: tifffile.TiffPage) -> bool:
    return page.photometric == _LINEAR_RAW and page.compression in _JPEG_XL and not page.is_reduced


def _pages(tiff: tifffile.TiffFile) -> Iterator[tifffile.TiffPage]:
    """The pages, and those below them."""
    for page in tiff.pages:
        whole = page.aspage()
        yield whole
        for below in whole.pages or ():
            yield below.aspage()
