"""The checkerboard, a colour at a time: see kernels/orderings/checkerboard.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.ordering import Ordering, in_row_groups
from persfs_cl._cl.run import Run


@dataclass(frozen=True)
class Checkerboard(Ordering):
    """All cells of a colour, then all of the other."""

    file: ClassVar[str] = "checkerboard"
    coloured: ClassVar[bool] = True
    # Each half of a sweep reads the Z of both colours.
    numbers_a_cell: ClassVar[int] = 4
    reason: ClassVar[str] = "All cells of a colour at a time, a work-item each, which suits a GPU."
    for_want_of_vectors: ClassVar[bool] = True

    @property
    def kernels(self) -> tuple[str, ...]:
        """With a cell update of its own, which is of first order."""
        return "update", "colour", self.file

    def layout(self, shape: tuple[int, int]) -> Layout:
        """Columns apart."""
        return Layout.columns_apart(shape, self.lanes)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """Two launches; the direction is of no consequence."""
        layout = run.layout
        items = 1 if self.lanes > 1 else layout.stride // 2
        size, group = in_row_groups(run.device, items, layout.rows - 2, run.images)
        event, _ = [run.launch(size, group, colour=(layout.parity + half) % 2) for half in range(2)]
        return event
