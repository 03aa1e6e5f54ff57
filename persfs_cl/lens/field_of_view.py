"""The lens of Devernay and Faugeras, which has one number: COLMAP's FOV."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.errors import CameraError
from persfs_cl.lens.numbers import Lens


@dataclass(frozen=True, repr=False)
class FieldOfView(Lens):
    """Distortion as COLMAP's model FOV has it, after Devernay and Faugeras (2001).

    What a pinhole camera has at r from the principal point, in units of the focal length, is drawn at
    atan(2 r tan(ω / 2)) / ω.

    Parameters
    ----------
    omega : float
        The angle ω, in radians, between -π and π: about the field of view of an ideal fisheye lens. 0 is a pinhole
        camera.

    Raises
    ------
    CameraError
        When it is no such number.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> ps.Camera(focal_length=300.0, distortion=ps.FieldOfView(0.9)).distortion
    FieldOfView(omega=0.9)
    """

    omega: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if abs(self.omega) >= math.pi:
            degrees = math.radians(self.omega)
            raise CameraError.about(
                "distortion",
                self,
                f"is impossible, with {self.omega:g} for ω: give radians, between -π and π (3.14159); {self.omega:g} "
                f"degrees are {degrees:.4g}.",
            )


def draw(lens: FieldOfView, places: Array) -> Array:
    """Where the lens draws what a pinhole camera would have at some places."""
    if lens.omega == 0.0:
        return places.copy()
    wide = 2.0 * math.tan(lens.omega / 2.0)
    radius = np.hypot(*places.T)
    drawn = np.arctan(wide * radius) / lens.omega
    ratio = np.divide(drawn, radius, out=np.full(len(places), wide / lens.omega), where=radius > 0.0)
    return np.asarray(places * ratio[:, None])


def straight(lens: FieldOfView, places: Array) -> Array:
    """Where a pinhole camera has what the lens draws at some places; NaN where it draws nothing."""
    if lens.omega == 0.0:
        return places.copy()
    wide = 2.0 * math.tan(lens.omega / 2.0)
    radius = np.hypot(*places.T)
    angle = lens.omega * radius
    there = np.where(np.abs(angle) < math.pi / 2.0, np.tan(angle) / wide, np.nan)
    ratio = np.divide(there, radius, out=np.full(len(places), lens.omega / wide), where=radius > 0.0)
    return np.asarray(places * ratio[:, None])
