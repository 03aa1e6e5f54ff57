"""A surface that was solved: its depth, and what follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from persfs_cl import metrics
from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import as_floats, as_mask
from persfs_cl.colour import to_display
from persfs_cl.errors import InputError
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface import geometry as surface
from persfs_cl.surface import render as forward
from persfs_cl.surface.confidence import Confidence, cosine_to_light, slope_error

if TYPE_CHECKING:
    import trimesh

Unreliable = Mapping[str, Mask]
_BRIGHTEST = 1e100
"""More than any brightness; what is multiplied by it still has a double-precision number."""


@dataclass(frozen=True, eq=False)
class SolvedSurface:
    """A surface, and the photograph and the camera that it was found from.

    Attributes
    ----------
    depth : ndarray of float64, shape (height, width)
        z along the optical axis, in the units of the known values; NaN where not solved.
    log_depth : ndarray of float64, shape (height, width)
        Z = ln z.
    solved : ndarray of bool, shape (height, width)
        Pixels that have a depth, known ones included.
    unreached : ndarray of bool, shape (height, width)
        Pixels that were to be solved but have no depth: no known value can reach them, or none had reached them when
        the run was ended early.
    clamped : ndarray of bool, shape (height, width)
        Solved pixels where the equation degenerates (too dark for their place in the image): their slope is bounded
        by ``max_slope`` alone.
    image : ndarray of float64, shape (height, width)
        The brightness that was reconstructed: E, or that under the flash.
    camera, light, reflectance
        As given.
    device : Device
        Which it was found on, and is rendered on.
    albedo : ndarray of float64, shape (height, width), or None
        As given; 1 where there is no surface.
    walls : ndarray of bool, shape (height, width), or None
        Pixels on walls that the surface may have: inside the mask, or of known depth. They are solved where a side had
        a depth within `REACH <persfs_cl.surface.discontinuities.REACH>` pixels, from which it is continued. None where
        none were given.
    discontinuities : Discontinuities or None
        Where the walls interrupt the surface: between each of their pixels and the neighbours on other sides. Normals,
        mesh and the surface re-rendered do not look across. None where no walls were given.
    """

    depth: Array
    log_depth: Array
    solved: Mask
    unreached: Mask
    clamped: Mask
    image: Array
    camera: Camera
    light: Light
    reflectance: Reflectance
    device: Device
    albedo: Array | None = None
    walls: Mask | None = None
    discontinuities: surface.Discontinuities | None = None

    def normals(self) -> Array:
        """Unit normals towards the camera, shape (height, width, 3), in camera axes; NaN where not solved.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> normals = solution.normals()
        >>> normals.shape, bool((normals[..., 2] < 0).all())
        ((20, 20, 3), True)
        """
        return surface.normals(self.depth, self.camera, self.discontinuities)

    def points(self) -> Array:
        """Points z (x, y, 1) in camera axes, shape (height, width, 3); NaN where not solved.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> points = solution.points()
        >>> bool((points[..., 2] == solution.depth).all())
        True
        """
        return surface.points(self.depth, self.camera)

    def mesh(self, colour: NDArray[np.uint8] | None = None) -> trimesh.Trimesh:
        """Triangle mesh, with no faces across unsolved pixels or discontinuities.

        Parameters
        ----------
        colour : ndarray of uint8, shape (height, width) or (height, width, 3), optional
            Vertex colours; the image itself, encoded for display, when not given.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> mesh = solution.mesh()
        >>> mesh.vertices.shape, mesh.faces.shape
        ((400, 3), (722, 3))
        """
        if colour is None:
            colour = to_display(np.nan_to_num(self.image / self.white))
        return surface.mesh(self.depth, self.camera, colour, self.discontinuities)

    @property
    def white(self) -> float:
        """Brightness that is drawn white and counts 255 grey levels: 1, or under a flash the image's brightest."""
        if self.light.normalised:
            return 1.0
        used = self.solved if self.walls is None else self.solved & ~self.walls
        # Of known pixels the brightness may be anything, or black where a run was ended early.
        brightest = float(np.fmax.reduce(self.image[used], initial=0.0))
        return brightest if brightest * _BRIGHTEST >= 1.0 else 1.0

    def render(self) -> Array:
        """The surface re-rendered under its own light, eq. (6); NaN where not solved.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> ps.compare(solution.render(), scene.image).mean < 0.05
        True
        """
        return forward.render(
            self.depth,
            self.camera,
            light=self.light,
            reflectance=self.reflectance,
            albedo=self.albedo,
            discontinuities=self.discontinuities,
            device=self.device,
        )

    def residual(self, photo: Array | None = None) -> metrics.Errors:
        """Difference between the re-rendered and the given image in grey levels, 0 to 255 (the paper's Table 2).

        Parameters
        ----------
        photo : ndarray of float, shape (height, width), optional
            Compare with this image, on the same scale, such as the photograph before smoothing, instead of with the
            prepared :attr:`image`.

        Raises
        ------
        InputError
            When it holds no numbers, or is not of the image's shape.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> errors = solution.residual()
        >>> errors.count, errors.mean < 10
        (400, True)
        """
        given = self.image if photo is None else as_floats("photo", photo)
        if given.shape != self.image.shape:
            raise InputError(f"photo has shape {given.shape}: give one of the image's shape {self.image.shape}.")
        if (largest := float(np.fmax.reduce(np.abs(given), axis=None))) > _BRIGHTEST:
            raise InputError(f"photo goes up to {largest:g}: give one on the scale of the image, NaN where unknown.")
        return self._residual(self.render(), given)

    def _residual(self, rendered: Array, given: Array) -> metrics.Errors:
        grey = 255.0 / self.white
        seen = np.clip(rendered, 0.0, self.white)
        seen *= grey
        return metrics.compare(seen, grey * given)

    def confidence(self, unreliable: Unreliable | None = None) -> Confidence:
        """How far each pixel can be believed, as far as it can be told without knowing the surface.

        Parameters
        ----------
        unreliable : mapping of str to ndarray of bool, shape (height, width), optional
            Further pixels whose brightness does not tell of the slope, by the reason: shadows, highlights and the like.
            In :attr:`Confidence.unreliable <persfs_cl.surface.confidence.Confidence.unreliable>` they come after those
            that the solver knows of: "unreached", "clamped" and, where walls were given, "on a wall".

        Returns
        -------
        Confidence

        Raises
        ------
        InputError
            When `unreliable` is no mapping, or a map is not of bool, or not of the image's shape.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> dark = scene.image < 0.5
        >>> list(solution.confidence({"in the dark": dark}).unreliable)
        ['unreached', 'clamped', 'in the dark']
        """
        return self._confidence(self.normals(), unreliable)

    def _confidence(self, normals: Array, unreliable: Unreliable | None) -> Confidence:
        if unreliable is not None and not isinstance(unreliable, Mapping):
            raise InputError.about("unreliable", unreliable, "is no mapping: give maps of bool by their reasons.")
        shape = self.depth.shape
        given = {
            reason: as_mask(f"unreliable[{reason!r}]", pixels, shape) for reason, pixels in (unreliable or {}).items()
        }
        cosine = cosine_to_light(self.depth, normals, self.camera, self.light)
        own = {"unreached": self.unreached, "clamped": self.clamped}
        if self.walls is not None:
            own["on a wall"] = self.walls
        return Confidence(slope_error(cosine, self.reflectance), {**own, **given})
