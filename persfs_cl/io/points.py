"""A depth map compared with depths that are known at single points, as triangulation gives them."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.checks import FARTHEST, NEAREST, finite_number
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, as_path, read_bytes
from persfs_cl.wording import brief

_FIELDS = ("column", "row", "depth")
_FARTHEST_PIXEL = 1e9
_JSON_REMEDY = "give a list of objects that have column, row and depth."


@dataclass(frozen=True)
class PointErrors:
    """How far a depth map lies from the depths of points.

    Attributes
    ----------
    mean_relative : float
        Mean of |estimate - truth| / truth.
    rank_correlation : float or None
        Spearman's: 1 when the points are in the right order of depth. None where all values are equal.
    count : int
        How many points were compared.
    scale : float
        By which the estimate was multiplied.

    Examples
    --------
    >>> from persfs_cl.io import compare_points
    >>> errors = compare_points([1.0, 2.0], [1.0, 4.0], scale=False)
    >>> errors.mean_relative, errors.count
    (0.25, 2)
    """

    mean_relative: float
    rank_correlation: float | None
    count: int
    scale: float


def read_points(path: FilePath) -> Array:
    """Points of known depth from a CSV or JSON file.

    Parameters
    ----------
    path : path
        CSV: a line of names that holds column, row and depth, or three numbers a line in that order. JSON: a list of
        objects with these names, or an object that holds such a list as "points".

    Returns
    -------
    ndarray of float64, shape (points, 3)
        Column and row in pixels, which may be fractions, and depth.

    Raises
    ------
    InputError
        When the file cannot be read, or a point lacks one of the three numbers, or has one that is not finite, or no
        depth; the message says in which line of a CSV file, or which point of JSON.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from persfs_cl.io import read_points
    >>> with TemporaryDirectory() as folder:
    ...     np.savetxt(Path(folder) / "points.csv", [(10.5, 20.0, 1.25)], delimiter=",")
    ...     read_points(Path(folder) / "points.csv")
    array([[10.5 , 20.  ,  1.25]])
    """
    path = as_path(path)
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}, is no UTF-8 text: save the file as UTF-8, as CSV or JSON.") from error
    places, entries = _from_json(path, text) if path.suffix.lower() == ".json" else _from_csv(path, text)
    if not entries:
        raise InputError(f"{path} holds no point: give column, row and depth of at least one.")
    return np.array([_checked(place, entry) for place, entry in zip(places, entries, strict=True)])


def _checked(place: str, entry: Sequence[Any]) -> list[float]:
    """Column, row and depth as numbers."""
    numbers = []
    for name, value in zip(_FIELDS, entry, strict=True):
        number = _number(value) if isinstance(value, str) else finite_number(value)
        if isnan(number):
            raise InputError(f"{place} has {name} {brief(value)}: give a finite number.")
        numbers.append(number)
    column, row, depth = numbers
    if not NEAREST <= depth <= FARTHEST:
        raise InputError(
            f"{place} has depth {depth:g}: give a distance in front of the camera, from {NEAREST:g} to {FARTHEST:g}."
        )
    if max(abs(column), abs(row)) > _FARTHEST_PIXEL:
        raise InputError(
            f"{place} has column {column:g} and row {row:g}: give pixels, up to {_FARTHEST_PIXEL:g} from the first."
        )
    return numbers


def at_points(values: ArrayLike, points: Array) -> Array:
    """Values of a map at the pixels nearest to some points; NaN for points outside it.

    Examples
    --------
    >>> import numpy as np
    >>> from persfs_cl.io import at_points
    >>> at_points([[1.0, 2.0], [3.0, 4.0]], np.array([[1.0, 0.0, 9.0], [7.0, 0.0, 9.0]]))
    array([ 2., nan])
    """
    grid = np.asarray(values, dtype=np.float64)
    columns, rows = np.rint(np.nan_to_num(points[:, :2], nan=-1.0)).astype(np.int64).T
    inside = (rows >= 0) & (rows < grid.shape[0]) & (columns >= 0) & (columns < grid.shape[1])
    return np.where(inside, grid[np.where(inside, rows, 0), np.where(inside, columns, 0)], np.nan)


def compare_points(estimate: ArrayLike, truth: ArrayLike, *, scale: bool = True) -> PointErrors:
    """Compare depths of the same points.

    Parameters
    ----------
    estimate, truth : array_like of float, shape (points,)
        From 1e-30 to 1e30; points that are NaN in either are left out.
    scale : bool
        Multiply the estimate by the median of truth / estimate first.

    Returns
    -------
    PointErrors

    Raises
    ------
    InputError
        When no point is left, or a value is no depth from 1e-30 to 1e30.

    Examples
    --------
    >>> from persfs_cl.io import compare_points
    >>> compare_points([2.0, 4.0, 6.0], [1.0, 2.0, 3.0]).scale
    0.5
    """
    estimated, true = np.asarray(estimate, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    compared = ~(np.isnan(estimated) | np.isnan(true))
    if not compared.any():
        raise InputError(
            f"none of {true.size} points can be compared: the estimate has no depth at any of them. Give points by the "
            "columns and rows of its pixels."
        )
    estimated, true = estimated[compared], true[compared]
    for values in (estimated, true):
        if not (values.min() >= NEAREST and values.max() <= FARTHEST):
            raise InputError(
                f"depths range from {values.min():g} to {values.max():g}: give distances in front of the camera, from "
                f"{NEAREST:g} to {FARTHEST:g}."
            )
    factor = float(np.median(true / estimated)) if scale else 1.0
    ranks = _ranks(estimated), _ranks(true)
    correlation = None if min(map(np.ptp, ranks)) == 0 else float(np.corrcoef(*ranks)[0, 1])
    return PointErrors(float(np.mean(np.abs(factor * estimated - true) / true)), correlation, true.size, factor)


def _ranks(values: Array) -> Array:
    """1 for the least; equal values share the mean of their ranks."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - (counts - 1) / 2)[place])


def _from_json(path: Path, text: str) -> tuple[list[str], list[list[Any]]]:
    """Where each point stands, and its column, row and depth as they stand there."""
    try:
        loaded = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path}, line {error.lineno}, is no JSON ({error.msg} at column {error.colno}): mend or export it again."
        ) from error
    except (RecursionError, ValueError) as error:
        raise InputError(
            f"{path} is nested too deep, or has a number of too many digits, to be a list of points: {_JSON_REMEDY}"
        ) from error
    if isinstance(loaded, dict) and "points" not in loaded:
        raise InputError(f'{path} holds an object without "points": {_JSON_REMEDY}')
    points = loaded["points"] if isinstance(loaded, dict) else loaded
    if not isinstance(points, list):
        raise InputError(f"{path} holds {brief(points)}, no list: {_JSON_REMEDY}")
    places = [f"{path}, point {number}," for number in range(1, len(points) + 1)]
    entries = []
    for place, point in zip(places, points, strict=True):
        if not isinstance(point, dict):
            raise InputError(f"{place} is {brief(point)}, no object: {_JSON_REMEDY}")
        if missing := [name for name in _FIELDS if name not in point]:
            raise InputError(f"{place} lacks {' and '.join(missing)}: give column, row and depth.")
        entries.append([point[name] for name in _FIELDS])
    return places, entries


def _from_csv(path: Path, text: str) -> tuple[list[str], list[list[Any]]]:
    """As :func:`_from_json`."""
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True)
    places, rows = [], []
    try:
        for row in reader:
            if any(field.strip() for field in row):
                places.append(f"{path}, line {reader.line_num},")
                rows.append(row)
    except csv.Error as error:
        raise InputError(
            f"{path}, line {reader.line_num}, is no CSV ({error}): give three numbers a line, with commas between."
        ) from error
    names = [name.strip() for name in rows[0]] if rows else []
    if set(_FIELDS) <= set(names):
        where = [names.index(name) for name in _FIELDS]
        places, rows = places[1:], rows[1:]
    elif names and not any(map(_is_number, names)):
        raise InputError(
            f"{path} has the headings {brief(', '.join(names))}, but column, row and depth are wanted, with commas "
            "between: rename them, or leave the headings out and give these three numbers a line, the first two in "
            "pixels."
        )
    else:
        where, names = [0, 1, 2], list(_FIELDS)
    for place, row in zip(places, rows, strict=True):
        if len(row) != len(names):
            raise InputError(
                f"{place} has {len(row)} fields, not {len(names)}: give {', '.join(map(brief, names))}, with commas "
                "between."
            )
    return places, [[row[index] for index in where] for row in rows]


def _is_number(text: str) -> bool:
    return not isnan(_number(text)) or text.strip().lower() in ("nan", "inf", "-inf")


def _number(text: str) -> float:
    """As :func:`finite_number`, of a text."""
    try:
        return finite_number(float(text))
    except ValueError:
        return nan
