"""One image made ready for the sweeps, after everything about it has been checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import checks, masks
from persfs_cl._cl.launches import Grid
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera, PixelGrid, require_camera
from persfs_cl.checks import FARTHEST, NEAREST
from persfs_cl.errors import InputError
from persfs_cl.shading.light import FlashLight, ParallelLight
from persfs_cl.shading.material import Lambertian
from persfs_cl.shading.model import Model
from persfs_cl.solver import domain
from persfs_cl.surface.discontinuities import fill_walls
from persfs_cl.surface.geometry import Cuts

_NEAREST_LOG, _FARTHEST_LOG = math.log(NEAREST), math.log(FARTHEST)

_MOST_RELIEF = 1e9
"""Ratio of depths beyond which single precision no longer tells a step of the tolerance from none."""

_LEAST_LIGHT, _MOST_LIGHT = 1e-100, 1e100
"""What the brightest pixel may be under a flash, so that products of it have double-precision numbers."""

_STEEPEST_GROUND = 30.0
"""Degrees. A coin whose edge is bevelled has a median of 20 along its outline, a sphere 75 and more."""

_FARTHEST_LAMP = 1e3
"""A lamp that is so many times farther from the camera than from the surface leaves nothing of its relief."""

_MOST_PIXELS = 2**30
"""Indices within an array are computed in 32 bits here and there."""

_BLACK = 1e-6
"""Share of the brightest value that even a black pixel is taken to have under a flash: less than any camera tells."""


_DARK, _DARK_SHARE = 0.005, 0.05
"""When so many pixels are so dark beside the brightest, 14 times as far away if they face the lamp, they are probably
no part of what was photographed."""


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
        What the kernels read in place of the image: E; under a flash F = I R² / κ at the scale of `level`, for the
        upwind scheme with the lamp beside the camera I / κ, or without fall-off the cosine between surface and ray.
    highest_known : float
        Largest known W, less `level`; infinite where no known value is needed.
    sign : float
        +1 for a surface going away from the known values, W = Z; -1 for one coming towards the camera, W = -Z.
    log_ray : ndarray of float64, shape (height, width)
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
    known_values: NDArray[np.float64]
    first: NDArray[np.float64] | float
    shading: NDArray[np.float64]
    highest_known: float
    sign: float
    log_ray: NDArray[np.float64]
    level: float
    max_slope: float
    domain: domain.Domain
    grid: PixelGrid
    model: Model
    scheme: str

    @property
    def start(self) -> NDArray[np.float64]:
        """First values of W, less `level`, in an array of their own."""
        known = self.domain.known
        start = np.full(known.shape, self.first)
        start[known] = self.known_values - self.level
        if self.scheme == "upwind":
            # What is not there must not look like a low neighbour.
            start[~(known | self.domain.solved)] = masks.NOWHERE
        return start

    @property
    def numbers(self) -> Grid:
        """The problem as the kernels want it."""
        x_axis, y_axis = self.model.axes(self.grid)
        boundary = self.domain.boundary
        return Grid(
            log_depth=self.start,
            brightness=self.shading,
            flags=self.domain.flags,
            parameters=self.model.of_unit_gain.parameters(
                self.grid, scheme=self.scheme, sign=self.sign, max_slope=self.max_slope, unit=math.exp(self.level)
            ),
            x_axis=x_axis,
            y_axis=y_axis,
            cells=boundary.cells,
            inwards=boundary.inwards,
            edges=boundary.edges,
            rim_cells=self.scheme == "lax-friedrichs",
        )

    def relit(self, image: NDArray[np.float64]) -> Problem:
        """The same under a flash with fall-off, with other brightness to be solved for; `image` stays."""
        shading, first, level = _at_unit_distance(image, self.domain.solved, self.grid, self.model, self.scheme)
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
            block -= self.log_ray[rows]
            block[~(solved[rows] & (block >= _NEAREST_LOG) & (block <= _FARTHEST_LOG))] = np.nan
            np.exp(block, out=depth[rows])
            np.log(self.known_depth[rows], out=block, where=known[rows])
            np.copyto(depth[rows], self.known_depth[rows], where=known[rows])
        return log_depth, depth

    def continue_onto_walls(self, log_depth: NDArray[np.float64], depth: NDArray[np.float64]) -> Cuts | None:
        """Give walls a log depth and a depth, in place, and say where they cut the surface; None without walls."""
        if self.walls is None:
            return None
        known = self.known_depth[self.walls]
        cuts = fill_walls(log_depth, self.walls, self.image, np.log(known))
        filled = log_depth[self.walls]
        filled[~((filled >= _NEAREST_LOG) & (filled <= _FARTHEST_LOG))] = np.nan
        log_depth[self.walls] = filled
        depth[self.walls] = np.where(np.isfinite(known), known, np.exp(filled))
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
            return np.asarray(self.domain.solved & (used <= _BLACK * _largest(used, self.domain.solved)))
        if not isinstance(self.model.reflectance, Lambertian):
            between = self.model.between(self.grid)
            grazing = self.model.reflectance.shade(np.sqrt(np.maximum(0.0, 1.0 - between**2)), 0.0, between)
            return np.asarray(self.domain.solved & (self.image <= grazing))
        found = np.zeros_like(self.domain.solved)
        x = self.grid.x
        for rows in row_blocks(found.shape):
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

    Warns
    -----
    UserWarning
        When under a flash many pixels are as dark as what lies behind an object; when z = 1 is assumed on the outline
        of a mask that is no flat ground; when the principal point lies outside the image.
    """
    require_camera(camera)
    # A copy, so that the solution stays what it is whatever becomes of the user's array.
    photograph = np.array(checks.to_float64(require_image(image)), order="C")
    shape = photograph.shape
    grid = camera.grid(shape)
    camera.warn_if_off_image(shape)
    wanted = np.ones(shape, bool) if mask is None else _require_mask("mask", mask, shape)
    barriers = None if walls is None else _require_mask("walls", walls, shape)
    if known_depth is None and model.at_camera and not model.falls_off:
        raise InputError(
            f"known_depth is not given, but light={model.light!r} without fall-off tells of slopes only: give at "
            "least one depth, or photograph with fall-off."
        )
    if known_depth is not None:
        depths, known = _require_depths(known_depth, shape)
    else:
        known = np.zeros(shape, bool) if model.falls_off else masks.rim(wanted)
        depths = np.where(known, 1.0, np.nan)
    if known_depth is None and wanted.any() and not (wanted & ~known).any():
        raise InputError(
            f"All {int(wanted.sum())} pixels lie on the edge of the image or mask, where z = 1 is assumed, and none is "
            "left to solve: give known_depth."
        )
    layout = domain.lay_out(wanted, known, barriers, boundary, needs_known=not model.falls_off)
    on_walls = None if barriers is None else barriers & (wanted | known)
    reflecting = None
    if albedo is not None:
        used = layout.known | layout.solved
        reflecting = checks.require_albedo(albedo, used if on_walls is None else used | on_walls)
    # Pixels that are not solved may hold anything: what is no brightness must not be taken for one.
    if not (photograph.min() >= -_MOST_LIGHT and photograph.max() <= _MOST_LIGHT):
        photograph[~layout.solved & ~(np.abs(photograph) <= _MOST_LIGHT)] = np.nan
    with np.errstate(over="ignore"):
        given = photograph if reflecting is None else photograph / reflecting
    name = "image" if reflecting is None else "image / albedo"
    _require_shading(given, layout.solved, model, model.brightest(grid), name)
    if known_depth is None and not model.falls_off:
        warn_of_steep_outline(given, wanted if barriers is None else wanted & ~barriers, wanted, model)
    if model.falls_off:
        _require_unit(given, layout.solved, grid, model)
        _warn_of_background(given, layout.solved)

    sign = 1.0 if surface == "away" else -1.0
    log_ray = _log_of_ray(grid, model, scheme)
    known_values = sign * (np.log(depths[layout.known]) + log_ray[layout.known])
    # Those that no solved pixel sees must not spoil the level that keeps single precision for the relief.
    beside_solved = np.concatenate(
        [masks.Neighbours.of(layout.solved, rows).any[layout.known[rows]] for rows in row_blocks(shape)]
    )
    _require_relief(depths[layout.known][beside_solved])
    first: NDArray[np.float64] | float
    if model.falls_off:
        shading, first, level = _at_unit_distance(given, layout.solved, grid, model, scheme)
        highest_known = np.inf
    else:
        seen = known_values[beside_solved]
        level = float(seen.min())
        # No cell lies more than one step above a neighbour, so no path from a known value can climb higher than this.
        steps = np.count_nonzero(layout.solved) + 1
        highest_known = float(seen.max()) - level
        shading = model.facing(given) if model.at_camera else given
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
        log_ray=log_ray,
        level=level,
        max_slope=float(max_slope),
        domain=layout,
        grid=grid,
        model=model,
        scheme=scheme,
    )


def _log_of_ray(grid: PixelGrid, model: Model, scheme: str) -> NDArray[np.float64]:
    """See :attr:`Problem.log_ray`."""
    if model.at_camera and not model.falls_off:
        return np.asarray(0.5 * np.log1p(grid.x**2 + grid.y**2))
    light = model.light
    if scheme != "upwind" or not isinstance(light, ParallelLight) or light.p0 == light.q0 == 0.0:
        return np.broadcast_to(0.0, (grid.y.size, grid.x.size))
    facing = 1.0 + light.p0 * grid.x + light.q0 * grid.y
    if facing.min() <= 0.0:
        raise InputError(
            f"light={light!r} with scheme='upwind': some pixels look into the light, where no surface faces it. "
            "Crop or mask the image, or use scheme='lax-friedrichs'."
        )
    return np.asarray(np.log(facing))


def _at_unit_distance(
    image: NDArray[np.float64], solved: NDArray[np.bool_], grid: PixelGrid, model: Model, scheme: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """F, the start value of each pixel and the level subtracted from it: see :attr:`Problem.shading`.

    From exp(2 Z) F = c(θ) follows Z <= ½ ln(max c / F), where the surface would return the most light; with the lamp
    beside the camera likewise at the distance from the lamp. Black pixels would lie at infinity; they are given a
    little light.
    """
    light = model.flash
    beside = model.beside_camera and scheme == "upwind"
    shading = np.maximum(image, _BLACK * _largest(image, solved))
    # What is not solved may hold anything.
    shading[~solved] = light.gain
    shading /= light.gain
    first = np.zeros_like(shading)
    for rows in row_blocks(shading.shape):
        x, y, inside = grid.x, grid.y[rows], solved[rows]
        if not beside:
            shading[rows] *= 1.0 + x**2 + y**2
        square_distance = model.reflectance.brightest / shading[rows]
        if beside:
            first[rows][inside] = np.log(_depth_facing(light, square_distance, x, y)[inside])
        else:
            first[rows][inside] = 0.5 * np.log(square_distance[inside])
    level = float(np.median(first[solved], overwrite_input=True))
    shading *= np.exp(2.0 * level)
    first -= level
    return shading, first, level


def nearest_depth(light: FlashLight, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth at which the equation of a lamp beside the camera ends, of rays (x, y, 1).

    As in kernels/models/lamp_beside.cl.
    It lies beyond the point of the ray that is nearest to the lamp, by some margin, and beyond the lamp's plane.
    """
    right, below, ahead = light.offset
    square_ray, along = 1.0 + x**2 + y**2, right * x + below * y + ahead
    square = right**2 + below**2 + ahead**2
    aside = np.sqrt(np.maximum(0.0, square_ray * square - along**2))
    nearest = np.maximum((1.05 * along + 0.25 * aside) / square_ray, 1.02 * ahead)
    return np.maximum(nearest, 1e-3 * math.sqrt(square))


def _depth_facing(
    light: FlashLight, square_distance: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The farther depth at which a ray is so far from the lamp, or else the nearest that there is."""
    right, below, ahead = light.offset
    square_ray, along = 1.0 + x**2 + y**2, right * x + below * y + ahead
    excess = along**2 + square_ray * (square_distance - (right**2 + below**2 + ahead**2))
    return np.maximum((along + np.sqrt(np.maximum(excess, 0.0))) / square_ray, nearest_depth(light, x, y))


def _largest(brightness: NDArray[np.float64], solved: NDArray[np.bool_]) -> float:
    """The largest value of the pixels to solve; the others may hold anything."""
    return float(brightness.max(where=solved, initial=0.0))


def require_image(image: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.floating]]:
    """The image as an array, shape (height, width), perhaps the very array given; InputError when it is none."""
    given = checks.as_map("image", image)
    if given.ndim != 2 or given.size < 2:
        remedy = " A colour image must be made grey first: see read_image." if given.ndim == 3 else ""
        raise InputError(f"image has shape {given.shape}: give a (height, width) array of at least 2 pixels.{remedy}")
    if not np.issubdtype(given.dtype, np.floating):
        raise InputError(
            f"image has dtype {given.dtype}: give floats in [0, 1] in linear light, as read_image returns them "
            "(grey levels of 8 bits: divide by 255)."
        )
    if given.size > _MOST_PIXELS:
        raise InputError(f"image has shape {given.shape}: give one of at most {_MOST_PIXELS} pixels.")
    return given


def _require_shading(
    brightness: NDArray[np.float64], solved: NDArray[np.bool_], model: Model, most: float, name: str
) -> None:
    """Check the pixels that are used; the others may hold anything."""
    blocks = (brightness[rows][solved[rows]] for rows in row_blocks(solved.shape))
    # Both are NaN where one value is.
    extremes = np.array([(used.min(), used.max()) for used in blocks if used.size])
    darkest, brightest = float(extremes[:, 0].min()), float(extremes[:, 1].max())
    if not (math.isfinite(darkest) and math.isfinite(brightest)):
        bad = np.count_nonzero(~np.isfinite(brightness[solved]))
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
    if darkest == brightest and np.count_nonzero(solved) > 1 and np.isfinite(most):
        raise InputError(
            f"{name} is constant ({darkest:g}) inside the mask: it carries no shading to reconstruct from."
        )


def _require_unit(brightness: NDArray[np.float64], solved: NDArray[np.bool_], grid: PixelGrid, model: Model) -> None:
    """Refuse brightness and gain of a flash that put the surface where numbers end."""
    brightest, light = _largest(brightness, solved), model.flash
    if not _LEAST_LIGHT <= brightest <= _MOST_LIGHT:
        raise InputError(
            f"image goes up to {brightest:g} under light={light!r}: give a brightest value from {_LEAST_LIGHT:g} to "
            f"{_MOST_LIGHT:g}, and the gain on the same scale."
        )
    returned = math.log(light.gain) + math.log(model.reflectance.brightest) - math.log(brightest)
    reach, apart = math.exp(min(0.5 * returned, 500.0)), math.hypot(*light.offset)
    if apart > _FARTHEST_LAMP * reach:
        raise InputError(
            f"light={light!r} is {apart:g} away from the camera, but the brightest pixel, {brightest:g}, tells of a "
            f"surface at most {reach:g} from the lamp: give offset and gain in the same unit of depth."
        )
    ray = 1.0 + max(abs(grid.x[0]), abs(grid.x[-1])) ** 2 + max(abs(grid.y[0, 0]), abs(grid.y[-1, 0])) ** 2
    nearest, farthest = 0.5 * (returned - math.log(ray)), 0.5 * (returned - math.log(_BLACK))
    if nearest < _NEAREST_LOG or farthest > _FARTHEST_LOG:
        power = 0.5 * returned / math.log(10.0)
        raise InputError(
            f"light={light!r} puts an image that goes up to {brightest:g} at a depth of 1e{power:+.0f} or so: give the "
            f"gain, on the scale of the image, for a unit of depth in which the surface lies well between {NEAREST:g} "
            f"and {FARTHEST:g}."
        )


def warn_of_steep_outline(
    brightness: NDArray[np.float64], looked_at: NDArray[np.bool_], wanted: NDArray[np.bool_], model: Model
) -> None:
    """Warn where z = 1 is assumed along the outline of a mask that is no flat ground, as far as its brightness tells.

    Flat ground facing the camera has the angle θ0 = acos(1 / k) to a parallel light. A pixel at the angle θ, by its
    brightness beside that of the ground, is tilted by abs(θ - θ0) at least, whichever way. The frame of the image is
    not looked at: the object goes on there.

    Parameters
    ----------
    brightness : ndarray of float64, shape (height, width)
    looked_at, wanted : ndarray of bool, shape (height, width)
        Pixels whose brightness counts, and the mask.
    model : Model
        Under a parallel light.
    """
    light = model.light
    if wanted.all() or not isinstance(light, ParallelLight):
        return
    outline = looked_at & masks.Neighbours.of(~wanted).any & np.isfinite(brightness)
    if not outline.any():
        return
    ground = 1.0 / light.norm
    relative = brightness[outline] / float(model.reflectance.shade(ground, 1.0, ground))
    tilts = np.abs(np.arccos(np.clip(relative * ground, 0.0, 1.0)) - math.acos(ground))
    tilt = math.degrees(float(np.median(tilts)))
    if tilt > _STEEPEST_GROUND:
        checks.warn(
            "known_depth is not given, and the outline of the mask is taken for flat ground at z = 1; but by its "
            f"brightness half of it is {tilt:.0f} degrees or more from flat, as where an object turns away. The "
            "surface may then be worse than a flat sheet, or than the outline inflated like a balloon: give "
            "known_depth, try the other surface, or clip highlights if they set the white level."
        )


def _warn_of_background(brightness: NDArray[np.float64], solved: NDArray[np.bool_]) -> None:
    dim = _DARK * _largest(brightness, solved)
    dark = sum(np.count_nonzero(brightness[rows][solved[rows]] < dim) for rows in row_blocks(solved.shape))
    share = dark / np.count_nonzero(solved)
    if share > _DARK_SHARE:
        checks.warn(
            f"{100 * share:.0f} % of the pixels to solve are darker than {100 * _DARK:g} % of the brightest, and "
            "become a surface far away: if they are background or shadow, mask them out."
        )


def _require_mask(name: str, given: ArrayLike, shape: tuple[int, int]) -> NDArray[np.bool_]:
    return checks.as_mask(name, checks.as_map(name, given), shape)


def _require_depths(given: ArrayLike, shape: tuple[int, int]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The known depths, and where there are any."""
    depths = checks.as_map("known_depth", given)
    if depths.shape != shape or not np.issubdtype(depths.dtype, np.floating):
        raise InputError(
            f"known_depth is {depths.dtype} of shape {depths.shape}: give a float array of the image's shape {shape}, "
            "NaN where the depth is unknown."
        )
    known = ~np.isnan(depths)
    values = checks.to_float64(depths[known])
    if values.size == 0:
        raise InputError("known_depth holds no value: leave it out for z = 1 on the edge, or give at least one depth.")
    if infinite := np.count_nonzero(np.isinf(values)):
        raise InputError(f"known_depth holds {infinite} infinite values: use NaN for unknown.")
    nearest, farthest = float(values.min()), float(values.max())
    if nearest <= 0:
        raise InputError(
            f"known_depth goes down to {nearest:g}: depths are distances along the optical axis "
            "and positive; use NaN for unknown."
        )
    if nearest < NEAREST or farthest > FARTHEST:
        value = nearest if nearest < NEAREST else farthest
        raise InputError(
            f"known_depth holds {value:g}: give depths from {NEAREST:g} to {FARTHEST:g}, in another unit if need be, "
            "and NaN for unknown."
        )
    return checks.to_float64(depths), known


def _require_relief(depths: NDArray[np.float64]) -> None:
    """Refuse known depths, of those that the surface meets, that are too far apart for single precision."""
    nearest, farthest = float(depths.min(initial=np.inf)), float(depths.max(initial=0.0))
    if farthest > _MOST_RELIEF * nearest:
        raise InputError(
            f"known_depth goes from {nearest:g} to {farthest:g} beside pixels to solve: give depths of which the "
            f"farthest is at most {_MOST_RELIEF:g} times the nearest, and NaN for what is not known, or has no end."
        )
