"""A surface that was solved: its depth, and what follows from it.

It is long by what it says of each method, with an example; what they do is elsewhere.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from persfs_cl import metrics
from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.checks import as_floats, as_mask
from persfs_cl.colour import to_display
from persfs_cl.errors import InputError
from persfs_cl.quantiles import median
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface import geometry
from persfs_cl.surface import render as forward
from persfs_cl.surface.confidence import Confidence, SlopeErrors, cosine_to_light
from persfs_cl.surface.plots.maps import colour_normals
from persfs_cl.surface.simplify import as_mesh_faces, simplified_triangles
from persfs_cl.surface.solid import Block, solid_mesh

if TYPE_CHECKING:
    import trimesh

_Value = TypeVar("_Value")
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
    at_bound : ndarray of bool, shape (height, width)
        Solved pixels that lie on a bound of ``depth_range``, or of those that surface and guide set together: there
        the bound tells the depth, and not the photograph.
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
    at_bound: Mask
    image: Array
    camera: Camera
    light: Light
    reflectance: Reflectance
    device: Device
    albedo: Array | None = None
    walls: Mask | None = None
    discontinuities: geometry.Discontinuities | None = None

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
        return geometry.normals(self.depth, self.camera, self.discontinuities)

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
        return geometry.points(self.depth, self.camera)

    def mesh(self, colour: NDArray[np.uint8] | None = None, *, mesh_faces: int | None = None) -> trimesh.Trimesh:
        """Triangle mesh, with no faces across unsolved pixels or discontinuities.

        Parameters
        ----------
        colour : ndarray of uint8, shape (height, width) or (height, width, 3), optional
            Vertex colours; the image itself, encoded for display, when not given.
        mesh_faces : int, optional
            A mesh of more triangles is simplified to at most so many, 100 or more: the outline, holes and cuts stay,
            up to the error of the rest, and vertices are no pixels any more. None or 0 keeps all.

        Raises
        ------
        InputError
            When the colour is no image of the surface's size, or `mesh_faces` is no such number.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> mesh = solution.mesh()
        >>> mesh.vertices.shape, mesh.faces.shape
        ((400, 3), (722, 3))
        >>> len(solution.mesh(mesh_faces=100).faces) <= 100
        True
        """
        given = self.shown if colour is None else colour
        most = as_mesh_faces(mesh_faces)
        return simplified_triangles(self.depth, self.camera, most, given, self.discontinuities).mesh()

    def solid(self, width: float = 100.0, base: float = 3.0, *, mesh_faces: int | None = None) -> trimesh.Trimesh:
        """A watertight solid to be printed, in millimetres: the surface as a relief on a plate.

        Proportions stay: points of space are scaled alike along all axes. From its outline the solid widens along the
        lines of sight, down to a flat bottom. Where the surface jumps across walls, a steep slope joins its sides.

        Parameters
        ----------
        width : float
            Of the larger horizontal side, in millimetres.
        base : float
            Thickness of the plate below the deepest point, in millimetres.
        mesh_faces : int, optional
            As for :meth:`mesh`; the sides and the bottom count too.

        Returns
        -------
        trimesh.Trimesh
            x right, y up in the image, z up toward the camera; its bounds begin in the origin. Pixels without two
            neighbours, which have no area, are left out. Parts that touch in a pixel alone are drawn apart there, by a
            fifth of a pixel.

        Raises
        ------
        InputError
            When there is no surface, a size is no length above 0, the base is too thick for the width, or `mesh_faces`
            is no such number.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> solid = solution.solid(width=60.0, base=2.0)
        >>> bool(solid.is_watertight), [round(float(size), 3) for size in solid.extents[:2]]
        (True, [60.0, 60.0])
        """
        return solid_mesh(self.depth, self.camera, Block(width, base), mesh_faces)

    @property
    def shown(self) -> NDArray[np.uint8]:
        """The image as it is displayed, in grey levels."""
        return to_display(np.nan_to_num(self.image / self.white))

    @cached_property
    def white(self) -> float:
        """Brightness that is drawn white and counts 255 grey levels: 1, or under a flash the image's brightest."""
        if self.light.normalised:
            return 1.0
        used = self.solved if self.walls is None else self.solved & ~self.walls
        # Of known pixels the brightness may be anything, or black where a run was ended early.
        looked_at = self.image if used.all() else self.image[used]
        brightest = float(np.fmax.reduce(looked_at, axis=None, initial=0.0))
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
        return Derived(self).residual(photo)

    def confidence(self, unreliable: Unreliable | None = None) -> Confidence:
        """How far each pixel can be believed, as far as it can be told without knowing the surface.

        Parameters
        ----------
        unreliable : mapping of str to ndarray of bool, shape (height, width), optional
            Further pixels whose brightness does not tell of the slope, by the reason: shadows, highlights and the like.
            In :attr:`Confidence.unreliable <persfs_cl.surface.confidence.Confidence.unreliable>` they come after those
            that the solver knows of: "unreached", "clamped", where there are any "at a bound" and, where walls were
            given, "on a wall".

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
        return Derived(self, unreliable).confidence


class _Once(Generic[_Value]):
    """What an object computes when it is first asked for, while other threads that ask wait for it.

    `functools.cached_property` has one lock for all objects, or none, as Python's version goes.
    """

    def __init__(self, compute: Callable[[Derived], _Value]) -> None:
        self._compute, self._name, self.__doc__ = compute, compute.__name__, compute.__doc__

    def __get__(self, derived: Derived, _: type[Derived]) -> _Value:
        # At once, so that two threads never have two locks.
        lock, values = derived.memory.setdefault(self._name, (threading.Lock(), []))
        with lock:
            if not values:
                values.append(self._compute(derived))
            value: _Value = values[0]
            return value


class Derived:
    """What several files of a surface are made from, each computed once, when first asked for by any thread.

    In a large photograph these arrays take more memory than all the rest: they live as long as this object, or until
    :meth:`release`.

    Parameters
    ----------
    surface : SolvedSurface
    unreliable : mapping of str to ndarray of bool, optional
        As for :meth:`SolvedSurface.confidence`.
    """

    def __init__(self, surface: SolvedSurface, unreliable: Unreliable | None = None) -> None:
        self.surface = surface
        self._unreliable = unreliable
        self.memory: dict[str, tuple[threading.Lock, list[Any]]] = {}

    @_Once
    def normals(self) -> Array:
        """See :meth:`SolvedSurface.normals`."""
        return self.surface.normals()

    @_Once
    def _facing(self) -> tuple[NDArray[np.uint8], Array]:
        """Colours of the normals and errors of the slope, from normals that are not kept."""
        surface = self.surface
        shape = surface.depth.shape[0], surface.depth.shape[1]
        grid, errors = surface.camera.grid(shape), SlopeErrors(surface.reflectance)
        colours, slope_error = np.empty((*shape, 3), np.uint8), np.empty(shape)
        for rows, *normals in geometry.normal_blocks(surface.depth, grid, surface.discontinuities):
            colour_normals(normals, colours[rows])
            to_light = surface.light.toward(surface.depth[rows], grid.x, grid.y[rows])
            slope_error[rows] = errors(cosine_to_light(normals, to_light))
        return colours, slope_error

    @property
    def normal_colours(self) -> NDArray[np.uint8]:
        """See :func:`persfs_cl.surface.plots.normals_rgb`."""
        return self._facing[0]

    @_Once
    def rendered(self) -> Array:
        """See :meth:`SolvedSurface.render`."""
        return self.surface.render()

    @_Once
    def prepared_residual(self) -> metrics.Errors:
        """Difference between the re-rendered image and the one that was solved; see :meth:`residual`."""
        return self._residual(self.surface.image)

    def residual(self, photo: Array | None = None) -> metrics.Errors:
        """See :meth:`SolvedSurface.residual`."""
        if photo is None:
            return self.prepared_residual
        given, shape = as_floats("photo", photo), self.surface.image.shape
        if given.shape != shape:
            raise InputError(f"photo has shape {given.shape}: give one of the image's shape {shape}.")
        largest = max(float(np.fmax.reduce(given, axis=None)), -float(np.fmin.reduce(given, axis=None)))
        if largest > _BRIGHTEST:
            raise InputError(f"photo goes up to {largest:g}: give one on the scale of the image, NaN where unknown.")
        # Most differ in the first rows, if at all.
        image = self.surface.image
        if all(np.array_equal(given[rows], image[rows], equal_nan=True) for rows in row_blocks((shape[0], shape[1]))):
            return self.prepared_residual
        return self._residual(given)

    def _residual(self, given: Array) -> metrics.Errors:
        white, rendered = self.surface.white, self.rendered
        grey = 255.0 / white
        differences = np.empty(given.shape)
        for rows in row_blocks((given.shape[0], given.shape[1])):
            seen = np.clip(rendered[rows], 0.0, white)
            seen *= grey
            np.subtract(seen, grey * given[rows], out=differences[rows])
        return metrics.errors_of(differences)

    @_Once
    def depths(self) -> dict[str, float | None]:
        """Least, median and largest depth that was solved; None where there is none."""
        depth = self.surface.depth
        if not self.surface.solved.any():
            return dict.fromkeys(("min", "median", "max"))
        least, most = (float(of.reduce(depth, axis=None)) for of in (np.fmin, np.fmax))
        return {"min": least, "median": median(depth), "max": most}

    @_Once
    def confidence(self) -> Confidence:
        """See :meth:`SolvedSurface.confidence`."""
        unreliable, surface = self._unreliable, self.surface
        if unreliable is not None and not isinstance(unreliable, Mapping):
            raise InputError.about("unreliable", unreliable, "is no mapping: give maps of bool by their reasons.")
        shape = surface.depth.shape
        given = {
            reason: as_mask(f"unreliable[{reason!r}]", pixels, shape) for reason, pixels in (unreliable or {}).items()
        }
        own = {"unreached": surface.unreached, "clamped": surface.clamped}
        if surface.at_bound.any():
            own["at a bound"] = surface.at_bound
        if surface.walls is not None:
            own["on a wall"] = surface.walls
        return Confidence(self._facing[1], {**own, **given})

    def release(self) -> None:
        """Forget the arrays, for the memory; what is asked for again is computed again."""
        for name in ("normals", "_facing", "rendered", "confidence"):
            self.memory.pop(name, None)
