"""Photos, masks and depth maps in and out of files, as NumPy arrays in linear light."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.errors import InputError
from persfs_cl.files import FilePath, as_path, atomic_path, read_bytes
from persfs_cl.grey import decode_srgb, encode_srgb

if TYPE_CHECKING:
    import PIL.Image

Array = NDArray[np.float64]
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
_TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TIFF_SUFFIXES = (".tif", ".tiff")
_EXIF_ORIENTATION = 274


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

    def linear(self, samples: ArrayLike) -> Array:
        """Linear light, on the scale of `image`, of numbers as the file holds them: grey levels of an 8-bit photo."""
        share = np.asarray(samples, dtype=np.float64) / (self.white or 1.0)
        return decode_srgb(share) if self.encoding == "srgb" else share


@dataclass(frozen=True, eq=False)
class _Raster:
    """Samples as the file holds them, upright: (H, W, C) with C = grey, grey + alpha, RGB or RGB + alpha."""

    samples: NDArray[Any]
    bits: int

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

    8-bit and 16-bit integers and floats are read without loss. The EXIF orientation is applied. Colour
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
        When the file is missing, a folder, empty, broken, not such an image, animated or of several pages,
        or holds NaN (see `keep_nan`), infinite or negative values; when `channel` or `encoding` is unknown.
    """
    if channel not in get_args(Channel):
        raise InputError(f"channel={channel!r} is unknown: give one of {', '.join(get_args(Channel))}.")
    if encoding not in get_args(Encoding):
        raise InputError(f"encoding={encoding!r} is unknown: give one of {', '.join(get_args(Encoding))}.")
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
    )


def read_light(
    path: FilePath, shape: tuple[int, int], *, channel: Channel = "luminance", encoding: Encoding = "auto"
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

    Returns
    -------
    ndarray of float64, shape `shape`
        NaN where a file of floats has it.

    Raises
    ------
    InputError
        When the file cannot be read, or is of another shape or of another type.
    """
    path = as_path(path)
    if path.suffix.lower() == ".npy":
        stored = _read_npy(path)
        if stored.dtype.kind not in "iuf":
            raise InputError(f"{path} holds {stored.dtype}, not numbers: save linear light as floats.")
        light = stored.astype(np.float64)
    else:
        light = read_photo(path, channel=channel, encoding=encoding, keep_nan=True).image
    _require_shape(path, light, shape)
    return light


def read_mask(path: FilePath, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """A mask from an image file or a NumPy file.

    Parameters
    ----------
    path : path
        A PNG, JPEG or TIFF image: True where a channel is above half of its range and alpha, if there is
        any, is too. Or a `.npy` file of bool.
    shape : (int, int)
        (height, width) that the mask must have.

    Returns
    -------
    ndarray of bool, shape `shape`

    Raises
    ------
    InputError
        When the file cannot be read, is of another shape or of another type, or is an image whose brightest
        sample is above 0 but not above half of the range.
    """
    path = as_path(path)
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
    _require_shape(path, mask, shape)
    return mask


def read_depth(path: FilePath, shape: tuple[int, int] | None = None) -> Array:
    """A depth map from a NumPy or TIFF file.

    Parameters
    ----------
    path : path
        `.npy`, `.tif` or `.tiff`, of floats or integers.
    shape : (int, int), optional
        (height, width) that the depth must have.

    Returns
    -------
    ndarray of float64, shape (H, W)
        Depth above 0, and NaN where it is unknown: where the file has NaN or, in a file of integers, 0.

    Raises
    ------
    InputError
        When the file cannot be read, is no single depth map of numbers, has another shape or suffix, or
        holds values that are infinite or not above 0.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix == ".npy":
        stored = _read_npy(path)
    elif suffix in _TIFF_SUFFIXES:
        stored = _read_raster(path).samples
        stored = stored[..., 0] if stored.shape[2] == 1 else stored
    else:
        raise InputError(f"{path} is not a depth map by its name: give a .npy, .tif or .tiff file.")
    if stored.dtype.kind not in "iuf":
        raise InputError(f"{path} holds {stored.dtype}, not numbers: save the depth as floats.")
    if stored.ndim != 2 or stored.size == 0:
        raise InputError(f"{path} has shape {stored.shape}: a depth map is (height, width).")
    if shape is not None:
        _require_shape(path, stored, shape)
    depth = stored.astype(np.float64)
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
        raise InputError(f"bits={bits!r} is impossible: give 8 or 16.")
    if encoding not in ("srgb", "linear"):
        raise InputError(f"encoding={encoding!r} is unknown: give srgb or linear.")
    values = _grey_array(image, "image")
    levels = _quantised(encode_srgb(values) if encoding == "srgb" else values, bits)
    # In memory first: imageio's writers print a traceback of their own when the disk is full.
    data = imageio.v3.imwrite("<bytes>", levels, extension=suffix)
    with atomic_path(target) as temporary:
        temporary.write_bytes(data)


def _read_raster(path: Path) -> _Raster:
    data = read_bytes(path)
    with _decoding(path):
        samples, bits, orientation = (
            _decode_tiff(path, data) if data.startswith(_TIFF_SIGNATURES) else _decode_png_or_jpeg(path, data)
        )
        if samples.ndim == 2:
            samples = samples[..., None]
        if samples.ndim != 3 or samples.size == 0 or samples.shape[2] > 4:
            raise InputError(f"{path} holds an array of shape {samples.shape}: save one grey or RGB image.")
        return _Raster(_upright(samples, orientation), bits)


def open_png_or_jpeg(path: FilePath, data: bytes) -> PIL.Image.Image:
    """The file as Pillow opens it, its pixels not yet decoded; InputError when they are too many.

    Pillow's own errors are let through.
    """
    from PIL import Image

    with warnings.catch_warnings():
        # Pillow warns from half its limit on, but photographs of 100 million pixels are not rare.
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            return Image.open(io.BytesIO(data), formats=("PNG", "JPEG"))
        except Image.DecompressionBombError as error:
            raise _too_large(path, "more than 178 million pixels are not read") from error


def _decode_png_or_jpeg(path: Path, data: bytes) -> tuple[NDArray[Any], int, int]:
    from PIL import UnidentifiedImageError

    try:
        photo = open_png_or_jpeg(path, data)
    except UnidentifiedImageError as error:
        raise InputError(f"{path} is not a PNG, JPEG or TIFF image: convert it to one of these.") from error
    with photo:
        # A multi-picture JPEG holds the photo first, then its preview or gain map.
        pictures = 1 if photo.format == "MPO" else getattr(photo, "n_frames", 1)
        if pictures != 1:
            raise InputError(f"{path} is an animation of {pictures} pictures: save the one you want alone.")
        orientation = int(photo.getexif().get(_EXIF_ORIENTATION, 1))
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

    with tifffile.TiffFile(io.BytesIO(data)) as tiff:
        pages = [page for page in tiff.pages if isinstance(page, tifffile.TiffPage) and not page.is_reduced]
        if not pages:
            raise tifffile.TiffFileError("it holds no image")
        if len(pages) != 1:
            raise InputError(f"{path} has {len(pages)} pages: save the one you want alone.")
        page = pages[0]
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
    elif model == tifffile.PHOTOMETRIC.MINISWHITE and samples.dtype.kind == "u":
        samples = 2**bits - 1 - samples
    elif model == tifffile.PHOTOMETRIC.YCBCR and page.compression == tifffile.COMPRESSION.JPEG:
        pass  # decoded to RGB already
    elif model not in (tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.RGB):
        raise InputError(f"{path} has the colour model {model.name}: save it as grey or RGB.")
    if samples.ndim == 3:
        extra = [tifffile.EXTRASAMPLE(kind) for kind in page.extrasamples]
        alpha = extra[:1] in ([tifffile.EXTRASAMPLE.ASSOCALPHA], [tifffile.EXTRASAMPLE.UNASSALPHA])
        samples = samples[..., : samples.shape[2] - len(extra) + alpha]
    return samples, bits, int(page.tags.valueof(_EXIF_ORIENTATION, 1))


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
    with _decoding(path):
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)


@contextmanager
def _decoding(path: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except MemoryError as error:
        raise _too_large(path, "the memory does not suffice") from error
    except Exception as error:  # whatever a decoder raises at broken data
        raise InputError(f"{path} is broken or not supported ({error}): save or copy it again.") from error


def _too_large(path: FilePath, why: str) -> InputError:
    return InputError(f"{path} is too large: {why}. Reduce it to some million pixels first.")


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


def _require_shape(path: Path, array: NDArray[Any], shape: tuple[int, int]) -> None:
    if array.shape != tuple(shape):
        raise InputError(
            f"{path} has shape {array.shape}, but the image has {tuple(shape)} (height, width): "
            "make them the same size."
        )


def _grey_array(values: ArrayLike, name: str) -> NDArray[np.floating[Any]]:
    array = np.asarray(values)
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
