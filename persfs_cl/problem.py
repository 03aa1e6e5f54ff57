"""One image made ready for the sweeps, after everything about it has been checked."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import domain
from persfs_cl._cl.launches import Grid
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.errors import InputError
from persfs_cl.light import ParallelLight
from persfs_cl.models import Model
from persfs_cl.reflectance import Lambertian
from persfs_cl.surface import Cuts
from persfs_cl.walls import fill_walls

_LARGEST = 700.0
"""|ln z| beyond which z is no longer a float64."""

_BLACK = 1e-6
"""Share of the brightest value that even a black pixel is taken to have under a flash: less than any camera tells."""


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
    start : ndarray of float64, shape (height, width)
        First values of W, less `level`: known values, and above them all the start value.
    shading : ndarray of float64, shape (height, width)
        What the kernels read in place of the image: E; under a flash F = I R² / κ at the scale of `level`, or without
        fall-off the cosine between surface and ray.
    highest_known : float
        Largest known W, less `level`; infinite where no known value is needed.
    sign : float
        +1 for a surface going away from the known values, W = Z; -1 for one coming towards the camera, W = -Z.
    log_ray : ndarray of float64, shape (height, width), or float
        What stands between Z = ln z and what the kernels solve for in place of Z: under a flash without fall-off the
        log distance, Z + ln R, and for the upwind scheme under a parallel light Z + ln(1 + p0 x + q0 y), which is level
        where the surface faces the light; else 0.
    level : float
        Smallest known W, or a typical one; subtracting it keeps single precision for the relief.
    max_slope : float
    domain : Domain
    grid : PixelGrid
    model : Model
    scheme : str
    """

    photograph: NDArray[np.float64]
    albedo: NDArray[np.float64] | None
    image: NDArray[np.float64]
    camera: Camera
    known_depth: NDArray[np.float64]
    walls: NDArray[np.bool_] | None
    start: NDArray[np.float64]
    shading: NDArray[np.float64]
    highest_known: float
    sign: float
    log_ray: NDArray[np.float64] | float
    level: float
    max_slope: float
    domain: domain.Domain
    grid: PixelGrid
    model: Model
    scheme: str

    @property
    def numbers(self) -> Grid:
        """The problem as the kernels want it."""
        x_axis, y_axis = self.model.axes(self.grid)
        boundary = self.domain.boundary
        return Grid(
            log_depth=self.start,
            brightness=self.shading,
            flags=self.domain.flags,
            parameters=self.model.parameters(self.grid, sign=self.sign, max_slope=self.max_slope),
            x_axis=x_axis,
            y_axis=y_axis,
            cells=boundary.cells,
            inwards=boundary.inwards,
            edges=boundary.edges,
            rim_cells=self.scheme == "lax-friedrichs",
        )

    def relit(self, image: NDArray[np.float64]) -> Problem:
        """The same under a flash with fall-off, with other brightness to be solved for; `image` stays."""
        known, solved = self.domain.known, self.domain.solved
        shading, start, level = _at_unit_distance(image, solved, self.grid, self.model)
        start[known] = np.log(self.known_depth[known]) - level
        if self.scheme == "upwind":
            start[~(known | solved)] = domain.NOWHERE
        return replace(self, shading=shading, start=start, level=level)

    def depth(
        self, values: NDArray[np.floating], *, converged: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Log depth and depth from the values of a run; NaN where there is none.

        A run that was ended early may not have brought every pixel down from the start value. What a known value has
        reached lies no higher than one step for each pixel on the shortest way from it.
        """
        log_depth = values.astype(np.float64)
        log_depth += self.level
        if self.sign < 0:
            np.negative(log_depth, out=log_depth)
        if not isinstance(self.log_ray, float):
            log_depth -= self.log_ray
        reached = self.domain.solved & (log_depth < _LARGEST) & (log_depth > -_LARGEST)
        if not converged and np.isfinite(self.highest_known):
            step = self.max_slope * max(self.grid.dx, self.grid.dy)
            ways = domain.steps_from(self.domain.known, self.domain.known | self.domain.solved)
            reached &= values <= (self.highest_known + step * ways) * (1.0 + 1e-5) + 1e-6
        np.copyto(log_depth, np.nan, where=~reached)
        depth = np.exp(log_depth)
        known = np.nonzero(self.domain.known)
        depth[known] = self.known_depth[known]
        log_depth[known] = np.log(depth[known])
        return log_depth, depth

    def continue_onto_walls(self, log_depth: NDArray[np.float64], depth: NDArray[np.float64]) -> Cuts | None:
        """Give walls a log depth and a depth, in place, and say where they cut the surface; None without walls."""
        if self.walls is None:
            return None
        known = self.known_depth[self.walls]
        cuts = fill_walls(log_depth, self.walls, self.image, np.log(known))
        depth[self.walls] = np.where(np.isfinite(known), known, np.exp(log_depth[self.walls]))
        return cuts

    @property
    def degenerate(self) -> NDArray[np.bool_]:
        """Pixels to solve where the equation gives no bound to the slope.

        Under a parallel light H is not coercive there: {P : H(P) <= 0} is unbounded. The set is bounded where
        A = e² (I + xx') - ññ', e = k E, is positive definite: for e² > |ñ|² - (x·ñ)² / (1 + r²), with
        ñ = (x - p0, y - q0) and r² = x² + y². Under a flash only a black pixel is such a one; without fall-off, and for
        other materials under a parallel light, every pixel that is as dark as the material at grazing.
        """
        light = self.model.light
        if not isinstance(light, ParallelLight):
            used = self.image if self.model.falls_off else self.shading
            return np.asarray(self.domain.solved & (used <= _BLACK * used[self.domain.solved].max()))
        if not isinstance(self.model.reflectance, Lambertian):
            between = self.model.between(self.grid)
            grazing = self.model.reflectance.shade(np.sqrt(np.maximum(0.0, 1.0 - between**2)), 0.0, between)
            return np.asarray(self.domain.solved & (self.image <= grazing))
        found = np.zeros_like(self.domain.solved)
        x = self.grid.x
        # By rows that fit the cache: over whole images the intermediate arrays would cost more than the arithmetic.
        for begin in range(0, len(found), 32):
            rows = slice(begin, begin + 32)
            y = self.grid.y[rows]
            offset_x, offset_y = x - light.p0, y - light.q0
            # The bound is at most |ñ|²: most photographs are brighter than that nearly everywhere.
            if (light.norm * self.image[rows].min()) ** 2 > (offset_x**2).max() + (offset_y**2).max():
                continue
            along = x * offset_x + y * offset_y
            bound = offset_x**2 + offset_y**2 - along**2 / (1.0 + x**2 + y**2)
            found[rows] = self.domain.solved[rows] & ((light.norm * self.image[rows]) ** 2 <= bound)
        return found


def prepare(
    image: ArrayLike,
    camera: Camera,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    model: Model,
    scheme: str,
    surface: str,
    boundary: str,
    max_slope: float,
    albedo: ArrayLike | None = None,
) -> Problem:
    """Make an image ready; see :func:`persfs_cl.reconstruct` for the parameters.

    Raises
    ------
    InputError, CameraError
        When something cannot be used.
    """
    if not isinstance(camera, Camera):
        raise InputError(f"camera={camera!r} is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")
    # A copy, so that the solution stays what it is whatever becomes of the user's array.
    photograph = require_image(image).copy()
    shape = photograph.shape
    grid = camera.grid(shape)
    wanted = _require_mask("mask", mask, shape, default=True)
    barriers = _require_mask("walls", walls, shape, default=False)
    if known_depth is None and model.at_camera and not model.falls_off:
        raise InputError(
            f"known_depth is not given, but light={model.light!r} without fall-off tells of slopes only: give at "
            "least one depth, or photograph with fall-off."
        )
    assumed = domain.rim(wanted) if not model.falls_off else np.zeros_like(wanted)
    depths = _require_depths(known_depth, shape, assumed)
    if known_depth is None and wanted.any() and not (wanted & np.isnan(depths)).any():
        raise InputError(
            f"All {int(wanted.sum())} pixels lie on the edge of the image or mask, where z = 1 is assumed, and none is "
            "left to solve: give known_depth."
        )
    layout = domain.lay_out(wanted, np.isfinite(depths), barriers, boundary, needs_known=not model.falls_off)
    on_walls = None if walls is None else barriers & (wanted | np.isfinite(depths))
    used = layout.known | layout.solved
    reflecting = None if albedo is None else require_albedo(albedo, used if on_walls is None else used | on_walls)
    given = photograph if reflecting is None else photograph / reflecting
    name = "image" if reflecting is None else "image / albedo"
    _require_shading(given, layout.solved, model, model.brightest(grid), name)

    sign = 1.0 if surface == "away" else -1.0
    log_ray = _log_of_ray(grid, model, scheme)
    rays = log_ray if isinstance(log_ray, float) else log_ray[layout.known]
    known = sign * (np.log(depths[layout.known]) + rays)
    if model.falls_off:
        shading, start, level = _at_unit_distance(given, layout.solved, grid, model)
        highest_known = np.inf
    else:
        # Those that no solved pixel sees must not spoil the level that keeps single precision for the relief.
        seen = domain.Neighbours.of(layout.solved).any[layout.known]
        level = float(known[seen].min())
        # No cell lies more than one step above a neighbour, so no path from a known value can climb higher than this.
        steps = np.count_nonzero(layout.solved) + 1
        highest_known = float(known[seen].max()) - level
        shading = model.facing(given) if model.at_camera else given
        start = np.full(shape, highest_known + steps * max_slope * max(grid.dx, grid.dy))
    start[layout.known] = known - level
    if scheme == "upwind":
        # What is not there must not look like a low neighbour.
        start[~(layout.known | layout.solved)] = domain.NOWHERE
    return Problem(
        photograph=photograph,
        albedo=reflecting,
        image=given,
        camera=camera,
        known_depth=depths,
        walls=on_walls,
        start=start,
        shading=shading,
        highest_known=highest_known,
        sign=sign,
        log_ray=log_ray,
        level=level,
        max_slope=float(max_slope),
        domain=layout,
        grid=grid,
        model=model,
        scheme=scheme,
    )


def _log_of_ray(grid: PixelGrid, model: Model, scheme: str) -> NDArray[np.float64] | float:
    """See :attr:`Problem.log_ray`."""
    if model.at_camera and not model.falls_off:
        return np.asarray(0.5 * np.log1p(grid.x**2 + grid.y**2))
    light = model.light
    if scheme != "upwind" or not isinstance(light, ParallelLight) or light.p0 == light.q0 == 0.0:
        return 0.0
    facing = 1.0 + light.p0 * grid.x + light.q0 * grid.y
    if facing.min() <= 0.0:
        raise InputError(
            f"light={light!r} with scheme='upwind': some pixels look into the light, where no surface faces it. "
            "Crop or mask the image, or use scheme='lax-friedrichs'."
        )
    return np.asarray(np.log(facing))


def _at_unit_distance(
    image: NDArray[np.float64], solved: NDArray[np.bool_], grid: PixelGrid, model: Model
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """F = I R² / κ, the start value of each pixel and the level subtracted from it.

    From exp(2 Z) F = c(θ) follows Z <= ½ ln(max c / F), where the surface would return the most light. Black pixels
    would lie at infinity; they are given a little light.
    """
    lit = np.maximum(image, _BLACK * image[solved].max()) if solved.any() else image
    shading = lit * (1.0 + grid.x**2 + grid.y**2) / model.light.gain  # type: ignore[union-attr] # a flash has a gain
    start = np.zeros_like(shading)
    start[solved] = 0.5 * np.log(model.reflectance.brightest / shading[solved])
    level = float(np.median(start[solved]))
    return shading * np.exp(2.0 * level), start - level, level


def as_array(name: str, given: ArrayLike) -> NDArray[Any]:
    """The array that a user gave; InputError for lists of unequal length and the like."""
    try:
        return np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is no array ({error}): give numbers in rows of equal length.") from error


def require_image(image: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """The image as float64, shape (height, width), perhaps the very array given; InputError when it is none."""
    given = as_array("image", image)
    if given.ndim != 2 or given.size < 2:
        remedy = " A colour image must be made grey first: see read_image." if given.ndim == 3 else ""
        raise InputError(f"image has shape {given.shape}: give a (height, width) array of at least 2 pixels.{remedy}")
    if not np.issubdtype(given.dtype, np.floating):
        raise InputError(
            f"image has dtype {given.dtype}: give floats in [0, 1] in linear light, as read_image returns them "
            "(grey levels of 8 bits: divide by 255)."
        )
    return given.astype(np.float64, copy=False)


def require_albedo(albedo: ArrayLike, used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The albedo as float64, shape (height, width), 1 where it is not used; InputError when it is none."""
    given = as_array("albedo", albedo)
    if given.shape != used.shape or not np.issubdtype(given.dtype, np.floating):
        raise InputError(
            f"albedo is {given.dtype} of shape {given.shape}: give a float array of the image's shape {used.shape}, "
            "the share of light in (0, 1] that each pixel's surface returns."
        )
    # Written so that a NaN is found too.
    if bad := int(np.count_nonzero(~((given > 0) & (given <= 1)) & used)):
        raise InputError(
            f"albedo is not in (0, 1] at {bad} pixels with a surface, where it ranges from {given[used].min():g} to "
            f"{given[used].max():g}: divide by its largest value, and mask out what is black or unknown."
        )
    return np.where(used, given, 1.0).astype(np.float64)


def _require_shading(
    brightness: NDArray[np.float64], solved: NDArray[np.bool_], model: Model, most: float, name: str
) -> None:
    """Check the pixels that are used; the others may hold anything."""
    bad, count, darkest, brightest = 0, 0, np.inf, -np.inf
    # By rows that fit the cache: over whole images the intermediate arrays would cost more than the arithmetic.
    for begin in range(0, len(solved), 32):
        used = brightness[begin : begin + 32][solved[begin : begin + 32]]
        if used.size:
            bad += int(np.count_nonzero(~np.isfinite(used)))
            count += used.size
            darkest, brightest = min(darkest, float(used.min())), max(brightest, float(used.max()))
    if bad:
        raise InputError(f"{name} holds {bad} NaN or infinite values inside the mask: mask them out.")
    if darkest < 0.0 or brightest > most * (1.0 + 1e-6):
        if model.falls_off:
            remedy = "light is not negative. Subtract less, or mask these pixels out."
        elif model.at_camera:
            remedy = (
                f"{model.light!r} on {model.reflectance!r} gives at most {most:g}. Scale the image, or give the gain "
                "that belongs to it."
            )
        elif isinstance(model.reflectance, Lambertian):
            remedy = "E must lie in [0, 1]. Use normalise_grey, or divide by the brightest value."
        else:
            remedy = f"{model.reflectance!r} is seen no brighter than {most:.3g} under this light. Scale the image."
        raise InputError(f"{name} ranges from {darkest:g} to {brightest:g}: {remedy}")
    if brightest == 0.0:
        raise InputError(f"{name} is all black inside the mask: it carries no shading to reconstruct from.")
    if darkest == brightest and count > 1 and np.isfinite(most):
        raise InputError(
            f"{name} is constant ({darkest:g}) inside the mask: it carries no shading to reconstruct from."
        )


def _require_mask(name: str, given: ArrayLike | None, shape: tuple[int, int], *, default: bool) -> NDArray[np.bool_]:
    if given is None:
        return np.full(shape, default)
    pixels = as_array(name, given)
    if pixels.dtype != bool or pixels.shape != shape:
        raise InputError(
            f"{name} is {pixels.dtype} of shape {pixels.shape}: give a bool array of the image's shape {shape}."
        )
    return pixels


def _require_depths(given: ArrayLike | None, shape: tuple[int, int], assumed: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The known depths; 1 at the pixels `assumed` when none are given."""
    if given is None:
        return np.where(assumed, 1.0, np.nan)
    depths = as_array("known_depth", given)
    if depths.shape != shape or not np.issubdtype(depths.dtype, np.floating):
        raise InputError(
            f"known_depth is {depths.dtype} of shape {depths.shape}: give a float array of the image's shape {shape}, "
            "NaN where the depth is unknown."
        )
    if np.isinf(depths).any():
        raise InputError(f"known_depth holds {int(np.isinf(depths).sum())} infinite values: use NaN for unknown.")
    if (depths <= 0).any():
        raise InputError(
            f"known_depth goes down to {float(np.nanmin(depths)):g}: depths are distances along the optical axis "
            "and positive; use NaN for unknown."
        )
    if np.isnan(depths).all():
        raise InputError("known_depth holds no value: leave it out for z = 1 on the edge, or give at least one depth.")
    return depths.astype(np.float64, copy=False)
