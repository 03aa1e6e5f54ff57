"""The camera with the distortion of its lens: one value, most of whose lines say how to use it and where to get it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.checks import as_array, finite_numbers, warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.io.calibrations import Calibrated
from persfs_cl.io.cameras import read_camera
from persfs_cl.io.exif import exif_focal_length
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.lens.distortion import Distortion, as_distortion, distorted, distortion_of, undistorted
from persfs_cl.wording import brief, keyword

_WIDEST_DEGREES = 85.0
_WIDEST = math.tan(math.radians(_WIDEST_DEGREES))
_LEAST_TANGENT = 1e-100
COMMON_VIEWS = "Common cameras have 30 to 80."
"""What an error about a field of view, in degrees, ends with."""


@dataclass(frozen=True)
class Camera:
    """A camera. Pixels are centred on integers.

    Parameters
    ----------
    focal_length : float or (float, float)
        In pixels, above 0; two values are (fx, fy).
    principal_point : (float, float), optional
        Where the optical axis meets the image: (cx, cy), column and row in pixels; a part that was cut out of a
        photograph keeps its axis, which may lie outside. Left out, it is the middle of the image,
        ((width - 1) / 2, (height - 1) / 2).
    distortion : sequence of float, Fisheye, FieldOfView or RadTanFisheye, optional
        How the lens bends straight lines: OpenCV's coefficients k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, τx,
        τy]]]], or a lens of another model. :func:`persfs_cl.reconstruct` straightens the image and all that goes with
        it, see :func:`persfs_cl.undistort`. Left out, or all 0, it is a pinhole camera.

    Raises
    ------
    CameraError
        When a focal length is not a number between 0.001 and 1e9, the principal point is not two finite numbers, or the
        distortion is none.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> camera = ps.Camera(focal_length=590.0, principal_point=(270, 270))
    >>> camera.fx, camera.fy, camera.principal_point
    (590.0, 590.0, (270.0, 270.0))
    """

    focal_length: float | tuple[float, float]
    principal_point: tuple[float, float] | None = None
    distortion: Distortion | None = None

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
        object.__setattr__(self, "distortion", as_distortion(self.distortion))

    def __repr__(self) -> str:
        bent = "" if self.distortion is None else f", distortion={self.distortion}"
        return f"Camera(focal_length={self.focal_length}, principal_point={self.principal_point}{bent})"

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
            When the ray of a pixel lies more than 85 degrees from the optical axis, or the lens has a distortion.
        InputError
            When `shape` is not an image's.

        Examples
        --------
        In a view of 90 degrees the edges of the image lie at x = ±1, half a pixel beyond the outermost centres:

        >>> import persfs_cl as ps
        >>> grid = ps.Camera.from_fov(90.0, (3, 4)).grid((3, 4))
        >>> grid.x
        array([-0.75, -0.25,  0.25,  0.75])
        >>> grid.y.shape
        (3, 1)
        """
        height, width = _image_shape(shape)
        if self.distortion is not None:
            raise CameraError.about(
                "distortion",
                self.distortion,
                "makes pixels that lie on no straight lines: give what persfs_cl.undistort makes of the image and of "
                "this camera.",
            )
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
        """Warn where the principal point lies outside an image of shape (height, width): for a crop, or by a slip.

        Examples
        --------
        >>> import warnings
        >>> import persfs_cl as ps
        >>> camera = ps.Camera(focal_length=100.0, principal_point=(500.0, 20.0))
        >>> with warnings.catch_warnings(record=True) as said:
        ...     warnings.simplefilter("always")
        ...     camera.warn_if_off_image((40, 60))
        >>> len(said)
        1
        """
        height, width = shape
        cx, cy = self.centre(shape)
        if not (-0.5 <= cx <= width - 0.5 and -0.5 <= cy <= height - 0.5):
            warn(
                f"{_pair('principal_point', cx, cy)} lies outside the image of shape {shape}: right for a part "
                "that was cut out of a photo, whose optical axis it keeps. Otherwise, it is (column, row) in pixels of "
                "this very image: was it resized after the camera was calibrated?"
            )

    def centre(self, shape: tuple[int, int]) -> tuple[float, float]:
        """The principal point in an image of shape (height, width): as given, or else the middle.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.Camera(focal_length=100.0).centre((40, 60))
        (29.5, 19.5)
        """
        height, width = shape
        return self.principal_point or ((width - 1) / 2, (height - 1) / 2)

    def pixels(self, places: Array, shape: tuple[int, int]) -> Array:
        """Where the camera draws what lies at some normalised places.

        Parameters
        ----------
        places : ndarray of float64, shape (n, 2)
            x / z and y / z of points.
        shape : (int, int)
            (height, width) of the image.

        Returns
        -------
        ndarray of float64, shape (n, 2)
            Column and row in pixels.

        Examples
        --------
        >>> import numpy as np
        >>> import persfs_cl as ps
        >>> ps.Camera(focal_length=100.0).pixels(np.array([[0.1, 0.0]]), (41, 61))
        array([[40., 20.]])
        """
        drawn = places if self.distortion is None else distorted(self.distortion, places)
        return np.asarray(drawn * (self.fx, self.fy) + self.centre(shape))

    def places(self, pixels: Array, shape: tuple[int, int]) -> Array:
        """Normalised places of what the camera draws at some pixels: the inverse of :meth:`pixels`.

        Parameters
        ----------
        pixels : ndarray of float64, shape (n, 2)
            Column and row.
        shape : (int, int)
            (height, width) of the image.

        Returns
        -------
        ndarray of float64, shape (n, 2)
            NaN where the lens draws nothing.

        Examples
        --------
        >>> import numpy as np
        >>> import persfs_cl as ps
        >>> ps.Camera(focal_length=100.0).places(np.array([[40.0, 20.0]]), (41, 61))
        array([[0.1, 0. ]])
        """
        drawn = (pixels - self.centre(shape)) / (self.fx, self.fy)
        return np.asarray(drawn if self.distortion is None else undistorted(self.distortion, drawn))

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

        Examples
        --------
        >>> import persfs_cl as ps
        >>> round(ps.Camera.from_fov(60.0, (480, 640)).fx, 3)
        554.256
        """
        _, width = _image_shape(image_shape)
        angle = finite_numbers(horizontal_degrees)
        if angle is None or len(angle) != 1 or not 0 < angle[0] < 180:
            raise CameraError(
                f"A horizontal field of view of {brief(horizontal_degrees)} degrees is impossible: give an angle "
                f"between 0 and 180. {COMMON_VIEWS}",
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
            An image of any format that `read_photo` reads.

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

        Examples
        --------
        A photo taken as with a 26 mm lens on 35 mm film:

        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> from PIL import ExifTags, Image
        >>> import persfs_cl as ps
        >>> exif = Image.Exif()
        >>> exif.get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.FocalLengthIn35mmFilm] = 26
        >>> with TemporaryDirectory() as folder:
        ...     path = Path(folder) / "photo.jpg"
        ...     Image.new("L", (400, 300)).save(path, exif=exif)
        ...     camera = ps.Camera.from_exif(path)
        >>> round(camera.fx, 1)
        300.5
        """
        try:
            length, _ = exif_focal_length(path)
        except CameraError as error:
            raise error.adding(
                f"Or have it from the horizontal field of view, by Camera.from_fov(degrees, shape). {COMMON_VIEWS}"
            ) from error
        return cls(length)

    @classmethod
    def from_file(cls, path: FilePath) -> Camera:
        """The camera that a file describes.

        Parameters
        ----------
        path : path
            `.yaml`, `.yml` or `.json` with `camera_matrix` and `distortion_coefficients`, as OpenCV's calibration and
            ROS write them (`distortion_model` or `fisheye_model` tell a fisheye), or the `camera.json` that comes with
            results. Or COLMAP's `cameras.txt` with one camera, of any of its models but FOV.

        Returns
        -------
        Camera

        Raises
        ------
        InputError
            When it cannot be read, or holds no camera, or several.
        CameraError
            When it holds an impossible camera, or a lens model that is not known; when PyYAML, which
            reads YAML, is not installed.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import persfs_cl as ps
        >>> with TemporaryDirectory() as folder:
        ...     path = Path(folder) / "cameras.txt"
        ...     _ = path.write_text("1 SIMPLE_RADIAL 640 480 590.0 320.0 240.0 -0.12")
        ...     camera = ps.Camera.from_file(path)
        >>> camera.principal_point, camera.distortion
        ((319.5, 239.5), (-0.12, 0.0, 0.0, 0.0))
        """
        return camera_from(path, read_camera(as_path(path)))

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

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.Camera.from_matrix([[590.0, 0.0, 320.0], [0.0, 588.0, 240.0], [0.0, 0.0, 1.0]])
        Camera(focal_length=(590.0, 588.0), principal_point=(320.0, 240.0))
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


def camera_from(path: FilePath, calibrated: Calibrated) -> Camera:
    """The camera that a file describes.

    Raises
    ------
    CameraError
        When it is impossible, naming the file.
    """
    try:
        distortion = distortion_of(calibrated.model, calibrated.distortion)
        return Camera(calibrated.focal_length, calibrated.principal_point, distortion)
    except CameraError as error:
        raise error.at(str(path)) from error


def require_camera(given: object) -> None:
    """Refuse what is given for a camera and is none.

    Raises
    ------
    InputError
        Naming it.
    """
    if not isinstance(given, Camera):
        raise InputError.about("camera", given, "is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")


def _pair(name: str, one: float, other: float) -> str:
    return keyword(name, (one, other), written=_in_brackets(one, other))


def _in_brackets(one: float, other: float) -> str:
    return f"({one:.10g}, {other:.10g})"


def _image_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    sizes = finite_numbers(shape)
    if sizes is None or len(sizes) != 2 or min(sizes) < 1 or any(size % 1 for size in sizes):
        raise InputError(f"Image shape {brief(shape)} is impossible: give (height, width) in whole pixels.")
    return int(sizes[0]), int(sizes[1])
