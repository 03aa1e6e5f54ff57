"""The lexicographic order by whole images: see kernels/orderings/wavefront_images.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.ordering import ALL_ITERATIONS, WORK_GROUP_OF_ONE
from persfs_cl._cl.orderings.strips import Strips
from persfs_cl._cl.run import Run


@dataclass(frozen=True)
class WavefrontImages(Strips):
    """Whole iterations of an image by one work-item, boundary and largest change included."""

    file: ClassVar[str] = "wavefront_images"
    function: ClassVar[str] = "iterate"
    before: ClassVar[tuple[str, ...]] = ("update", "change", "tiles", "strip", "boundary")
    reason: ClassVar[str] = "A small image fits into the cache of one processor, which takes it through all its sweeps."
    single_sweeps: ClassVar[bool] = False

    def iterations_a_launch(self, run: Run) -> int:
        """All."""
        return ALL_ITERATIONS

    def counters(self, images: int, layout: Layout) -> int:
        """The tickets."""
        return 1

    def iterate(self, run: Run, iterations: int) -> cl.Event:
        """One launch."""
        # Every group draws one ticket too many in each launch.
        first = run.launches * (run.images + self.work_groups)
        return run.launch(
            (self.work_groups,), WORK_GROUP_OF_ONE, iterations=iterations, first_ticket=first, sweeps_before=run.sweeps
        )
