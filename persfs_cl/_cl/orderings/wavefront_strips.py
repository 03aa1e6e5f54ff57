"""The lexicographic order by strips that follow each other: see kernels/orderings/wavefront_strips.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.ordering import WORK_GROUP_OF_ONE
from persfs_cl._cl.orderings.strips import Strips
from persfs_cl._cl.run import Run

_APART = 32
"""As in kernels/orderings/strip.cl."""
_FIRST_CLAIM = 1
"""As in kernels/orderings/wavefront_strips.cl."""


@dataclass(frozen=True)
class WavefrontStrips(Strips):
    """Strips of an image shared out to work-groups, up to four sweeps a launch.

    Attributes
    ----------
    polls : int
        How long a work-group waits for another in vain: so many looks at its counter, some hundred microseconds.
    """

    file: ClassVar[str] = "wavefront_strips"
    before: ClassVar[tuple[str, ...]] = ("update", "change", "tiles", "strip")
    reason: ClassVar[str] = "A large image is shared out to the processors in strips, which vectors run along."
    sweeps_together: ClassVar[bool] = True

    polls: int = 4000

    def counters(self, images: int, layout: Layout) -> int:
        """Of the groups, of the claims on strips, and of the strips."""
        return _FIRST_CLAIM + (1 + _APART) * images * self._strips(layout)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """One launch."""
        return run.launch(
            (self.work_groups,),
            WORK_GROUP_OF_ONE,
            first_sweep=number,
            sweeps=count,
            sweeps_before=run.sweeps,
            polls=self.polls,
        )

    def is_done(self, run: Run) -> bool:
        """Whether each strip has been claimed for each sweep."""
        claims = run.counters()[_FIRST_CLAIM:][: run.images * self._strips(run.layout)]
        return bool((claims == run.sweeps).all())

    def _strips(self, layout: Layout) -> int:
        """Of an image."""
        return -(-layout.height // self.strip_rows)
