"""Cameras in files, as calibrations write them: OpenCV's YAML and JSON, and what resembles it, and COLMAP's cameras."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from persfs_cl.checks import finite_number
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
_LENSES = {
    **dict.fromkeys(("fisheye", "equidistant", "kannala_brandt4"), "fisheye"),
    "fov": "fov",
    **dict.fromkeys(("rad_tan_thin_prism_fisheye", "fisheye624"), "rad_tan_thin_prism_fisheye"),
}
"""What files call models of lenses whose numbers are not OpenCV's, and what these are called here."""
_OTHERS = ("none", "pinhole", "perspective", "opencv", "plumb_bob", "radtan", "brown_conrady", "rational_polynomial")
_WIDTH, _HEIGHT, _SIZE = ("image_width", "width"), ("image_height", "height"), ("resolution", "image_size")
_LARGEST = 2**20
_MATRIX_TAG = "tag:yaml.org,2002:opencv-matrix"


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
        The numbers of its lens, in the order of the model; none of a pinhole camera.
    model : str
        Of the lens, as :mod:`persfs_cl.lens.models` calls it.
    size : (int, int) or None
        (height, width) of its images.
    """

    focal_length: float | tuple[float, float]
    principal_point: tuple[float, float] | None = None
    distortion: tuple[float, ...] = ()
    model: str = "opencv"
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
        When PyYAML is not installed; when the lens is of a model that is not known.
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
    while isinstance(inner, Mapping) and _first(inner, _MATRIX) is None:
        # Such as cam0.
        inside = [one for one in inner.values() if isinstance(one, Mapping) and _first(one, _MATRIX) is not None]
        if len(inside) > 1:
            raise InputError(f"{path} has {len(inside)} cameras: leave the one that took the photo.")
        if not inside and len(inner) != 1:
            break
        inner = inside[0] if inside else next(iter(inner.values()))
    matrix = _first(inner, _MATRIX) if isinstance(inner, Mapping) else None
    if matrix is None:
        raise InputError(
            f"{path} has no camera_matrix: give a file that holds it, its distortion_coefficients, image_width and "
            "image_height, as OpenCV's calibration does."
        )
    flat = isinstance(matrix, Sequence) and not any(isinstance(row, Sequence) for row in matrix)
    fx, fy, cx, cy = _pinhole(
        path, _numbers(path, "camera_matrix", matrix), by_columns="intrinsic_matrix" in inner and flat
    )
    models = [str(inner[name]).lower() for name in _MODEL if inner.get(name) is not None]
    lens = next((_LENSES[model] for model in models if model in _LENSES), "opencv")
    if inner.get("fisheye_model"):
        lens = "fisheye"
    for told in (model for model in models if model not in (*_LENSES, *_OTHERS)):
        raise CameraError(
            f"{path} has the lens model {brief(told)}, which is not known: undistort the photos with the program that "
            "calibrated it, and give the pinhole camera that it writes."
        )
    coefficients = _first(inner, _COEFFICIENTS)
    distortion = () if coefficients is None else _numbers(path, "distortion_coefficients", coefficients)
    return Calibrated((fx, fy), (cx, cy), distortion, lens, _size(path, inner))


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
        number = finite_number(value)
        if not (number % 1 == 0 and 1 <= number <= _LARGEST):
            raise InputError(f"{path} has {brief(value)} for {name}: give whole pixels, or leave both out.")
        sizes.append(int(number))
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
            number = finite_number(value)
            if math.isnan(number):
                raise InputError(f"{path} has {brief(value)} in {name}: give finite numbers.")
            found.append(number)
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
    try:
        import yaml
    except ImportError as error:
        raise CameraError(
            f"{path} is YAML, which PyYAML reads, and that is missing: pip install 'persfs-cl[lens]'."
        ) from error

    class Loader(yaml.SafeLoader):
        """Knows OpenCV's matrices, which are mappings."""

        def matrix(self, node: Any) -> Any:
            return self.construct_mapping(node, deep=True)

    Loader.add_constructor(_MATRIX_TAG, Loader.matrix)
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
        # OpenCV's first line is of no version of YAML.
        body = text.partition("\n")[2] if text.startswith("%YAML:") else text
        # Of several documents, as programs that go on writing make them, the first.
        return next(yaml.load_all(body, Loader), None)  # a safe loader
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is no YAML ({brief(str(error))}): mend it, or export it again.") from error
