"""From what a user gave for an image to its surface of least energy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from persfs_cl import masks
from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.choices import Precision
from persfs_cl.grid import PixelGrid
from persfs_cl.preparation.inpaint import harmonic
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.minimise import Minimum, Stopping, minimise
from persfs_cl.solver.energy.prior import Prior
from persfs_cl.solver.energy.view import View
from persfs_cl.solver.energy.weights import weights_for
from persfs_cl.solver.problem import Problem

_GRIDS, _GRIDS_OF_PRIOR = 6, 4
"""At most; a prior has the large forms."""


@dataclass(frozen=True)
class Sought:
    """An image, and what is known of its surface. Arrays have the shape (height, width).

    Attributes
    ----------
    image : ndarray of float64
        Brightness of a surface that returns all light.
    grid : PixelGrid
    light : Light
    reflectance : Reflectance
    solved : ndarray of bool
        Pixels to find the depth of.
    known : ndarray of float64
        ln z of pixels that keep it, NaN elsewhere.
    limits : ndarray of float64, shape (2, height, width), or None
        Bounds of ln z from below and from above, NaN where there is none.
    prior : Prior or None
    """

    image: Array
    grid: PixelGrid
    light: Light
    reflectance: Reflectance
    solved: Mask
    known: Array
    limits: Array | None = None
    prior: Prior | None = None

    @classmethod
    def of(cls, problem: Problem, prior: Prior | None = None) -> Sought:
        """What a user gave."""
        domain, limits = problem.domain, None
        if problem.depth_range is not None:
            within = problem.depth_range.cut(problem.window)
            limits = np.where(domain.solved, np.log(np.stack([within.near, within.far])), np.nan)
        return cls(
            image=problem.image,
            grid=problem.grid,
            light=problem.model.light,
            reflectance=problem.model.reflectance,
            solved=domain.solved,
            known=np.log(np.where(domain.known, problem.known_depth, np.nan)),
            limits=limits,
            prior=prior,
        )

    def filled(self, log_depth: Array) -> Array:
        """What is known, `log_depth` elsewhere, and what lies between them where that is NaN."""
        first = np.where(np.isnan(self.known), log_depth, self.known)
        there = ~np.isnan(first)
        return _filled(first, self.solved & ~there, there)


def regularised(
    device: Device,
    sought: Sought,
    stopping: Stopping,
    *,
    paint: str | float = "plain",
    smoothing: float | None = None,
    fitted: bool = False,
    precision: Precision = "float32",
    start: Array | None = None,
) -> Minimum:
    """Find the surface of least energy.

    Parameters
    ----------
    device : Device
    sought : Sought
    stopping : Stopping
    paint : "plain", "painted" or float
        How far brightness varies beyond the shading; a number is the spread of ln albedo.
    smoothing : float, optional
        Pixels to smooth over; 1 for plain surfaces and 20 for painted ones when not given.
    fitted : bool
        Whether paint has been divided out, see :mod:`persfs_cl.solver.energy.albedo`.
    precision : {"float32", "float64"}
    start : ndarray of float64, shape (height, width), optional
        ln z to begin with, NaN where it is to be filled in; the prior when not given.

    Returns
    -------
    Minimum
    """
    prior = sought.prior
    if start is None:
        start = np.full(sought.image.shape, np.nan) if prior is None else prior.log_depth
    first = sought.filled(start)
    present = sought.solved | ~np.isnan(sought.known)
    # Single precision is for the relief.
    level = float(np.median(first[present]))
    light = sought.light.of_unit_gain.in_unit(math.exp(level))
    nothing = np.full(sought.image.shape, np.nan)
    sure = np.zeros_like(nothing) if prior is None else np.where(np.isnan(prior.log_depth), 0.0, 1.0 / prior.tolerance)
    view = View(
        image=np.where(sought.solved, sought.image / sought.light.scaled(np.ones((1, 1)), level), 1.0),
        solved=sought.solved,
        known=sought.known - level,
        prior=nothing if prior is None else prior.log_depth - level,
        certainty=np.where(sought.solved, sure, 0.0),
        limits=None if sought.limits is None else sought.limits - level,
        grid=sought.grid,
    )
    first = first - level
    weight = None if prior is None else prior.weight
    weights = weights_for(view, first, light, sought.reflectance, paint, smoothing, weight, fitted=fitted)
    found = minimise(
        device,
        view,
        first,
        light,
        sought.reflectance,
        weights,
        stopping,
        precision=precision,
        most_grids=_GRIDS if prior is None else _GRIDS_OF_PRIOR,
    )
    found.level = level
    return found


def _filled(values: Array, unknown: Mask, given: Mask) -> Array:
    """With values between those given; a typical one where no way leads from them."""
    if not unknown.any():
        return values
    typical = float(np.median(values[given]))
    reached = masks.connected(given, given | unknown)
    filled = np.where(given, values, typical)
    inside = unknown & reached
    if inside.any():
        filled[inside] = harmonic(values, inside, given)
    return filled
