"""Maps that go with a photograph, pixel for pixel: masks, depths, and light such as an albedo or vignetting."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.checks import to_float64, warn
from persfs_cl.errors import InputError
from persfs_cl.io.decode import is_of_sensor, read_header, read_raster, require_brightness, require_type
from persfs_cl.io.exr import read_exr
from persfs_cl.io.files import FilePath, as_path, folder_error
from persfs_cl.io.npy import read_npy, read_npy_header
from persfs_cl.io.photos import Channel, Encoding, read_light_photo
from persfs_cl.io.raster import ON_A_SIDE, TURNED, upright

MapKind = Literal["depth", "light", "mask"]
_TIFF_SUFFIXES = (".tif", ".tiff")
_STORED: dict[MapKind, tuple[str, str]] = {
    "depth": ("iuf", "not numbers: save the depth as floats"),
    "light": ("iuf", "not numbers: save linear light as floats"),
    "mask": ("b", "not bool: save it as mask.astype(bool)"),
}
"""Kinds of dtype of what NumPy files may hold, and what is said of others."""


def read_light(
    path: FilePath,
    shape: tuple[int, int],
    *,
    channel: Channel = "luminance",
    encoding: Encoding = "auto",
    orientation: int = 1,
    half_size: bool = False,
) -> Array:
    """A map of linear light that goes with a photo: ambient light, or the vignetting of the lens.

    Parameters
    ----------
    path : path
        An image of any format that `read_photo` reads, or a `.npy` file of linear light.
    shape : (int, int)
        (height, width) that the map must have.
    channel, encoding
        As for `read_photo`, for images.
    orientation : int
        `Photo.orientation` of the photo that it goes with: then files made without turning the photo are told of.
    half_size : bool
        Read a camera raw file in half the size, as the photo that it goes with; other files have that size.

    Returns
    -------
    ndarray of float64, shape `shape`
        NaN where a file of floats has it.

    Raises
    ------
    InputError
        When the file cannot be read, or is of another shape or of another type.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and the shape does not tell whether the file was made for the turned photo.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> with TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "dark.npy", np.full((2, 3), 0.25))
    ...     dark = ps.read_light(Path(folder) / "dark.npy", (2, 3))
    >>> dark
    array([[0.25, 0.25, 0.25],
           [0.25, 0.25, 0.25]])
    """
    path = as_path(path)
    own = 1
    if path.suffix.lower() == ".npy":
        stored = read_npy(path)
        _require_stored("light", path, stored.dtype)
        light = to_float64(stored)
    else:
        halved = half_size and is_of_sensor(path)
        photo = read_light_photo(path, channel=channel, encoding=encoding, keep_nan=True, half_size=halved)
        light, own = photo.image, photo.orientation
    _require_shape(path, light.shape, shape, orientation, own=own)
    return light


def read_mask(path: FilePath, shape: tuple[int, int], *, orientation: int = 1) -> NDArray[np.bool_]:
    """A mask from an image file or a NumPy file.

    Parameters
    ----------
    path : path
        An image of any format that `read_photo` reads: True where a channel is above half of its range and alpha, if
        there is any, is too. Or a `.npy` file of bool.
    shape : (int, int)
        (height, width) that the mask must have.
    orientation : int
        `Photo.orientation` of the photo that it goes with: then files made without turning the photo are told of.

    Returns
    -------
    ndarray of bool, shape `shape`

    Raises
    ------
    InputError
        When the file cannot be read, is of another shape or of another type, or is an image whose brightest
        sample is above 0 but not above half of the range.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and the shape does not tell whether the file was made for the turned photo.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> mask = ps.read_mask(files("persfs_cl") / "data" / "coin_mask.png", (72, 72))
    >>> mask.dtype, bool(mask[0, 0]), bool(mask[36, 36])
    (dtype('bool'), False, True)
    """
    path = as_path(path)
    own = 1
    if path.suffix.lower() == ".npy":
        mask = read_npy(path)
        _require_stored("mask", path, mask.dtype)
    else:
        raster = read_raster(path)
        require_brightness(path, raster)
        brightest = float(raster.colours.max())
        if 0 < brightest <= raster.white / 2:
            raise InputError(
                f"{path} selects no pixel: its brightest sample is {brightest:g} of {raster.white:g}. "
                "Paint white what is to be selected."
            )
        mask = np.any(raster.colours > raster.white / 2, axis=2)
        if raster.opaque is not None:
            mask &= raster.opaque
        own = raster.orientation
    _require_shape(path, mask.shape, shape, orientation, own=own)
    return mask


def read_depth(path: FilePath, shape: tuple[int, int] | None = None, *, orientation: int = 1) -> Array:
    """A depth map from a NumPy or TIFF file.

    Parameters
    ----------
    path : path
        `.npy`, `.tif` or `.tiff`, of floats or integers.
    shape : (int, int), optional
        (height, width) that the depth must have.
    orientation : int
        `Photo.orientation` of the photo that it goes with: then files made without turning the photo are told of.

    Returns
    -------
    ndarray of float64, shape (H, W)
        Depth above 0, and NaN where it is unknown: where the file has NaN or, in a file of integers, 0.

    Raises
    ------
    InputError
        When the file cannot be read, is no single depth map of numbers, has another shape or suffix, or
        holds values that are infinite or not above 0.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and the shape does not tell whether the file was made for the turned photo.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> with TemporaryDirectory() as folder:
    ...     np.save(Path(folder) / "depth.npy", np.array([[1500, 0], [1480, 1470]], np.uint16))
    ...     depth = ps.read_depth(Path(folder) / "depth.npy")
    >>> depth
    array([[1500.,   nan],
           [1480., 1470.]])
    """
    path = as_path(path)
    _require_depth_name(path)
    depth, own = _numbers(path)
    if shape is not None:
        _require_shape(path, depth.shape, shape, orientation, own=own)
    bad = np.isinf(depth) | (depth <= 0)
    if bad.any():
        raise InputError(
            f"In {path}, {np.count_nonzero(bad)} of {bad.size} values are infinite or not above 0, such as "
            f"{depth[bad][0]:g}: they are no depth. Mark unknown pixels with NaN."
        )
    return depth


def read_numbers(path: FilePath, shape: tuple[int, int] | None = None, *, orientation: int = 1) -> Array:
    """A coarse map of depths, or of numbers that go with them, of any size.

    One whose sides have about the ratio of the photo as it lies in its file is turned as EXIF turned the photo.

    Parameters
    ----------
    path : path
        `.npy`, `.tif`, `.tiff`, `.png` (16 bits, say), or `.exr`, of which the package OpenEXR reads the channel Z.
    shape : (int, int), optional
        (height, width) of the photo that it goes with.
    orientation : int
        `Photo.orientation` of that photo.

    Returns
    -------
    ndarray of float64, shape (H, W)
        NaN where nothing is known: where the file has NaN or, in a file of integers, 0.

    Raises
    ------
    InputError
        When the file cannot be read, is no single map of numbers, or has another suffix.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and the ratio of sides does not tell whether the file was made for the turned photo.
    """
    path = as_path(path)
    if path.suffix.lower() not in (".npy", ".png", ".exr", *_TIFF_SUFFIXES):
        raise InputError(f"{path} is no map of numbers by its name: give a .npy, .tiff, .png or .exr file.")
    numbers, own = _numbers(path)
    numbers[np.isinf(numbers)] = np.nan
    if shape is not None and own != orientation and lies_on_a_side(path, numbers.shape, shape, orientation):
        return upright(numbers, orientation)
    return numbers


def lies_on_a_side(path: Path, size: tuple[int, ...], shape: tuple[int, int], orientation: int) -> bool:
    """Whether what a file says is of a photo as it lies in its file, by the ratio of sides, and not as it is read.

    Parameters
    ----------
    path : Path
    size : (int, int)
        (height, width) of what it says, on any scale.
    shape, orientation
        Of the photo as it is read, and what EXIF says of it.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and the ratio does not tell.
    """
    if orientation not in TURNED:
        return False
    as_read, as_in_file = (abs(_ratio(size) - sign * _ratio(shape)) for sign in (1.0, -1.0))
    if orientation not in ON_A_SIDE or as_read == as_in_file:
        _warn_of_turning(path, _how(orientation))
        return False
    return as_in_file < as_read


def _ratio(size: tuple[int, ...]) -> float:
    """Logarithm of that of height and width."""
    return math.log(size[0]) - math.log(size[1])


def _numbers(path: Path) -> tuple[Array, int]:
    """One number a pixel in an array of its own, NaN where integers are 0; and the orientation of an image's EXIF."""
    own = 1
    if path.suffix.lower() == ".npy":
        stored: NDArray[Any] = read_npy(path)
    elif path.suffix.lower() == ".exr":
        stored = read_exr(path)
    else:
        raster = read_raster(path)
        stored, own = raster.samples, raster.orientation
        stored = stored[..., 0] if stored.shape[2] == 1 else stored
    _require_stored("depth", path, stored.dtype)
    if stored.ndim != 2 or stored.size == 0:
        raise InputError(f"{path} has shape {stored.shape}: a depth map is (height, width).")
    # A copy in any case; what float64 cannot hold becomes infinite.
    numbers = to_float64(stored).copy()
    if stored.dtype.kind != "f":
        numbers[stored == 0] = np.nan
    return numbers, own


def check_map(
    kind: MapKind, path: FilePath, shape: tuple[int, int], *, orientation: int = 1, half_size: bool = False
) -> None:
    """Refuse a map by its header, for what the function that reads it would refuse it so far.

    Parameters
    ----------
    kind : {"depth", "light", "mask"}
        Which function that is.
    path, shape, orientation, half_size
        As for that function.

    Raises
    ------
    InputError
        When the file is missing, empty, of another shape or type, or broken within its header.

    Warns
    -----
    UserWarning
        As the function that reads it.
    """
    path = as_path(path)
    if kind == "depth":
        _require_depth_name(path)
    if path.suffix.lower() == ".npy":
        header = read_npy_header(path)
        _require_stored(kind, path, header.dtype)
    else:
        header = read_header(path, half_size=half_size and kind == "light")
        if kind != "depth":
            require_type(path, header.dtype, header.bits)
    _require_shape(path, header.shape, shape, orientation, own=header.orientation)


def _require_depth_name(path: Path) -> None:
    if path.suffix.lower() not in (".npy", *_TIFF_SUFFIXES):
        if path.is_dir():
            raise folder_error(path)
        raise InputError(f"{path} is not a depth map by its name: give a .npy, .tif or .tiff file.")


def _require_stored(kind: MapKind, path: Path, dtype: np.dtype[Any]) -> None:
    kinds, remedy = _STORED[kind]
    if dtype.kind not in kinds:
        raise InputError(f"{path} holds {dtype}, {remedy}.")


def _require_shape(
    path: Path, found: tuple[int, ...], shape: tuple[int, int], orientation: int = 1, *, own: int = 1
) -> None:
    """Refuse another shape than the photo's, and warn of one that fits the photo as it was before EXIF turned it.

    `own` is the orientation that the file itself had.
    """
    turned = orientation in TURNED and own != orientation
    how = _how(orientation)
    if found != tuple(shape):
        if turned and orientation in ON_A_SIDE and found == tuple(shape)[::-1]:
            raise InputError(
                f"{path} has shape {found}, and fits the photo as it lies in its file; the photo is read upright "
                f"({how}), with {tuple(shape)} (height, width). Turn {path} in the same way."
            )
        raise InputError(
            f"{path} has shape {found}, but the image has {tuple(shape)} (height, width): make them the same size."
        )
    if turned and (orientation not in ON_A_SIDE or shape[0] == shape[1]):
        _warn_of_turning(path, how)


def _how(orientation: int) -> str:
    return f"EXIF orientation {orientation}: {TURNED.get(orientation)}"


def _warn_of_turning(path: Path, how: str) -> None:
    warn(
        f"The photo is read upright ({how}), and by its shape nobody can tell whether {path} was made for it so: make "
        "sure that it was, and not without turning the photo.",
    )
