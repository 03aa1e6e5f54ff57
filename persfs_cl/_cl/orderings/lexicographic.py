"""The paper's order: see kernels/orderings/lexicographic.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.orderings.ordering import WORK_GROUP_OF_ONE, Ordering
from persfs_cl._cl.run import DIRECTIONS, Run


@dataclass(frozen=True)
class Lexicographic(Ordering):
    """Cell by cell, one work-item an image."""

    file: ClassVar[str] = "lexicographic"
    serial: ClassVar[bool] = True
    reason: ClassVar[str] = "One work-item follows the paper's loops, cell by cell."

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """One launch."""
        leftwards, upwards = DIRECTIONS[number]
        return run.launch((run.images,), WORK_GROUP_OF_ONE, leftwards=leftwards, upwards=upwards)
