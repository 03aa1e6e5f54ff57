"""The checkerboard, a colour at a time: see kernels/orderings/checkerboard.cl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.kernel import in_row_groups
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.account import first_account
from persfs_cl._cl.orderings.ordering import InRowGroups
from persfs_cl._cl.run import Run

_BEFORE, _WHOLE_ROW = 2, 2**30
"""As in the kernel: the number of a half-sweep before the first one; and more vectors than any row has."""


@dataclass(frozen=True)
class Checkerboard(InRowGroups):
    """All cells of a colour, then all of the other."""

    file: ClassVar[str] = "checkerboard"
    coloured: ClassVar[bool] = True
    # Each half of a sweep reads the Z of both colours.
    numbers_a_cell: ClassVar[int] = 4
    reason: ClassVar[str] = "All cells of a colour at a time, a work-item each, which suits a GPU."
    for_want_of_vectors: ClassVar[bool] = True
    numbers_a_sweep: ClassVar[int] = 2

    @property
    def kernels(self) -> tuple[str, ...]:
        """With a cell update of its own, which is of first order."""
        return "update", "colour", "account", self.file

    @property
    def definitions(self) -> dict[str, int]:
        """With the parts that rest."""
        return {**super().definitions, "PART": self.group if self.lanes == 1 else _WHOLE_ROW, **self.account}

    def layout(self, shape: tuple[int, int]) -> Layout:
        """Columns apart."""
        return Layout.columns_apart(shape, self.lanes)

    def last_changes(self, images: Sequence[Image], layout: Layout) -> NDArray[np.int32]:
        """Of parts of rows, of one colour and of the other."""
        columns = layout.stride - 2 * max(self.lanes, 4)
        account = first_account(
            images,
            layout,
            (1, 2 * self.group if self.lanes == 1 else columns),
            before=_BEFORE,
            border=1,
            first_column=layout.first_column,
            last_column=columns,
        )
        return np.stack([account, account], axis=1)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """Two launches; the direction is of no consequence."""
        layout = run.layout
        items, group_of_row = (1, 1) if self.lanes > 1 else (layout.stride // 2, self.group)
        size, group = in_row_groups(group_of_row, items, layout.rows - 2, run.images)
        event, _ = [
            run.launch(size, group, colour=(layout.parity + half) % 2, halves_before=2 * run.sweeps + half)
            for half in range(2)
        ]
        return event
