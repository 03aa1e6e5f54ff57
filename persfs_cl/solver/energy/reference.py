"""The energy in plain NumPy, float64: what the kernels of kernels/energy/ are judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.grid import PixelGrid
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.view import View
from persfs_cl.solver.energy.weights import Weights


@dataclass(frozen=True)
class Reference:
    """An energy as a function of Z, see kernels/energy/linearise.cl.

    Attributes
    ----------
    view : View
    light, reflectance
        Of unit gain, in the unit of exp Z.
    weights : Weights
    """

    view: View
    light: Light
    reflectance: Reflectance
    weights: Weights

    def energy(self, log_depth: Array, white: float = 0.0) -> float:
        """The sum of all terms."""
        weights = self.weights
        counted = self.residuals(log_depth, white)
        shading = weights.weight * _cauchy(counted, weights.scale).sum()
        off = (log_depth - np.where(self.view.certainty > 0.0, self.view.prior, 0.0)) * self.view.certainty
        prior = weights.prior_weight * _charbonnier(off, weights.prior_scale).sum()
        bent = sum(share * _charbonnier(bend, weights.crease).sum() for share, bend in self.bends(log_depth))
        return float(shading + prior + weights.smoothness * bent)

    def residuals(self, log_depth: Array, white: float = 0.0) -> Array:
        """Of the brightness, 0 where none counts."""
        weights, view = self.weights, self.view
        p, q = slopes_of(log_depth, view.present, view.grid)
        shaded = self.light.brightness(log_depth, p, q, view.grid.x, view.grid.y, self.reflectance)
        lifted = 0.5 * (shaded + np.sqrt(shaded**2 + 4.0 * weights.floor**2))
        given = np.where(view.solved, view.image, 1.0)
        if weights.painted:
            share = given / (given + 3.0 * weights.dark)
            found = (np.log(given + weights.dark) - np.log(lifted) - white) * share / weights.noise
        else:
            found = (given - lifted) / np.hypot(weights.noise, weights.share * given)
        return np.where(view.solved, found, 0.0)

    def bends(self, log_depth: Array) -> list[tuple[float, Array]]:
        """Second differences of slopes along x, along y and across, and how often each counts."""
        numbers, present, z = self.weights.numbers(self.view), self.view.present, log_depth
        bend_x, bend_y = numbers["bend_x"], numbers["bend_y"]
        row = present[:, :-2] & present[:, 1:-1] & present[:, 2:]
        column = present[:-2] & present[1:-1] & present[2:]
        square = present[:-1, :-1] & present[1:, :-1] & present[:-1, 1:] & present[1:, 1:]
        twist = z[1:, 1:] - z[1:, :-1] - z[:-1, 1:] + z[:-1, :-1]
        return [
            (1.0, bend_x * np.where(row, z[:, 2:] - 2.0 * z[:, 1:-1] + z[:, :-2], 0.0)),
            (1.0, bend_y * np.where(column, z[2:] - 2.0 * z[1:-1] + z[:-2], 0.0)),
            (2.0, np.sqrt(bend_x * bend_y) * np.where(square, twist, 0.0)),
        ]


def slopes_of(log_depth: Array, present: Mask, grid: PixelGrid) -> tuple[Array, Array]:
    """dZ/dx and dZ/dy: central differences, one-sided where a neighbour is missing, 0 where both are."""
    found = []
    for axis, spacing in ((1, grid.dx), (0, grid.dy)):
        rise, both = np.diff(log_depth, axis=axis), _both(present, axis)
        steps, counts = np.zeros((2, *log_depth.shape))
        for part in (_but_last(axis), _but_first(axis)):
            steps[part] += np.where(both, rise, 0.0)
            counts[part] += both
        found.append(steps / np.maximum(counts, 1.0) / spacing)
    return found[0], found[1]


def _but_last(axis: int) -> tuple[slice, ...]:
    return (slice(None),) * axis + (slice(None, -1),)


def _but_first(axis: int) -> tuple[slice, ...]:
    return (slice(None),) * axis + (slice(1, None),)


def _both(present: Mask, axis: int) -> Mask:
    return np.asarray(present[_but_last(axis)] & present[_but_first(axis)])


def _cauchy(values: Array, scale: float) -> Array:
    return np.asarray(0.5 * scale**2 * np.log1p((values / scale) ** 2))


def _charbonnier(values: Array, scale: float) -> Array:
    return np.asarray(scale**2 * (np.sqrt(1.0 + (values / scale) ** 2) - 1.0))
