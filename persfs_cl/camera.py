"""The pinhole camera and its normalised pixel grid."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.checks import as_array, finite_numbers, warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.decoding import decoding
from persfs_cl.io.files import FilePath, read_bytes
from persfs_cl.io.photos import exif_number, open_png_or_jpeg
from persfs_cl.io.raw import refuse_raw
from persfs_cl.io.tiff import BIG_SIGNATURES, IMAGE_LENGTH, IMAGE_WIDTH, SIGNATURES, Directory, read_directories
from persfs_cl.wording import brief, keyword

# The frame of 35 mm film is 36 mm × 24 mm.
_FILM_DIAGONAL = math.hypot(36.0, 24.0)
# EXIF's FocalPlaneResolutionUnit, in millimetres. 2 and 3 are in the standard, 4 and 5 in use beside it.
_RESOLUTION_UNITS = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
# Millimetres: the longer side of the sensor of a simple telephone and of a medium-format camera, with room.
_SENSORS = (3.0, 60.0)
# Degrees: of a telescope, and of the widest lens that draws straight lines straight.
_VIEWS = (1.0, 150.0)
# The 35 mm equivalent is rounded to whole millimetres, and makers differ in what they hold to be equivalent.
_AGREEMENT = 1.1
# Pixels, of which no camera that writes FocalPlaneXResolution makes so few.
_SMALL = 1_000_000
_EDITORS = re.compile(
    r"photoshop|lightroom|gimp|paint\.?net|affinity|irfanview|imagemagick|graphicsmagick|darktable|rawtherapee|"
    r"capture one|acdsee|picasa|snapseed|paint ?shop|pixelmator|corel|digikam|gthumb|shotwell|xnview|faststone|luminar|"
    r"dxo|photolab|\bon1\b|photoscape|krita|imageready|photo editor|photos? \d|windows photo|preview|iphoto|aperture|"
    r"photo gallery|zoner|polarr|vsco|canva|pixlr|adobe|ffmpeg|nikon transfer|capture nx|viewnx|digital photo prof",
    re.IGNORECASE,
)
_TELL = f"Give {keyword('focal_length')}, in pixels."
_WIDEST_DEGREES = 85.0
_WIDEST = math.tan(math.radians(_WIDEST_DEGREES))
_LEAST_TANGENT = 1e-100


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
            raise CameraError.about(
                "focal_length",
                self.focal_length,
                "is impossible: give one number of pixels between 0.001 and 1e9, or two, (fx, fy).",
            )
        object.__setattr__(self, "focal_length", lengths if len(lengths) == 2 else lengths[0])
        if self.principal_point is not None:
            point = finite_numbers(self.principal_point)
            if point is None or len(point) != 2:
                raise CameraError.about(
                    "principal_point",
                    self.principal_point,
                    "is impossible: give two finite numbers of pixels, (column, row), or leave it out for the middle "
                    "of the image.",
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
                f"{_pair('focal_length', self.fx, self.fy)} and {_pair('principal_point', cx, cy)} put a corner of an "
                f"image of shape {_in_brackets(height, width)} at {math.degrees(math.atan(farthest)):.4g} degrees from "
                f"the optical axis, and no lens draws more than {_WIDEST_DEGREES:g}: all are in pixels of this very "
                "image, not in millimetres; was it resized after the camera was calibrated?",
                argument="focal_length" if self.principal_point is None else "principal_point",
                value=self.focal_length if self.principal_point is None else self.principal_point,
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
                f"{_pair('principal_point', cx, cy)} lies outside the image of shape {shape}: right for a part "
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
                "between 0 and 180. Common cameras have 30 to 80.",
                argument="horizontal_degrees",
                value=horizontal_degrees,
            )
        # The least tangent only keeps the quotient a number; so long a focal length is refused.
        return cls(width / 2 / max(math.tan(math.radians(angle[0]) / 2), _LEAST_TANGENT), principal_point)

    @classmethod
    def from_exif(cls, path: FilePath) -> Camera:
        """The camera that a photo's EXIF data describe, with the principal point in the middle.

        The 35 mm equivalent focal length is used where there is one; it is an equivalence of *diagonals*
        (CIPA DCG-001): f = FocalLengthIn35mmFilm · (diagonal in pixels) / 43.27 mm. It is a whole number of
        millimetres, so expect an error of 1 or 2 %. Otherwise
        f = FocalLength · FocalPlaneXResolution · (width in pixels) / ExifImageWidth, which corrects for a photo that
        was resized since. Pixels are taken as square, so that the camera fits the photo held either way, and the
        array that `read_image` returns.

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
            When the EXIF data do not give the focal length, or only without the size that the photo had when it was
            taken; when they make the sensor narrower than 3 or wider than 60 mm, or the view narrower than 1° or
            wider than 150°; when the photo was cropped since, or it is a BigTIFF file.
        InputError
            When the file cannot be read.

        Warns
        -----
        UserWarning
            When FocalPlaneXResolution is used and an editor may have resized the photo without mending it: the photo
            is small, or names an editor. When the two ways differ by more than a tenth.
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
            raise CameraError(
                f"The camera matrix {brief(matrix)} is impossible: give 3×3 finite numbers.",
                argument="matrix",
                value=matrix,
            )
        if not np.allclose(k[2], (0, 0, 1), rtol=0, atol=1e-6):
            raise CameraError(f"The camera matrix ends in {k[2].tolist()}, not in [0, 0, 1]: divide it by K[2, 2].")
        if max(abs(k[0, 1]), abs(k[1, 0])) > 1e-6 * abs(k[0, 0]):
            raise CameraError(
                f"The camera matrix has skew: K[0, 1] = {k[0, 1]:g} and K[1, 0] = {k[1, 0]:g} must be 0. "
                "Undistort or rectify the photo first."
            )
        return cls((k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]))


def require_camera(given: object) -> None:
    """Refuse what is given for a camera and is none.

    Raises
    ------
    InputError
        Naming it.
    """
    if not isinstance(given, Camera):
        raise InputError.about("camera", given, "is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")


def exif_focal_length(path: FilePath) -> tuple[float, str]:
    """The focal length that a photo's EXIF data describe, and by which of their tags.

    Parameters, errors, warnings and meaning are those of :meth:`Camera.from_exif`.

    Returns
    -------
    focal_length : float
        In pixels.
    tags : str
        Their names.
    """
    size, tags = _read_exif(path)
    taken = _size_when_taken(path, size, tags)
    film, length = _positive(tags, "FocalLengthIn35mmFilm"), _positive(tags, "FocalLength")
    resolution = _positive(tags, "FocalPlaneXResolution")
    unit = _RESOLUTION_UNITS.get(int(exif_number(tags.get("FocalPlaneResolutionUnit", 2)) or 0))
    by_sensor = None
    if length and resolution and unit and taken:
        by_sensor = length * resolution / unit * max(size) / max(taken)
    if film:
        by_film = film * math.hypot(*size) / _FILM_DIAGONAL
        _require_view(path, f"FocalLengthIn35mmFilm = {film:g}", by_film, size)
        if by_sensor and abs(math.log(by_sensor / by_film)) > math.log(_AGREEMENT):
            warn(
                f"The EXIF data of {path} disagree: by FocalLengthIn35mmFilm the focal length is {by_film:.5g} pixels, "
                f"by FocalLength and FocalPlaneXResolution {by_sensor:.5g}. The first is taken. If the photo was "
                f"resized or cropped, give {keyword('focal_length')}, in pixels.",
            )
        return by_film, "FocalLengthIn35mmFilm"
    if not tags:
        raise CameraError(f"{path} has no EXIF data: the focal length in pixels is unknown. {_TELL}")
    if not (length and resolution and unit):
        missing = "FocalLengthIn35mmFilm"
        if not length:
            missing += " and FocalLength"
        elif not resolution:
            missing += " and FocalPlaneXResolution (the size of the sensor)"
        else:
            missing += " and a usable FocalPlaneResolutionUnit"
        raise CameraError(f"The EXIF data of {path} lack {missing}: the focal length in pixels is unknown. {_TELL}")
    if not (taken and by_sensor):
        raise CameraError(
            f"The EXIF data of {path} lack FocalLengthIn35mmFilm and a usable ExifImageWidth and ExifImageHeight: "
            "whether the photo was resized since FocalPlaneXResolution was written is unknown, and so is the focal "
            f"length in pixels. {_TELL}"
        )
    sensor = max(taken) / resolution * unit
    what = f"FocalPlaneXResolution with ExifImageWidth and ExifImageHeight, {taken[0]:g} × {taken[1]:g},"
    if not _SENSORS[0] <= sensor <= _SENSORS[1]:
        raise CameraError(
            f"By {what} the sensor of {path} is {sensor:.3g} mm wide behind a lens of {length:g} mm, and none is under "
            f"{_SENSORS[0]:g} or over {_SENSORS[1]:g} mm: the photo was resized since, or the EXIF data are wrong. "
            f"{_TELL}"
        )
    view = _require_view(path, "FocalLength and FocalPlaneXResolution", by_sensor, size)
    doubt = _editor(tags)
    if not doubt and size[0] * size[1] < _SMALL and sorted(taken) == sorted(size):
        doubt = f"the photo is as small as its EXIF data say, {size[0]} × {size[1]} pixels"
    if doubt:
        warn(
            f"By {what} the sensor of {path} is {sensor:.2g} mm wide behind a lens of {length:g} mm, a view of "
            f"{view:.1f}° along the longer side; but {doubt}, so that an editor may have resized it without mending "
            f"FocalPlaneXResolution. Check these numbers, or give {keyword('focal_length')}, in pixels.",
        )
    return by_sensor, "FocalLength and FocalPlaneXResolution"


def _size_when_taken(path: FilePath, size: tuple[int, int], tags: Mapping[str, Any]) -> tuple[float, float] | None:
    """The size that the EXIF data give the photo, or None; one of another shape than the file's is refused."""
    width, height = _positive(tags, "ExifImageWidth"), _positive(tags, "ExifImageHeight")
    if not (width and height):
        return None
    # Long and short side, because a photo may have been turned upright since.
    resized, resized_short = max(size) / max(width, height), min(size) / min(width, height)
    rounding = 1 / min(size)
    if abs(resized / resized_short - 1) > 0.01 + rounding:
        raise CameraError(
            f"{path} has {size[0]}×{size[1]} pixels but was taken with {width:g}×{height:g}: it was "
            f"cropped since, and its EXIF data no longer hold. {_TELL}"
        )
    return width, height


def _require_view(path: FilePath, tags: str, focal_length: float, size: tuple[int, int]) -> float:
    """The angle of view along the longer side, in degrees; refused where no lens that draws straight lines has it."""
    view = 2 * math.degrees(math.atan(max(size) / 2 / focal_length))
    if not _VIEWS[0] <= view <= _VIEWS[1]:
        raise CameraError(
            f"By {tags} {path} has a view of {view:.3g}° along its longer side, and none is under {_VIEWS[0]:g}° or "
            f"over {_VIEWS[1]:g}°: the EXIF data are wrong. {_TELL}"
        )
    return view


def _editor(tags: Mapping[str, Any]) -> str:
    """What says that an editor saved the photo; nothing where nothing does."""
    for name in ("Software", "ProcessingSoftware"):
        value = tags.get(name)
        text = value.decode("latin-1") if isinstance(value, bytes) else str(value or "")
        if _EDITORS.search(text):
            return f"{name} says {' '.join(text.split())[:60]!r}"
    return ""


def _pair(name: str, one: float, other: float) -> str:
    return keyword(name, (one, other), written=_in_brackets(one, other))


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
    with decoding(path, "cannot be read as a PNG, JPEG or TIFF photo"):
        if data.startswith(SIGNATURES):
            pages = read_directories(path, data)
            refuse_raw(path, data, pages)
            if data.startswith(BIG_SIGNATURES):
                # Pillow reads tags at 32-bit offsets only.
                raise CameraError(f"{path} is a BigTIFF file, whose EXIF data are not read. {_TELL}")
            # Read as bare tags: Pillow cannot open TIFF images of floats.
            exif = Image.Exif()
            exif.load_from_fp(io.BytesIO(data))
            whole = next((page for page in pages if not page.reduced), Directory({}))
            size = whole.number(IMAGE_WIDTH), whole.number(IMAGE_LENGTH)
            if min(size) < 1:
                raise InputError(f"{path} is broken: it does not say its width and height. Save or copy it again.")
        else:
            with open_png_or_jpeg(path, data) as photo:
                exif, size = photo.getexif(), photo.size
                _refuse_loops(path, photo.info.get("exif"))
        tags = {**exif, **exif.get_ifd(ExifTags.IFD.Exif)}
    return size, {ExifTags.TAGS.get(tag, str(tag)): value for tag, value in tags.items()}


def _refuse_loops(path: FilePath, exif: object) -> None:
    """Refuse EXIF data of a PNG or JPEG file whose directories lead back to themselves."""
    if isinstance(exif, bytes):
        inside = exif.removeprefix(b"Exif\0\0")
        if inside.startswith(SIGNATURES):
            read_directories(path, inside)


def _positive(tags: Mapping[str, Any], name: str) -> float | None:
    """The tag as a number above 0; None when it is absent, or 0 or 0/0, which EXIF writes for unknown."""
    value = exif_number(tags.get(name))
    return value if value is not None and value > 0 else None
