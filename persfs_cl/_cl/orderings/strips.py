"""What the orderings by strips have in common: see kernels/orderings/strip.cl."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings.account import first_account
from persfs_cl._cl.orderings.ordering import Ordering

_BEFORE, _BORDER = 4, 8
"""As in kernels/shared/tiles.cl: a number of a sweep before the first one, and tiles around the image."""


@dataclass(frozen=True)
class Strips(Ordering):
    """Strips of the wavefront, which vectors run along.

    Attributes
    ----------
    vectors : int
        Of a strip: with three the latency of the square root is hidden, and the registers suffice.
    work_groups : int
        How many run at a time.
    """

    vectors_down: ClassVar[bool] = True
    counts_tiles: ClassVar[bool] = True

    vectors: int = 3
    work_groups: int = 1

    @property
    def strip_rows(self) -> int:
        """Rows of a strip."""
        return self.vectors * self.lanes

    @property
    def definitions(self) -> dict[str, int]:
        """With the height of a strip."""
        return {**super().definitions, "VECTORS": self.vectors, **self.account}

    def layout(self, shape: tuple[int, int]) -> Layout:
        """The last strip may reach past the image; lanes lean out by a strip's height and a block."""
        return Layout.padded(shape, -shape[0] % self.strip_rows + self.margin, self.strip_rows + 2 * self.lanes)

    def last_changes(self, images: Sequence[Image], layout: Layout) -> NDArray[np.int32]:
        """Of tiles, see kernels/shared/tiles.cl."""
        return first_account(images, layout, (self.lanes, self.lanes), before=_BEFORE, border=_BORDER)

    def _sizes(self) -> tuple[str, ...]:
        return f"rows: {self.strip_rows}", f"groups: {self.work_groups}"
