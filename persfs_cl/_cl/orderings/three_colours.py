"""Three colours in place of the checkerboard at second order: see kernels/orderings/three_colours.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.orderings.ordering import Ordering, in_row_groups
from persfs_cl._cl.run import Run


@dataclass(frozen=True)
class ThreeColours(Ordering):
    """All cells of a colour, then all of the next."""

    file: ClassVar[str] = "three_colours"
    coloured: ClassVar[bool] = True
    # Each half of a sweep reads the Z of both colours.
    numbers_a_cell: ClassVar[int] = 4
    # Values come some pixels far in an iteration, and corrections have to go back and forth.
    corrections: ClassVar[int] = 8
    reason: ClassVar[str] = (
        "At second order a cell reads two neighbours on every side, for which two colours do not suffice."
    )

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """Three launches; the direction is of no consequence."""
        size, group = in_row_groups(run.device, run.layout.width, run.layout.height, run.images)
        event, *_ = [run.launch(size, group, colour=colour) for colour in range(3)]
        return event
