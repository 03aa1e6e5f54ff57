"""The pinhole camera and its normalised pixel grid."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.checks import as_array, brief, finite_numbers, warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.files import FilePath, read_bytes
from persfs_cl.images import open_png_or_jpeg

# The frame of 35 mm film is 36 mm × 24 mm.
_FILM_DIAGONAL = math.hypot(36.0, 24.0)
# EXIF's FocalPlaneResolutionUnit, in millimetres. 2 and 3 are in the standard, 4 and 5 in use beside it.
_RESOLUTION_UNITS = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
# Pillow reads tags at 32-bit offsets only.
_BIG_TIFF_SIGNATURES = (b"II+\0", b"MM\0+")
_WIDEST_DEGREES = 85.0
_WIDEST = math.tan(math.radians(_WIDEST_DEGREES))
_LEAST_TANGENT = 1e-100
_TELL = "Give the focal length in pixels (--focal-length), or the horizontal field of view (--fov)."


@dataclass(frozen=True)
class PixelGrid:
    """Normalised image coordinates of the pixel centres of one image.

    Attributes
    ----------
    x : ndarray of float64, shape (width,)
        (column - cx) / fx.
    y : ndarray of float64, shape (height, 1)
        (row - cy) / fy, a column so that it broadcasts against x.
    dx, dy : float
        Pixel spacing, 1/fx and 1/fy.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    dx: float
    dy: float


@dataclass(frozen=True)
class Camera:
    """A pinhole camera without distortion. Pixels are centred on integers.

    Parameters
    ----------
    focal_length : float or (float, float)
        In pixels, above 0; two values are (fx, fy).
    principal_point : (float, float), optional
        Where the optical axis meets the image: (cx, cy), column and row in pixels; a part that was cut out of a
        photograph keeps its axis, which may lie outside. Left out, it is the middle of the image,
        ((width - 1) / 2, (height - 1) / 2).

    Raises
    ------
    CameraError
        When a focal length is not a number between 0.001 and 1e9, or the principal point is not two finite numbers.
    """

    focal_length: float | tuple[float, float]
    principal_point: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        lengths = finite_numbers(self.focal_length)
        if lengths is None or len(lengths) > 2 or min(lengths) < 1e-3 or max(lengths) > 1e9:
            raise CameraError(
                f"focal_length={brief(self.focal_length)} is impossible: give one number of pixels "
                "between 0.001 and 1e9, or two, (fx, fy)."
            )
        object.__setattr__(self, "focal_length", lengths if len(lengths) == 2 else lengths[0])
        if self.principal_point is not None:
            point = finite_numbers(self.principal_point)
            if point is None or len(point) != 2:
                raise CameraError(
                    f"principal_point={brief(self.principal_point)} is impossible: give two finite numbers of "
                    "pixels, (column, row), or leave it out for the middle of the image."
                )
            object.__setattr__(self, "principal_point", point)

    @property
    def fx(self) -> float:
        """Horizontal focal length in pixels."""
        return self.focal_length[0] if isinstance(self.focal_length, tuple) else self.focal_length

    @property
    def fy(self) -> float:
        """Vertical focal length in pixels."""
        return self.focal_length[1] if isinstance(self.focal_length, tuple) else self.focal_length

    def grid(self, shape: tuple[int, int]) -> PixelGrid:
        """Normalised coordinates of the pixels of one image (section 1 of the method).

        Parameters
        ----------
        shape : (int, int)
            (height, width) of the image.

        Returns
        -------
        PixelGrid

        Raises
        ------
        CameraError
            When the ray of a pixel lies more than 85 degrees from the optical axis.
        InputError
            When `shape` is not an image's.
        """
        height, width = _image_shape(shape)
        cx, cy = self.centre((height, width))
        farthest = math.hypot(max(abs(cx), abs(width - 1 - cx)) / self.fx, max(abs(cy), abs(height - 1 - cy)) / self.fy)
        if not farthest <= _WIDEST:
            raise CameraError(
                f"focal_length={_in_brackets(self.fx, self.fy)} and principal_point={_in_brackets(cx, cy)} put a "
                f"corner of an image of shape {_in_brackets(height, width)} at {math.degrees(math.atan(farthest)):.4g} "
                f"degrees from the optical axis, and no lens draws more than {_WIDEST_DEGREES:g}: all are in pixels of "
                "this very image, not in millimetres; was it resized after the camera was calibrated?"
            )
        x = (np.arange(width, dtype=np.float64) - cx) / self.fx
        y = ((np.arange(height, dtype=np.float64) - cy) / self.fy)[:, None]
        return PixelGrid(x, y, 1 / self.fx, 1 / self.fy)

    def warn_if_off_image(self, shape: tuple[int, int]) -> None:
        """Warn where the principal point lies outside an image of shape (height, width): for a crop, or by a slip."""
        height, width = shape
        cx, cy = self.centre(shape)
        if not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
            warn(
                f"principal_point={_in_brackets(cx, cy)} lies outside the image of shape {shape}: right for a part "
                "that was cut out of a photo, whose optical axis it keeps. Otherwise, it is (column, row) in pixels of "
                "this very image: was it resized after the camera was calibrated?"
            )

    def centre(self, shape: tuple[int, int]) -> tuple[float, float]:
        """The principal point in an image of shape (height, width): as given, or else the middle."""
        height, width = shape
        return self.principal_point or ((width - 1) / 2, (height - 1) / 2)

    @classmethod
    def from_fov(
        cls,
        horizontal_degrees: float,
        image_shape: tuple[int, int],
        principal_point: tuple[float, float] | None = None,
    ) -> Camera:
        """The camera of a given horizontal field of view, with square pixels.

        Parameters
        ----------
        horizontal_degrees : float
            Angle between the left and the right edge of the image, in (0, 180) degrees.
        image_shape : (int, int)
            (height, width) in pixels.
        principal_point : (float, float), optional
            As for `Camera`.

        Returns
        -------
        Camera
            focal_length = (width / 2) / tan(angle / 2).

        Raises
        ------
        CameraError
            When the angle or the principal point is impossible.
        InputError
            When `image_shape` is not an image's.
        """
        _, width = _image_shape(image_shape)
        angle = finite_numbers(horizontal_degrees)
        if angle is None or len(angle) != 1 or not 0 < angle[0] < 180:
            raise CameraError(
                f"A horizontal field of view of {brief(horizontal_degrees)} degrees is impossible: give an angle "
                "between 0 and 180. Common cameras have 30 to 80."
            )
        # The least tangent only keeps the quotient a number; so long a focal length is refused.
        return cls(width / 2 / max(math.tan(math.radians(angle[0]) / 2), _LEAST_TANGENT), principal_point)

    @classmethod
    def from_exif(cls, path: FilePath) -> Camera:
        """The camera that a photo's EXIF data describe, with the principal point in the middle.

        The 35 mm equivalent focal length is used where there is one; it is an equivalence of *diagonals*
        (CIPA DCG-001): f = FocalLengthIn35mmFilm · (diagonal in pixels) / 43.27 mm. It is a whole number of
        millimetres, so expect an error of 1 or 2 %. Otherwise
        f = FocalLength · FocalPlaneXResolution, corrected where the photo was resized since. Pixels are taken
        as square, so that the camera fits the photo held either way, and the array that `read_image` returns.

        Parameters
        ----------
        path : path
            A PNG, JPEG or TIFF file.

        Returns
        -------
        Camera

        Raises
        ------
        CameraError
            When the EXIF data do not give the focal length, the photo was cropped since, or it is a BigTIFF file.
        InputError
            When the file cannot be read.
        """
        return cls(exif_focal_length(path)[0])

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Camera:
        """The camera of a 3×3 calibration matrix [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].

        Parameters
        ----------
        matrix : array_like, shape (3, 3)
            In pixels, as OpenCV and others give it: pixels centred on integers.

        Returns
        -------
        Camera

        Raises
        ------
        CameraError
            When the matrix is not of this form: wrong shape, not finite, focal lengths not above 0, a skew of
            more than a millionth of the focal length, or another last row.
        """
        try:
            k = as_array("matrix", matrix)
        except InputError:
            k = np.empty(0)
        if k.shape != (3, 3) or k.dtype.kind not in "iuf" or not np.isfinite(k).all():
            raise CameraError(f"The camera matrix {brief(matrix)} is impossible: give 3×3 finite numbers.")
        if not np.allclose(k[2], (0, 0, 1), rtol=0, atol=1e-6):
            raise CameraError(f"The camera matrix ends in {k[2].tolist()}, not in [0, 0, 1]: divide it by K[2, 2].")
        if max(abs(k[0, 1]), abs(k[1, 0])) > 1e-6 * abs(k[0, 0]):
            raise CameraError(
                f"The camera matrix has skew: K[0, 1] = {k[0, 1]:g} and K[1, 0] = {k[1, 0]:g} must be 0. "
                "Undistort or rectify the photo first."
            )
        return cls((k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]))


def exif_focal_length(path: FilePath) -> tuple[float, str]:
    """The focal length that a photo's EXIF data describe, and by which of their tags.

    Parameters, errors and meaning are those of :meth:`Camera.from_exif`.

    Returns
    -------
    focal_length : float
        In pixels.
    tags : str
        Their names.
    """
    size, tags = _read_exif(path)
    width, height = _positive(tags, "ExifImageWidth"), _positive(tags, "ExifImageHeight")
    resized = 1.0
    if width and height:
        # Long and short side, because a photo may have been turned upright since.
        resized, resized_short = max(size) / max(width, height), min(size) / min(width, height)
        rounding = 1 / min(size)
        if abs(resized / resized_short - 1) > 0.01 + rounding:
            raise CameraError(
                f"{path} has {size[0]}×{size[1]} pixels but was taken with {width:g}×{height:g}: it was "
                f"cropped since, and its EXIF data no longer hold. {_TELL}"
            )
    film = _positive(tags, "FocalLengthIn35mmFilm")
    if film:
        return film * math.hypot(*size) / _FILM_DIAGONAL, "FocalLengthIn35mmFilm"
    length = _positive(tags, "FocalLength")
    resolution = _positive(tags, "FocalPlaneXResolution")
    unit = _RESOLUTION_UNITS.get(tags.get("FocalPlaneResolutionUnit", 2))
    if length and resolution and unit:
        return length * resolution / unit * resized, "FocalLength and FocalPlaneXResolution"
    missing = "FocalLengthIn35mmFilm"
    if not length:
        missing += " and FocalLength"
    elif not resolution:
        missing += " and FocalPlaneXResolution (the size of the sensor)"
    else:
        missing += " and a usable FocalPlaneResolutionUnit"
    raise CameraError(f"The EXIF data of {path} lack {missing}: the focal length in pixels is unknown. {_TELL}")


def _in_brackets(one: float, other: float) -> str:
    return f"({one:.10g}, {other:.10g})"


def _image_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    sizes = finite_numbers(shape)
    if sizes is None or len(sizes) != 2 or min(sizes) < 1 or any(size % 1 for size in sizes):
        raise InputError(f"Image shape {brief(shape)} is impossible: give (height, width) in whole pixels.")
    return int(sizes[0]), int(sizes[1])


def _read_exif(path: FilePath) -> tuple[tuple[int, int], Mapping[str, Any]]:
    """Size in pixels, one side and the other, and the EXIF tags by name."""
    from PIL import ExifTags, Image

    data = read_bytes(path)
    if data.startswith(_BIG_TIFF_SIGNATURES):
        raise CameraError(f"{path} is a BigTIFF file, whose EXIF data are not read. {_TELL}")
    try:
        if data[:2] in (b"II", b"MM"):
            # Read as bare tags: Pillow cannot open TIFF images of floats.
            exif = Image.Exif()
            exif.load_from_fp(io.BytesIO(data))
            size = exif[ExifTags.Base.ImageWidth], exif[ExifTags.Base.ImageLength]
        else:
            with open_png_or_jpeg(path, data) as photo:
                exif, size = photo.getexif(), photo.size
        tags = {**exif, **exif.get_ifd(ExifTags.IFD.Exif)}
    except InputError:
        raise
    except Exception as error:  # whatever a decoder raises at broken data
        raise InputError(
            f"{path} cannot be read as a PNG, JPEG or TIFF photo ({error}): convert or copy it again."
        ) from error
    return size, {ExifTags.TAGS.get(tag, str(tag)): value for tag, value in tags.items()}


def _positive(tags: Mapping[str, Any], name: str) -> float | None:
    """The tag as a number above 0; None when it is absent, or 0 or 0/0, which EXIF writes for unknown."""
    try:
        value = float(tags[name])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) and value > 0 else None
