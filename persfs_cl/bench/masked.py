"""What the rest of the frame costs around a small object."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import in_kernels, time_record, timed
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.upwind import Upwind

FRAME, BOX, RATIO = "whole frame", "its box", "frame over box"
CASES: dict[str, tuple[Light, str]] = {
    "Lax-Friedrichs, parallel light": (ps.ParallelLight(), LaxFriedrichs.name),
    "upwind, flash": (ps.FlashLight(), Upwind.name),
}

_SIZE = 1024
_SHARE = 4
"""Edges of the object in one of the frame."""


def masked(plan: Plan) -> Iterator[list[Record]]:
    """A bump on a sixteenth of the frame, by its mask in the whole frame, and in its box alone."""
    size = plan.size(_SIZE)
    for name, (light, scheme) in CASES.items():
        box = ps.bump((size // _SHARE, size // _SHARE), light=light)
        calls = {FRAME: _call(plan, box, scheme, size), BOX: _call(plan, box, scheme, None)}
        details = {what: f"{call().iterations} iterations" for what, call in calls.items()}
        timings = timed(plan, {what: in_kernels(call) for what, call in calls.items()})
        common: dict[str, Any] = {
            "experiment": "masked",
            "size": size,
            "images": 1,
            "precision": plan.precision,
        }
        ratios = timings[FRAME].over(timings[BOX])
        yield [
            *(time_record(timings[what], workload=f"{name}: {what}", detail=details[what], **common) for what in calls),
            Record.of(ratios, workload=name, quantity=RATIO, unit="", **common),
        ]


def _call(plan: Plan, box: Scene, scheme: str, size: int | None) -> Callable[[], ps.Solution]:
    """Solves the box, within a frame of that size unless it is None."""
    edge = box.image.shape[0]
    # Not in the middle, where nobody puts it on purpose.
    row, column = (0, 0) if size is None else (size // 8, size // 2)
    shape = (size or edge, size or edge)

    def framed(values: NDArray[Any], elsewhere: float) -> NDArray[Any]:
        whole = np.full(shape, elsewhere, values.dtype)
        whole[row : row + edge, column : column + edge] = values
        return whole

    middle = (edge - 1) / 2
    camera = ps.Camera(box.camera.focal_length, (column + middle, row + middle))
    known: dict[str, Any] = {}
    if box.light.flat_rim:
        known = {"known_depth": framed(box.known_depth, np.nan), "surface": box.surface}
    return partial(
        ps.reconstruct,
        framed(box.image, 0.0),
        camera,
        mask=framed(box.mask, False),
        light=box.light,
        scheme=scheme,
        device=plan.device,
        precision=plan.precision,
        **known,
    )
