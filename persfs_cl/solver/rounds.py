"""A lamp beside the camera, as far as the equation that is solved does not have it: rounds of corrected photographs.

The upwind scheme has the lamp at its place, and a material that shades by the angle to the lamp alone, as a Lambertian
one does. The Lax-Friedrichs scheme has the lamp at the camera.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from persfs_cl.shading.material import Lambertian
from persfs_cl.shading.model import Model
from persfs_cl.solver.problem import Problem, nearest_depth
from persfs_cl.solver.reference import brightness
from persfs_cl.surface.geometry import log_depth_gradient

Array = NDArray[np.float64]

ROUNDS = 10
"""At most so many runs of the sweeps."""

SETTLED, LOST = 3e-5, 1e-3
"""Mean |ΔZ| between two runs below which no further one is worth it, and above which the last is not to be trusted."""

_DIMMEST = 0.1
"""Where the lamp beside the camera gives less than this share of what the equation has, the share is not used: the
surface turns its back to the lamp, or nearly."""

_DARKEST = 1e-9
_SMOOTHINGS = 16
"""Of the share, over about 3 pixels. It depends on the slopes, in which rounding and the steps of pixels show; where
the surface faces the camera these would come back larger from every round."""


def in_rounds(model: Model, scheme: str) -> bool:
    """Whether the equation of a resolved scheme has not all of a lamp beside the camera."""
    return model.beside_camera and not (scheme == "upwind" and isinstance(model.reflectance, Lambertian))


def too_near(problem: Problem, depth: Array) -> NDArray[np.bool_]:
    """Solved pixels at the nearest depth that the equation of a lamp beside the camera has."""
    if not (problem.model.beside_camera and problem.scheme == "upwind"):
        return np.zeros(depth.shape, bool)
    return problem.domain.solved & (depth <= 1.001 * nearest_depth(problem.model.flash, problem.grid.x, problem.grid.y))


def as_solved(problem: Problem, depth: Array) -> tuple[Problem, NDArray[np.bool_]]:
    """Give the equation the photograph that belongs to it, as far as a surface tells.

    Parameters
    ----------
    problem : Problem
        Under a flash with fall-off beside the camera.
    depth : ndarray of float64, shape (height, width)
        What the surface is thought to be; NaN where it is not known.

    Returns
    -------
    problem : Problem
        The same with another photograph.
    dim : ndarray of bool, shape (height, width)
        Pixels that the lamp hardly reaches, where the photograph tells little.
    """
    grid, model, lamp = problem.grid, problem.model, problem.model.flash
    surface = (np.log(depth), *log_depth_gradient(depth, problem.camera), grid.x, grid.y)
    if problem.scheme == "upwind":
        # The distance to the lamp is the same in both.
        lamp = replace(lamp, falloff=False, gain=1.0)
        had = model.reflectance.coaxial(brightness(*surface, lamp, Lambertian()))
    else:
        had = brightness(*surface, replace(lamp, offset=(0.0, 0.0, 0.0)), model.reflectance)
    given = brightness(*surface, lamp, model.reflectance)
    there = np.isfinite(depth)
    dim = there & ~(given >= _DIMMEST * had)
    # Neither is above 0 where the surface is turned away.
    had = np.where(there, np.maximum(had, _DARKEST), 1.0)
    logarithm = np.log(had / np.where(there, np.clip(given, _DIMMEST * had, had / _DIMMEST), 1.0))
    weight = _smoothed(there.astype(np.float64))
    share = np.exp(np.divide(_smoothed(logarithm), weight, out=np.zeros_like(weight), where=there))
    return problem.relit(problem.image * share), dim


def _smoothed(values: Array) -> Array:
    for _ in range(_SMOOTHINGS):
        padded = np.pad(values, 1)
        rows = padded[:-2] + 2.0 * padded[1:-1] + padded[2:]
        values = (rows[:, :-2] + 2.0 * rows[:, 1:-1] + rows[:, 2:]) / 16.0
    return values
