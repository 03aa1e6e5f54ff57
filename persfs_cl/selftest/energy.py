"""A small energy with all of its terms, for the reference: see kernels/energy/."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl._cl.energy import Descent
from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.choices import Precision
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.minimise import terms_of
from persfs_cl.solver.energy.reference import Reference
from persfs_cl.solver.energy.view import View
from persfs_cl.solver.energy.weights import Weights

PAIRS = ((0, 1), (0, 2), (1, 0), (2, 0), (1, 1), (1, -1))
"""Rows and columns from a pixel to the other of a pair, plane after plane."""
PLAIN = Weights(
    painted=False,
    noise=0.03,
    share=0.05,
    floor=0.02,
    dark=0.02,
    weight=1.3,
    scale=3.0,
    prior_weight=0.4,
    prior_scale=2.0,
    smoothness=0.7,
    crease=0.2,
)
PAINTED = replace(PLAIN, painted=True, noise=0.3, share=0.0, weight=0.08, scale=1.8, crease=0.02)


def rough(
    light: Light,
    reflectance: Reflectance,
    weights: Weights,
    shape: tuple[int, int] = (11, 14),
    *,
    spacing: int = 1,
    bounded: bool = False,
) -> tuple[Reference, Array]:
    """An energy of noise, with a hole in the mask and some known pixels; and a surface.

    Parameters
    ----------
    light, reflectance
        Of unit gain.
    weights : Weights
    shape : (int, int)
        9 by 8 at least.
    spacing : int
        Of the pixels, in those of the finest grid.
    bounded : bool
        Whether a third of the pixels have bounds, which leave no room for a step.
    """
    rng = np.random.default_rng(7)
    grid = Camera(focal_length=(20.0, 24.0)).grid(shape)
    x, y = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
    log_depth = 0.06 * np.sin(x / 2.0) * np.cos(y / 3.0) + rng.normal(0.0, 0.004, shape)
    solved = np.ones(shape, bool)
    solved[4:6, 3:5] = solved[0, 0] = solved[-1, 5] = False
    solved[6, 5:7] = False
    known = np.full(shape, np.nan)
    known[6, 5:7] = log_depth[6, 5:7]
    certainty = np.where((rng.random(shape) < 0.7) & solved, rng.uniform(10.0, 60.0, shape), 0.0)
    limits = None
    if bounded:
        held = solved & (rng.random(shape) < 1.0 / 3.0)
        limits = np.where(held, np.stack([log_depth, log_depth + 1e-4]), np.nan)
    view = View(
        image=rng.uniform(0.1, 0.9, shape),
        solved=solved,
        known=known,
        prior=np.where(certainty > 0.0, log_depth + rng.normal(0.0, 0.03, shape), np.nan),
        certainty=certainty,
        limits=limits,
        grid=grid,
        spacing=spacing,
    )
    return Reference(view, light, reflectance, weights), np.where(view.present, log_depth, 0.0)


def descent_of(reference: Reference, log_depth: Array, device: Device, precision: Precision) -> Descent:
    """It on a device."""
    terms = terms_of(reference.view, log_depth, reference.light, reference.reflectance, reference.weights)
    kernels = ["elementary", reference.reflectance.kernel, reference.light.shading_kernel]
    return Descent(device, terms, kernels, precision)


def derivative(reference: Reference, log_depth: Array, direction: Array, white: float) -> float:
    """Of the energy along a direction, by central differences of fourth order."""
    step = 1e-5
    ahead, behind, farther, before = (
        reference.energy(log_depth + factor * step * direction, white) for factor in (1.0, -1.0, 2.0, -2.0)
    )
    return (8.0 * (ahead - behind) - (farther - before)) / (12.0 * step)


def multiplied(planes: Array, values: Array) -> Array:
    """A matrix times values; of each pair of pixels the planes hold one number, see normal_equations.cl."""
    height, width = values.shape
    result: Array = planes[0] * values
    for plane, (down, right) in zip(planes[1:], PAIRS, strict=True):
        rows, columns = slice(0, height - down), slice(max(0, -right), width - max(0, right))
        other_rows, other_columns = slice(down, height), slice(max(0, right), width - max(0, -right))
        part = plane[rows, columns]
        result[rows, columns] += part * values[other_rows, other_columns]
        result[other_rows, other_columns] += part * values[rows, columns]
    return result
