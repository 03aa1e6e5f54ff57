"""What COLMAP writes as text: `cameras.txt`, `images.txt` and `points3D.txt`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.calibrations import Calibrated
from persfs_cl.io.files import read_lines
from persfs_cl.io.maps import lies_on_a_side
from persfs_cl.io.raster import upright_places

_MODELS: dict[str, tuple[int, tuple[int, ...], str]] = {
    "SIMPLE_PINHOLE": (1, (), "opencv"),
    "PINHOLE": (2, (), "opencv"),
    "SIMPLE_RADIAL": (1, (0,), "opencv"),
    "RADIAL": (1, (0, 1), "opencv"),
    "OPENCV": (2, (0, 1, 2, 3), "opencv"),
    "FULL_OPENCV": (2, (0, 1, 2, 3, 4, 5, 6, 7), "opencv"),
    "SIMPLE_FISHEYE": (1, (), "fisheye"),
    "FISHEYE": (2, (), "fisheye"),
    "SIMPLE_RADIAL_FISHEYE": (1, (0,), "fisheye"),
    "RADIAL_FISHEYE": (1, (0, 1), "fisheye"),
    "OPENCV_FISHEYE": (2, (0, 1, 2, 3), "fisheye"),
    "THIN_PRISM_FISHEYE": (2, (0, 1, 4, 5, 2, 3, 6, 7), "fisheye"),
    "RAD_TAN_THIN_PRISM_FISHEYE": (2, tuple(range(12)), "rad_tan_thin_prism_fisheye"),
    "FOV": (2, (0,), "fov"),
}
"""Of a model: focal lengths, the places of its coefficients among those of a lens, and what this is called here."""
_LEAST = {"opencv": 4, "fisheye": 4}
"""Coefficients that a lens has at least, where any is given."""
_STRETCHED = 0.01
"""Logarithm of a ratio that an image may be longer along one side, where sides are not rounded."""


@dataclass(frozen=True)
class ColmapCamera:
    """A line of `cameras.txt`.

    Attributes
    ----------
    line : int
        Its number.
    model : str
    size : (int, int)
        (height, width) of its images.
    camera : Calibrated or None
        None for a model that is not known here.
    """

    line: int
    model: str
    size: tuple[int, int]
    camera: Calibrated | None = None


def read_colmap_cameras(path: Path) -> dict[int, ColmapCamera]:
    """The cameras of a `cameras.txt`, by their numbers.

    Raises
    ------
    InputError
        When it cannot be read; names the line.
    """
    cameras: dict[int, ColmapCamera] = {}
    for number, line in read_lines(path):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        try:
            identity, model, width, height = int(fields[0]), fields[1], int(fields[2]), int(fields[3])
            numbers = tuple(map(float, fields[4:]))
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS") from error
        if min(width, height) < 1:
            raise InputError(
                f"{path}, line {number}, has images of {width} x {height} pixels: give the width and height that "
                "COLMAP wrote, both 1 at least."
            )
        if identity in cameras:
            raise InputError(f"{path}, line {number}, is the second with camera {identity}: leave one of them out.")
        if model not in _MODELS:
            cameras[identity] = ColmapCamera(number, model, (height, width))
            continue
        lengths, places, lens = _MODELS[model]
        if len(numbers) != lengths + 2 + len(places):
            raise _odd(path, number, line, f"{lengths + 2 + len(places)} parameters for {model}")
        length = numbers[0] if lengths == 1 else (numbers[0], numbers[1])
        column, row, *coefficients = numbers[lengths:]
        distortion = dict(zip(places, coefficients, strict=True))
        count = max(_LEAST.get(lens, 0), len(places)) if places else 0
        given = tuple(distortion.get(place, 0.0) for place in range(count))
        # Pixels are centred on integers here, and on halves there.
        camera = Calibrated(length, (column - 0.5, row - 0.5), given, lens, (height, width))
        cameras[identity] = ColmapCamera(number, model, (height, width), camera)
    if not cameras:
        raise InputError(f"{path} has no camera: give the cameras.txt that COLMAP wrote.")
    return cameras


def unknown_model(path: Path, camera: ColmapCamera) -> str:
    """Why a camera cannot be used, and what to do."""
    return (
        f"{path}, line {camera.line}, has the camera model {camera.model}, and known are {', '.join(_MODELS)}: "
        "undistort the photos first, by colmap image_undistorter, and give the cameras that it writes."
    )


def read_colmap_images(path: Path) -> Iterator[tuple[int, str, int]]:
    """The images of an `images.txt`: line, name, and number of the camera.

    Raises
    ------
    InputError
        When it cannot be read; names the line.
    """
    points = False
    for number, line in read_lines(path):
        if points:
            # The points of the image before, perhaps none; millions in some files.
            points = False
            continue
        if not line or line.startswith("#"):
            continue
        fields = line.split(maxsplit=9)
        try:
            camera, name = int(fields[8]), fields[9]
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME") from error
        points = True
        yield number, name, camera


def read_colmap_points(path: Path, photo: Path, shape: tuple[int, int], *, orientation: int = 1) -> Array:
    """The points of a `points3D.txt` that an image sees, by the `images.txt` beside it.

    COLMAP may have seen the photo in another size, and as it lies in its file: `cameras.txt`, if there is one beside
    them, has the size, and what it saw is scaled, and turned as EXIF turned the photo. Without it, COLMAP has seen the
    photo as it is read.

    Parameters
    ----------
    path : Path
        Of the points.
    photo : Path
        The image, whose name in `images.txt` is the end of its path.
    shape : (int, int)
        (height, width) of the photo as it is read.
    orientation : int
        `Photo.orientation` of it.

    Returns
    -------
    ndarray of float64, shape (points, 3)
        Column and row where the photo sees each, pixels centred on integers, and its depth along the optical axis.

    Raises
    ------
    InputError
        When a file cannot be read, there is no such image, or more than one, or it sees no point; when the image that
        COLMAP saw has another ratio of sides.

    Warns
    -----
    UserWarning
        When EXIF turned the photo, and nothing tells whether COLMAP saw it so.
    """
    images, cameras = path.with_name("images.txt"), path.with_name("cameras.txt")
    image = _image_of(images, photo)
    places = {}
    for number, line in read_lines(path):
        if not line or line.startswith("#"):
            continue
        fields = line.split(maxsplit=4)
        try:
            identity = int(fields[0])
            if identity in image.seen:
                places[identity] = [float(field) for field in fields[1:4]]
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "POINT3D_ID X Y Z R G B ERROR TRACK") from error
    both = [identity for identity in image.seen if identity in places]
    if not both:
        raise InputError(
            f"{path} has none of the {len(image.seen)} points that {photo.name} sees by {images}: see that both are of "
            "one model."
        )
    w, x, y, z, *shift = image.pose
    forward = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    depths = np.array([places[identity] for identity in both]) @ forward + shift[2]
    size = _size_of(cameras, image.camera, images) if cameras.exists() else shape
    on_photo = _on_photo(np.array([image.seen[identity] for identity in both]), size, cameras, shape, orientation)
    found = np.column_stack([on_photo - 0.5, depths])
    return found[found[:, 2] > 0.0]


@dataclass(frozen=True)
class _Image:
    """An image of `images.txt`: rotation, as a unit quaternion, and shift; its camera; and where it sees which points.

    Places are counted from the outer edges of the first pixel.
    """

    name: str
    pose: list[float]
    camera: int
    seen: dict[int, tuple[float, float]]


def _size_of(path: Path, camera: int, images: Path) -> tuple[int, int]:
    """Height and width of the images of a camera."""
    cameras = read_colmap_cameras(path)
    if camera not in cameras:
        raise InputError(f"{path} has no camera {camera}, which {images} names: see that both are of one model.")
    return cameras[camera].size


def _on_photo(places: Array, size: tuple[int, int], path: Path, shape: tuple[int, int], orientation: int) -> Array:
    """Places in an image of some size, as those in the photo as it is read."""
    if lies_on_a_side(path, size, shape, orientation):
        places, size = upright_places(places, size, orientation), size[::-1]
    scale = np.array([shape[1] / size[1], shape[0] / size[0]])
    if abs(math.log(scale[0] / scale[1])) > _STRETCHED + 1.0 / min(*size, *shape):
        raise InputError(
            f"{path} has images of {size[1]} x {size[0]} pixels, and the photo has {shape[1]} x {shape[0]}: give the "
            "one that COLMAP saw, uncropped; it may be resized."
        )
    return np.asarray(places * scale)


def _image_of(path: Path, photo: Path) -> _Image:
    """The one that a photo is."""
    found: list[_Image] = []
    points = False
    matching = False
    for number, line in read_lines(path):
        if points:
            points = False
            if matching:
                found[-1].seen.update(_observations(path, number, line))
            continue
        if not line or line.startswith("#"):
            continue
        fields = line.split(maxsplit=9)
        try:
            name = fields[9]
            matching = photo.as_posix().endswith(f"/{name}") or photo.as_posix() == name
            if matching:
                quaternion = np.array([float(field) for field in fields[1:5]])
                pose = [*(quaternion / np.linalg.norm(quaternion)), *(float(field) for field in fields[5:8])]
                found.append(_Image(name, pose, int(fields[8]), {}))
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME") from error
        points = True
    if len(found) > 1:
        names = " and ".join(image.name for image in found)
        raise InputError(f"{path} has {len(found)} images that {photo} may be, {names}: leave one of them there.")
    if not found or not found[0].seen:
        raise InputError(f"{path} has no image {photo.name}, or none of its points: name it as COLMAP does.")
    return found[0]


def _observations(path: Path, number: int, line: str) -> dict[int, tuple[float, float]]:
    fields = line.split()
    try:
        triples = zip(fields[0::3], fields[1::3], fields[2::3], strict=True)
        return {int(point): (float(column), float(row)) for column, row, point in triples if int(point) >= 0}
    except ValueError as error:
        raise _odd(path, number, line, "X Y POINT3D_ID for each point") from error


def _odd(path: Path, number: int, line: str, expected: str) -> InputError:
    shown = line if len(line) <= 60 else f"{line[:60]}…"
    return InputError(f"{path}, line {number}, is {shown!r}: COLMAP writes {expected} there.")
