"""What is to be done, and how thoroughly."""

from __future__ import annotations

from dataclasses import dataclass

from persfs_cl._cl.device import Device


@dataclass(frozen=True)
class Plan:
    """Settings of all experiments.

    Attributes
    ----------
    device : Device
    repeats : int
        Measurements of each time.
    quick : bool
        Leave out what takes long: the larger images, and the sweeps in NumPy. What is left has the same numbers.
    """

    device: Device
    repeats: int = 7
    quick: bool = False
