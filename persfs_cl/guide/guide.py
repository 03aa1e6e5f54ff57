"""What a user gave as a guide: a coarse map, or points, of depth, inverse depth, or numbers that go with either."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import FARTHEST, NEAREST, as_floats, unlike, warn
from persfs_cl.choices import GuideKind, GuideScale
from persfs_cl.errors import InputError
from persfs_cl.guide.cells import Cells
from persfs_cl.maps import as_array_of_image
from persfs_cl.wording import keyword

_MOST_PIXELS = 2**30
_FARTHEST_PIXEL = 1e9
_STRETCHED = 0.03
"""Logarithm of a ratio that cells may be longer along one side."""
_LEAST = {"fixed": 1, "fit": 1, "affine": 3}
"""Cells that tell the scale."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points of an image at which something is known of the depth, for ``guide``.

    Parameters
    ----------
    columns, rows : array_like of float, shape (points,)
        Place in pixels, which are centred on integers; it may be a fraction. Points outside the image or the mask are
        not used.
    depths : array_like of float, shape (points,)
        Along the optical axis, or what ``guide_kind`` says; NaN where it is not known.

    Raises
    ------
    InputError
        When these are no numbers, there is no point, or not as many of each.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> points = ps.Points([10.5, 40.0], [20.0, 5.25], [1.25, 1.3])
    >>> points
    Points(2 of them)
    """

    columns: Array
    rows: Array
    depths: Array

    def __init__(self, columns: ArrayLike, rows: ArrayLike, depths: ArrayLike) -> None:
        given = {"columns": columns, "rows": rows, "depths": depths}
        for name, values in given.items():
            found = as_floats(name, values)
            if found.ndim != 1 or found.size == 0:
                raise unlike(name, values, f"has shape {found.shape}: give one number a point, of one point at least.")
            object.__setattr__(self, name, found)
        counts = [getattr(self, name).size for name in given]
        if len(set(counts)) > 1:
            raise InputError(
                f"There are {counts[0]} columns, {counts[1]} rows and {counts[2]} depths: give as many of each, one a "
                "point.",
                argument="depths",
                value=depths,
            )
        for name in ("columns", "rows"):
            # Written so that NaN is refused too.
            if not (np.abs(getattr(self, name)) <= _FARTHEST_PIXEL).all():
                raise unlike(name, given[name], f"holds no place in an image: give pixels, up to {_FARTHEST_PIXEL:g}.")

    def __repr__(self) -> str:
        return f"Points({self.columns.size} of them)"


@dataclass(frozen=True, eq=False)
class Guide:
    """What a guide says of an image.

    Attributes
    ----------
    cells : Cells
        Of ln depth; where `affine`, of the numbers as they were given.
    kind : {"depth", "inverse"}
    affine : bool
        Whether depth, or its inverse, is the numbers times an unknown factor, plus an unknown offset.
    """

    cells: Cells
    kind: GuideKind
    affine: bool

    @classmethod
    def of(cls, given: Any, wanted: Mask, kind: GuideKind, scale: GuideScale) -> Guide:
        """What a user gave for an image, whose pixels that are to be solved, or known, are `wanted`.

        Raises
        ------
        InputError
            When it is no guide, or says too little of these pixels.

        Warns
        -----
        UserWarning
            When a map has another ratio of sides than the image.
        """
        affine = scale == "affine"
        if isinstance(given, Points):
            says = _checked(given, given.depths, kind, affine=affine)
            cells = Cells.of_points(given.columns, given.rows, says, wanted)
        else:
            values = as_array_of_image("guide", given)
            if values.dtype.kind not in "iuf" or values.ndim != 2 or not 0 < values.size <= _MOST_PIXELS:
                raise unlike(
                    "guide",
                    given,
                    f"is {values.dtype} of shape {values.shape}: give numbers of shape (height, width), of any size "
                    "over the same view, NaN where nothing is known, or persfs_cl.Points.",
                )
            _warn_of_another_view(values.shape, wanted.shape)
            cells = Cells.of_map(_checked(given, as_floats("guide", values), kind, affine=affine), wanted)
        if cells.count < _LEAST[scale]:
            few = "nothing" if cells.count == 0 else f"{cells.count} values"
            raise unlike(
                "guide",
                given,
                f"says {few} of the {np.count_nonzero(wanted)} pixels to solve, where {keyword('guide_scale', scale)} "
                f"wants {_LEAST[scale]} at least: see that it is of the same view, and that the mask is right.",
            )
        return cls(cells, kind, affine)

    def log_depth(self, factor: float, offset: float) -> Array:
        """ln depth of the cells for one factor and offset of the numbers; NaN where there is no depth."""
        linear = factor * self.cells.values + offset
        with np.errstate(divide="ignore", invalid="ignore"):
            logarithm = np.log(linear)
        logarithm[~(linear > 0.0)] = np.nan
        return np.asarray(-logarithm if self.kind == "inverse" else logarithm)


def _warn_of_another_view(shape: tuple[int, ...], image_shape: tuple[int, ...]) -> None:
    (rows, columns), (height, width) = shape, image_shape
    apart = abs(math.log(height / rows / (width / columns)))
    # Sides are whole numbers of cells.
    if apart > _STRETCHED + 1.0 / rows + 1.0 / columns:
        warn(
            f"{keyword('guide')} has {columns} x {rows} cells for an image of {width} x {height} pixels, whose sides "
            f"have another ratio, by a factor of {math.exp(apart):.3g}: see that both show the same view, uncropped."
        )


def _checked(given: Any, values: Array, kind: GuideKind, *, affine: bool) -> Array:
    """ln depth, or for `affine` the numbers; NaN where there is none."""
    if np.isinf(values).any():
        raise unlike("guide", given, "holds infinite values: use NaN where nothing is known.")
    if affine:
        return values
    # Written so that NaN is none of them.
    if (bad := (values < NEAREST) | (values > FARTHEST)).any():
        what = "inverse depths" if kind == "inverse" else "depths"
        raise unlike(
            "guide",
            given,
            f"holds {float(values[bad][0]):g} ({np.count_nonzero(bad)} such values): {what} are from {NEAREST:g} to "
            f"{FARTHEST:g}. Use NaN where nothing is known, and {keyword('guide_scale', 'affine')} where its scale "
            "and its zero are not known.",
        )
    logarithm = np.log(values)
    return -logarithm if kind == "inverse" else logarithm
