"""The least energy, by Gauss-Newton's method with reweighting, from coarse grids to the finest."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl._cl.energy import Descent, Terms
from persfs_cl.arrays import Array
from persfs_cl.choices import Precision
from persfs_cl.choices import Stopping as BoundBy
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.distance import distance_to_limit
from persfs_cl.solver.energy.line_search import search
from persfs_cl.solver.energy.view import View, finer, means
from persfs_cl.solver.energy.weights import Weights
from persfs_cl.surface.outcome import Status

_SMALLEST_SIDE = 16
"""Pixels of the shorter side of the coarsest grid, at least."""

_COARSE_ITERATIONS = 25
_COARSE_GAIN = 5e-4
"""Share of the energy that an iteration on a coarse grid must gain to be worth another."""

_STEPS, _REDUCTION = 5, 0.3
"""Of the method of conjugate gradients for a step: how many at most, and the remainder that is small enough. More
cost more than they gain: the directions made of them go on where they end, and the energy is not quadratic."""

_GAIN, _SPAN = 1e-3, 5
"""Share of the energy that it may fall by over so many iterations at the end; while it falls by more no distance is
believed. Where each pixel brings about 1 to the energy, 1e-3 of it is what 5 % of the standard deviation of its depth
makes."""
_FEW = 5
"""Changes, and estimates of the distance, before the last one that count with it."""

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-6, 1e4
_SHORT, _LONGEST = 0.3, 4.0
_DAMPED_MORE, _DAMPED_LESS = 10.0, 0.2


@dataclass(frozen=True)
class Stopping:
    """When to end.

    Attributes
    ----------
    tolerance : float
    bounds : {"distance", "change", "gain"}
        What that bounds: of Z the estimated distance to the minimum, or the change of an iteration alone; or the share
        of the energy that it falls by over the last iterations.
    max_iterations : int
    callback : callable or None
        Called with the number of the iteration and its change; returns True to stop.
    """

    tolerance: float
    bounds: BoundBy
    max_iterations: int
    callback: Callable[[int, float], bool | None] | None


@dataclass
class Minimum:
    """What was found.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Z, NaN where nothing is.
    changes : list of float
        max |ΔZ| of each iteration, on all grids.
    energies : list of float
        On the finest grid, at first and after each iteration; they never rise.
    status : Status
    distance : float
        Estimate of max |Z - minimum|; NaN where that cannot be told. Where nothing lower was found, of the last step.
    level : float
        What ln z has more than Z.
    white : float
        Level of ln albedo.
    build_seconds, kernel_seconds : float
    """

    log_depth: Array
    changes: list[float] = field(default_factory=list)
    energies: list[float] = field(default_factory=list)
    status: Status = Status.MAX_ITERATIONS
    distance: float = math.nan
    level: float = 0.0
    white: float = 0.0
    build_seconds: float = 0.0
    kernel_seconds: float = 0.0


def minimise(
    device: Device,
    view: View,
    start: Array,
    light: Light,
    reflectance: Reflectance,
    weights: Weights,
    stopping: Stopping,
    *,
    precision: Precision,
    most_grids: int,
) -> Minimum:
    """Find the surface of least energy near the one to start with.

    Parameters
    ----------
    device : Device
    view : View
    start : ndarray of float64, shape (height, width)
        Z where the view has something.
    light, reflectance
        Of unit gain, in the unit of exp Z.
    weights : Weights
    stopping : Stopping
    precision : {"float32", "float64"}
    most_grids : int
        How many grids there are, the finest included, where the image is large enough.
    """
    views, starts = [view], [start]
    while len(views) < most_grids and min(views[-1].image.shape) >= 2 * _SMALLEST_SIDE:
        starts.append(means(starts[-1], views[-1].present)[0])
        views.append(views[-1].coarser())
        if not views[-1].solved.any():
            del views[-1], starts[-1]
            break
    found = Minimum(starts[-1])
    # What the coarser grids have changed, so that the start keeps its fine forms.
    change = np.zeros_like(starts[-1])
    for own, first in zip(reversed(views), reversed(starts), strict=True):
        change = change if change.shape == first.shape else _spread(change, first.shape)
        values = _within(own, first + change)
        began = time.perf_counter()
        terms = terms_of(own, values, light, reflectance, weights)
        descent = Descent(device, terms, ["elementary", reflectance.kernel, light.shading_kernel], precision)
        found.build_seconds += time.perf_counter() - began
        began = time.perf_counter()
        _descend(descent, found, weights, stopping, precision, finest=own is view)
        found.kernel_seconds += time.perf_counter() - began
        values = np.where(own.present, descent.log_depth(), np.nan)
        change = values - first
        if found.status is Status.STOPPED:
            break
    if values.shape != start.shape:
        for first in reversed(starts[: len(views) - 1]):
            if first.size > change.size:
                change = _spread(change, first.shape)
        values = _within(view, start + change)
    found.log_depth = np.where(view.solved, values, view.known)
    return found


def _spread(change: Array, shape: tuple[int, ...]) -> Array:
    """What has changed, on the next finer grid; 0 where nothing near has."""
    return np.nan_to_num(finer(change, np.isfinite(change), shape))


def _within(view: View, values: Array) -> Array:
    """Values with what is known, and between the bounds."""
    result = np.where(np.isnan(view.known), values, view.known)
    if view.limits is not None:
        np.fmax(result, view.limits[0], out=result, where=view.solved)
        np.fmin(result, view.limits[1], out=result, where=view.solved)
    return result


def terms_of(view: View, first: Array, light: Light, reflectance: Reflectance, weights: Weights) -> Terms:
    """What the device is given of an energy, and of the surface to begin with."""
    grid = view.grid
    return Terms(
        log_depth=np.where(view.present, first, 0.0),
        brightness=np.where(view.solved, view.image, 1.0),
        flags=view.flags,
        fixed=~view.solved,
        prior=np.where(view.certainty > 0.0, view.prior, 0.0),
        certainty=view.certainty,
        limits=view.limits,
        parameters={
            "half_inverse_dx": 0.5 / grid.dx,
            "half_inverse_dy": 0.5 / grid.dy,
            "step_x": 0.0,
            "step_y": 0.0,
            "steepest": 0.0,
            "sign": 1.0,
            **light.shading_numbers,
            **reflectance.numbers,
        },
        x=grid.x,
        y=grid.y[:, 0],
        numbers=weights.numbers(view),
        painted=weights.painted,
    )


def _descend(
    descent: Descent, found: Minimum, weights: Weights, stopping: Stopping, precision: Precision, *, finest: bool
) -> None:
    """Go down on one grid, and note what happens."""
    free, rounding = weights.white_is_free, float(np.finfo(precision).eps)
    here = descent.linearise(found.white)
    if free:
        found.white = here.white
        here = descent.linearise(found.white)
    energies: list[float] = [here.energy]
    changes: list[float] = []
    whole: list[float] = []
    damping, length, afresh = _FIRST_DAMPING, 1.0, True
    status, left = Status.MAX_ITERATIONS, math.nan
    while len(found.changes) < stopping.max_iterations and math.isfinite(here.energy):
        descent.assemble(damping)
        descent.solve(_STEPS, _REDUCTION)
        reached = search(descent, here, descent.turn(afresh=afresh), found.white, length)
        if reached.length == 0.0:
            descent.linearise(found.white)
            if afresh:
                left = reached.change if math.isnan(left) else left
                damping = max(_DAMPED_MORE * damping, _FIRST_DAMPING)
            afresh, length = True, 1.0
            if damping > _MOST_DAMPING:
                # Nothing lower is found: what is left is rounding.
                status = Status.CONVERGED
                break
            continue
        there, left = reached.sums, math.nan
        if free:
            whitened = descent.linearise(there.white)
            if whitened.energy <= there.energy:
                found.white, there = there.white, whitened
            else:
                # By rounding.
                descent.linearise(found.white)
        # A direction that leads nowhere says nothing of the next.
        afresh = reached.length < _SHORT
        length = min(max(reached.length, _SHORT), _LONGEST)
        damping = max(_DAMPED_LESS * damping, _LEAST_DAMPING)
        gained, here = here.energy - there.energy, there
        energies.append(here.energy)
        changes.append(reached.change)
        whole.append(reached.change / min(1.0, reached.length))
        found.changes.append(reached.change)
        if stopping.callback is not None and stopping.callback(len(found.changes), reached.change):
            status = Status.STOPPED
            break
        if not finest:
            if len(changes) == _COARSE_ITERATIONS or gained <= _COARSE_GAIN * here.energy:
                break
            continue
        if reached.change == 0.0 or _is_met(stopping, reached.change, energies, whole, rounding):
            status = Status.CONVERGED
            break
    if finest or status is Status.STOPPED:
        found.status, found.energies = status, energies
        # Where nothing changes any more, the changes before it tell nothing.
        estimate = distance_to_limit if whole and whole[-1] == 0.0 else estimated_distance
        found.distance = estimate(whole, rounding) if math.isnan(left) else left


def _is_met(
    stopping: Stopping, change: float, energies: Sequence[float], whole: Sequence[float], rounding: float
) -> bool:
    """Whether the tolerance is."""
    if stopping.bounds == "change":
        return change <= stopping.tolerance
    gained = energies[-1 - _SPAN] - energies[-1] if len(energies) > _SPAN else math.inf
    if stopping.bounds == "gain":
        return gained <= stopping.tolerance * energies[-1]
    return gained <= _GAIN * energies[-1] and estimated_distance(whole, rounding) <= stopping.tolerance


def estimated_distance(changes: Sequence[float], rounding: float) -> float:
    """As :func:`distance_to_limit`, of changes that shrink unevenly.

    Each counts as the largest of the last few, and the estimate is the largest of the last few; NaN where one is.
    """
    few = [max(changes[max(0, place - _FEW) : place + 1]) for place in range(len(changes))]
    latest = range(max(2, len(few) - _FEW + 1), len(few) + 1)
    return float(np.max([distance_to_limit(few[:count], rounding) for count in latest] or [math.nan]))
