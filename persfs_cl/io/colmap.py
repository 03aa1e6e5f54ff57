"""Cameras and images as COLMAP writes them in text: `cameras.txt` and `images.txt`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from persfs_cl.errors import InputError
from persfs_cl.io.files import read_lines

_PINHOLES = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4}
"""Models without distortion, and how many parameters they have."""


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
    focal_length : float, (float, float) or None
        In pixels; None for a model with distortion.
    principal_point : (float, float) or None
        Column and row with pixels centred on integers, as here, and not on halves, as there.
    """

    line: int
    model: str
    size: tuple[int, int]
    focal_length: float | tuple[float, float] | None = None
    principal_point: tuple[float, float] | None = None


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
        if model not in _PINHOLES:
            cameras[identity] = ColmapCamera(number, model, (height, width))
            continue
        if len(numbers) != _PINHOLES[model]:
            raise _odd(path, number, line, f"{_PINHOLES[model]} parameters for {model}")
        *lengths, column, row = numbers
        length = (lengths[0], lengths[1]) if len(lengths) == 2 else lengths[0]
        cameras[identity] = ColmapCamera(number, model, (height, width), length, (column - 0.5, row - 0.5))
    if not cameras:
        raise InputError(f"{path} has no camera: give the cameras.txt that COLMAP wrote.")
    return cameras


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


def _odd(path: Path, number: int, line: str, expected: str) -> InputError:
    shown = line if len(line) <= 60 else f"{line[:60]}…"
    return InputError(f"{path}, line {number}, is {shown!r}: COLMAP writes {expected} there.")
