"""What is to be measured, and how thoroughly."""

from __future__ import annotations

from dataclasses import dataclass

from persfs_cl._cl.device import Device
from persfs_cl.choices import Ordering, Precision

STANDARD_SIZES = (128, 256, 512, 1024, 2048, 4096)
_STANDARD_SIZE = 2048


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
    precision : str
    repeats : int
    least_seconds : float
        How long a single measurement takes at least.
    """

    device: Device
    sizes: tuple[int, ...] | None = None
    batch: tuple[int, ...] = (1, 4, 16, 64)
    orderings: tuple[Ordering, ...] = ("wavefront", "checkerboard", "lexicographic")
    precision: Precision = "float32"
    repeats: int = 5
    least_seconds: float = 0.05

    def edges(self, usual: tuple[int, ...] = STANDARD_SIZES) -> tuple[int, ...]:
        """The sizes asked for, or else the usual ones."""
        return self.sizes or usual

    def size(self, wanted: int = _STANDARD_SIZE) -> int:
        """`wanted`; where sizes are asked for, the largest that is no larger, or else the smallest."""
        sizes = self.edges((wanted,))
        return max((size for size in sizes if size <= wanted), default=min(sizes))
