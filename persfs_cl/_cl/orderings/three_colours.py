"""Three colours in place of the checkerboard at second order: see kernels/orderings/three_colours.cl."""

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

_BEFORE, _REACH = 3, 2
"""As in the kernel: the number of a third of a sweep before the first one, and parts around the image."""


@dataclass(frozen=True)
class ThreeColours(InRowGroups):
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
    before: ClassVar[tuple[str, ...]] = ("update", "cell", "account")
    numbers_a_sweep: ClassVar[int] = 3

    @property
    def definitions(self) -> dict[str, int]:
        """With the parts that rest."""
        return {**super().definitions, "PART": self.group, **self.account}

    def last_changes(self, images: Sequence[Image], layout: Layout) -> NDArray[np.int32]:
        """Of parts of rows."""
        return first_account(images, layout, (1, self.group), before=_BEFORE, border=_REACH)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """Three launches; the direction is of no consequence."""
        size, group = in_row_groups(self.group, run.layout.width, run.layout.height, run.images)
        before = 3 * run.sweeps
        event, *_ = [run.launch(size, group, colour=colour, thirds_before=before + colour) for colour in range(3)]
        return event
