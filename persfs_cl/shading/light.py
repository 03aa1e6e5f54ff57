"""Lights: where the illumination of the photograph comes from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from persfs_cl.checks import brief, finite_number, finite_numbers
from persfs_cl.errors import InputError

_STEEPEST = 1e3
_FARTHEST = 1e9
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
            number = finite_number(value)
            if not abs(number) <= _STEEPEST:
                raise InputError(
                    f"{name}={brief(value)} is not a light slope: give a finite number between -{_STEEPEST:g} and "
                    f"{_STEEPEST:g}, 0 for a frontal light."
                )
            object.__setattr__(self, name, number)

    @property
    def norm(self) -> float:
        """Length of s, k = sqrt(1 + p0² + q0²)."""
        return math.hypot(1.0, self.p0, self.q0)


@dataclass(frozen=True)
class FlashLight:
    """A point light at the optical centre of the camera, or beside it: a flash, a torch, the lamp of an endoscope.

    With ρ the distance from lamp to surface and c what the reflectance returns, the image is I = κ c / ρ², or
    I = κ c without fall-off (section 4 of the method).

    Parameters
    ----------
    falloff : bool
        Light fades with the square of the distance. False for photographs that were corrected for this: they tell of
        the slopes only, and the surface can have any size.
    gain : float
        κ > 0, the brightness of a surface that faces the lamp at distance 1 and returns all its light. It holds the
        unit of depth: 100 times the gain makes every depth 10 times as large.
    offset : (float, float, float)
        Where the lamp is, from the optical centre, in units of depth along the camera's axes (x right, y down,
        z forward). (0, 0, 0) is a coaxial light. A lamp that is seen an angle away from the camera, from depth d, is
        d times its tangent aside.

    Raises
    ------
    InputError
        When the gain is not a finite number above 0, the offset not three finite numbers, or the fall-off not a bool.
    """

    falloff: bool = True
    gain: float = 1.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.falloff, (bool, np.bool_)):
            raise InputError(
                f"falloff={brief(self.falloff)} is no choice: give True where light fades with the square of the "
                "distance, or False."
            )
        gain = finite_number(self.gain)
        if not gain > 0:
            raise InputError(
                f"gain={brief(self.gain)} is not a brightness: give a finite number above 0, the brightness of a white "
                "surface that faces the lamp at distance 1."
            )
        offset = self.offset
        numbers = finite_numbers(offset) or ()
        if len(numbers) != 3 or not all(abs(number) <= _FARTHEST for number in numbers):
            raise InputError(
                f"offset={brief(offset)} is not a place: give three numbers up to {_FARTHEST:g}, (right, down, "
                "forward) from the optical centre in units of depth, (0, 0, 0) for a light at the camera."
            )
        object.__setattr__(self, "falloff", bool(self.falloff))
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "offset", numbers)

    @property
    def coaxial(self) -> bool:
        """True when the lamp is at the optical centre."""
        return self.offset == (0.0, 0.0, 0.0)


Light: TypeAlias = ParallelLight | FlashLight
