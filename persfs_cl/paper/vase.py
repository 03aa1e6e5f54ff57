"""Table 1 and Figure 2: the synthetic vase, as docs/paper.md states it.

The paper leaves open how far away the vase is, where the optical axis meets it, and what is known. Here the focal
length of 100 pixels is the width of the image, the axis meets its middle, the background is one focal length away, with
the vase bulging away from the camera by (13), and background and frame are known. Errors are those of the height, over
the whole image, after both heights have been scaled to [0, 1].
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from persfs_cl.metrics import Errors, compare
from persfs_cl.paper import figures, printed
from persfs_cl.paper.history import followed, marching, sweeping, told
from persfs_cl.paper.literal import Reading, iterates
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings
from persfs_cl.paper.tables import HERE, PRINTED, PRINTED_TANKUS, TANKUS, error_tables, time_table
from persfs_cl.scenes.analytic import vase
from persfs_cl.scenes.scene import Scene

START = 1.0
"""C of the literal readings: ln z of a depth of 2.7, where the vase ends at 1.29."""

CLOSEST = Reading(0.36, rescaled=True)
"""The reading whose history is nearest to the printed one, of those tried, where the ends at which the image cuts the
vase off are unknown, so that (12) is at work there. C is a little above the farthest point of the vase, at 0.25."""

_UPWIND = "here, upwind"
_LITERAL = "one σ, rescaled"
_CLOSEST = "closest reading"


def measured(scene: Scene, depth: NDArray[np.float64]) -> Errors:
    """Errors of the height, both heights scaled to [0, 1]."""
    return compare(depth, scene.depth, align="range")


def experiment(plan: Plan) -> Findings:
    """Both methods side by side, and our own with each of its corrections taken back."""
    scene = vase()
    measure = partial(measured, scene)
    common = (scene.image, scene.camera, measure, printed.ITERATIONS)
    here = sweeping(*common, repeats=plan.repeats, device=plan.device, **told(scene))
    upwind = sweeping(*common, repeats=plan.repeats, device=plan.device, scheme="upwind", **told(scene))
    tankus = marching(*common, repeats=plan.repeats, **told(scene))
    readings = {
        "one σ": Reading(START, one_viscosity=True),
        "rescaled": Reading(START, rescaled=True),
        _LITERAL: Reading(START, one_viscosity=True, rescaled=True),
    }
    literal = {
        name: followed(iterates(scene, reading, plan.device), measure, printed.ITERATIONS).history
        for name, reading in readings.items()
    }
    open_ends = iterates(vase(known="background"), CLOSEST, plan.device)
    histories = {
        PRINTED: printed.YANG_HAN_VASE,
        HERE: here.history,
        _UPWIND: upwind.history,
        **literal,
        _CLOSEST: followed(open_ends, measure, printed.ITERATIONS).history,
        PRINTED_TANKUS: printed.TANKUS_VASE,
        TANKUS: tankus.history,
    }
    compared = {name: histories[name] for name in (HERE, _UPWIND, _LITERAL, _CLOSEST, TANKUS)}
    iterations = printed.ITERATIONS
    draw_courses = partial(
        figures.histories,
        own=compared,
        printed={"Yang and Han": printed.YANG_HAN_VASE, "Tankus": printed.TANKUS_VASE},
        unit="height scaled to [0, 1]",
    )
    draw_shapes = partial(
        figures.vase_shapes, scene=scene, here=here.depth, tankus=tankus.depth, iterations=iterations[-1]
    )
    return Findings(
        [*error_tables("table1", histories, iterations, "{:.4f}"), time_table("table1", histories, iterations)],
        {"table1.png": draw_courses, "figure2.png": draw_shapes},
    )
