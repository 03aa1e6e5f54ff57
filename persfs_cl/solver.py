"""The paper's flow chart: initialise, sweep, renew the boundary, test convergence."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import domain
from persfs_cl._cl.device import Device, select_device
from persfs_cl._cl.launches import Sweeper
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.errors import ConvergenceError, InputError
from persfs_cl.forward import kernel_parameters, shading_model
from persfs_cl.light import ParallelLight
from persfs_cl.reflectance import Lambertian
from persfs_cl.solution import Elapsed, Solution, Status

Callback = Callable[[int, float], bool | None]

_CHOICES = {
    "surface": ("away", "toward"),
    "boundary": ("auto", "outflow", "extrapolate", "fixed", "wall"),
    "scheme": ("auto", "lax-friedrichs"),
    "ordering": ("wavefront", "checkerboard", "lexicographic"),
    "precision": ("float32", "float64"),
}


@dataclass(frozen=True)
class Problem:
    """One image made ready for the sweeps: everything the equation needs, as arrays and numbers.

    Attributes
    ----------
    brightness : ndarray of float64, shape (height, width)
        E; 1 where there is nothing to solve.
    start : ndarray of float64, shape (height, width)
        First values of W = ±Z, less `level`: known values, and above them all the start value.
    sign : float
        +1 for a surface going away from the known values, W = Z; -1 for one coming towards the camera, W = -Z.
    level : float
        Smallest known W; subtracting it keeps single precision for the relief.
    max_slope : float
    domain : Domain
    grid : PixelGrid
    light : ParallelLight
    """

    brightness: NDArray[np.float64]
    start: NDArray[np.float64]
    sign: float
    level: float
    max_slope: float
    domain: domain.Domain
    grid: PixelGrid
    light: ParallelLight

    @property
    def parameters(self) -> list[float]:
        """Numbers for the kernels."""
        return kernel_parameters(self.grid, self.light, sign=self.sign, max_slope=self.max_slope)

    @property
    def degenerate(self) -> NDArray[np.bool_]:
        """Pixels to solve where H is not coercive: {P : H(P) <= 0} is unbounded.

        The set is bounded where A = e² (I + xx') - ññ' of method, e = k E, is positive definite: for
        e² > |ñ|² - (x·ñ)² / (1 + r²), with ñ = (x - p0, y - q0) and r² = x² + y².
        """
        x, y = self.grid.x, self.grid.y
        offset_x, offset_y = x - self.light.p0, y - self.light.q0
        along = x * offset_x + y * offset_y
        bound = offset_x**2 + offset_y**2 - along**2 / (1.0 + x**2 + y**2)
        return np.asarray(self.domain.solved & ((self.light.norm * self.brightness) ** 2 <= bound))


def reconstruct(
    image: ArrayLike,
    camera: Camera,
    *,
    light: ParallelLight = ParallelLight(),
    reflectance: Lambertian = Lambertian(),
    mask: ArrayLike | None = None,
    walls: ArrayLike | None = None,
    known_depth: ArrayLike | None = None,
    surface: str = "away",
    boundary: str = "auto",
    scheme: str = "auto",
    ordering: str = "wavefront",
    max_iterations: int = 2000,
    tolerance: float = 1e-5,
    max_slope: float = 30.0,
    device: int | str | Device | None = None,
    precision: str = "float32",
    callback: Callback | None = None,
    throw: bool = False,
) -> Solution:
    """Reconstruct the surface that a shaded photograph shows, by Lax-Friedrichs fast sweeping (eqs. (4) to (12)).

    Parameters
    ----------
    image : array_like of float, shape (height, width)
        Normalised reflectance E in [0, 1], in linear light. A single row or column is a profile: the slope across it
        is taken as zero.
    camera : Camera
    light : ParallelLight
        Frontal by default.
    reflectance : Lambertian
    mask : array_like of bool, shape (height, width), optional
        True where the surface is to be solved; everywhere when not given.
    walls : array_like of bool, shape (height, width), optional
        True where the surface may jump: nothing propagates across these pixels, and they get no depth.
    known_depth : array_like of float, shape (height, width), optional
        Depths z > 0 that are kept exactly, NaN where unknown; inside the mask or beside it. When not given, the edge
        of the image or mask has z = 1 (the paper's zero boundary conditions).
    surface : {"away", "toward"}
        Which way the surface leaves the known values: Z grows away from them, or falls, coming towards the camera.
    boundary : {"auto", "outflow", "extrapolate", "fixed", "wall"}
        What holds on the edge of the image and mask where no depth is known. "outflow": the paper's eq. (12), nothing
        flows in from outside. "extrapolate": the surface continues linearly; values may flow in, and where they do the
        level is undetermined and drifts. "fixed": every edge pixel must be known. "wall": edge pixels are solved like
        others, with a state constraint outside. "auto" is "outflow".
    scheme : {"auto", "lax-friedrichs"}
    ordering : {"wavefront", "checkerboard", "lexicographic"}
        Order of the cells in a sweep. "wavefront" gives the bits of "lexicographic", in parallel; "checkerboard" other
        iterates and the same limit.
    max_iterations : int
        Iterations of four sweeps at most.
    tolerance : float
        The run has converged when max |ΔZ| over an iteration is at most this; Z = ln z, so 1e-5 is a relative change of
        depth of 0.001 % somewhere. It bounds the last step, not the error. 0 iterates until nothing changes.
    max_slope : float
        Bound on |dZ/dx| and |dZ/dy| between neighbouring pixels, along which Z climbs; 30 is a surface seen at 2° from
        grazing. It matters only where the equation itself sets none: see `Solution.clamped`.
    device : None, "cpu", "gpu", int, str or Device, optional
        See :func:`devices`. None honours PYOPENCL_CTX, and else takes the first.
    precision : {"float32", "float64"}
    callback : callable, optional
        Called as ``callback(iteration, change)`` after each iteration; returning True stops the run.
    throw : bool
        Raise ConvergenceError, carrying the solution, when the run did not converge.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        When an array or option cannot be used; the message says which, its value, and the remedy.
    CameraError
        When the principal point is far outside the image.
    DeviceError
        When no device fits, or it lacks the precision or the memory.
    ConvergenceError
        With ``throw=True``.
    """
    began = time.perf_counter()
    options = {
        "surface": surface,
        "boundary": boundary,
        "scheme": scheme,
        "ordering": ordering,
        "precision": precision,
    }
    for name, value in options.items():
        if value not in _CHOICES[name]:
            raise InputError(f"{name}={value!r} is not a choice: use one of {', '.join(_CHOICES[name])}.")
    options["scheme"] = "lax-friedrichs"
    options["boundary"] = "outflow" if boundary == "auto" else boundary
    if isinstance(max_iterations, bool) or not isinstance(max_iterations, (int, np.integer)) or max_iterations < 1:
        raise InputError(f"max_iterations={max_iterations!r}: give a whole number, at least 1.")
    _require_number("tolerance", tolerance, lowest=0.0, inclusive=True)
    _require_number("max_slope", max_slope, lowest=0.0, inclusive=False)

    model = shading_model(light, reflectance)
    if not isinstance(camera, Camera):
        raise InputError(f"camera={camera!r} is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")
    chosen = select_device(device)
    chosen.real(precision)
    problem = prepare(
        image,
        camera,
        light=light,
        mask=mask,
        walls=walls,
        known_depth=known_depth,
        surface=surface,
        boundary=options["boundary"],
        max_slope=max_slope,
    )
    build_began = time.perf_counter()
    edge = problem.domain.boundary
    sweeper = Sweeper(
        chosen,
        model=model,
        scheme="lax_friedrichs",
        ordering=ordering,
        precision=precision,
        log_depth=problem.start,
        brightness=problem.brightness,
        flags=problem.domain.flags,
        parameters=problem.parameters,
        cells=edge.cells,
        inwards=edge.inwards,
        edges=edge.edges,
        linear=options["boundary"] == "extrapolate",
        lowest=0.0,
    )
    build_seconds = time.perf_counter() - build_began

    changes, status = _iterate(sweeper, int(max_iterations), float(tolerance), callback)

    values = problem.sign * (sweeper.log_depth().astype(np.float64) + problem.level)
    has_depth = problem.domain.solved | problem.domain.known
    log_depth = np.where(has_depth, values, np.nan)
    depth = np.exp(log_depth)
    if known_depth is not None:
        depth = np.where(problem.domain.known, np.asarray(known_depth, dtype=np.float64), depth)
    solution = Solution(
        depth=depth,
        log_depth=np.log(depth),
        solved=has_depth,
        unreached=problem.domain.unreached,
        clamped=problem.degenerate,
        iterations=len(changes),
        changes=np.array(changes),
        status=status,
        elapsed=Elapsed(time.perf_counter() - began, sweeper.kernel_seconds, build_seconds),
        device=chosen,
        image=np.asarray(image, dtype=np.float64),
        camera=camera,
        light=problem.light,
        reflectance=reflectance,
        parameters={
            **options,
            "max_iterations": int(max_iterations),
            "tolerance": float(tolerance),
            "max_slope": float(max_slope),
        },
    )
    if throw and status is not Status.CONVERGED:
        raise ConvergenceError(
            f"Not converged after {solution.iterations} iterations: max |ΔZ| is still {changes[-1]:.3g}, above the "
            f"tolerance {tolerance:g}. {status.value}",
            solution,
        )
    return solution


def reconstruct_batch(
    images: Sequence[ArrayLike],
    cameras: Camera | Sequence[Camera],
    *,
    mask: Sequence[ArrayLike | None] | None = None,
    walls: Sequence[ArrayLike | None] | None = None,
    known_depth: Sequence[ArrayLike | None] | None = None,
    **keywords: Any,
) -> list[Solution]:
    """Reconstruct many images; the same numbers as one by one.

    Parameters
    ----------
    images : sequence of array_like
        As for :func:`reconstruct`; sizes may differ.
    cameras : Camera or sequence of Camera
        One for all, or one an image.
    mask, walls, known_depth : sequence, optional
        One entry an image, None where it has none.
    **keywords
        As for :func:`reconstruct`, the same for all images.

    Returns
    -------
    list of Solution

    Raises
    ------
    InputError
        When a list does not have one entry an image; otherwise as :func:`reconstruct`.
    """
    count = len(images)
    lists: dict[str, Sequence[Any]] = {
        "cameras": [cameras] * count if isinstance(cameras, Camera) else cameras,
        "mask": [None] * count if mask is None else mask,
        "walls": [None] * count if walls is None else walls,
        "known_depth": [None] * count if known_depth is None else known_depth,
    }
    for name, entries in lists.items():
        if len(entries) != count:
            raise InputError(f"{name} has {len(entries)} entries for {count} images: give one an image.")
    return [
        reconstruct(image, camera, mask=chosen, walls=barrier, known_depth=known, **keywords)
        for image, camera, chosen, barrier, known in zip(images, *lists.values(), strict=True)
    ]


def prepare(
    image: ArrayLike,
    camera: Camera,
    *,
    light: ParallelLight,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    surface: str,
    boundary: str,
    max_slope: float,
) -> Problem:
    """Check the arrays of one image and make them ready; see :func:`reconstruct` for the parameters.

    Raises
    ------
    InputError, CameraError
        When something cannot be used.
    """
    brightness = _require_image(image)
    shape = (brightness.shape[0], brightness.shape[1])
    grid = camera.grid(shape)
    wanted = _require_mask("mask", mask, shape, default=True)
    barriers = _require_mask("walls", walls, shape, default=False)
    depths = _require_depths(known_depth, shape, wanted)
    layout = domain.lay_out(wanted, np.isfinite(depths), barriers, boundary)
    _require_shading(brightness, layout.solved)

    sign = 1.0 if surface == "away" else -1.0
    known = sign * np.log(depths[layout.known])
    level = float(known.min())
    # No cell lies more than one step above a neighbour, so no path from a known value can climb higher than this.
    steps = np.count_nonzero(layout.solved) + 1
    highest = float(known.max()) - level + steps * max_slope * max(grid.dx, grid.dy)
    start = np.full(shape, highest)
    start[layout.known] = known - level
    return Problem(
        brightness=np.where(layout.solved, brightness, 1.0),
        start=start,
        sign=sign,
        level=level,
        max_slope=float(max_slope),
        domain=layout,
        grid=grid,
        light=light,
    )


def _iterate(
    sweeper: Sweeper, max_iterations: int, tolerance: float, callback: Callback | None
) -> tuple[list[float], Status]:
    changes: list[float] = []
    for iteration in range(1, max_iterations + 1):
        changes.append(sweeper.iterate())
        stop = callback is not None and bool(callback(iteration, changes[-1]))
        if changes[-1] <= tolerance:
            return changes, Status.CONVERGED
        if stop:
            return changes, Status.STOPPED
    return changes, Status.MAX_ITERATIONS


def _require_number(name: str, value: object, *, lowest: float, inclusive: bool) -> None:
    good = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not good or not math.isfinite(value) or value < lowest or (value == lowest and not inclusive):  # type: ignore[arg-type, operator]
        least = "at least" if inclusive else "greater than"
        raise InputError(f"{name}={value!r}: give a finite number {least} {lowest:g}.")


def _require_image(image: ArrayLike) -> NDArray[np.float64]:
    given = np.asarray(image)
    if given.ndim != 2 or given.size < 2:
        remedy = " A colour image must be made grey first: see read_image." if given.ndim == 3 else ""
        raise InputError(f"image has shape {given.shape}: give a (height, width) array of at least 2 pixels.{remedy}")
    if not np.issubdtype(given.dtype, np.floating):
        raise InputError(
            f"image has dtype {given.dtype}: give floats in [0, 1] in linear light, as read_image returns them "
            "(grey levels of 8 bits: divide by 255)."
        )
    return given.astype(np.float64)


def _require_shading(brightness: NDArray[np.float64], solved: NDArray[np.bool_]) -> None:
    """Check the pixels that are used; the others may hold anything."""
    used = brightness[solved]
    if bad := int(np.count_nonzero(~np.isfinite(used))):
        raise InputError(f"image holds {bad} NaN or infinite values inside the mask: mask them out.")
    darkest, brightest = float(used.min()), float(used.max())
    if darkest < 0.0 or brightest > 1.0 + 1e-6:
        raise InputError(
            f"image ranges from {darkest:g} to {brightest:g}: E must lie in [0, 1]. Use normalise_grey, or divide by "
            "the brightest value."
        )
    if brightest == 0.0:
        raise InputError("image is all black inside the mask: it carries no shading to reconstruct from.")
    if darkest == brightest and used.size > 1:
        raise InputError(f"image is constant ({darkest:g}) inside the mask: it carries no shading to reconstruct from.")


def _require_mask(name: str, given: ArrayLike | None, shape: tuple[int, int], *, default: bool) -> NDArray[np.bool_]:
    if given is None:
        return np.full(shape, default)
    pixels = np.asarray(given)
    if pixels.dtype != bool or pixels.shape != shape:
        raise InputError(
            f"{name} is {pixels.dtype} of shape {pixels.shape}: give a bool array of the image's shape {shape}."
        )
    return pixels


def _require_depths(given: ArrayLike | None, shape: tuple[int, int], wanted: NDArray[np.bool_]) -> NDArray[np.float64]:
    if given is None:
        return np.where(domain.rim(wanted), 1.0, np.nan)
    depths = np.asarray(given)
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
    return depths.astype(np.float64)
