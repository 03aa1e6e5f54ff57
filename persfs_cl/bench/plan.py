"""What is to be measured, and how thoroughly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from persfs_cl._cl.device import Device
from persfs_cl._cl.orderings import ORDERINGS
from persfs_cl._cl.registers import LANES, lanes
from persfs_cl.choices import Precision
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.upwind import Upwind

STANDARD_SIZES = (128, 256, 512, 1024, 2048, 4096)
_STANDARD_SIZE = 2048
SCHEMES = (LaxFriedrichs.name, Upwind.name)
_BAND_PIXELS = (2**11, 2**13)


@dataclass(frozen=True)
class Plan:
    """Settings of all experiments.

    Attributes
    ----------
    device : Device
    sizes : tuple of int or None
        Pixels along an edge of square images, ascending; None = what is usual for each experiment.
    batch : tuple of int
        Numbers of images that share launches, ascending.
    orderings : tuple of str
    schemes : tuple of str or None
        Of :data:`SCHEMES`; None = what is usual for each experiment.
    precision : str
    repeats : int
    least_seconds : float
        How long a single measurement takes at least.
    strip_rows, lanes : tuple of int
        Of the experiment on tunings: heights of a strip, and cells that an item of the checkerboard updates at once.
    tiles : tuple of (int, int)
        Likewise: rows and columns of a tile.
    band_rows, work_groups : tuple of int or None
        Likewise: heights of a band, and how many groups run side by side; None = what suits image and device.
    tasks : int
        Photographs of the experiment on handing them out, and ten times as many as those of the one on memory.
    endoscopy : Path or None
        Folder of the endoscope's frame, which comes with no package.
    """

    device: Device
    sizes: tuple[int, ...] | None = None
    batch: tuple[int, ...] = (1, 4, 16, 64)
    orderings: tuple[str, ...] = tuple(ORDERINGS)
    schemes: tuple[str, ...] | None = None
    precision: Precision = "float32"
    repeats: int = 5
    least_seconds: float = 0.05
    strip_rows: tuple[int, ...] = (8, 16, 24, 32, 48)
    lanes: tuple[int, ...] | None = None
    tiles: tuple[tuple[int, int], ...] = ((16, 64), (32, 64), (64, 64))
    band_rows: tuple[int, ...] | None = None
    work_groups: tuple[int, ...] | None = None
    tasks: int = 100_000
    endoscopy: Path | None = None

    def edges(self, usual: tuple[int, ...] = STANDARD_SIZES) -> tuple[int, ...]:
        """The sizes asked for, or else the usual ones."""
        return self.sizes or usual

    def size(self, wanted: int = _STANDARD_SIZE) -> int:
        """`wanted`; where sizes are asked for, the largest that is no larger, or else the smallest."""
        sizes = self.edges((wanted,))
        return max((size for size in sizes if size <= wanted), default=min(sizes))

    def edges_up_to(self, usual: tuple[int, ...], largest: int = _STANDARD_SIZE) -> list[int]:
        """The same, without those that take too long; the smallest at least."""
        return [size for size in self.edges(usual) if size <= self.size(largest)]

    @property
    def parallel_orderings(self) -> list[str]:
        """Those that use the device's units: what the lexicographic order comes to is the wavefront's, to the bit."""
        return [ordering for ordering in self.orderings if ordering != "lexicographic"]

    def schemes_or(self, usual: tuple[str, ...] = SCHEMES[:1]) -> tuple[str, ...]:
        """The schemes asked for, or else the usual ones."""
        return self.schemes or usual

    def groups(self) -> tuple[int, ...]:
        """How many groups run side by side: as asked for, or one, and as many as the device has units."""
        return self.work_groups or tuple(sorted({1, self.device.compute_units}))

    def widths(self) -> tuple[int, ...]:
        """Widths of vectors: as asked for, or all that the device takes."""
        return self.lanes or tuple(width for width in LANES if width <= lanes(self.device, self.precision))

    def heights(self, width: int) -> tuple[int, ...]:
        """Rows of the bands of an image so wide: as asked for, or of a few thousand pixels."""
        return self.band_rows or tuple(sorted({max(1, pixels // width) for pixels in _BAND_PIXELS}))
