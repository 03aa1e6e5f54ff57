"""Bounds of the depth that are numbers or files."""

from __future__ import annotations

from pathlib import Path

from persfs_cl.checks import FARTHEST, NEAREST, as_number
from persfs_cl.errors import InputError
from persfs_cl.wording import keyword


def checked_bounds(near: float | Path | None, far: float | Path | None) -> tuple[float | Path | None, ...]:
    """The nearest and the farthest depth, as far as numbers tell whether they are such; None for no bound.

    Raises
    ------
    InputError
        When a number is no depth, or they leave none between them.
    """
    bounds = tuple(
        given if given is None or isinstance(given, Path) else _depth(name, given)
        for name, given in (("near", near), ("far", far))
    )
    nearest, farthest = bounds
    if isinstance(nearest, float) and isinstance(farthest, float) and nearest > farthest:
        raise InputError(
            f"{keyword('near', nearest)} is beyond {keyword('far', farthest)}: let the first be the smaller depth.",
            argument="near",
            value=nearest,
        )
    return bounds


def _depth(name: str, given: float) -> float:
    return as_number(name, given, least=NEAREST, most=FARTHEST, what="a depth", hint=", or a file")
