"""The lexicographic order by tiles on anti-diagonals: see kernels/orderings/wavefront_tiles.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import pyopencl as cl

from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.run import DIRECTIONS, Run


@dataclass(frozen=True)
class WavefrontTiles(Ordering):
    """A launch for each anti-diagonal of tiles, a work-group a tile.

    Attributes
    ----------
    tile : tuple of int
        Rows and columns of a tile; as many work-items as rows make a work-group.
    """

    file: ClassVar[str] = "wavefront_tiles"
    reason: ClassVar[str] = "Many work-items go along the diagonals of a tile, which suits a GPU."
    for_want_of_vectors: ClassVar[bool] = True

    tile: tuple[int, int] = (32, 64)

    @property
    def definitions(self) -> dict[str, int]:
        """With the tile."""
        return {**super().definitions, "TILE_ROWS": self.tile[0], "TILE_COLUMNS": self.tile[1]}

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """As many launches as there are diagonals."""
        high, wide = self.tile
        leftwards, upwards = DIRECTIONS[number]
        rows, columns = -(-run.layout.height // high), -(-run.layout.width // wide)
        events = []
        for diagonal in range(rows + columns - 1):
            first = max(0, diagonal - columns + 1)
            size = ((min(diagonal, rows - 1) - first + 1) * high, run.images)
            own = {"leftwards": leftwards, "upwards": upwards, "tile_diagonal": diagonal, "first_tile_row": first}
            events.append(run.launch(size, (high, 1), **own))
        return events[0]

    def _sizes(self) -> tuple[str, ...]:
        return ("{} × {}".format(*self.tile),)
