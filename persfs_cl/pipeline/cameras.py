"""Cameras of many photographs, from a table that says which photograph has which."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from persfs_cl.camera import Camera, camera_from
from persfs_cl.checks import as_number, finite_numbers
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.calibrations import Calibrated
from persfs_cl.io.colmap import read_colmap_cameras, read_colmap_images, unknown_model
from persfs_cl.io.files import FilePath, as_path, read_bytes, read_lines
from persfs_cl.lens.distortion import Distortion, as_distortion
from persfs_cl.lens.fisheye import Fisheye
from persfs_cl.pipeline.listing import Input
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.wording import brief

_PATH = "path"
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""In OpenCV's order."""
_COLUMNS = ("focal_length", "fx", "fy", "fov", "cx", "cy", "width", "height", "fisheye", *_COEFFICIENTS)
_SHAPE = (1000, 1000)
"""Of an image that a field of view is tried on: any will do."""


@dataclass(frozen=True)
class CameraTable:
    """Which photograph has which camera.

    Attributes
    ----------
    path : Path
        The file, named in errors.
    rows : mapping of str to CameraChoice
        By the path of the photograph as the table has it, without "." and ".." where possible.
    refused : mapping of str to str
        Photographs whose camera cannot be used, and why.
    every : CameraChoice or None
        The camera of all photographs, of a table that names none.
    """

    path: Path
    rows: Mapping[str, CameraChoice]
    refused: Mapping[str, str]
    every: CameraChoice | None = None

    def choice(self, entry: Input, roots: Iterable[Path] = ()) -> CameraChoice:
        """The camera of an input.

        The table may have it by the name of its results; by its path relative to the folder of the table; relative
        to one of `roots`; or by its absolute path. The first of these that is there counts. The frames of a video may
        have rows of their own, `clip.mp4/000012`, or share that of the video.

        Parameters
        ----------
        entry : Input
        roots : iterable of Path
            The folders of :attr:`persfs_cl.pipeline.listing.Listing.roots`.

        Raises
        ------
        CameraError
            When the table lacks it, or has a camera of an unknown model for it.
        """
        for key in self._keys(entry, roots):
            if key in self.rows:
                return self.rows[key]
            if key in self.refused:
                raise CameraError(f"{entry.path}: {self.refused[key]}")
        if self.every is not None:
            return self.every
        raise CameraError(
            f"{entry.path} has no camera in {self.path}: add a row for {entry.name!r}, or leave the photo out."
        )

    def _keys(self, entry: Input, roots: Iterable[Path]) -> Iterator[str]:
        frame = "" if entry.frame is None else entry.name[entry.name.rindex("/") :]
        for ending in dict.fromkeys((frame, "")):
            yield entry.name.removesuffix(frame) + ending
            absolute = os.path.abspath(entry.path)
            for folder in (self.path.parent, *roots):
                yield _key(_relative(absolute, folder)) + ending
            yield _key(absolute) + ending


def read_cameras(path: FilePath) -> CameraTable:
    """The cameras in a table.

    Parameters
    ----------
    path : path
        - A `.csv` file, whose first line names the columns: `path`; `focal_length`, or `fx` and `fy`, or `fov`; and,
          if one likes, `cx` and `cy`, `width` and `height`. All but the field of view, in degrees, are in pixels, which
          are centred on integers. Coefficients of the distortion are `k1`, `k2`, `p1`, `p2`, `k3` to `k6`, as OpenCV
          has them, or with 1 for `fisheye` `k1` to `k4` of a fisheye lens.
        - A `.json` file, with an object that has the same names for each photograph: by their paths in an object, or
          with a `path` each in a list. `focal_length` may be a pair, `principal_point` may stand for `cx` and `cy`, and
          a list `distortion` for its coefficients.
        - The folder of a model of COLMAP, in text, or its `cameras.txt`, with `images.txt` beside it. Cameras are of
          any of its pinhole, radial, OpenCV, fisheye and FOV models. COLMAP centres pixels on halves, which is taken
          into account. Without `images.txt`, its only camera is that of all photographs.

    Returns
    -------
    CameraTable

    Raises
    ------
    InputError
        When it cannot be read or understood; names the line.
    CameraError
        When it has an impossible camera; names the line and the value.
    """
    path = as_path(path)
    if path.is_dir():
        return _read_colmap(path / "cameras.txt")
    suffix = path.suffix.lower()
    if suffix == ".txt":
        return _read_colmap(path)
    if suffix == ".csv":
        return _table(path, _csv_rows(path))
    if suffix == ".json":
        return _table(path, _json_rows(path))
    if not path.exists():
        raise InputError(f"{path} does not exist: check the spelling and the folder.")
    raise InputError(f"{path} is no table of cameras by its name: give a .csv or .json file, or COLMAP's cameras.txt.")


def _table(path: Path, rows: Iterable[tuple[str, str, Mapping[str, Any]]]) -> CameraTable:
    """Of rows that come with the place where they are, and the path of the photograph."""
    found: dict[str, CameraChoice] = {}
    places: dict[str, str] = {}
    for place, name, row in rows:
        key = _key(name)
        if key in found:
            raise InputError(f"{place}, has {name!r} again after {places[key]}: leave one of them out.")
        try:
            found[key] = replace(_choice(row), table=path)
        except (CameraError, InputError) as error:
            # The words of a table are not those of a command's options.
            raise type(error)(f"{place}, {name!r}: {error}") from error
        places[key] = place
    if not found:
        raise InputError(f"{path} has no row: write one for each photo.")
    return CameraTable(path, found, {})


def _choice(row: Mapping[str, Any]) -> CameraChoice:
    """What the names of a row say, checked as far as one can without the image."""
    given = dict(row)
    point = _pair(given, "cx", "cy")
    point = given.pop("principal_point", None) if point is None else point
    size = _pair(given, "height", "width")
    lengths = _pair(given, "fx", "fy")
    distortion = _distortion(given)
    said = {"fx and fy": lengths, "focal_length": given.pop("focal_length", None), "fov": given.pop("fov", None)}
    if given:
        raise InputError(f"{next(iter(given))!r} is no name of a table: use {', '.join((_PATH, *_COLUMNS))}.")
    if len([value for value in said.values() if value is not None]) != 1:
        names = " and ".join(name for name, value in said.items() if value is not None) or "neither"
        raise InputError(f"it has {names}: give the focal length or the field of view, once.")
    fov = None if said["fov"] is None else as_number("fov", said["fov"], error=CameraError)
    camera = Camera(lengths or said["focal_length"] or 0.0, point, distortion) if fov is None else None
    tried = Camera.from_fov(fov, _SHAPE, point) if camera is None and fov is not None else camera
    shape = None
    if size is not None:
        shape = int(size[0]), int(size[1])
        if shape != size or min(shape) < 1:
            raise InputError(f"width {size[1]:g} and height {size[0]:g} are no size: give whole pixels.")
    return CameraChoice(
        None if camera is None else camera.focal_length,
        fov,
        None if tried is None else tried.principal_point,
        shape,
        distortion=distortion if camera is None else camera.distortion,
    )


def _distortion(given: dict[str, Any]) -> Distortion | None:
    """What a row says of the lens, taken out of it."""
    fisheye = given.pop("fisheye", False)
    if fisheye not in (0, 1):
        raise InputError(f"it has {brief(fisheye)} for fisheye: give 1, or leave it out.")
    named = {
        name: as_number(name, given.pop(name), what="a coefficient", error=CameraError)
        for name in _COEFFICIENTS
        if name in given
    }
    listed = given.pop("distortion", None)
    if listed is not None and named:
        raise InputError(f"it has a distortion and {next(iter(named))}: give the coefficients once.")
    if fisheye and any(name.startswith("p") or name in ("k5", "k6") for name in named):
        raise InputError(f"a fisheye has k1, k2, k3 and k4, and it has {', '.join(named)}: leave the others out.")
    if fisheye:
        numbers = () if listed is None else finite_numbers(listed)
        if numbers is None or len(numbers) not in (0, 1, 2, 3, 4, 8):
            raise InputError(f"it has {brief(listed)} for the distortion of a fisheye: give k1, k2, k3 and k4.")
        return Fisheye(*numbers, **named)
    if named:
        last = max(_COEFFICIENTS.index(name) for name in named)
        # As many as OpenCV takes: 4, 5 or 8.
        listed = [named.get(name, 0.0) for name in _COEFFICIENTS[: 4 if last < 4 else 5 if last == 4 else 8]]
    return as_distortion(listed)


def _pair(given: dict[str, Any], one: str, other: str) -> tuple[float, float] | None:
    """Two numbers that a row has both, or neither, taken out of it."""
    first, second = given.pop(one, None), given.pop(other, None)
    if (first is None) != (second is None):
        raise InputError(f"it has {one if second is None else other} alone: give {one} and {other}, or neither.")
    if first is None:
        return None
    return as_number(one, first, error=CameraError), as_number(other, second, error=CameraError)


def _csv_rows(path: Path) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    lines = csv.reader((line for _, line in read_lines(path)), skipinitialspace=True)
    try:
        header = [name.strip() for name in next(lines, [])]
        if _PATH not in header:
            raise InputError(f"{path} has no column 'path', but {header}: name the columns in the first line.")
        unknown = [name for name in header if name not in (_PATH, *_COLUMNS)]
        if unknown or len({*header}) < len(header):
            raise InputError(
                f"{path} has the columns {header}: leave out those that are not, or are twice, among "
                f"{', '.join((_PATH, *_COLUMNS))}."
            )
        for fields in lines:
            if not fields:
                continue
            place = f"{path}, line {lines.line_num}"
            if len(fields) != len(header):
                raise InputError(f"{place}, has {len(fields)} values for {len(header)} columns: mend it.")
            row: dict[str, Any] = dict(zip(header, map(str.strip, fields), strict=True))
            name = row.pop(_PATH)
            if not name:
                raise InputError(f"{place}, names no photo in its column 'path': add it.")
            yield place, name, {column: _number(place, column, text) for column, text in row.items() if text}
    except csv.Error as error:
        raise InputError(f"{path}, line {lines.line_num}, is no CSV ({error}): mend it.") from error


def _number(place: str, column: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InputError(f"{place}, has {text!r} for {column}: give a number.") from error


def _json_rows(path: Path) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    try:
        content = json.loads(read_bytes(path), object_pairs_hook=_Once)
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        where = f", line {error.lineno}" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"{path}{where}, is no JSON ({error}): mend it.") from error
    except RecursionError as error:
        raise InputError(f"{path} is nested too deep: give a list, or an object, of objects.") from error
    if isinstance(content, _Once):
        if content.twice:
            raise InputError(f"{path} has {content.twice[0]!r} more than once: leave one of them out.")
        entries: list[tuple[str, object, object]] = [(f"{path}", name, row) for name, row in content.items()]
    elif isinstance(content, list):
        entries = [
            (f"{path}, entry {number}", row.get(_PATH) if isinstance(row, dict) else None, row)
            for number, row in enumerate(content, 1)
        ]
    else:
        raise InputError(f"{path} holds {type(content).__name__}: give a list, or an object, of objects.")
    for place, name, row in entries:
        if not isinstance(row, _Once) or not isinstance(name, str) or not name:
            raise InputError(f"{place}, is no object with a path: write {{'path': …, 'focal_length': …}}.")
        if row.twice:
            raise InputError(f"{place}, {name!r} has {row.twice[0]!r} more than once: leave one of them out.")
        yield place, name, {key: value for key, value in row.items() if key != _PATH and value is not None}


class _Once(dict[str, Any]):
    """An object of JSON, which knows the names that it was given twice."""

    def __init__(self, pairs: list[tuple[str, Any]]) -> None:
        super().__init__(pairs)
        names = [name for name, _ in pairs]
        self.twice = [name for name in self if names.count(name) > 1] if len(self) < len(names) else []


def _read_colmap(path: Path) -> CameraTable:
    if not path.exists() and path.with_suffix(".bin").exists():
        raise InputError(
            f"{path} does not exist, but {path.stem}.bin: write the model as text, by colmap model_converter "
            f"--input_path {path.parent} --output_path {path.parent} --output_type TXT."
        )
    cameras = read_colmap_cameras(path)
    usable = {
        number: _colmap_choice(path, camera.line, camera.camera)
        for number, camera in cameras.items()
        if camera.camera is not None
    }
    images = path.with_name("images.txt")
    if not images.exists():
        if len(cameras) > 1:
            raise InputError(
                f"{path} has {len(cameras)} cameras: put COLMAP's images.txt beside it, which tells whose."
            )
        for camera in cameras.values():
            if camera.camera is None:
                raise CameraError(unknown_model(path, camera))
        return CameraTable(path, {}, {}, next(iter(usable.values())))
    rows, refused = {}, {}
    for line, name, number in read_colmap_images(images):
        if number not in cameras:
            raise InputError(
                f"{images}, line {line}, names camera {number}, which {path} lacks: give both of one model."
            )
        if number in usable:
            rows[_key(name)] = usable[number]
        else:
            refused[_key(name)] = unknown_model(path, cameras[number])
    return CameraTable(path, rows, refused)


def _colmap_choice(path: Path, line: int, camera: Calibrated) -> CameraChoice:
    return replace(CameraChoice.like(camera_from(f"{path}, line {line}", camera)), size=camera.size, table=path)


def _key(path: str) -> str:
    return os.path.normpath(path).replace(os.sep, "/")


def _relative(absolute: str, folder: Path) -> str:
    try:
        return os.path.relpath(absolute, folder)
    except ValueError:  # on another drive of Windows
        return absolute
