"""Depth maps, images, arrays and texts written to files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.checks import as_array, check_choice
from persfs_cl.colour import encode_srgb, quantised, to_display
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, as_path, atomic_path, json_text

_TIFF_SUFFIXES = (".tif", ".tiff")


def write_depth(path: FilePath, depth: ArrayLike) -> None:
    """Write a depth map.

    Parameters
    ----------
    path : path
        `.npy` keeps the precision of `depth`; `.tif` and `.tiff` are float32.
    depth : array_like, shape (H, W)
        NaN where there is none.

    Raises
    ------
    InputError
        When the suffix is another, `depth` is no (H, W) array of numbers, or the file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from persfs_cl.io import read_depth, write_depth
    >>> with TemporaryDirectory() as folder:
    ...     write_depth(Path(folder) / "depth.tiff", np.array([[1.25, np.nan]]))
    ...     read_depth(Path(folder) / "depth.tiff")
    array([[1.25,  nan]])
    """
    import tifffile

    target = as_path(path)
    suffix = target.suffix.lower()
    if suffix not in (".npy", *_TIFF_SUFFIXES):
        raise InputError(f"{target} cannot hold a depth map: give a name that ends in .npy, .tif or .tiff.")
    values = _grey_array(depth, "depth")
    with atomic_path(target) as temporary:
        if suffix == ".npy":
            np.save(temporary, values, allow_pickle=False)
        else:
            tifffile.imwrite(temporary, values.astype(np.float32), photometric="minisblack", metadata=None)


def write_grey(
    path: FilePath,
    image: ArrayLike,
    bits: Literal[8, 16] = 8,
    *,
    encoding: Literal["srgb", "linear"] = "srgb",
) -> None:
    """Write a grey image of integers.

    Parameters
    ----------
    path : path
        `.png`, `.tif` or `.tiff`.
    image : array_like, shape (H, W)
        Linear light; cut to [0, 1], NaN becomes 0.
    bits : {8, 16}
        Bits per sample.
    encoding : {"srgb", "linear"}
        "srgb" is what viewers, and `read_image`, expect; "linear" writes image · (2^bits - 1).

    Raises
    ------
    InputError
        When an option or the suffix is another, `image` is no (H, W) array of numbers, or the file cannot
        be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from persfs_cl.io import read_image, write_grey
    >>> with TemporaryDirectory() as folder:
    ...     write_grey(Path(folder) / "image.png", [[0.0, 0.2, 1.0]], bits=16)
    ...     read_image(Path(folder) / "image.png").round(3)
    array([[0. , 0.2, 1. ]])
    """
    target = as_path(path)
    suffix = target.suffix.lower()
    if suffix not in (".png", *_TIFF_SUFFIXES):
        raise InputError(f"{target} cannot hold a grey image: give a name that ends in .png, .tif or .tiff.")
    if bits not in (8, 16):
        raise InputError.about("bits", bits, "is impossible: give 8 or 16.")
    check_choice("encoding", encoding, ("srgb", "linear"))
    values = _grey_array(image, "image")
    levels = np.empty(values.shape, np.uint8 if bits == 8 else np.uint16)
    for rows in row_blocks((values.shape[0], values.shape[1])):
        levels[rows] = quantised(encode_srgb(values[rows]) if encoding == "srgb" else values[rows], bits)
    if suffix == ".png":
        write_png(target, levels)
        return
    import imageio.v3

    # In memory first: imageio's writers print a traceback of their own when the disk is full.
    data = imageio.v3.imwrite("<bytes>", levels, extension=suffix)
    with atomic_path(target) as temporary:
        temporary.write_bytes(data)


def display_levels(image: Array, white: float = 1.0) -> NDArray[np.uint8]:
    """Grey image of linear light as 8-bit sRGB; cut to [0, white], NaN becomes 0."""
    levels = np.empty(image.shape, np.uint8)
    for rows in row_blocks((image.shape[0], image.shape[1])):
        levels[rows] = to_display(image[rows] / white)
    return levels


def write_png(path: FilePath, levels: NDArray[np.unsignedinteger[Any]]) -> None:
    """Write whole levels as PNG: photographs, maps and drawings alike, fast.

    Parameters
    ----------
    path : path
    levels : ndarray of uint8 or uint16, shape (H, W) or (H, W, 3)

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    import imagecodecs

    # Noise hardly gets smaller by more effort, and what is smooth is as small as by five times the time.
    data = imagecodecs.png_encode(
        levels,
        level=imagecodecs.PNG.COMPRESSION.SPEED,
        strategy=imagecodecs.PNG.STRATEGY.RLE,
        filter=imagecodecs.PNG.FILTER.PAETH,
    )
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_levels(path: FilePath, levels: NDArray[np.uint16], text: Mapping[str, str]) -> None:
    """Write whole levels that stand for numbers as PNG of 16 bits, with texts that say for which.

    Parameters
    ----------
    path : path
    levels : ndarray of uint16, shape (H, W)
    text : mapping of str to str
        Values by their keywords, of ASCII both.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    for name, value in text.items():
        info.add_text(name, value)
    with atomic_path(path) as temporary:
        Image.fromarray(levels).save(temporary, pnginfo=info, compress_level=1)


def write_array(path: FilePath, values: NDArray[Any]) -> None:
    """Write an array as .npy.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with atomic_path(path) as temporary:
        np.save(temporary, values, allow_pickle=False)


def write_arrays(path: FilePath, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays, by their names, as one .npz, not compressed.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with atomic_path(path) as temporary:
        np.savez(temporary, allow_pickle=False, **arrays)


def write_json(path: FilePath, *entries: Mapping[str, Any] | None) -> None:
    """Write mappings as one JSON object; of equal names the last one counts.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    merged = {name: value for some in entries for name, value in (some or {}).items()}
    with atomic_path(path) as temporary:
        temporary.write_text(json_text(merged) + "\n", encoding="utf-8")


def _grey_array(values: ArrayLike, name: str) -> NDArray[np.floating[Any]]:
    array = as_array(name, values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"The {name} holds {array.dtype}, not numbers: give an array of floats.")
    if array.ndim != 2 or array.size == 0:
        raise InputError(f"The {name} has shape {array.shape}: give an array (height, width).")
    return array if array.dtype.kind == "f" else array.astype(np.float64)
