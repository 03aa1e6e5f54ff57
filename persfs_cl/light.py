"""Lights: where the illumination of the photograph comes from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from persfs_cl.errors import InputError

_STEEPEST = 1e3
"""Beyond this slope the light grazes the image plane at less than a tenth of a degree."""


@dataclass(frozen=True)
class ParallelLight:
    """A light infinitely far away, the paper's s = (-p0, -q0, 1).

    Parameters
    ----------
    p0, q0 : float
        Slopes of the light. In camera axes (x right, y down, z forward) the light travels along
        (p0, q0, 1): ``p0 > 0`` puts the lamp to the left of the camera, ``q0 > 0`` above it.
        Both 0 is a frontal light.

    Raises
    ------
    InputError
        When a slope is not a number between -1000 and 1000.
    """

    p0: float = 0.0
    q0: float = 0.0

    def __post_init__(self) -> None:
        for name in ("p0", "q0"):
            value = getattr(self, name)
            try:
                number = float(value)
            except (TypeError, ValueError):
                number = math.nan
            if not abs(number) <= _STEEPEST:
                raise InputError(
                    f"{name}={value!r} is not a light slope: give a finite number between -{_STEEPEST:g} and "
                    f"{_STEEPEST:g}, 0 for a frontal light."
                )
            object.__setattr__(self, name, number)

    @property
    def norm(self) -> float:
        """Length of s, k = sqrt(1 + p0² + q0²)."""
        return math.hypot(1.0, self.p0, self.q0)
