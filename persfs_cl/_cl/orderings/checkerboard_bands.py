"""The checkerboard by bands of rows: see kernels/orderings/checkerboard_bands.cl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.account import first_account
from persfs_cl._cl.orderings.ordering import ALL_ITERATIONS, WORK_GROUP_OF_ONE, Ordering
from persfs_cl._cl.run import Run

_LAUNCHED_CELLS = 2**22
"""Of the iterations that make one launch: some ten milliseconds, against which a launch is nothing."""
_SEGMENT, _BEFORE = 4, 2
"""As in the kernel: vectors of a segment, and a number of a half-sweep before the first one."""


@dataclass(frozen=True)
class CheckerboardBands(Ordering):
    """Bands that a work-group takes through several half-sweeps while they are in its cache.

    Attributes
    ----------
    band_rows : int
        Rows of a band.
    work_groups : int
        How many run at a time.
    polls : int
        How long a group looks for work in vain, in looks at counters that lie far apart; these lie closer by.
    """

    file: ClassVar[str] = "checkerboard_bands"
    coloured: ClassVar[bool] = True
    # Each half of a sweep reads the Z of both colours.
    numbers_a_cell: ClassVar[int] = 4
    reason: ClassVar[str] = "The processors take bands of rows that fit into their caches, in vectors."
    sweeps_together: ClassVar[bool] = True
    numbers_a_sweep: ClassVar[int] = 2

    band_rows: int = 1
    work_groups: int = 1
    polls: int = 4000

    @property
    def kernels(self) -> tuple[str, ...]:
        """With a cell update of its own, which is of first order."""
        return "update", "colour", "change", "account", self.file

    @property
    def definitions(self) -> dict[str, int]:
        """Without accounts where nothing rests."""
        return {**super().definitions, **self.account}

    def layout(self, shape: tuple[int, int]) -> Layout:
        """Columns apart."""
        return Layout.columns_apart(shape, self.lanes)

    def counters(self, images: int, layout: Layout) -> int:
        """Of the images, and of the bands."""
        return images * (1 + self._bands(layout))

    def last_changes(self, images: Sequence[Image], layout: Layout) -> NDArray[np.int32]:
        """Of segments of bands, of one colour and of the other, see the kernel."""
        account = first_account(
            images,
            layout,
            (self.band_rows, 2 * _SEGMENT * self.lanes),
            before=_BEFORE,
            border=1,
            first_column=layout.first_column,
            last_column=layout.stride - 2 * max(self.lanes, 4),
        )
        return np.stack([account, account], axis=1)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """One launch; the direction is of no consequence."""
        return self._launch(run, iterations=1, halves=2 * count, measured=0)

    def iterations_a_launch(self, run: Run) -> int:
        """All where each group has an image.

        Else few: a group that loses its processor is missing until the next launch.
        """
        if run.has_boundary:
            return 0
        if run.images >= self.work_groups:
            return ALL_ITERATIONS
        return max(1, _LAUNCHED_CELLS // run.pixels)

    def iterate(self, run: Run, iterations: int) -> cl.Event:
        """One launch."""
        return self._launch(run, iterations=iterations, halves=8, measured=1)

    def is_done(self, run: Run) -> bool:
        """Whether each band has been through all stages of its image."""
        states = run.counters()[run.images :].reshape(run.images, -1)
        stages = 2 * run.sweeps_of + run.own_measures_of
        return bool((states == 2 * stages[:, None]).all())

    def _launch(self, run: Run, **own: int) -> cl.Event:
        return run.launch(
            (self.work_groups,),
            WORK_GROUP_OF_ONE,
            first_colour=run.layout.parity,
            band_rows=self.band_rows,
            stages_before=2 * run.sweeps + run.own_measures,
            iterations_before=run.own_measures,
            sweeps_before=run.sweeps,
            measured_sweeps=run.measured_sweeps,
            polls=self.polls,
            **own,
        )

    def _bands(self, layout: Layout) -> int:
        """Of an image."""
        return -(-layout.height // self.band_rows)

    def _sizes(self) -> tuple[str, ...]:
        return f"rows: {self.band_rows}", f"groups: {self.work_groups}"
