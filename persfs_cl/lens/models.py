"""The models of lenses that are not OpenCV's coefficients: what files call them, and their formulas."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from persfs_cl.arrays import Array
from persfs_cl.errors import CameraError
from persfs_cl.lens import field_of_view, fisheye, rad_tan_fisheye
from persfs_cl.lens.field_of_view import FieldOfView
from persfs_cl.lens.fisheye import Fisheye
from persfs_cl.lens.numbers import Lens
from persfs_cl.lens.rad_tan_fisheye import RadTanFisheye

OPENCV = "opencv"
"""What files call a lens by OpenCV's coefficients."""


@dataclass(frozen=True)
class LensModel:
    """A model of lenses.

    Attributes
    ----------
    name : str
        What files and the command line call it.
    kind : type
        Whose fields are its numbers.
    counts : collection of int
        How many of the numbers a file may have; the others are 0.
    wanted : str
        The numbers, in words.
    draw : callable
        Of the lens, and places of a pinhole camera: where the lens draws them.
    straighten : callable
        Of the lens, and what it draws: about where a pinhole camera has it, NaN for nowhere.
    """

    name: str
    kind: type[Lens]
    counts: Collection[int]
    wanted: str
    draw: Callable[[Any, Array], Array]
    straighten: Callable[[Any, Array], Array]


_ALL = (
    LensModel(
        "fisheye",
        Fisheye,
        (0, 4, 8),
        "k1, k2, k3 and k4, or p1, p2, sx1 and sy1 too",
        fisheye.draw,
        fisheye.nearly_straight,
    ),
    LensModel("fov", FieldOfView, (1,), "the one number ω", field_of_view.draw, field_of_view.straight),
    LensModel(
        "rad_tan_thin_prism_fisheye",
        RadTanFisheye,
        (12,),
        "k0 to k5, p0, p1 and s0 to s3",
        rad_tan_fisheye.draw,
        rad_tan_fisheye.nearly_straight,
    ),
)
MODELS = {model.name: model for model in _ALL}
_OF_KIND = {model.kind: model for model in _ALL}


def model_of(lens: Lens) -> LensModel:
    """The model of a lens."""
    return _OF_KIND[type(lens)]


def lens_of(name: str, coefficients: Collection[float]) -> Lens:
    """The lens of a model that has some numbers.

    Raises
    ------
    CameraError
        When there is no such model, or it has other numbers.
    """
    if name not in MODELS:
        raise CameraError.about("distortion", name, f"is no model of a lens: give one of {', '.join(MODELS)}.")
    model = MODELS[name]
    if len(coefficients) not in model.counts:
        raise CameraError.about(
            "distortion", coefficients, f"is impossible for a lens of the model {name}: give {model.wanted}."
        )
    return model.kind(*coefficients)
