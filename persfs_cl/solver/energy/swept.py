"""Where the descent begins without a prior: at what the sweeps make of the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array
from persfs_cl.solver.iterate import Iteration
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.schemes import AUTO, scheme_for

_TOLERANCE = 1e-4
"""As near as a start has to be."""


def swept(device: Device, problem: Problem, options: Options, callback: Callback | None) -> Array:
    """Find ln z by the sweeps, shape (height, width), NaN where they find nothing.

    An energy has many minima, and descends into the one that it begins near. The sweeps need no start. They are no
    iterations of the descent: neither counted, nor heard by the user's callback.
    """
    light, reflectance = problem.model.light, problem.model.reflectance
    scheme = scheme_for(AUTO, light, reflectance, "wall")
    model = scheme.model(light, reflectance)
    offset = model.offset(problem.grid)
    known = problem.domain.known
    given = replace(
        problem.given,
        scheme=scheme,
        model=model,
        offset=offset,
        known_values=problem.sign * (np.log(problem.known_depth[known]) + offset[known]),
        max_slope=scheme.max_slope(light),
    )
    swept_problem = Problem.of(given)
    settings = Options(**{**options, "tolerance": _TOLERANCE, "stopping": "distance", "boundary": "wall"})
    run = Iteration.of(device, [swept_problem], settings, callback)
    return run.surfaces([swept_problem])[0][0]
