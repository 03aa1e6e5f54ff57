"""A lamp beside the camera: the photograph that the same surface would give with the lamp at the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from persfs_cl.problem import Problem
from persfs_cl.reference import brightness
from persfs_cl.surface import log_depth_gradient

Array = NDArray[np.float64]

ROUNDS = 10
"""At most so many runs of the sweeps."""

SETTLED, LOST = 3e-5, 1e-3
"""Mean |ΔZ| between two runs below which no further one is worth it, and above which the last is not to be trusted."""

_DIMMEST = 0.1
"""Where the lamp beside the camera gives less than this share of what it would give at the camera, the share is not
used: the surface turns its back to the lamp, or nearly."""

_SMOOTHINGS = 16
"""Of the share, over about 3 pixels. It depends on the slopes, in which rounding and the steps of pixels show; where
the surface faces the camera these would come back larger from every round."""


def at_camera(problem: Problem, depth: Array) -> tuple[Problem, NDArray[np.bool_]]:
    """Take the lamp to the camera, as far as a surface tells what that does to the photograph.

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
    grid, model, beside_camera = problem.grid, problem.model, problem.model.light
    p, q = log_depth_gradient(depth, problem.camera)
    at, beside = (
        brightness(np.log(depth), p, q, grid.x, grid.y, light, model.reflectance)
        for light in (replace(beside_camera, offset=(0.0, 0.0, 0.0)), beside_camera)  # type: ignore[arg-type] # a flash
    )
    there = np.isfinite(depth)
    dim = there & ~(beside >= _DIMMEST * at)
    logarithm = np.log(np.where(there, at, 1.0) / np.where(there, np.maximum(beside, _DIMMEST * at), 1.0))
    weight = _smoothed(there.astype(np.float64))
    share = np.exp(np.divide(_smoothed(logarithm), weight, out=np.zeros_like(weight), where=there))
    return problem.relit(problem.image * share), dim


def _smoothed(values: Array) -> Array:
    for _ in range(_SMOOTHINGS):
        padded = np.pad(values, 1)
        rows = padded[:-2] + 2.0 * padded[1:-1] + padded[2:]
        values = (rows[:, :-2] + 2.0 * rows[:, 1:-1] + rows[:, 2:]) / 16.0
    return values
