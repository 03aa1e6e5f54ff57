"""A depth map beside depths that are known at single points, as triangulation gives them."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.errors import InputError
from persfs_cl.files import FilePath, as_path, read_bytes

Array = NDArray[np.float64]

_FIELDS = ("column", "row", "depth")


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
        When the file cannot be read, or a point lacks one of the three numbers.
    """
    path = as_path(path)
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
        entries = _from_json(text) if path.suffix.lower() == ".json" else _from_csv(path, text)
        points = np.array(entries, dtype=np.float64)
    except InputError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path} holds no list of points ({error!r}): give CSV with column, row and depth, or JSON with a list of "
            "objects that have these names."
        ) from error
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all() or (points[:, 2] <= 0).any():
        raise InputError(
            f"{path} must hold column, row and a depth above 0 for each point, all of them finite numbers."
        )
    return points


def at_points(values: ArrayLike, points: Array) -> Array:
    """Values of a map at the pixels nearest to some points; NaN for points beside it."""
    grid = np.asarray(values, dtype=np.float64)
    columns, rows = np.rint(points[:, :2]).astype(int).T
    inside = (rows >= 0) & (rows < grid.shape[0]) & (columns >= 0) & (columns < grid.shape[1])
    return np.where(inside, grid[np.where(inside, rows, 0), np.where(inside, columns, 0)], np.nan)


def compare_points(estimate: ArrayLike, truth: ArrayLike, *, scale: bool = True) -> PointErrors:
    """Compare depths of the same points.

    Parameters
    ----------
    estimate, truth : array_like of float, shape (points,)
        Above 0; points that are NaN in either are left out.
    scale : bool
        Multiply the estimate by the median of truth / estimate first.

    Returns
    -------
    PointErrors

    Raises
    ------
    InputError
        When no point is left, or a value is not above 0.
    """
    estimated, true = np.asarray(estimate, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    compared = ~(np.isnan(estimated) | np.isnan(true))
    if not compared.any():
        raise InputError(f"none of {true.size} points can be compared: the estimate has no depth at any of them.")
    estimated, true = estimated[compared], true[compared]
    if min(estimated.min(), true.min()) <= 0:
        raise InputError(f"depths go down to {min(estimated.min(), true.min()):g}: they must be above 0.")
    factor = float(np.median(true / estimated)) if scale else 1.0
    ranks = _ranks(estimated), _ranks(true)
    correlation = None if min(map(np.ptp, ranks)) == 0 else float(np.corrcoef(*ranks)[0, 1])
    return PointErrors(float(np.mean(np.abs(factor * estimated - true) / true)), correlation, true.size, factor)


def _ranks(values: Array) -> Array:
    """1 for the least; equal values share the mean of their ranks."""
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(counts) - (counts - 1) / 2)[place])


def _from_json(text: str) -> list[list[Any]]:
    loaded = json.loads(text)
    points = loaded["points"] if isinstance(loaded, dict) else loaded
    return [[point[name] for name in _FIELDS] for point in points]


def _from_csv(path: Path, text: str) -> list[list[Any]]:
    rows = [row for row in csv.reader(text.splitlines()) if row]
    names = [name.strip() for name in rows[0]] if rows else []
    if set(_FIELDS) <= set(names):
        return [[row[names.index(name)] for name in _FIELDS] for row in rows[1:]]
    if names and not any(map(_is_number, names)):
        raise InputError(
            f"{path} has the headings {', '.join(names)}, but column, row and depth are wanted, with commas between: "
            "rename them, or leave the headings out and give these three numbers a line, the first two in pixels."
        )
    return rows


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
