"""What a guide and a surface have in common, and what either tells of the other: the scale of a guide, or the light."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.checks import warn
from persfs_cl.errors import InputError
from persfs_cl.guide.fit import Fitted
from persfs_cl.guide.guide import Guide
from persfs_cl.shading.model import Light
from persfs_cl.solver.bounds import DepthRange
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.told import concerning
from persfs_cl.wording import keyword

_NOISES, _SHARE = 3.0, 0.02
"""Scatters of guide less surface, and share of the depth, from which a common offset says that light and guide
contradict each other."""


@dataclass(frozen=True, eq=False)
class Agreed:
    """A problem, and its guide fitted to a surface.

    Attributes
    ----------
    problem : Problem
        Under the light that the guide has told.
    fitted : Fitted
    gain : float or None
        Where it was unknown.
    log_depth : ndarray of float64, shape (height, width)
        The surface in that light.
    """

    problem: Problem
    fitted: Fitted
    gain: float | None
    log_depth: Array

    @classmethod
    def on(cls, problem: Problem, guide: Guide, log_depth: Array, options: Options) -> Agreed:
        """From a surface that the photograph alone gives.

        Raises
        ------
        InputError
            When guide and surface have nothing in common.

        Warns
        -----
        UserWarning
            When the scale of a guide contradicts the light.
        """
        light, unknown = problem.model.light, options["light"].unknown
        fitted = Fitted.to_surface(
            guide,
            log_depth,
            mean_focal_length(problem.camera),
            scale=options["guide_scale"],
            gain_unknown=unknown is not None,
            held=light.determines_depth,
            tolerance=options["guide_tolerance"],
        )
        if unknown is None:
            # Paint makes a surface look farther than it is.
            plain = options["paint"] == "plain" and not problem.fits_albedo
            if plain and options["guide_scale"] == "fixed" and light.determines_depth:
                _warn_of_contradiction(fitted, light)
        return cls.by(problem, fitted, log_depth, options)

    @classmethod
    def by(cls, problem: Problem, fitted: Fitted, log_depth: Array, options: Options) -> Agreed:
        """From a guide that was fitted to the surface."""
        light, unknown = problem.model.light, options["light"].unknown
        if unknown is None:
            return cls(problem, fitted, None, log_depth)
        light = light.for_farther(fitted.farther)
        problem = problem.between(problem.depth_range or DepthRange.none(problem.window.image_shape), light)
        log_depth = np.where(problem.domain.known, log_depth, log_depth + fitted.farther)
        return cls(problem, fitted, float(getattr(light, unknown)), log_depth)


@contextmanager
def about(number: int) -> Iterator[None]:
    """A block whose warnings and errors are about one image of several."""
    with concerning(number):
        try:
            yield
        except InputError as error:
            error.place = number
            raise


def mean_focal_length(camera: Camera) -> float:
    """Of a camera whose pixels may not be square."""
    return 0.5 * (camera.fx + camera.fy)


def _warn_of_contradiction(fitted: Fitted, light: Light) -> None:
    if abs(fitted.disagreement) > max(_NOISES * fitted.scatter, _SHARE):
        warn(
            f"{keyword('guide')} has most depths {math.exp(fitted.disagreement):.3g} times as large as "
            f"{keyword('light', light)} gives them, and is believed. If it is of another scale, give "
            f"{keyword('guide_scale', 'fit')}; if the gain is not known, {keyword('gain', None)} for the light."
        )
