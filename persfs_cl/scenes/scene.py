"""A scene: a surface, its photograph, and what a solver may be told of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance


@dataclass(frozen=True, eq=False)
class Scene:
    """A surface, the photograph of it, and what a solver may be told.

    Attributes
    ----------
    depth : ndarray of float64, shape (height, width)
        True depth z > 0 along the optical axis, in units of the depth of the background or frame unless the
        scene says otherwise. The gain and the offset of a flash are in the same unit.
    image : ndarray of float64, shape (height, width)
        Brightness of the analytic surface, quantised, with noise as asked for; self-shadowed pixels are 0. Under a
        parallel light E of eq. (6), cut off at 1; under a flash I, as large as its gain makes it.
    camera : Camera
        Its principal point is the image centre.
    mask : ndarray of bool, shape (height, width)
        True on the surface to reconstruct.
    known_depth : ndarray of float64, shape (height, width)
        True depth where a solver under a parallel light may know it, NaN elsewhere. A flash photograph with fall-off
        determines the surface without.
    log_depth_gradient : tuple of two ndarray of float64, shape (height, width)
        p = dZ/dx and q = dZ/dy of Z = ln z in normalised image coordinates, x right and y down.
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    surface : {"away", "toward"}
        Which way the surface leaves the values in ``known_depth``: the solver's keyword of that name.
    name : str
    singular_point : tuple of float or None
        (row, column), in pixels, of the scene's only peak or pit, where E = 1. None when the scene has
        several, or when its light is oblique or a flash or its material not Lambertian, which moves E = 1 off the
        peak.
    walls : ndarray of bool, shape (height, width), or None
        The nearer pixel of every two inside the mask between which the depth jumps. None where nothing jumps.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 30), light=ps.FlashLight(gain=2.0))
    >>> scene.image.shape, scene.name, scene.light.gain
    ((20, 30), 'bump', 2.0)
    """

    depth: Array
    image: Array
    camera: Camera
    mask: Mask
    known_depth: Array
    log_depth_gradient: tuple[Array, Array]
    light: Light
    reflectance: Reflectance
    surface: Surface
    name: str
    singular_point: tuple[float, float] | None = None
    walls: Mask | None = None

    def __repr__(self) -> str:
        height, width = self.depth.shape
        depths = f"depth {np.nanmin(self.depth):.4g} to {np.nanmax(self.depth):.4g}"
        return f"<Scene {self.name!r}, {width} x {height} pixels, {depths}, {self.light}, {self.reflectance}>"

    def seeded(self) -> Scene:
        """Give the same scene with only its singular point known, as when an object's top is measured.

        Returns
        -------
        Scene
            ``known_depth`` holds the one, two or four pixels around the singular point. ``surface`` is
            reversed: what goes away from the frame comes toward the camera when seen from its own peak.

        Raises
        ------
        InputError
            When the scene has no single singular point.

        Examples
        --------
        >>> import numpy as np
        >>> import persfs_cl as ps
        >>> scene = ps.bump((21, 21)).seeded()
        >>> np.argwhere(np.isfinite(scene.known_depth)).tolist(), scene.surface
        ([[10, 10]], 'toward')
        """
        if self.singular_point is None:
            raise InputError(
                f"the scene {self.name!r} under {self.light} has no single singular point to be seeded from: use its"
                " known_depth, or take a Lambertian bump or sphere_cap under a frontal light."
            )
        row, column = self.singular_point
        rows, columns = np.ogrid[: self.depth.shape[0], : self.depth.shape[1]]
        beside = (np.abs(rows - row) < 1) & (np.abs(columns - column) < 1)
        return replace(
            self,
            known_depth=np.where(beside, self.depth, np.nan),
            surface="toward" if self.surface == "away" else "away",
        )
