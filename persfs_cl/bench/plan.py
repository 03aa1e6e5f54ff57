"""What is to be measured, and how thoroughly."""

from __future__ import annotations

from dataclasses import dataclass

from persfs_cl._cl.device import Device

_STANDARD_SIZE = 2048


@dataclass(frozen=True)
class Plan:
    """Settings of all experiments.

    Attributes
    ----------
    device : Device
    sizes : tuple of int
        Pixels along an edge of square images, ascending.
    batch : tuple of int
        Numbers of images that share launches, ascending.
    orderings : tuple of str
    precision : str
    repeats : int
    least_seconds : float
        How long a single measurement takes at least.
    """

    device: Device
    sizes: tuple[int, ...] = (128, 256, 512, 1024, 2048, 4096)
    batch: tuple[int, ...] = (1, 4, 16, 64)
    orderings: tuple[str, ...] = ("wavefront", "checkerboard", "lexicographic")
    precision: str = "float32"
    repeats: int = 5
    least_seconds: float = 0.05

    def size(self, wanted: int = _STANDARD_SIZE) -> int:
        """The largest of the sizes that is no larger than `wanted`, or else the smallest."""
        return max((size for size in self.sizes if size <= wanted), default=min(self.sizes))
