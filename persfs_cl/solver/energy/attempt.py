"""One problem whose energy is minimised: with what its guide tells, and what comes of it."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array
from persfs_cl.checks import warn
from persfs_cl.guide.agreement import noise_of
from persfs_cl.guide.few import scatter_of
from persfs_cl.guide.fit import Fitted, slope_of
from persfs_cl.solver.agreed import Agreed, about, mean_focal_length
from persfs_cl.solver.attempt import Attempt
from persfs_cl.solver.complete import tolerance_of
from persfs_cl.solver.energy.albedo import fit_albedo
from persfs_cl.solver.energy.minimise import Minimum, Stopping
from persfs_cl.solver.energy.prior import MOST, Prior
from persfs_cl.solver.energy.regularised import Sought, regularised
from persfs_cl.solver.energy.swept import swept
from persfs_cl.solver.iterate import Iteration, Watch, stop_at_once
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.outcome import Status
from persfs_cl.wording import keyword

_LEAST_OF_RELIEF, _LEAST = 1e-3, 1e-7
"""Tolerance at least, as a share of the relief of the guide, and in ln depth."""
_AGREE = 2.0
"""Noises by which guide and surface may scatter."""
_FARTHEST_APART = math.log(1e6)
"""How far apart depths of a photograph may be, in ln: by a factor of a million."""
_TRIAL = 40
"""Iterations after which the surface tells how far the guide scatters about it."""


def minimised(device: Device, problem: Problem, options: Options, watch: Watch | None, number: int) -> Attempt:
    """The surface of least energy of one problem.

    Parameters
    ----------
    device : Device
    problem : Problem
    options, watch
        As for :func:`persfs_cl.solver.solve.solve`.
    number : int
        Of the problem that warnings concern.

    Raises
    ------
    InputError
        When guide and surface have nothing in common.

    Warns
    -----
    UserWarning
        When the scale of a guide contradicts the light, or the surface runs away.
    """
    began = time.perf_counter()
    stopped = watch is not None and watch.stopped
    light, guide = problem.model.light, problem.guide
    start: Array | None = None
    if guide is None or light.determines_depth or options["guide_scale"] != "fixed":
        start = swept(device, problem, options, stop_at_once if stopped else None)
    fitted, gain = None, None
    if guide is not None and start is not None:
        with about(number):
            agreed = Agreed.on(problem, guide, start, options)
        problem, fitted, gain, start = agreed.problem, agreed.fitted, agreed.gain, agreed.log_depth
    elif guide is not None:
        fitted = Fitted.as_given(guide, mean_focal_length(problem.camera), options["guide_tolerance"])
    # Between points of a plain surface such a light tells more than they do.
    between = not (light.determines_depth and options["paint"] == "plain" and not problem.fits_albedo)
    prior = None if fitted is None else prior_of(fitted, between=between)
    if fitted is not None and prior is not None and start is not None and not between:
        prior = replace(prior, counts=_counts(fitted, start))
    stopping = Stopping(
        tolerance=tolerance_of(options),
        bounds=options["stopping"],
        max_iterations=options["max_iterations"],
        callback=stop_at_once if stopped else watch,
    )
    keywords: dict[str, Any] = {
        "paint": "painted" if problem.fits_albedo else options["paint"],
        "smoothing": options["smoothing"],
        "precision": options["precision"],
    }
    # Of a flash the sweeps know more than any guide.
    begin = start if prior is None or light.determines_depth else None
    trial: Minimum | None = None
    if fitted is not None and start is None and options["guide_tolerance"] is None:
        # Of the guide alone nobody can tell noise from relief.
        most = min(_TRIAL, stopping.max_iterations)
        trial = regularised(device, Sought.of(problem, prior), replace(stopping, max_iterations=most), **keywords)
        cells = fitted.cells
        noise = noise_of(cells.values - cells.of_surface(trial.log_depth + trial.level), cells)
        fitted = replace(fitted, noise=noise)
        prior = prior_of(fitted, between=between)
        if watch:
            watch.before = len(trial.changes)
    sought = Sought.of(problem, prior)
    if trial is not None and (trial.status is Status.STOPPED or len(trial.changes) >= stopping.max_iterations):
        found = trial
    elif problem.fits_albedo:
        found, albedo = fit_albedo(
            device, sought, stopping, smoothing=options["smoothing"], precision=options["precision"]
        )
        problem = replace(problem, albedo=problem.window.spread(np.nan_to_num(albedo, nan=1.0), 1.0))
    else:
        left = stopping.max_iterations - (0 if trial is None else len(trial.changes))
        found = regularised(device, sought, replace(stopping, max_iterations=left), start=begin, **keywords)
    if _has_run_away(found):
        with about(number):
            warn(
                "The surface has run away: do not use it. Too little tells how far it is: give more of "
                f"{keyword('known_depth')}, {keyword('depth_range')} or {keyword('guide')}, or take another scheme."
            )
    if watch:
        watch.before = 0
    if trial is not None and found is not trial:
        found.changes = [*trial.changes, *found.changes]
        found.build_seconds += trial.build_seconds
        found.kernel_seconds += trial.kernel_seconds
    run = Iteration(
        [], [found.changes], [found.status], [found.distance], "energy", found.build_seconds, found.kernel_seconds
    )
    # Its values are those of Z itself, whatever the sweeps would have solved for.
    plain = replace(problem, level=found.level, sign=1.0, offset=np.zeros_like(problem.image))
    surface = plain.depth(found.log_depth, converged=True)
    told = None
    if fitted is not None and prior is not None and found.status is not Status.STOPPED:
        departure = problem.window.spread(prior.log_depth - surface[0], np.nan)
        told = fitted.outcome(fitted.count, fitted.noise, gain, departure)
    return Attempt(problem, run, surface, None, time.perf_counter() - began, told)


def _has_run_away(found: Minimum) -> bool:
    """Whether its energy is no number, or its depths are farther apart than those of any photograph."""
    heights = found.log_depth[~np.isnan(found.log_depth)]
    told = heights.size > 0 and bool(np.isfinite(found.energies).all())
    return not (told and np.ptp(heights) <= _FARTHEST_APART)


def _counts(fitted: Fitted, log_depth: Array) -> float:
    """Pixels that a number of the guide counts as, where the image tells the depth: one, if they agree.

    They do not where guide and surface scatter by much more than neighbours within the guide do: then the surface has
    paint from the image. A common offset, which noise brings about too, is no such difference.
    """
    cells = fitted.cells
    noise = min(fitted.noise, noise_of(cells.values, cells))
    return 1.0 if scatter_of(cells.values - cells.of_surface(log_depth)) <= _AGREE * noise else MOST


def prior_of(fitted: Fitted, *, between: bool) -> Prior:
    """What cells of ln depth say of each pixel: between their middles, the less surely the steeper it is there.

    Parameters
    ----------
    fitted : Fitted
    between : bool
        Whether points say something of what lies between them. A point that does not is a measurement of one pixel.
    """
    cells = fitted.cells
    middle = cells.interpolated(cells.values)
    relief = float(np.ptp(cells.values[~np.isnan(cells.values)]))
    # Beyond it the energy is of the guide alone, whose bends no shading softens.
    noise = max(math.hypot(fitted.noise, fitted.distortion), _LEAST_OF_RELIEF * relief, _LEAST)
    if cells.are_points and not between:
        return Prior(middle, np.where(cells.of_pixel >= 0, noise, np.inf))
    tolerance = np.sqrt(noise**2 + (slope_of(middle) * cells.spacing) ** 2 / 12.0)
    if cells.are_points:
        # Nothing is known of what lies between them but how they differ from each other.
        _, distance = cells.nearest(cells.values)
        tolerance = np.hypot(tolerance, cells.differing * distance / cells.spacing)
    # What no cell reaches is left to the photograph.
    nowhere = ~cells.reached(~np.isnan(cells.values))
    middle[nowhere] = tolerance[nowhere] = np.nan
    return Prior(middle, tolerance, cells.spacing)
