"""One image made ready for the sweeps, after everything about it has been checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import masks
from persfs_cl._cl.image import Image
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera, PixelGrid, require_camera
from persfs_cl.checks import FARTHEST, NEAREST, as_mask, to_float64
from persfs_cl.errors import InputError
from persfs_cl.maps import as_albedo, as_array_of_image, as_known_depth
from persfs_cl.shading.model import Model
from persfs_cl.solver.domain import Domain, lay_out
from persfs_cl.solver.inputs import (
    require_image,
    require_relief,
    require_shading,
    warn_of_background,
    warn_of_steep_outline,
)
from persfs_cl.solver.options import Options
from persfs_cl.solver.schemes import scheme_for
from persfs_cl.solver.schemes.scheme import Scheme
from persfs_cl.surface.discontinuities import fill_walls
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.wording import keyword

_NEAREST_LOG, _FARTHEST_LOG = math.log(NEAREST), math.log(FARTHEST)

_MOST_LIGHT = 1e100
"""What a pixel may hold that is not solved, and be no NaN."""


@dataclass(frozen=True)
class Problem:
    """One image made ready for the sweeps: everything the equation needs, as arrays and numbers.

    Attributes
    ----------
    photograph : ndarray of float64, shape (height, width)
        As given; anything where there is nothing to solve.
    albedo : ndarray of float64, shape (height, width), or None
        By which the photograph was divided.
    image : ndarray of float64, shape (height, width)
        E, or the brightness under a flash, of the surface without its albedo.
    camera : Camera
    known_depth : ndarray of float64, shape (height, width)
        NaN where unknown.
    walls : ndarray of bool, shape (height, width), or None
        Pixels of walls that belong to the surface: inside the mask, or of known depth. None where no walls are given.
    known_values : ndarray of float64, shape (n,)
        W of the known pixels, in the order of the image.
    first : ndarray of float64, shape (height, width), or float
        Values of W, less `level`, from which the others begin: above all known ones.
    shading : ndarray of float64, shape (height, width)
        What the kernels read in place of the image, see :class:`persfs_cl.shading.model.Model`; at the scale of `level`
        where the image tells the depth.
    highest_known : float
        Largest known W, less `level`; infinite where no known value is needed.
    sign : float
        +1 for a surface going away from the known values, W = Z; -1 for one coming towards the camera, W = -Z.
    offset : ndarray of float64, shape (height, width)
        What the unknown has more than Z = ln z, see :meth:`persfs_cl.shading.model.Model.offset`.
    level : float
        Smallest known W, or a typical one; subtracting it keeps single precision for the relief.
    max_slope : float
    domain : Domain
    grid : PixelGrid
    model : Model
    scheme : Scheme
    """

    photograph: NDArray[np.float64]
    albedo: NDArray[np.float64] | None
    image: NDArray[np.float64]
    camera: Camera
    known_depth: NDArray[np.float64]
    walls: NDArray[np.bool_] | None
    known_values: NDArray[np.float64]
    first: NDArray[np.float64] | float
    shading: NDArray[np.float64]
    highest_known: float
    sign: float
    offset: NDArray[np.float64]
    level: float
    max_slope: float
    domain: Domain
    grid: PixelGrid
    model: Model
    scheme: Scheme

    @property
    def start(self) -> NDArray[np.float64]:
        """First values of W, less `level`, in an array of their own."""
        known = self.domain.known
        start = np.full(known.shape, self.first)
        start[known] = self.known_values - self.level
        if self.scheme.outside is not None:
            # What is not there must not look like a low neighbour.
            start[~(known | self.domain.solved)] = self.scheme.outside
        return start

    @property
    def kernel_arguments(self) -> Image:
        """The problem as the kernels want it."""
        x_axis, y_axis = self.model.axes(self.grid)
        boundary = self.domain.boundary
        return Image(
            log_depth=self.start,
            brightness=self.model.read_by_kernels(self.shading),
            flags=self.domain.flags,
            parameters=self.model.parameters(
                self.grid, sign=self.sign, max_slope=self.max_slope, unit=math.exp(self.level)
            ),
            x_axis=x_axis,
            y_axis=y_axis,
            cells=boundary.cells,
            inwards=boundary.inwards,
            edges=boundary.edges,
            outside=self.scheme.outside,
        )

    def corrected(self, image: NDArray[np.float64]) -> Problem:
        """The same where the image tells the depth, with another brightness to be solved for; `image` stays."""
        shading, first, level = self.model.start(image, self.domain.solved, self.grid)
        return replace(self, shading=shading, first=first, level=level)

    def depth(self, values: NDArray[np.float64], *, converged: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Log depth, in the place of the values of a run, and depth; NaN where there is none.

        A run that was ended early may not have brought every pixel down from the start value. What a known value has
        reached lies no higher than one step for each pixel on the shortest way from it.
        """
        known, solved = self.domain.known, self.domain.solved
        if not converged and np.isfinite(self.highest_known):
            step = self.max_slope * max(self.grid.dx, self.grid.dy)
            ways = masks.steps_from(known, known | solved)
            values[values > (self.highest_known + step * ways) * (1.0 + 1e-5) + 1e-6] = np.nan
        log_depth, depth = values, np.empty_like(values)
        for rows in row_blocks(depth.shape):
            block = log_depth[rows]
            block += self.level
            block *= self.sign
            block -= self.offset[rows]
            block[~(solved[rows] & (block >= _NEAREST_LOG) & (block <= _FARTHEST_LOG))] = np.nan
            np.exp(block, out=depth[rows])
            np.log(self.known_depth[rows], out=block, where=known[rows])
            np.copyto(depth[rows], self.known_depth[rows], where=known[rows])
        return log_depth, depth

    def continue_onto_walls(self, log_depth: NDArray[np.float64], depth: NDArray[np.float64]) -> Discontinuities | None:
        """Give walls a log depth and a depth, in place, and say where they cut the surface; None without walls."""
        if self.walls is None:
            return None
        known = self.known_depth[self.walls]
        discontinuities = fill_walls(log_depth, self.walls, self.image, np.log(known))
        filled = log_depth[self.walls]
        filled[~((filled >= _NEAREST_LOG) & (filled <= _FARTHEST_LOG))] = np.nan
        log_depth[self.walls] = filled
        depth[self.walls] = np.where(np.isfinite(known), known, np.exp(filled))
        return discontinuities

    @property
    def degenerate(self) -> NDArray[np.bool_]:
        """Pixels to solve where the equation gives no bound to the slope."""
        return self.model.degenerate(self.image, self.shading, self.domain.solved, self.grid)

    @property
    def kernels(self) -> tuple[str, ...]:
        """Kernel files of model and scheme."""
        return self.scheme.kernels(self.model)


def prepare(
    image: ArrayLike,
    camera: Camera,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    albedo: ArrayLike | None = None,
    *,
    options: Options,
) -> Problem:
    """Make an image ready; see :func:`persfs_cl.reconstruct` for the parameters.

    The options are complete, see :func:`persfs_cl.solver.options.complete`.

    Raises
    ------
    InputError, CameraError
        When something cannot be used.

    Warns
    -----
    UserWarning
        When under a flash many pixels are as dark as what lies behind an object; when z = 1 is assumed on the outline
        of a mask that is no flat ground; when the principal point lies outside the image.
    """
    require_camera(camera)
    light, scheme = options["light"], scheme_for(options["scheme"], options["light"], options["reflectance"])
    model = scheme.model(light, options["reflectance"])
    # A copy, so that the solution stays what it is whatever becomes of the user's array.
    photograph = np.array(to_float64(require_image(image)), order="C")
    shape = photograph.shape
    grid = camera.grid(shape)
    camera.warn_if_off_image(shape)
    wanted = np.ones(shape, bool) if mask is None else as_mask("mask", as_array_of_image("mask", mask), shape)
    barriers = None if walls is None else as_mask("walls", as_array_of_image("walls", walls), shape)
    if known_depth is None and not light.flat_rim and not light.determines_depth:
        raise InputError(
            f"{keyword('known_depth')} is not given, but {keyword('light', light)} without fall-off tells of slopes "
            "only: give at least one depth, or photograph with fall-off.",
            argument="known_depth",
        )
    if known_depth is not None:
        depths, known = as_known_depth("known_depth", known_depth, shape)
    else:
        known = masks.rim(wanted) if light.flat_rim else np.zeros(shape, bool)
        depths = np.where(known, 1.0, np.nan)
    if known_depth is None and wanted.any() and not (wanted & ~known).any():
        raise InputError(
            f"All {int(wanted.sum())} pixels lie on the edge of the image or mask, where z = 1 is assumed, and none is "
            f"left to solve: give {keyword('known_depth')}.",
            argument="known_depth",
        )
    layout = lay_out(wanted, known, barriers, options["boundary"], needs_known=not light.determines_depth)
    on_walls = None if barriers is None else barriers & (wanted | known)
    reflecting = None
    if albedo is not None:
        used = layout.known | layout.solved
        reflecting = as_albedo("albedo", albedo, used if on_walls is None else used | on_walls)
    # Pixels that are not solved may hold anything: what is no brightness must not be taken for one.
    if not (photograph.min() >= -_MOST_LIGHT and photograph.max() <= _MOST_LIGHT):
        photograph[~layout.solved & ~(np.abs(photograph) <= _MOST_LIGHT)] = np.nan
    with np.errstate(over="ignore"):
        given = photograph if reflecting is None else photograph / reflecting
    name = "image" if reflecting is None else "image / albedo"
    require_shading(given, layout.solved, model, model.brightest(grid), name)
    if known_depth is None and light.flat_rim:
        looked_at = wanted if barriers is None else wanted & ~barriers
        warn_of_steep_outline(given, looked_at, wanted, light, options["reflectance"])
    if light.determines_depth:
        model.check_scale(given, layout.solved, grid)
        warn_of_background(given, layout.solved)

    sign = 1.0 if options["surface"] == "away" else -1.0
    offset = model.offset(grid)
    known_values = sign * (np.log(depths[layout.known]) + offset[layout.known])
    # Those that no solved pixel sees must not spoil the level that keeps single precision for the relief.
    beside_solved = np.concatenate(
        [masks.Neighbours.of(layout.solved, rows).any[layout.known[rows]] for rows in row_blocks(shape)]
    )
    require_relief(depths[layout.known][beside_solved])
    first: NDArray[np.float64] | float
    max_slope = cast("float", options["max_slope"])
    if light.determines_depth:
        shading, first, level = model.start(given, layout.solved, grid)
        highest_known = np.inf
    else:
        seen = known_values[beside_solved]
        level = float(seen.min())
        # No cell lies more than one step above a neighbour, so no path from a known value can climb higher than this.
        steps = np.count_nonzero(layout.solved) + 1
        highest_known = float(seen.max()) - level
        shading = model.shading(given)
        first = highest_known + steps * max_slope * max(grid.dx, grid.dy)
    return Problem(
        photograph=photograph,
        albedo=reflecting,
        image=given,
        camera=camera,
        known_depth=depths,
        walls=on_walls,
        known_values=known_values,
        first=first,
        shading=shading,
        highest_known=highest_known,
        sign=sign,
        offset=offset,
        level=level,
        max_slope=max_slope,
        domain=layout,
        grid=grid,
        model=model,
        scheme=scheme,
    )
