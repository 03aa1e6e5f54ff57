"""What COLMAP writes as text: `cameras.txt`, `images.txt` and `points3D.txt`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.calibrations import Calibrated
from persfs_cl.io.files import read_lines

_MODELS: dict[str, tuple[int, tuple[int, ...], bool]] = {
    "SIMPLE_PINHOLE": (1, (), False),
    "PINHOLE": (2, (), False),
    "SIMPLE_RADIAL": (1, (0,), False),
    "RADIAL": (1, (0, 1), False),
    "OPENCV": (2, (0, 1, 2, 3), False),
    "FULL_OPENCV": (2, (0, 1, 2, 3, 4, 5, 6, 7), False),
    "SIMPLE_RADIAL_FISHEYE": (1, (0,), True),
    "RADIAL_FISHEYE": (1, (0, 1), True),
    "OPENCV_FISHEYE": (2, (0, 1, 2, 3), True),
}
"""Of a model that OpenCV has too: focal lengths, the places of its coefficients among OpenCV's, and whether they are a
fisheye's."""


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
        if identity in cameras:
            raise InputError(f"{path}, line {number}, is the second with camera {identity}: leave one of them out.")
        if model not in _MODELS:
            cameras[identity] = ColmapCamera(number, model, (height, width))
            continue
        lengths, places, fisheye = _MODELS[model]
        if len(numbers) != lengths + 2 + len(places):
            raise _odd(path, number, line, f"{lengths + 2 + len(places)} parameters for {model}")
        length = numbers[0] if lengths == 1 else (numbers[0], numbers[1])
        column, row, *coefficients = numbers[lengths:]
        distortion = dict(zip(places, coefficients, strict=True))
        # As many as OpenCV has at least.
        given = tuple(distortion.get(place, 0.0) for place in range(max(4, len(places)))) if places else ()
        # Pixels are centred on integers here, and on halves there.
        camera = Calibrated(length, (column - 0.5, row - 0.5), given, fisheye, (height, width))
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


def read_colmap_points(path: Path, photo: Path) -> Array:
    """The points of a `points3D.txt` that an image sees, by the `images.txt` beside it.

    Parameters
    ----------
    path : Path
        Of the points.
    photo : Path
        The image, whose name in `images.txt` is the end of its path.

    Returns
    -------
    ndarray of float64, shape (points, 3)
        Column and row where the image sees each, pixels centred on integers, and its depth along the optical axis.

    Raises
    ------
    InputError
        When a file cannot be read, there is no such image, or it sees no point.
    """
    images = path.with_name("images.txt")
    pose, seen = _pose_and_observations(images, photo)
    places = {}
    for number, line in read_lines(path):
        if not line or line.startswith("#"):
            continue
        fields = line.split(maxsplit=4)
        try:
            identity = int(fields[0])
            if identity in seen:
                places[identity] = [float(field) for field in fields[1:4]]
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "POINT3D_ID X Y Z R G B ERROR TRACK") from error
    both = [identity for identity in seen if identity in places]
    if not both:
        raise InputError(
            f"{path} has none of the {len(seen)} points that {photo.name} sees by {images}: see that both are of one "
            "model."
        )
    w, x, y, z, *shift = pose
    forward = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    depths = np.array([places[identity] for identity in both]) @ forward + shift[2]
    found = np.column_stack([np.array([seen[identity] for identity in both]) - 0.5, depths])
    return found[found[:, 2] > 0.0]


def _pose_and_observations(path: Path, photo: Path) -> tuple[list[float], dict[int, tuple[float, float]]]:
    """Rotation, as a unit quaternion, and shift of an image, and where it sees which points."""
    pose: list[float] | None = None
    points = False
    for number, line in read_lines(path):
        if points:
            if pose is not None:
                return pose, _observations(path, number, line)
            points = False
            continue
        if not line or line.startswith("#"):
            continue
        fields = line.split(maxsplit=9)
        try:
            name = fields[9]
            if photo.as_posix().endswith(f"/{name}") or photo.as_posix() == name:
                quaternion = np.array([float(field) for field in fields[1:5]])
                pose = [*(quaternion / np.linalg.norm(quaternion)), *(float(field) for field in fields[5:8])]
        except (ValueError, IndexError) as error:
            raise _odd(path, number, line, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME") from error
        points = True
    raise InputError(f"{path} has no image {photo.name}, or none of its points: name it as COLMAP does.")


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
