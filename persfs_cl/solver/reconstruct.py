"""The paper's flow chart: initialise, sweep, renew the boundary, test convergence."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.launches import Grid, Sweeper
from persfs_cl._cl.selection import select_device
from persfs_cl.camera import Camera
from persfs_cl.checks import FARTHEST, NEAREST, brief, finite_number, warn
from persfs_cl.choices import Boundary, Ordering, Precision, Scheme, Surface
from persfs_cl.errors import CameraError, ConvergenceError, InputError
from persfs_cl.shading.light import FlashLight, Light, ParallelLight
from persfs_cl.shading.material import Lambertian, Reflectance
from persfs_cl.shading.model import Model
from persfs_cl.solver import rounds as lamp
from persfs_cl.solver.problem import Problem, prepare, require_image
from persfs_cl.surface.solution import Elapsed, Solution, Status

Callback = Callable[[int, float], bool | None]
_Surface = tuple[NDArray[np.float64], NDArray[np.float64]]

_CHOICES = {
    "surface": get_args(Surface),
    "boundary": get_args(Boundary),
    "scheme": get_args(Scheme),
    "ordering": get_args(Ordering),
    "precision": get_args(Precision),
}

MAX_SLOPE = 30.0
MAX_SLOPE_UPWIND = 5.0
_STEEPEST = 1e6
_MOST_ITERATIONS = 10**9

_FREE_CORRECTIONS = 40
"""Iterations of second order in which values may rise, at least."""

_QUEUE_SECONDS = 0.03
"""Iterations are queued so many at a time as take about this long: few waits, and Ctrl-C is still heard at once."""


def reconstruct(
    image: ArrayLike,
    camera: Camera,
    *,
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    mask: ArrayLike | None = None,
    walls: ArrayLike | None = None,
    known_depth: ArrayLike | None = None,
    albedo: ArrayLike | None = None,
    surface: Surface = "away",
    boundary: Boundary = "auto",
    scheme: Scheme = "auto",
    ordering: Ordering = "wavefront",
    accuracy_order: int = 1,
    max_iterations: int = 2000,
    tolerance: float = 1e-5,
    max_slope: float | None = None,
    device: int | str | Device | None = None,
    precision: Precision = "float32",
    callback: Callback | None = None,
    throw: bool = False,
) -> Solution:
    """Reconstruct the surface that a shaded photograph shows, by fast sweeping (eqs. (4) to (12) and their kin).

    Parameters
    ----------
    image : array_like of float, shape (height, width)
        In linear light. Under a parallel light the normalised reflectance E in [0, 1]; under a flash the brightness
        on the scale of its gain, which may be any. A single row or column is a profile: across it the slope is that at
        which H is least.
    camera : Camera
    light : ParallelLight or FlashLight
        A frontal parallel light by default. Under a flash that fades with distance the image alone determines the
        depth, in the unit of the gain: no known values, no choice of `surface`. A lamp beside the camera is where it is
        in the upwind scheme, for a Lambertian surface that lies in no shadow and leads away from the lamp at every
        edge, or has known depths there. Other materials shade there by the angle to the lamp alone, and for the
        Lax-Friedrichs scheme the lamp is at the camera: then the image is corrected by what the surface found says of
        that, and solved again, in up to 10 rounds, for a lamp not farther off than a tenth of the depth or so.
    reflectance : Lambertian, OrenNayar or Phong
        Under a parallel light others than Lambertian are for the Lax-Friedrichs scheme, and an image is on the scale of
        what the material returns.
    mask : array_like of bool, shape (height, width), optional
        True where the surface is to be solved; everywhere when not given.
    walls : array_like of bool, shape (height, width), optional
        True where the surface may jump: nothing propagates across these pixels. After the solve each gets its depth
        from the side that it belongs to, see :attr:`Solution.cuts`.
    known_depth : array_like of float, shape (height, width), optional
        Depths that are kept exactly, from 1e-30 to 1e30 and at most a factor of 1e9 apart; NaN where unknown; inside
        the mask or beside it. When not given, with a parallel light the edge of the image or mask has z = 1 (the
        paper's zero boundary conditions), with a warning where a mask's outline is no flat ground; with a flash
        nothing is known, and without its fall-off some depth must be given.
    albedo : array_like of float, shape (height, width), optional
        Share of light in (0, 1] that the surface returns at each pixel, by which the image is divided; 1 if not given.
    surface : {"away", "toward"}
        Which way the surface leaves the known values: Z grows away from them, or falls, coming towards the camera.
    boundary : {"auto", "outflow", "extrapolate", "fixed", "wall"}
        What holds on the edge of the image and mask where no depth is known. "outflow": the paper's eq. (12), nothing
        flows in from outside. "extrapolate": the surface continues linearly; values may flow in, and where they do the
        level is undetermined and drifts. "fixed": every edge pixel must be known. "wall": edge pixels are solved like
        others, with a state constraint outside. "auto" is "outflow" for the Lax-Friedrichs scheme under a parallel
        light, else "wall". The upwind scheme knows "wall" and "fixed" only: by its nature nothing flows in.
    scheme : {"auto", "lax-friedrichs", "upwind"}
        "lax-friedrichs" is the paper's: it takes any Hamiltonian, smears, and needs many iterations. "upwind" solves
        each cell exactly from the neighbours upwind: a few iterations, and several times less error. "auto" is the
        paper's under a parallel light, and upwind under a flash where the material permits it.
    ordering : {"wavefront", "checkerboard", "lexicographic"}
        Order of the cells in a sweep. "wavefront" gives the bits of "lexicographic", in parallel; "checkerboard" other
        iterates and, where the boundary is monotone, the same limit: with known edges or ``boundary="wall"``; under
        eq. (12) the limit may differ a little, and with "extrapolate" much.
    accuracy_order : int
        1: both schemes are of first order. 2: the upwind scheme, once converged, is corrected to second order where the
        surface is smooth, and stays as it is beside ridges, edges and silhouettes. Some more iterations, each slower;
        many more with the checkerboard.
    max_iterations : int
        Iterations of four sweeps at most; with a lamp beside the camera in each round.
    tolerance : float
        The run has converged when max |ΔZ| over an iteration is at most this; Z = ln z, so 1e-5 is a relative change of
        depth of 0.001 % somewhere. It bounds the last step, not the error. 0 iterates until nothing changes.
    max_slope : float, optional
        Bound on |dZ/dx| and |dZ/dy| between neighbouring pixels, along which Z climbs. It matters where the equation
        itself sets none, see `Solution.clamped`, and where the surface is steeper still. 30, a surface seen at 2° from
        grazing, when not given; for the upwind scheme under a parallel light, which takes it at its word, 5 (11°).
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
        When the ray of a pixel lies more than 85 degrees from the optical axis.
    DeviceError
        When no device fits, or it lacks the precision or the memory.
    ConvergenceError
        With ``throw=True``.
    """
    return reconstruct_batch(
        [image],
        [camera],
        light=light,
        reflectance=reflectance,
        mask=[mask],
        walls=[walls],
        known_depth=[known_depth],
        albedo=[albedo],
        surface=surface,
        boundary=boundary,
        scheme=scheme,
        ordering=ordering,
        accuracy_order=accuracy_order,
        max_iterations=max_iterations,
        tolerance=tolerance,
        max_slope=max_slope,
        device=device,
        precision=precision,
        callback=callback,
        throw=throw,
    )[0]


def reconstruct_batch(
    images: Iterable[ArrayLike],
    cameras: Camera | Iterable[Camera],
    *,
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    mask: Sequence[ArrayLike | None] | None = None,
    walls: Sequence[ArrayLike | None] | None = None,
    known_depth: Sequence[ArrayLike | None] | None = None,
    albedo: Sequence[ArrayLike | None] | None = None,
    surface: Surface = "away",
    boundary: Boundary = "auto",
    scheme: Scheme = "auto",
    ordering: Ordering = "wavefront",
    accuracy_order: int = 1,
    max_iterations: int = 2000,
    tolerance: float = 1e-5,
    max_slope: float | None = None,
    device: int | str | Device | None = None,
    precision: Precision = "float32",
    callback: Callback | None = None,
    throw: bool = False,
) -> list[Solution]:
    """Reconstruct many images; the same numbers, bit for bit, as one by one.

    Images of one size share launches, as many at a time as the device's memory takes; an image that has converged
    costs nothing more.

    Parameters
    ----------
    images : iterable of array_like
        As for :func:`reconstruct`; sizes may differ.
    cameras : Camera or iterable of Camera
        One for all, or one an image.
    mask, walls, known_depth, albedo : sequence, optional
        One entry an image, None where it has none.
    callback : callable, optional
        Called as ``callback(iteration, change)`` with the largest change of the images that share launches and have
        not converged; returning True stops these, and all that have not begun.
    light, reflectance, surface, boundary, scheme, ordering, accuracy_order
        As for :func:`reconstruct`, the same for all images.
    max_iterations, tolerance, max_slope, device, precision, throw
        As for :func:`reconstruct`, the same for all images.

    Returns
    -------
    list of Solution
        In the order of the images. `elapsed` is an image's share.

    Raises
    ------
    InputError
        When a list does not have one entry an image; otherwise as :func:`reconstruct`, naming the image.
    """
    began = time.perf_counter()
    options = Options(
        surface, boundary, scheme, ordering, precision, accuracy_order, max_iterations, tolerance, max_slope
    )
    model = Model.of(light, reflectance)
    scheme = model.scheme(options.scheme)
    options = options.resolved(model, scheme)
    slope = float(options.max_slope or MAX_SLOPE)
    if callback is not None and not callable(callback):
        raise InputError(f"callback={brief(callback)} cannot be called: give a function of iteration and change.")
    if not isinstance(throw, (bool, np.bool_)):
        raise InputError(f"throw={brief(throw)} is no choice: give True or False.")
    given = _entries("images", images)
    count = len(given)
    lists = {
        "cameras": [cameras] * count if isinstance(cameras, Camera) else _entries("cameras", cameras),
        "mask": [None] * count if mask is None else _entries("mask", mask),
        "walls": [None] * count if walls is None else _entries("walls", walls),
        "known_depth": [None] * count if known_depth is None else _entries("known_depth", known_depth),
        "albedo": [None] * count if albedo is None else _entries("albedo", albedo),
    }
    for name, entries in lists.items():
        if len(entries) != count:
            raise InputError(f"{name} has {len(entries)} entries for {count} images: give one an image.")
    inputs: list[Any] = list(zip(given, *lists.values(), strict=True))

    @contextmanager
    def naming(number: int) -> Iterator[None]:
        """Put the number of the image before the message of an error."""
        try:
            yield
        except (InputError, CameraError) as error:
            raise type(error)(f"images[{number}]: {error}" if count > 1 else str(error)) from None
        except MemoryError as error:
            raise InputError(
                f"images[{number}] does not fit into memory ({brief(error)}): reduce its size, or cut out a part."
            ) from error

    def prepared(number: int) -> Problem:
        with naming(number):
            image, camera, region, barriers, known, reflecting = inputs[number]
            return prepare(
                image, camera, region, barriers, known, model, scheme, surface, options.boundary, slope, reflecting
            )

    chosen = select_device(device)
    chosen.real(precision)
    shapes = []
    for number, image in enumerate(given):
        with naming(number):
            shapes.append(require_image(image).shape)
    pieces = list(_pieces(shapes, chosen, precision))
    if len(pieces) > 1:
        # A bad image must not be found only after others have been solved.
        for number in range(count):
            prepared(number)
    solutions: list[Solution | None] = [None] * count
    watch = None if callback is None else _Watch(callback)
    for members in pieces:
        problems = [prepared(number) for number in members]
        run = _Run.of(chosen, problems, options, _stop_at_once if watch and watch.stopped else watch)
        results = run.surfaces(problems)
        rounds = None
        if lamp.in_rounds(model, scheme):
            rounds = _correct_photographs(chosen, problems, results, run, options, watch)
        for problem, (_, depth), status in zip(problems, results, run.statuses, strict=True):
            _warn_if_too_near(problem, depth)
            if status is Status.CONVERGED:
                _warn_if_lost(problem, depth)
        cuts = [problem.continue_onto_walls(*result) for problem, result in zip(problems, results, strict=True)]
        clamped = [problem.degenerate for problem in problems]
        share = 1.0 / len(members)
        elapsed = Elapsed(share * (time.perf_counter() - began), share * run.kernel_seconds, share * run.build_seconds)
        for place, number in enumerate(members):
            problem, (log_depth, depth) = problems[place], results[place]
            solved = np.isfinite(depth)
            solutions[number] = Solution(
                depth=depth,
                log_depth=log_depth,
                solved=solved,
                unreached=(problem.domain.solved | problem.domain.unreached) & ~solved,
                clamped=clamped[place] & solved,
                iterations=len(run.changes[place]),
                changes=np.array(run.changes[place]),
                status=run.statuses[place],
                elapsed=elapsed,
                device=chosen,
                image=problem.photograph,
                camera=problem.camera,
                light=light,
                reflectance=reflectance,
                parameters={
                    **options.report,
                    "sweep": run.variant,
                    **({"lamp_rounds": rounds[place]} if rounds else {}),
                },
                albedo=problem.albedo,
                walls=problem.walls,
                cuts=cuts[place],
            )
        began = time.perf_counter()
    finished = [solution for solution in solutions if solution is not None]
    if throw:
        for number, solution in enumerate(finished):
            _require_convergence(solution, f"images[{number}]: " if count > 1 else "", options.tolerance)
    return finished


def _entries(name: str, given: Any) -> list[Any]:
    if isinstance(given, (str, os.PathLike)):
        raise InputError(f"{name}={str(given)!r} is no list: give a list of arrays, one entry an image.")
    if isinstance(given, np.ndarray) and given.ndim == 2:
        raise InputError(
            f"{name} is one array of shape {given.shape}: give a list, one entry an image, even if all are the same."
        )
    try:
        return list(given)
    except Exception as error:  # an object may raise anything
        raise InputError(f"{name}={brief(given)} is no list: give one entry an image.") from error


@dataclass(frozen=True)
class Options:
    """Keywords that are the same for all images of a call, checked.

    Raises
    ------
    InputError
        Naming the keyword, its value, and what it may be.
    """

    surface: Surface
    boundary: Boundary
    scheme: Scheme
    ordering: Ordering
    precision: Precision
    accuracy_order: int
    max_iterations: int
    tolerance: float
    max_slope: float | None

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            if not isinstance(value := getattr(self, name), str) or value not in choices:
                raise InputError(f"{name}={brief(value)} is not a choice: use one of {', '.join(choices)}.")
        if finite_number(self.accuracy_order) not in (1.0, 2.0):
            raise InputError(f"accuracy_order={brief(self.accuracy_order)}: the schemes are of order 1 or 2.")
        count = self.max_iterations
        if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or not 1 <= count <= _MOST_ITERATIONS:
            raise InputError(
                f"max_iterations={brief(count)}: give a whole number, at least 1 and at most {_MOST_ITERATIONS}."
            )
        tolerance = _require_number("tolerance", self.tolerance, lowest=0.0, inclusive=True)
        # Plain numbers, whatever type they came in: comparisons of short ones overflow.
        object.__setattr__(self, "tolerance", tolerance)
        if self.max_slope is not None:
            slope = _require_number("max_slope", self.max_slope, lowest=0.0, inclusive=False)
            if slope > _STEEPEST:
                raise InputError(
                    f"max_slope={brief(self.max_slope)} is no bound: 30 is a surface seen at 2 degrees from grazing. "
                    f"Give at most {_STEEPEST:g}."
                )
            object.__setattr__(self, "max_slope", slope)

    def resolved(self, model: Model, scheme: Scheme) -> Options:
        """The same with "auto" replaced, checked against the model.

        Raises
        ------
        InputError
            When a choice makes no sense for the model or the scheme.
        """
        flash = isinstance(model.light, FlashLight)
        boundary = self.boundary
        if boundary == "auto":
            boundary = "wall" if flash or scheme == "upwind" else "outflow"
        if scheme == "upwind" and boundary in ("outflow", "extrapolate"):
            raise InputError(
                f"boundary={boundary!r} with scheme='upwind': by this scheme nothing flows in from outside anyway. Use "
                "boundary='wall', or scheme='lax-friedrichs'."
            )
        if model.falls_off and boundary == "extrapolate":
            raise InputError("boundary='extrapolate' under a flash has no level to start from: use boundary='wall'.")
        if model.falls_off and self.surface != "away":
            raise InputError(
                f"surface={self.surface!r} under a flash with fall-off: the image alone tells which way the surface "
                "goes. Leave the keyword out."
            )
        if scheme != "upwind" and self.accuracy_order == 2:
            raise InputError(
                f"accuracy_order=2 with scheme={scheme!r}: only the upwind scheme has a correction to second order. "
                "Use scheme='upwind', or accuracy_order=1."
            )
        slope = self.max_slope
        if slope is None:
            slope = MAX_SLOPE_UPWIND if scheme == "upwind" and not flash else MAX_SLOPE
        return replace(self, boundary=boundary, scheme=scheme, max_slope=slope)

    @property
    def report(self) -> dict[str, Any]:
        """All of them as plain values."""
        numbers = {
            "accuracy_order": int(self.accuracy_order),
            "max_iterations": int(self.max_iterations),
            "tolerance": float(self.tolerance),
            "max_slope": self.max_slope,
        }
        return {name: getattr(self, name) for name in _CHOICES} | numbers


def _pieces(shapes: Sequence[tuple[int, ...]], device: Device, precision: str) -> Iterator[list[int]]:
    """Numbers of images that may share launches: of one shape, and together well within the device's memory."""
    # Values, their copy, brightness and flags, with something to spare for padding.
    bytes_a_pixel = 3 * np.dtype(precision).itemsize + 2
    by_shape: dict[tuple[int, ...], list[int]] = {}
    for number, shape in enumerate(shapes):
        by_shape.setdefault(shape, []).append(number)
    for shape, numbers in by_shape.items():
        # Index arithmetic within an array is done in 32 bits here and there, hence the second bound.
        cells = math.prod(length + 96 for length in shape)
        most = max(1, min(device.memory // (4 * cells * bytes_a_pixel), 2**30 // cells))
        for begin in range(0, len(numbers), most):
            yield numbers[begin : begin + most]


@dataclass
class _Run:
    """What the iteration of some images that share launches came to, one entry an image.

    The values of `grids` are those that the iteration has reached.
    """

    grids: list[Grid]
    changes: list[list[float]]
    statuses: list[Status]
    variant: str
    build_seconds: float = 0.0
    kernel_seconds: float = 0.0

    @classmethod
    def of(cls, device: Device, problems: Sequence[Problem], options: Options, callback: Callback | None) -> _Run:
        """Iterate to convergence at first order, and from there at second order if that is wanted."""
        grids = [problem.numbers for problem in problems]
        run = cls(grids, [[] for _ in grids], [Status.CONVERGED] * len(grids), "")
        kernels = problems[0].model.kernels_with(problems[0].scheme)
        run._advance(device, kernels, options, callback)
        if options.accuracy_order == 2:
            corrected = [place for place, status in enumerate(run.statuses) if status is Status.CONVERGED]
            first_order = {place: run.grids[place].log_depth.copy() for place in corrected}
            for only_lower in (False, True):
                if only_lower:
                    # What does not settle may have gone anywhere.
                    for place in corrected:
                        run.grids[place].log_depth[:] = first_order[place]
                run._advance(device, kernels, options, callback, corrected, only_lower=only_lower)
                corrected = [place for place in corrected if run.statuses[place] is Status.MAX_ITERATIONS]
        return run

    def _advance(
        self,
        device: Device,
        kernels: Sequence[str],
        options: Options,
        callback: Callback | None,
        corrected: Sequence[int] | None = None,
        *,
        only_lower: bool = False,
    ) -> None:
        """Iterate from where the images are: all at first order, or some that are `corrected` to second order."""
        places = range(len(self.grids)) if corrected is None else corrected
        done = max(map(len, self.changes))
        most = options.max_iterations
        if corrected is not None and not only_lower:
            # Where the surface is smooth this is ample; what still changes is decided one way or the other. The
            # checkerboard, which carries values some pixels in an iteration, has to carry corrections back and forth.
            turns = 8 if options.ordering == "checkerboard" else 2
            most = min(most, done + max(_FREE_CORRECTIONS, turns * done))
        if not places or done >= most:
            for place in places:
                self.statuses[place] = Status.MAX_ITERATIONS
            return
        began = time.perf_counter()
        sweeper = Sweeper(
            device,
            [self.grids[place] for place in places],
            model=kernels,
            ordering=options.ordering,
            precision=options.precision,
            tolerance=options.tolerance,
            linear=options.boundary == "extrapolate",
            second_order=corrected is not None,
            only_lower=only_lower,
        )
        self.build_seconds += time.perf_counter() - began
        self.variant = sweeper.tuning.variant
        changes, statuses = _iterate(sweeper, most, options.tolerance, callback, done)
        self.kernel_seconds += sweeper.kernel_seconds
        sweeper.copy_log_depth(self.grids[place].log_depth for place in places)
        for number, place in enumerate(places):
            self.changes[place] += changes[number]
            self.statuses[place] = statuses[number]

    def surfaces(self, problems: Sequence[Problem]) -> list[_Surface]:
        """Log depth, in the place of the values, and depth of each image."""
        return [
            problem.depth(grid.log_depth, converged=status is Status.CONVERGED)
            for problem, grid, status in zip(problems, self.grids, self.statuses, strict=True)
        ]


def _warn_if_too_near(problem: Problem, depth: NDArray[np.float64]) -> None:
    if count := int(np.count_nonzero(lamp.too_near(problem, depth))):
        warn(
            f"{count} pixels come out as near to the camera as the lamp of light={problem.model.light!r}, where their "
            "depth ends: do not rely on them. Mask out what is too bright, or check the lamp's place and its gain, "
            "which go by the same unit of depth."
        )


def _warn_if_lost(problem: Problem, depth: NDArray[np.float64]) -> None:
    if count := int(np.count_nonzero(problem.domain.solved & np.isnan(depth))):
        warn(
            f"{count} pixels come out nearer than {NEAREST:g} or farther than {FARTHEST:g}, and have no depth: they, "
            "or those between them and a known depth, are too dark for the light, and only "
            f"max_slope={problem.max_slope:g} bounds their slope. Mask them out, or lower max_slope."
        )


def _correct_photographs(
    device: Device,
    problems: Sequence[Problem],
    surfaces: list[_Surface],
    run: _Run,
    options: Options,
    watch: _Watch | None,
) -> list[int]:
    """Correct the photographs by the surfaces that a run found, for the equation that is solved, and solve again.

    That is repeated until it changes little. `surfaces` becomes that of the last rounds; `run` gets the statuses of an
    image's last round, and the changes of all rounds.

    Returns
    -------
    rounds : list of int
        Runs of each image, the first included.
    """
    rounds = [1] * len(problems)
    active = list(range(len(problems)))
    while active:
        if watch and watch.stopped:
            for place in active:
                run.statuses[place] = Status.STOPPED
            break
        relit, dim = zip(*(lamp.as_solved(problems[place], surfaces[place][1]) for place in active), strict=True)
        if watch:
            watch.before = max(len(run.changes[place]) for place in active)
        again = _Run.of(device, relit, options, watch)
        run.kernel_seconds += again.kernel_seconds
        run.build_seconds += again.build_seconds
        going = []
        for number, (place, surface) in enumerate(zip(active, again.surfaces(relit), strict=True)):
            rounds[place] += 1
            run.statuses[place] = again.statuses[number]
            run.changes[place] += again.changes[number]
            change = float(np.nanmean(np.abs(surface[0] - surfaces[place][0])))
            surfaces[place] = surface
            if change > lamp.SETTLED and rounds[place] < lamp.ROUNDS:
                going.append(place)
                continue
            if change > lamp.LOST:
                if run.statuses[place] is Status.CONVERGED:
                    run.statuses[place] = Status.MAX_ITERATIONS
                warn(
                    f"light={problems[place].model.light!r} is too far from the camera: after {rounds[place]} rounds "
                    f"the depth still changes by {100 * change:.2g} % on average. Do not rely on it."
                )
            if shaded := int(dim[number].sum()):
                warn(f"{shaded} pixels turn their back to the lamp, or nearly: their depth is a guess. Mask them out.")
        active = going
    if watch:
        watch.before = 0
    return rounds


@dataclass
class _Watch:
    """The user's callback, who may have asked to stop in the iteration that was the last anyway."""

    callback: Callback
    before: int = 0
    stopped: bool = False

    def __call__(self, iteration: int, change: float) -> bool:
        """Count on from the iterations of runs before."""
        self.stopped = bool(self.callback(self.before + iteration, change))
        return self.stopped


def _iterate(
    sweeper: Sweeper, max_iterations: int, tolerance: float, callback: Callback | None, done: int
) -> tuple[list[list[float]], list[Status]]:
    """Iterate until every image has converged, and record each one's changes; `done` iterations count already."""
    changes: list[list[float]] = [[] for _ in range(sweeper.count)]
    statuses = [Status.MAX_ITERATIONS] * sweeper.count
    active = set(range(sweeper.count))
    iteration, queued = done, 1 if callback else sweeper.queued_at_least
    while active and iteration < max_iterations:
        began = time.perf_counter()
        rows = sweeper.run(min(queued, max_iterations - iteration))
        for row in rows:
            if not active:
                break
            iteration += 1
            largest = max(float(row[image]) for image in active)
            for image in sorted(active):
                changes[image].append(float(row[image]))
                if row[image] <= tolerance:
                    statuses[image] = Status.CONVERGED
                    active.discard(image)
            if callback is not None and callback(iteration, largest):
                for image in active:
                    statuses[image] = Status.STOPPED
                return changes, statuses
        # A callback may stop the run after any iteration, so that with one none may be queued in advance.
        if callback is None:
            seconds = time.perf_counter() - began
            queued = max(sweeper.queued_at_least, min(4 * queued, int(queued * _QUEUE_SECONDS / seconds)))
    return changes, statuses


def _stop_at_once(_iteration: int, _change: float) -> bool:
    """The callback of images that had not begun when the user's callback stopped the run."""
    return True


def _require_convergence(solution: Solution, which: str, tolerance: float) -> None:
    if solution.status is not Status.CONVERGED:
        change = solution.changes[-1]
        # Not so where a round of the lamp, or of the second order, was still to come.
        still = f": max |ΔZ| is still {change:.3g}, above the tolerance {tolerance:g}" if change > tolerance else ""
        raise ConvergenceError(
            f"{which}Not converged after {solution.iterations} iterations{still}. {solution.status.value}", solution
        )


def _require_number(name: str, value: object, *, lowest: float, inclusive: bool) -> float:
    """The value as a number; InputError when it is none, or too low."""
    number = finite_number(value)
    # Written so that a NaN is refused too.
    if not (number > lowest or (number == lowest and inclusive)):
        least = "at least" if inclusive else "greater than"
        raise InputError(f"{name}={brief(value)}: give a finite number {least} {lowest:g}.")
    return number
