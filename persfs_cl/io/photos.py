"""Photographs read from files, as one channel of linear light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.checks import as_whole_number, check_choice
from persfs_cl.colour import decode_srgb, to_display
from persfs_cl.io.decode import Raster, read_raster, require_brightness
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.io.video import read_samples

Channel = Literal["luminance", "red", "green", "blue", "mean", "max"]
Encoding = Literal["auto", "srgb", "linear"]
# Shares of linear red, green and blue.
_WEIGHTS: dict[str, tuple[float, float, float]] = {
    "luminance": (0.2126, 0.7152, 0.0722),  # Rec. 709
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "mean": (1 / 3, 1 / 3, 1 / 3),
}


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
    encoding : {"srgb", "linear"}
        How the samples were understood.
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
    encoding: Literal["srgb", "linear"]
    channel: Channel
    largest_sample: NDArray[Any]
    smallest_sample: NDArray[Any]
    white: float | None
    orientation: int = 1

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
        share = np.asarray(samples, dtype=np.float64) / (self.white or 1.0)
        return decode_srgb(share) if self.encoding == "srgb" else share


def read_image(path: FilePath, *, channel: Channel = "luminance", encoding: Encoding = "auto") -> Array:
    """A photo as one channel of linear light.

    Parameters
    ----------
    path, channel, encoding
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
    return read_photo(path, channel=channel, encoding=encoding).image


def read_photo(
    path: FilePath, *, channel: Channel = "luminance", encoding: Encoding = "auto", keep_nan: bool = False
) -> Photo:
    """A photo from a PNG, JPEG or TIFF file: grey, colour or palette, with or without alpha.

    8-bit and 16-bit integers and floats are read without loss; colours that alpha was multiplied into are divided by
    it again. The EXIF orientation is applied. Colour
    profiles are not: values are taken as sRGB (or linear) whatever profile the file names. Of the several
    pictures in a phone's multi-picture JPEG, the first is the photo.

    Parameters
    ----------
    path : path
    channel : {"luminance", "red", "green", "blue", "mean", "max"}
        What becomes the grey image: Rec. 709 luminance, one channel, or the mean or the largest of the three, always
        of linear values. Grey files have only the one.
    encoding : {"auto", "srgb", "linear"}
        What the samples are. "auto" takes integers as sRGB and floats as linear.
    keep_nan : bool
        Take NaN, in a file of floats, for pixels without a value, instead of refusing the photo; they are black
        in `Photo.colour`.

    Returns
    -------
    Photo

    Raises
    ------
    InputError
        When the file is missing, a folder, no regular file, empty, broken, not such an image, a camera raw file,
        animated or of several pages, or holds NaN (see `keep_nan`), infinite or negative values; when it has more
        pixels than the environment variable PERSFS_CL_MAX_PIXELS says, which is a share of the memory if it is not
        set; when `channel` or `encoding` is unknown.

    Warns
    -----
    UserWarning
        When the file is damaged or odd, but was read.

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
    check_choice("channel", channel, Channel)
    check_choice("encoding", encoding, Encoding)
    path = as_path(path)
    raster = read_raster(path)
    require_brightness(path, raster, keep_nan=keep_nan)
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
    return _photo(as_path(path), Raster(read_samples(path, frame), 8, 1), channel, encoding)


def _photo(path: Path, raster: Raster, channel: Channel, encoding: Encoding) -> Photo:
    samples = raster.colours
    floating = samples.dtype.kind == "f"
    if encoding == "auto":
        encoding = "linear" if floating else "srgb"

    def linear(values: NDArray[Any]) -> Array:
        scaled = values.astype(np.float64) / raster.white
        return decode_srgb(scaled) if encoding == "srgb" else scaled

    channels = [samples[..., index] for index in range(samples.shape[2])]
    weights = (1.0,) if len(channels) == 1 else _WEIGHTS.get(channel, (1.0, 1.0, 1.0))
    smallest = np.minimum.reduce(channels)
    largest = np.maximum.reduce([values for weight, values in zip(weights, channels, strict=True) if weight])
    if channel == "max":
        # Brighter light is a larger number, so the largest sample may be chosen before it is decoded.
        channels, weights = [largest], (1.0,)
    if floating:
        light = (linear(values) for values in channels)
        colour = to_display(linear(samples))
    else:
        # A table of every possible sample costs far less than a power for each pixel.
        levels = linear(np.arange(2**raster.bits))
        light = (levels[values] for values in channels)
        colour = to_display(levels)[samples]
    image = np.zeros(samples.shape[:2])
    for weight, values in zip(weights, light, strict=True):
        image += weight * values
    if colour.shape[2] == 1:
        colour = np.repeat(colour, 3, axis=2)
    return Photo(
        image=image,
        colour=colour,
        mask=raster.opaque,
        path=path,
        bits=raster.bits,
        encoding=encoding,
        channel=channel,
        largest_sample=largest,
        smallest_sample=smallest,
        white=None if floating else raster.white,
        orientation=raster.orientation,
    )
