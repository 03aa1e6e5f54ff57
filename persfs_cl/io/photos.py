"""Photographs read from files, as one channel of linear light."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.checks import as_whole_number, check_choice, warn
from persfs_cl.colour import ColourSpace, Curve, Three, to_display
from persfs_cl.errors import InputError
from persfs_cl.io.code_points import CodePoints, coded_space
from persfs_cl.io.decode import read_raster, require_brightness, require_sensor
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.io.profiles import profile_space
from persfs_cl.io.raster import Raster
from persfs_cl.io.video import read_samples
from persfs_cl.wording import keyword

Channel = Literal["luminance", "red", "green", "blue", "mean", "max"]
Encoding = Literal["auto", "srgb", "linear"]
_SINGLE: dict[str, Three] = {"red": (1.0, 0.0, 0.0), "green": (0.0, 1.0, 0.0), "blue": (0.0, 0.0, 1.0)}
_SRGB, _LINEAR = ColourSpace("srgb"), ColourSpace("linear")
_EQUAL: Three = (1.0, 1.0, 1.0)
_ROWS = 256
"""Of colours that are made at once."""
_DEPTHS = (10, 12, 14)
"""Bits of sensors and their converters, whose numbers may lie in files of 16 bits as they are."""


@dataclass(frozen=True, eq=False)
class Photo:
    """What a photo's file holds, upright.

    Attributes
    ----------
    image : ndarray of float64, shape (H, W)
        Linear light of one channel. In [0, 1] for integer files; a float file keeps its own scale.
    colour : ndarray of uint8, shape (H, W, 3)
        sRGB colours, for vertices and previews; grey files give three equal channels.
    mask : ndarray of bool, shape (H, W), or None
        True where alpha is above one half; None when the file has no alpha.
    path : Path
        Where it came from.
    bits : int
        Bits per sample in the file.
    encoding : {"srgb", "linear", "profile", "pq", "hlg"}
        How the samples were understood; "profile" by the curves of the colour profile, the last two as in HDR photos.
    channel : {"luminance", "red", "green", "blue", "mean", "max"}
        What of the colours the image is.
    largest_sample : ndarray of uint8, uint16 or float, shape (H, W)
        The file's own number, at each pixel the largest of the channels that `image` is made of.
    smallest_sample : ndarray of uint8, uint16 or float, shape (H, W)
        The same, but the smallest of all colours.
    white : float or None
        The largest number that a file of this type can hold, where sensors saturate; None for floats.
    orientation : int
        How EXIF turned the photo: 1 not at all, 2 to 8 as EXIF numbers them. The arrays are upright already.
    profile : str
        Name of the colour profile or code that was used, or "camera" for a raw file; empty where there is none.
    space : ColourSpace
        What the numbers mean: the curve, and the light of the primaries.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> ps.read_photo(files("persfs_cl") / "data" / "coin.png")
    <Photo 'coin.png', 72 x 72 pixels of 8 bits, srgb, luminance>
    """

    image: Array
    colour: NDArray[np.uint8]
    mask: NDArray[np.bool_] | None
    path: Path
    bits: int
    encoding: Curve
    channel: Channel
    largest_sample: NDArray[Any]
    smallest_sample: NDArray[Any]
    white: float | None
    orientation: int = 1
    profile: str = ""
    space: ColourSpace = field(default=_SRGB, repr=False)

    def __repr__(self) -> str:
        height, width = self.image.shape
        alpha = "" if self.mask is None else ", with alpha"
        return (
            f"<Photo {self.path.name!r}, {width} x {height} pixels of {self.bits} bits{alpha}, {self.encoding}, "
            f"{self.channel}>"
        )

    def linear(self, samples: ArrayLike) -> Array:
        """Linear light, on the scale of `image`, of numbers as the file holds them: grey levels of an 8-bit photo.

        Examples
        --------
        The light of a grey level, such as a black level that was measured in the file:

        >>> from importlib.resources import files
        >>> import persfs_cl as ps
        >>> photo = ps.read_photo(files("persfs_cl") / "data" / "coin.png")
        >>> photo.linear([0, 128, 255]).round(3)
        array([0.   , 0.216, 1.   ])
        """
        return self.space.linear(np.asarray(samples, dtype=np.float64) / (self.white or 1.0), 1)


def read_image(
    path: FilePath,
    *,
    channel: Channel = "luminance",
    encoding: Encoding = "auto",
    page: int | None = None,
    half_size: bool = False,
) -> Array:
    """A photo as one channel of linear light.

    Parameters
    ----------
    path, channel, encoding, page, half_size
        As for `read_photo`, which also gives the alpha mask and the colours.

    Returns
    -------
    ndarray of float64, shape (H, W)
        Linear light, in [0, 1] for integer files; a float file keeps its own scale.

    Raises
    ------
    InputError
        As `read_photo`.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> image = ps.read_image(files("persfs_cl") / "data" / "coin.png")
    >>> image.shape, image.dtype
    ((72, 72), dtype('float64'))
    """
    return read_photo(path, channel=channel, encoding=encoding, page=page, half_size=half_size).image


def read_photo(
    path: FilePath,
    *,
    channel: Channel = "luminance",
    encoding: Encoding = "auto",
    keep_nan: bool = False,
    page: int | None = None,
    half_size: bool = False,
) -> Photo:
    """A photo from a file: PNG, JPEG, TIFF, camera raw, WebP, AVIF, HEIC, JPEG 2000 or BMP.

    It may be grey, colour or palette, with or without alpha. Integers of 8 to 16 bits and floats are read without loss;
    colours that alpha was multiplied into are divided by it again. The EXIF orientation is applied. Of the several
    pictures in a phone's multi-picture JPEG or HEIC, the first is the photo.

    A camera raw file (with the package rawpy, which `pip install 'persfs-cl[raw]'` brings) is linear: the black level
    is subtracted, the level at which the sensor saturates is 65535 in each channel, and the colours between are
    interpolated (AHD). Its channels are those of the sensor, weighted by the camera's daylight balance, which is the
    same for all its photos: so a dark frame or a flat field that it took goes with them. Files of HEIC need pillow-heif
    (`pip install 'persfs-cl[heif]'`).

    Parameters
    ----------
    path : path
    channel : {"luminance", "red", "green", "blue", "mean", "max"}
        What becomes the grey image: luminance, by Rec. 709 or the primaries of the colour profile, one channel, or the
        mean or the largest of the three, always of linear values. Grey files have only the one.
    encoding : {"auto", "srgb", "linear"}
        What the samples are. "auto" goes by an embedded ICC profile, or the code points of HEIC and AVIF, such as PQ
        and HLG, if there are such; without them, it takes integers as sRGB and floats as linear. The others go before
        what the file says.
    keep_nan : bool
        Take NaN, in a file of floats, for pixels without a value, instead of refusing the photo; they are black
        in `Photo.colour`.
    page : int, optional
        Which page of a TIFF file, or picture of another, from 1; needed where there are several.
    half_size : bool
        Of a camera raw file, make one pixel of each square of four, without interpolating colours. Camera and maps are
        then of half the size.

    Returns
    -------
    Photo

    Raises
    ------
    InputError
        When the file is missing, a folder, no regular file, empty, broken, not such an image, animated or of several
        pages of which none is chosen, or holds NaN (see `keep_nan`), infinite or negative values; when it has more
        pixels than the environment variable PERSFS_CL_MAX_PIXELS says, which is a share of the memory if it is not
        set; when a package that reads it is missing; when `channel` or `encoding` is unknown, or `half_size` is asked
        of another file than a camera's.

    Warns
    -----
    UserWarning
        When the file is damaged or odd, but was read; when its colour profile cannot be used; when its numbers have
        16 bits, but look like those of 10, 12 or 14.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> photo = ps.read_photo(files("persfs_cl") / "data" / "coin.png", channel="green")
    >>> photo.bits, photo.encoding, photo.white, photo.mask
    (8, 'srgb', 255.0, None)
    >>> photo.image.shape, photo.colour.shape
    ((72, 72), (72, 72, 3))
    """
    return read_light_photo(
        path, channel=channel, encoding=encoding, keep_nan=keep_nan, page=page, half_size=half_size, dark=False
    )


def read_light_photo(
    path: FilePath,
    *,
    channel: Channel,
    encoding: Encoding,
    keep_nan: bool,
    page: int | None = None,
    half_size: bool = False,
    dark: bool = True,
) -> Photo:
    """As :func:`read_photo`, also for what may well be `dark`, such as a photo without the lamp."""
    check_choice("channel", channel, Channel)
    check_choice("encoding", encoding, Encoding)
    if page is not None:
        page = as_whole_number("page", page, least=1)
    path = as_path(path)
    if half_size:
        require_sensor(path)
    raster = read_raster(path, page=page, half_size=half_size)
    require_brightness(path, raster, keep_nan=keep_nan)
    if not dark:
        _warn_of_few_bits(path, raster)
    return _photo(path, raster, channel, encoding)


def read_frame(path: FilePath, frame: int, *, channel: Channel = "luminance", encoding: Encoding = "auto") -> Photo:
    """A frame of a video, as a photo of 8 bits.

    It is turned as the video says. Reading frames in their order is fast; going back begins again from the first.

    Parameters
    ----------
    path : path
        A video of any format that FFmpeg reads.
    frame : int
        From 0.
    channel, encoding
        As for :func:`read_photo`.

    Returns
    -------
    Photo

    Raises
    ------
    InputError
        When the file is missing or no video, or has no such frame; when PyAV is not installed, which
        `pip install 'persfs-cl[video]'` brings; when `channel` or `encoding` is unknown.
    """
    check_choice("channel", channel, Channel)
    check_choice("encoding", encoding, Encoding)
    frame = as_whole_number("frame", frame)
    return _photo(as_path(path), Raster(read_samples(path, frame), 8), channel, encoding)


def _looked_up(table: NDArray[np.uint8], samples: NDArray[Any]) -> NDArray[np.uint8]:
    # What is for displays already comes out as it is.
    same = samples.dtype == table.dtype and np.array_equal(table, np.arange(len(table)))
    return samples.copy() if same else np.take(table, samples)


def _photo(path: Path, raster: Raster, channel: Channel, encoding: Encoding) -> Photo:
    samples, white = raster.colours, raster.white
    floating, count = samples.dtype.kind == "f", samples.shape[2]
    space = _space(path, raster, encoding)
    alike = space.curve != "profile" and space.gains == _EQUAL

    # A table of every possible sample costs far less than a power for each pixel.
    steps = np.arange(1 if floating else 2**raster.bits) / white
    tables = [space.linear(steps, index) for index in range(1 if alike else count)]

    def linear(values: NDArray[Any], index: int) -> Array:
        if floating:
            return space.linear(values.astype(np.float64) / white, index)
        return np.take(tables[0 if alike else index], values)

    channels = [samples[..., index] for index in range(count)]
    weights = (1.0,) if count == 1 else _weights(space, channel)
    smallest = np.minimum.reduce(channels)
    largest = np.maximum.reduce([values for weight, values in zip(weights, channels, strict=True) if weight])
    if channel == "max" and alike:
        # Brighter light is a larger number, so the largest sample may be chosen before it is decoded.
        channels, weights = [largest], (1.0,)
    height, width = samples.shape[:2]
    image = np.zeros((height, width))
    combine = np.maximum if channel == "max" else np.add
    for rows in row_blocks((height, width)):
        for index, (weight, values) in enumerate(zip(weights, channels, strict=True)):
            combine(image[rows], weight * linear(values[rows], index), out=image[rows])
    if alike and (space.to_srgb is None or count == 1):
        colour = to_display(linear(samples, 0)) if floating else _looked_up(to_display(tables[0]), samples)
    else:
        colour = _colours(space, linear, samples)
    if colour.shape[2] == 1:
        colour = np.repeat(colour, 3, axis=2)
    return Photo(
        image=image,
        colour=colour,
        mask=raster.opaque,
        path=path,
        bits=raster.bits,
        encoding=space.curve,
        channel=channel,
        largest_sample=largest,
        smallest_sample=smallest,
        white=None if floating else white,
        orientation=raster.orientation,
        profile=space.name,
        space=space,
    )


def _space(path: Path, raster: Raster, encoding: Encoding) -> ColourSpace:
    """What the numbers mean: as is said, or else as the file says."""
    if isinstance(raster.space, ColourSpace):
        if encoding == "srgb":
            raise InputError.about("encoding", encoding, f"is not that of {path}, a camera raw file: leave it out.")
        return raster.space
    if encoding != "auto":
        return _SRGB if encoding == "srgb" else _LINEAR
    told = None
    if isinstance(raster.space, CodePoints):
        told = coded_space(path, raster.space)
    elif raster.space is not None:
        told = profile_space(path, raster.space, raster.colours.shape[2])
    return told or (_LINEAR if raster.samples.dtype.kind == "f" else _SRGB)


def _weights(space: ColourSpace, channel: Channel) -> Three:
    if channel == "max":
        return space.gains
    return _SINGLE.get(channel) or (space.luminance if channel == "luminance" else space.mean)


def _colours(
    space: ColourSpace, linear: Callable[[NDArray[Any], int], Array], samples: NDArray[Any]
) -> NDArray[np.uint8]:
    """The photo in sRGB, a few rows at a time."""
    colour = np.empty(samples.shape, np.uint8)
    for first in range(0, len(samples), _ROWS):
        rows = samples[first : first + _ROWS]
        light = np.stack([linear(rows[..., index], index) for index in range(samples.shape[2])], axis=-1)
        mixed = light @ np.array(space.to_srgb).T if space.to_srgb and light.shape[2] == 3 else light
        colour[first : first + _ROWS] = to_display(mixed)
    return colour


def _warn_of_few_bits(path: Path, raster: Raster) -> None:
    """Warn of 16 bits that look like fewer: nothing is rescaled, and nothing would count as saturated."""
    # A colour space that is sure is that of a sensor, whose numbers were scaled to its white level.
    if raster.bits != 16 or raster.samples.dtype.kind == "f" or isinstance(raster.space, ColourSpace):
        return
    brightest = int(raster.colours.max())
    bits = next((bits for bits in _DEPTHS if brightest < 2**bits), None)
    if bits is None or brightest < 2**8:
        return
    level = 2**bits - 1
    warn(
        f"{path} has 16 bits, but no number above {brightest}: they look like those of {bits} bits. If so, give "
        f"{keyword('saturation', level)} and {keyword('encoding', 'linear')}, and for a parallel light with a known "
        f"{keyword('white_level')} count in shares of 65535; nothing is rescaled."
    )
