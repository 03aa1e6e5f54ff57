"""Photos, masks and depth maps in and out of files, as NumPy arrays in linear light."""

from __future__ import annotations

import io
import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.checks import as_array, check_choice, to_float64, warn
from persfs_cl.errors import InputError
from persfs_cl.io.decoding import decoding
from persfs_cl.io.files import FilePath, as_path, atomic_path, read_bytes
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.raw import refuse_raw
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
from persfs_cl.preparation.normalise import decode_srgb, encode_srgb

if TYPE_CHECKING:
    import PIL.Image
    import tifffile

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
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_SIGNATURE = b"\xff\xd8\xff"
_TIFF_SUFFIXES = (".tif", ".tiff")
_EXIF_ORIENTATION = 274
_JPEG_BLOCK = 16
# Of the compressions that say their own size, those whose header is looked at: JPEG, JPEG 2000, PNG and WebP.
_LOOKED_INTO = (6, 7, 33003, 33004, 33005, 33007, 34712, 34892, 34933, 50001)
_TURNED = {2: "mirrored", 3: "turned by 180°", 4: "flipped", 5: "transposed", 6: "turned", 7: "transposed", 8: "turned"}
_ON_A_SIDE = (5, 6, 7, 8)


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

    def linear(self, samples: ArrayLike) -> Array:
        """Linear light, on the scale of `image`, of numbers as the file holds them: grey levels of an 8-bit photo."""
        share = np.asarray(samples, dtype=np.float64) / (self.white or 1.0)
        return decode_srgb(share) if self.encoding == "srgb" else share


@dataclass(frozen=True, eq=False)
class _Raster:
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
    """
    check_choice("channel", channel, Channel)
    check_choice("encoding", encoding, Encoding)
    path = as_path(path)
    raster = _read_raster(path)
    _require_brightness(path, raster, keep_nan=keep_nan)
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


def read_light(
    path: FilePath,
    shape: tuple[int, int],
    *,
    channel: Channel = "luminance",
    encoding: Encoding = "auto",
    orientation: int = 1,
) -> Array:
    """A map of linear light that goes with a photo: ambient light, or the vignetting of the lens.

    Parameters
    ----------
    path : path
        A PNG, JPEG or TIFF image, or a `.npy` file of linear light.
    shape : (int, int)
        (height, width) that the map must have.
    channel, encoding
        As for `read_photo`, for images.
    orientation : int
        `Photo.orientation` of the photo that it goes with: then files made without turning the photo are told of.

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
    """
    path = as_path(path)
    own = 1
    if path.suffix.lower() == ".npy":
        stored = _read_npy(path)
        if stored.dtype.kind not in "iuf":
            raise InputError(f"{path} holds {stored.dtype}, not numbers: save linear light as floats.")
        light = to_float64(stored)
    else:
        photo = read_photo(path, channel=channel, encoding=encoding, keep_nan=True)
        light, own = photo.image, photo.orientation
    _require_shape(path, light, shape, orientation, own=own)
    return light


def read_mask(path: FilePath, shape: tuple[int, int], *, orientation: int = 1) -> NDArray[np.bool_]:
    """A mask from an image file or a NumPy file.

    Parameters
    ----------
    path : path
        A PNG, JPEG or TIFF image: True where a channel is above half of its range and alpha, if there is
        any, is too. Or a `.npy` file of bool.
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
    """
    path = as_path(path)
    own = 1
    if path.suffix.lower() == ".npy":
        mask = _read_npy(path)
        if mask.dtype != np.bool_:
            raise InputError(f"{path} holds {mask.dtype}, not bool: save it as mask.astype(bool).")
    else:
        raster = _read_raster(path)
        _require_brightness(path, raster)
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
    _require_shape(path, mask, shape, orientation, own=own)
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
    """
    path = as_path(path)
    own = 1
    suffix = path.suffix.lower()
    if suffix == ".npy":
        stored = _read_npy(path)
    elif suffix in _TIFF_SUFFIXES:
        raster = _read_raster(path)
        stored, own = raster.samples, raster.orientation
        stored = stored[..., 0] if stored.shape[2] == 1 else stored
    else:
        raise InputError(f"{path} is not a depth map by its name: give a .npy, .tif or .tiff file.")
    if stored.dtype.kind not in "iuf":
        raise InputError(f"{path} holds {stored.dtype}, not numbers: save the depth as floats.")
    if stored.ndim != 2 or stored.size == 0:
        raise InputError(f"{path} has shape {stored.shape}: a depth map is (height, width).")
    if shape is not None:
        _require_shape(path, stored, shape, orientation, own=own)
    # A copy in any case; what float64 cannot hold is refused as infinite.
    depth = to_float64(stored).copy()
    if stored.dtype.kind != "f":
        depth[stored == 0] = np.nan
    bad = np.isinf(depth) | (depth <= 0)
    if bad.any():
        raise InputError(
            f"In {path}, {np.count_nonzero(bad)} of {bad.size} values are infinite or not above 0, such as "
            f"{depth[bad][0]:g}: they are no depth. Mark unknown pixels with NaN."
        )
    return depth


def to_display(light: ArrayLike) -> NDArray[np.uint8]:
    """Linear light as 8-bit sRGB, for screens and vertex colours.

    Parameters
    ----------
    light : array_like
        Linear light; cut to [0, 1], NaN becomes 0.

    Returns
    -------
    ndarray of uint8, of the same shape
    """
    return _quantised(encode_srgb(light), 8).astype(np.uint8, copy=False)


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
    """
    import imageio.v3

    target = as_path(path)
    suffix = target.suffix.lower()
    if suffix not in (".png", *_TIFF_SUFFIXES):
        raise InputError(f"{target} cannot hold a grey image: give a name that ends in .png, .tif or .tiff.")
    if bits not in (8, 16):
        raise InputError.about("bits", bits, "is impossible: give 8 or 16.")
    check_choice("encoding", encoding, ("srgb", "linear"))
    values = _grey_array(image, "image")
    levels = _quantised(encode_srgb(values) if encoding == "srgb" else values, bits)
    # In memory first: imageio's writers print a traceback of their own when the disk is full.
    data = imageio.v3.imwrite("<bytes>", levels, extension=suffix)
    with atomic_path(target) as temporary:
        temporary.write_bytes(data)


def _read_raster(path: Path) -> _Raster:
    data = read_bytes(path)
    with decoding(path):
        samples, bits, orientation = (
            _decode_tiff(path, data) if data.startswith(SIGNATURES) else _decode_png_or_jpeg(path, data)
        )
        if samples.ndim == 2:
            samples = samples[..., None]
        if samples.ndim != 3 or samples.size == 0 or samples.shape[2] > 4:
            raise InputError(f"{path} holds an array of shape {samples.shape}: save one grey or RGB image.")
        return _Raster(_upright(samples, orientation), bits, orientation)


def open_png_or_jpeg(path: FilePath, data: bytes) -> PIL.Image.Image:
    """The file as Pillow opens it, its pixels not yet decoded.

    Pillow's own errors are let through.

    Raises
    ------
    InputError
        When it is neither, or has too many pixels.
    """
    from PIL import JpegImagePlugin, PngImagePlugin

    # Not by PIL.Image.open, whose own limit on pixels, warned of and then enforced, is the same on every machine.
    if data.startswith(_PNG_SIGNATURE):
        photo: PIL.Image.Image = PngImagePlugin.PngImageFile(io.BytesIO(data))
    elif data.startswith(_JPEG_SIGNATURE):
        photo = JpegImagePlugin.jpeg_factory(io.BytesIO(data))
    else:
        refuse_raw(path, data)
        raise InputError(f"{path} is not a PNG, JPEG or TIFF image: convert it to one of these.")
    require_pixels(path, (photo.height, photo.width))
    return photo


def _decode_png_or_jpeg(path: Path, data: bytes) -> tuple[NDArray[Any], int, int]:
    with open_png_or_jpeg(path, data) as photo:
        # A multi-picture JPEG holds the photo first, then its preview or gain map.
        pictures = 1 if photo.format == "MPO" else getattr(photo, "n_frames", 1)
        if pictures != 1:
            raise InputError(f"{path} is an animation of {pictures} pictures: save the one you want alone.")
        orientation = _orientation(photo.getexif().get(_EXIF_ORIENTATION))
        # The bit depth has this place in every PNG. Pillow would drop the lower half of 16-bit colours.
        if photo.format == "PNG" and data[24] == 16:
            import imagecodecs

            return imagecodecs.png_decode(data), 16, orientation
        if photo.has_transparency_data:
            mode = "LA" if photo.mode in ("1", "L", "LA") else "RGBA"
        elif photo.mode in ("1", "L"):
            mode = "L"
        elif photo.mode in ("P", "RGB"):
            mode = "RGB"
        else:
            raise InputError(f"{path} has the colour model {photo.mode}: save it as grey or RGB.")
        return np.asarray(photo.convert(mode)), 8, orientation


def _decode_tiff(path: Path, data: bytes) -> tuple[NDArray[Any], int, int]:
    import tifffile

    directories = read_directories(path, data)
    refuse_raw(path, data, directories)
    for directory in directories:
        _require_tiff_pixels(path, directory)
    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        pages = [page for page in tiff.pages if isinstance(page, tifffile.TiffPage) and not page.is_reduced]
        if not pages:
            raise tifffile.TiffFileError("it holds no image")
        if len(pages) != 1:
            raise InputError(f"{path} has {len(pages)} pages: save the one you want alone.")
        page = pages[0]
        _require_whole(path, page, data)
        samples = page.asarray()
    bits = page.bitspersample
    model = tifffile.PHOTOMETRIC(page.photometric)
    if page.axes not in ("YX", "YXS", "SYX"):
        raise InputError(f"{path} has the axes {page.axes}: save one flat image, height × width.")
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
    elif model == tifffile.PHOTOMETRIC.YCBCR and page.compression == tifffile.COMPRESSION.JPEG:
        pass  # decoded to RGB already
    elif model not in (tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.RGB):
        raise InputError(f"{path} has the colour model {model.name}: save it as grey or RGB.")
    if samples.ndim == 3:
        extra = [tifffile.EXTRASAMPLE(kind) for kind in page.extrasamples]
        associated = extra[:1] == [tifffile.EXTRASAMPLE.ASSOCALPHA]
        alpha = associated or extra[:1] == [tifffile.EXTRASAMPLE.UNASSALPHA]
        samples = samples[..., : samples.shape[2] - len(extra) + alpha]
        if associated and samples.dtype.kind in "uf":
            samples = _unmultiplied(samples, bits)
    return samples, bits, _orientation(page.tags.valueof(_EXIF_ORIENTATION))


def _require_tiff_pixels(path: Path, directory: Directory) -> None:
    """Refuse a page for what its decoder would make room for: whole tiles, and all samples of a pixel."""
    shape = []
    for whole, part in ((IMAGE_DEPTH, TILE_DEPTH), (IMAGE_LENGTH, TILE_LENGTH), (IMAGE_WIDTH, TILE_WIDTH)):
        size, tile = directory.number(whole, 1), directory.number(part, 1)
        shape.append(-(-size // tile) * tile if tile > 0 else size)
    # Four samples of up to 16 bits are a pixel; floats of 32 bits take the room of two such samples.
    samples = directory.number(SAMPLES_PER_PIXEL, 1) * max(1, directory.number(BITS_PER_SAMPLE, 8) // 16)
    require_pixels(path, tuple(shape if shape[0] > 1 else shape[1:]), weight=max(1, -(-samples // 4)))


def _require_whole(path: Path, page: tifffile.TiffPage, data: bytes) -> None:
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
    number = exif_number(value)
    return int(number) if number in _TURNED else 1


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


def _upright(samples: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Undo EXIF's orientation: 1 is upright, 3 upside down, 6 and 8 on a side, the others mirrored."""
    if orientation in (5, 6, 7, 8):
        samples = samples.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        samples = samples[::-1]
    if orientation in (2, 3, 6, 7):
        samples = samples[:, ::-1]
    return np.ascontiguousarray(samples)


def _read_npy(path: Path) -> NDArray[Any]:
    data = read_bytes(path)
    with decoding(path):
        file = io.BytesIO(data)
        version = np.lib.format.read_magic(file)
        # Versions 2 and 3 differ in the letters of field names only.
        read_header = np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(file)
        if dtype.hasobject:
            raise InputError(f"{path} holds Python objects, which are not read: save an array of numbers.")
        promised, held = math.prod(shape) * dtype.itemsize, len(data) - file.tell()
        if promised > held or min(shape, default=0) < 0:
            raise InputError(
                f"{path} is broken: its header promises shape {shape} of {dtype}, {promised} bytes, and {held} follow. "
                "Save or copy it again."
            )
        require_pixels(path, shape)
        file.seek(0)
        return np.lib.format.read_array(file, allow_pickle=False)


def _require_brightness(path: Path, raster: _Raster, *, keep_nan: bool = False) -> None:
    samples = raster.colours
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
    elif samples.dtype.kind != "u" or raster.bits > 16:
        raise InputError(f"{path} holds samples of type {samples.dtype}: save it as floats or unsigned 8 or 16 bits.")


def _require_shape(
    path: Path, array: NDArray[Any], shape: tuple[int, int], orientation: int = 1, *, own: int = 1
) -> None:
    """Refuse another shape than the photo's, and warn of one that fits the photo as it was before EXIF turned it.

    `own` is the orientation that the file itself had.
    """
    turned = orientation in _TURNED and own != orientation
    how = f"EXIF orientation {orientation}: {_TURNED.get(orientation)}"
    if array.shape != tuple(shape):
        if turned and orientation in _ON_A_SIDE and array.shape == tuple(shape)[::-1]:
            raise InputError(
                f"{path} has shape {array.shape}, and fits the photo as it lies in its file; the photo is read upright "
                f"({how}), with {tuple(shape)} (height, width). Turn {path} in the same way."
            )
        raise InputError(
            f"{path} has shape {array.shape}, but the image has {tuple(shape)} (height, width): "
            "make them the same size."
        )
    if turned and (orientation not in _ON_A_SIDE or shape[0] == shape[1]):
        warn(
            f"The photo is read upright ({how}), and by its shape nobody can tell whether {path} was made for it so: "
            "make sure that it was, and not without turning the photo.",
        )


def _grey_array(values: ArrayLike, name: str) -> NDArray[np.floating[Any]]:
    array = as_array(name, values)
    if array.dtype.kind not in "iuf":
        raise InputError(f"The {name} holds {array.dtype}, not numbers: give an array of floats.")
    if array.ndim != 2 or array.size == 0:
        raise InputError(f"The {name} has shape {array.shape}: give an array (height, width).")
    return array if array.dtype.kind == "f" else array.astype(np.float64)


def _quantised(values: NDArray[np.floating[Any]], bits: int) -> NDArray[np.unsignedinteger[Any]]:
    """Whole levels of values in [0, 1]; what lies outside is cut, NaN becomes 0."""
    white = 2**bits - 1
    levels: Array = np.rint(np.nan_to_num(values, nan=0.0).clip(0.0, 1.0) * white)
    return levels.astype(np.uint8 if bits == 8 else np.uint16)
