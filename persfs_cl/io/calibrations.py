"""Cameras in files, as calibrations write them: OpenCV's YAML and JSON, and what resembles it, and COLMAP's cameras."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.files import FilePath, as_path, read_bytes
from persfs_cl.wording import brief

_MATRIX = ("camera_matrix", "cameraMatrix", "K", "intrinsic_matrix", "intrinsics", "camera_mat", "mtx")
_COEFFICIENTS = (
    "distortion_coefficients",
    "distortion_coeffs",
    "dist_coeffs",
    "distCoeffs",
    "distortion",
    "dist_coeff",
    "dist",
    "D",
)
_MODEL = ("distortion_model", "camera_model", "model")
_FISHEYES = ("fisheye", "equidistant", "kannala_brandt4")
_OTHERS = ("none", "pinhole", "perspective", "opencv", "plumb_bob", "radtan", "brown_conrady", "rational_polynomial")
_WIDTH, _HEIGHT, _SIZE = ("image_width", "width"), ("image_height", "height"), ("resolution", "image_size")
_LARGEST = 2**20


@dataclass(frozen=True)
class Calibrated:
    """A camera as a file has it.

    Attributes
    ----------
    focal_length : float or (float, float)
        In pixels.
    principal_point : (float, float) or None
        Column and row, with pixels centred on integers.
    distortion : tuple of float
        Coefficients in OpenCV's order; none of a pinhole camera.
    fisheye : bool
        Whether they are those of a fisheye lens.
    size : (int, int) or None
        (height, width) of its images.
    """

    focal_length: float | tuple[float, float]
    principal_point: tuple[float, float] | None = None
    distortion: tuple[float, ...] = ()
    fisheye: bool = False
    size: tuple[int, int] | None = None


def read_calibration(path: FilePath) -> Calibrated:
    """The one camera of a `.yaml`, `.yml` or `.json` file.

    Parameters
    ----------
    path : path
        `camera_matrix`, `distortion_coefficients`, `image_width` and `image_height`, as OpenCV's calibration and ROS
        write them, or other names that are in use for these; `intrinsic_matrix` column by column, as Open3D does.

    Raises
    ------
    InputError
        When it cannot be read, or holds no camera.
    CameraError
        When OpenCV, which reads YAML, is not installed; when the lens is of a model that is not known.
    """
    path = as_path(path)
    suffix = path.suffix.lower()
    if suffix == ".json":
        content = _from_json(path)
    elif suffix in (".yaml", ".yml"):
        content = _from_yaml(path)
    else:
        if not path.exists():
            raise InputError(f"{path} does not exist: check the spelling and the folder.")
        raise InputError(f"{path} is no camera by its name: give a .yaml or .json file, or COLMAP's cameras.txt.")
    return camera_of(path, content)


def camera_of(path: Path, content: Any) -> Calibrated:
    """The camera that an object of a file describes.

    Raises
    ------
    InputError, CameraError
        Naming the file.
    """
    inner = content
    while isinstance(inner, Mapping) and _first(inner, _MATRIX) is None and len(inner) == 1:
        inner = next(iter(inner.values()))  # such as cam0
    matrix = _first(inner, _MATRIX) if isinstance(inner, Mapping) else None
    if matrix is None:
        raise InputError(
            f"{path} has no camera_matrix: give a file that holds it, its distortion_coefficients, image_width and "
            "image_height, as OpenCV's calibration does."
        )
    columns = "intrinsic_matrix" in inner and not isinstance(matrix, Mapping) and not isinstance(matrix[0], Sequence)
    fx, fy, cx, cy = _pinhole(path, _numbers(path, "camera_matrix", matrix), by_columns=columns)
    model = str(_first(inner, _MODEL) or "").lower()
    told = str(inner.get("distortion_model") or inner.get("model") or model).lower()
    fisheye = told in _FISHEYES or bool(inner.get("fisheye_model"))
    if told and told not in (*_FISHEYES, *_OTHERS):
        raise CameraError(
            f"{path} has the lens model {brief(told)}, which is not known: undistort the photos with the program that "
            "calibrated it, and give the pinhole camera that it writes."
        )
    coefficients = _first(inner, _COEFFICIENTS)
    distortion = () if coefficients is None else _numbers(path, "distortion_coefficients", coefficients)
    return Calibrated((fx, fy), (cx, cy), distortion, fisheye, _size(path, inner))


def _pinhole(path: Path, numbers: tuple[float, ...], *, by_columns: bool) -> tuple[float, float, float, float]:
    if len(numbers) == 4:
        fx, fy, cx, cy = numbers
        return fx, fy, cx, cy
    if len(numbers) != 9:
        raise InputError(f"{path} has {len(numbers)} numbers for camera_matrix: give 3 × 3, or fx, fy, cx and cy.")
    if by_columns:
        numbers = tuple(numbers[3 * column + row] for row in range(3) for column in range(3))
    fx, skew, cx, other, fy, cy, *last = numbers
    if last != [0.0, 0.0, 1.0] or max(abs(skew), abs(other)) > 1e-6 * abs(fx):
        raise CameraError(
            f"{path} has the camera matrix {brief(numbers)}, with skew, or a last row that is not 0, 0, 1: give one of "
            "the form fx, 0, cx; 0, fy, cy; 0, 0, 1."
        )
    return fx, fy, cx, cy


def _size(path: Path, content: Mapping[str, Any]) -> tuple[int, int] | None:
    width, height = _first(content, _WIDTH), _first(content, _HEIGHT)
    if width is None and height is None:
        both = _first(content, _SIZE)
        if both is None:
            return None
        if not isinstance(both, Sequence) or len(both) != 2:
            raise InputError(f"{path} has the size {brief(both)}: give image_width and image_height.")
        width, height = both
    sizes = []
    for name, value in (("image_height", height), ("image_width", width)):
        whole = isinstance(value, (int, float)) and not isinstance(value, bool) and value == int(value)
        if not (whole and 1 <= value <= _LARGEST):
            raise InputError(f"{path} has {brief(value)} for {name}: give whole pixels, or leave both out.")
        sizes.append(int(value))
    return sizes[0], sizes[1]


def _first(content: Mapping[str, Any], names: Sequence[str]) -> Any:
    return next((content[name] for name in names if content.get(name) is not None), None)


def _numbers(path: Path, name: str, given: Any) -> tuple[float, ...]:
    """Numbers of a list, a list of lists, or a matrix as OpenCV writes it."""
    given = given.get("data") if isinstance(given, Mapping) else given
    found: list[float] = []
    rows = given if isinstance(given, Sequence) and not isinstance(given, str) else [None]
    for row in rows:
        for value in row if isinstance(row, Sequence) and not isinstance(row, str) else [row]:
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise InputError(f"{path} has {brief(value)} in {name}: give finite numbers.")
            found.append(float(value))
    return tuple(found)


def _from_json(path: Path) -> Any:
    try:
        return json.loads(read_bytes(path))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        where = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"{path}{where}, is no JSON ({error}): mend it, or export it again.") from error
    except RecursionError as error:
        raise InputError(f"{path} is nested too deep: give an object with a camera_matrix.") from error


def _from_yaml(path: Path) -> Any:
    data = read_bytes(path)
    try:
        import cv2
    except ImportError as error:
        raise CameraError(
            f"{path} is YAML, which OpenCV reads, and that is missing: pip install 'persfs-cl[lens]'."
        ) from error
    try:
        text = data.decode("utf-8-sig")
        # OpenCV wants its own first line, which others do not write.
        body = text if text.lstrip().startswith("%YAML") else f"%YAML:1.0\n---\n{text.lstrip().removeprefix('---')}"
        storage = cv2.FileStorage(body, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        try:
            return _plain(storage.root(), cv2)
        finally:
            storage.release()
    except (cv2.error, UnicodeDecodeError, SystemError, ValueError) as error:
        raise InputError(
            f"{path} is no YAML that OpenCV reads ({brief(str(error))}): write it by cv2.FileStorage, or as JSON."
        ) from error


def _plain(node: Any, cv2: Any) -> Any:
    """A node of OpenCV's files as Python's own values."""
    if node.isMap():
        return {name: _plain(node.getNode(name), cv2) for name in node.keys()}  # noqa: SIM118  # it is no mapping
    if node.isSeq():
        return [_plain(node.at(place), cv2) for place in range(node.size())]
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return node.real()
    return node.string() if node.isString() else None
