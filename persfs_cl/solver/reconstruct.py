"""The main entry: a shaded image, or many, to the surface that it shows."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl._cl.selection import select_device
from persfs_cl.camera import Camera
from persfs_cl.checks import unlike
from persfs_cl.errors import CameraError, ConvergenceError, InputError
from persfs_cl.framing.maps import straighten
from persfs_cl.guide.guide import Points
from persfs_cl.solver.complete import complete, require_guide, tolerance_of
from persfs_cl.solver.given import Given, check
from persfs_cl.solver.iterate import Watch
from persfs_cl.solver.options import Options, with_options
from persfs_cl.solver.pieces import pieces, solve_in_pieces
from persfs_cl.solver.problem import Problem
from persfs_cl.surface.outcome import Status, Taken
from persfs_cl.surface.solution import Solution
from persfs_cl.told import concerning
from persfs_cl.wording import brief

if TYPE_CHECKING:
    from typing_extensions import Unpack


@with_options
def reconstruct(
    image: ArrayLike,
    camera: Camera,
    *,
    mask: ArrayLike | None = None,
    walls: ArrayLike | None = None,
    known_depth: ArrayLike | None = None,
    albedo: ArrayLike | Literal["fit"] | None = None,
    depth_range: tuple[ArrayLike | None, ArrayLike | None] | None = None,
    guide: ArrayLike | Points | None = None,
    **options: Unpack[Options],
) -> Solution:
    """Reconstruct the surface that a shaded photograph shows, by fast sweeping (eqs. (4) to (12) and their kin).

    Parameters
    ----------
    image : array_like of float, shape (height, width)
        In linear light. Under a parallel light the normalised reflectance E in [0, 1]; under a flash the brightness
        on the scale of its gain, which may be any. A single row or column is a profile: across it the slope is that at
        which H is least.
    camera : Camera
        Where its lens has a distortion, the image and all that goes with it are straightened first, as by
        :func:`undistort`, and the solution has the pixels of `Solution.camera`, a pinhole camera.
    light : ParallelLight or FlashLight
        A frontal parallel light by default. Under a flash that fades with distance the image alone determines the
        depth, in the unit of the gain: no known values, no choice of `surface`. In the upwind scheme an off-axis lamp
        is where it is, for a Lambertian surface that lies in no shadow and leads away from the lamp at every edge, or
        has known depths there. Other materials shade there by the angle to the lamp alone, and for the Lax-Friedrichs
        scheme the lamp is at the camera: then the image is corrected by what the surface found says of that, and solved
        again, in up to 10 rounds, for a lamp not farther off than a tenth of the depth or so.
    reflectance : Lambertian, OrenNayar or Phong
        Under a parallel light others than Lambertian are for the Lax-Friedrichs scheme, and an image is on the scale of
        what the material returns.
    mask : array_like of bool, shape (height, width), optional
        True where the surface is to be solved; everywhere when not given.
    walls : array_like of bool, shape (height, width), optional
        True where the surface may jump: nothing propagates across these pixels. After the solve each gets its depth
        from the side that it belongs to, see :attr:`Solution.discontinuities`.
    known_depth : array_like of float, shape (height, width), optional
        Depths that are kept exactly, from 1e-30 to 1e30 and at most a factor of 1e9 apart; NaN where unknown; inside
        the mask or next to it. When not given, with a parallel light the edge of the image or mask has z = 1 (the
        paper's zero boundary conditions), with a warning where a mask's outline is no flat ground; with a flash, or a
        `depth_range`, nothing is known. Without fall-off some depth or range must be given.
    albedo : array_like of float, shape (height, width), optional
        Share of light in (0, 1] that the surface returns at each pixel, by which the image is divided; 1 if not given.
        "fit" finds it along with the surface: piecewise smooth, with ``scheme="regularised"`` and a guide, which tells
        what is shape. Paint that follows the shape cannot be told from it.
    depth_range : (near, far), optional
        Depths between which the surface lies, each a number, or an array of float of shape (height, width); NaN, or
        None, where there is no bound. What lies there may be coarse: from a depth sensor, stereo, or a caliper. Where
        the photograph would lead beyond a bound the surface lies on it, see `Solution.at_bound`, and goes on from
        there. Where both bounds are the same the depth is known, inside the mask or next to it. Under a light without
        fall-off the surface hangs from known depths and, for ``surface="away"``, from far bounds; for "toward" from
        near ones. It is solved where one of these can reach.
    guide : array_like of float or Points, optional
        What is coarsely known of the depth: a map of any size over the same view, from a depth sensor, stereo, an
        elevation model or a network, or points, from structure from motion or a caliper; NaN where nothing is known.
        The surface is found from the photograph alone, and again between bounds that it and the guide set together, in
        three rounds, or five under a light without fall-off: the photograph tells the fine forms, the guide how far
        away each part is. For ``scheme="regularised"`` it is a prior. Farther than two spacings of the guide from what
        it says of, nothing is bounded. See `Solution.guide` for how far it was believed. Under a light without fall-off
        the guide tells the level too, and what is known besides is kept.
    guide_kind : {"depth", "inverse"}
        What its numbers are: depths, or inverse depths such as disparities.
    guide_scale : {"fixed", "fit", "affine"}
        "fixed": its numbers are in the unit of depth; where the gain of a flash is None, it is found from them. "fit":
        they have an unknown factor, and the light, or known depths, tell the unit. "affine": depths, or inverse depths,
        are its numbers times an unknown factor, plus an unknown offset, as networks give them.
    guide_tolerance : float, optional
        Share of the depth by which the guide scatters. Found from guide and photograph when not given.
    surface : {"away", "toward"}
        Which way the surface leaves the known values: Z grows away from them, or falls, coming towards the camera.
    boundary : {"auto", "outflow", "extrapolate", "fixed", "wall"}
        What holds on the edge of the image and mask where no depth is known. "outflow": the paper's eq. (12), nothing
        flows in from outside. "extrapolate": the surface continues linearly; values may flow in, and where they do the
        level is undetermined and drifts. "fixed": every edge pixel must be known. "wall": edge pixels are solved like
        others, with a state constraint outside. "auto" is "outflow" for the Lax-Friedrichs scheme under a parallel
        light, else "wall". The upwind scheme knows "wall" and "fixed" only: by its nature nothing flows in.
    scheme : {"auto", "lax-friedrichs", "upwind", "regularised"}
        "lax-friedrichs" is the paper's: it takes any Hamiltonian, smears, and needs many iterations where
        `acceleration` finds no coarser grids. "upwind" solves each cell exactly from the neighbours upwind: a few
        iterations, and several times less error. "auto" is upwind where it has the `boundary` and the material permits
        it, under a parallel light a perfectly matt one, under a flash one that is brightest face on; else the paper's.
        "regularised" finds the surface of least energy, which the image, what is known of the depth, and smoothness
        decide together; for any light and material, and by name only. It begins at what the sweeps find. Something must
        anchor the depth: known depths, a `depth_range`, or a flash with fall-off. To it `boundary`, `ordering`,
        `accuracy_order`, `acceleration` and `max_slope` mean nothing.
    ordering : {"wavefront", "checkerboard", "lexicographic"}
        Order of the cells in a sweep. "wavefront" gives the bits of "lexicographic", in parallel; "checkerboard" other
        iterates and, where the boundary is monotone, the same limit: with known edges or ``boundary="wall"``; under
        eq. (12) the limit may differ a little, and with "extrapolate" much.
    accuracy_order : int
        1: both schemes are of first order. 2: the upwind scheme, once converged, is corrected to second order where the
        surface is smooth, and stays as it is at ridges, edges and silhouettes. Some more iterations, each slower;
        many more with the checkerboard.
    paint : "plain", "painted" or float
        For "regularised": whether brightness varies beyond the shading, which no photograph tells. A number is the
        spread of ln albedo; "painted" estimates it where the descent begins.
    smoothing : float, optional
        For "regularised": over about how many pixels the surface is smoothed where the shading tells little; 1 when not
        given, 20 where it is painted, 3 where `albedo` is "fit".
    max_iterations : int
        Iterations of four sweeps at most; with an off-axis lamp that takes rounds, in each of them. For "regularised"
        steps of its descent, on all grids together; the sweeps that it may begin with are not counted.
    tolerance : float, optional
        The run has converged when Z is at most this from its limit, as far as the rate tells at which its changes
        shrink, see :attr:`Solution.distance`; or when nothing changes any more, or only rounding does. Z = ln z, so
        1e-5, the default, is 0.001 % of the depth; for "regularised" it is 2e-3, since noise and prior leave more open
        than that. It bounds what further iterations would change, not the error of the scheme. 0 iterates until nothing
        changes, down to the last bit.
    stopping : {"distance", "change", "gain"}
        What the tolerance bounds. "distance": that distance. "change": as in the paper, max |ΔZ| over an iteration,
        which may be hundreds of times less. "gain", for "regularised" only: the share of its energy by which five
        iterations lower it, 1e-3 when no tolerance is given. Then some pixels may still have far to go, most of them in
        shadow; :attr:`Solution.distance` says how far. For "regularised" all three are of its descent on the finest
        grid.
    resting : float
        For the upwind scheme at first order, by the wavefront: blocks of pixels are left alone as long as no value in
        and next to them has changed by more than this, all told, since they were swept. Then no sweep would change any
        value by more than this, and :attr:`Solution.distance` counts it. At most a tenth of the tolerance, for noise
        that large spares up to a sixth of the work. 0 leaves alone only what cannot change, so that the values are the
        same as without; else they differ a little with the device too. Where the sweeps are those for GPUs it counts as
        0; `parameters["resting"]` of the :class:`Solution` says which it was.
    acceleration : bool
        Reach the limit of the Lax-Friedrichs scheme sooner. Under a parallel light, where the surface is Lambertian and
        each pixel to solve has four neighbours, solved or known, a multigrid method takes about a dozen iterations.
        Elsewhere mixtures of what the last iterations came to (Anderson acceleration) take a third to two thirds of the
        iterations. False keeps every iterate as the scheme makes it: values only fall. It is without effect with
        ``stopping="change"``, under a flash with fall-off, with a `depth_range`, where the boundary flows out or is
        extrapolated, and, under a parallel light, where a wall bounds a material other than Lambertian.
    max_slope : float, optional
        Bound on |dZ/dx| and |dZ/dy| between neighbouring pixels, along which Z climbs. It matters where the equation
        itself sets none, see `Solution.clamped`, and where the surface is steeper still. 30, a surface seen at 2° from
        grazing, when not given; for the upwind scheme under a parallel light, which takes it at its word, 5 (11°).
    device : None, "cpu", "gpu", int, str or Device, optional
        See :func:`devices`. None honours PYOPENCL_CTX, and else takes the first.
    precision : {"float32", "float64"}
    callback : callable, optional
        Called as ``callback(iteration, change)`` after each iteration that counts; returning True stops the run.
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

    Examples
    --------
    A bump, photographed with a flash at the camera:

    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.status.name, solution.depth.shape
    ('CONVERGED', (20, 20))
    >>> ps.compare(solution.depth, scene.depth).mean < 0.01
    True
    """
    return reconstruct_batch(
        [image],
        [camera],
        mask=[mask],
        walls=[walls],
        known_depth=[known_depth],
        albedo=[albedo],
        depth_range=[depth_range],
        guide=[guide],
        **options,
    )[0]


@with_options
def reconstruct_batch(
    images: Iterable[ArrayLike],
    cameras: Camera | Iterable[Camera],
    *,
    mask: Sequence[ArrayLike | None] | None = None,
    walls: Sequence[ArrayLike | None] | None = None,
    known_depth: Sequence[ArrayLike | None] | None = None,
    albedo: Sequence[ArrayLike | Literal["fit"] | None] | None = None,
    depth_range: Sequence[tuple[ArrayLike | None, ArrayLike | None] | None] | None = None,
    guide: Sequence[ArrayLike | Points | None] | None = None,
    **options: Unpack[Options],
) -> list[Solution]:
    """Reconstruct many images; the same numbers, bit for bit, as one by one, unless `resting` is given.

    Images of about one size share launches, some at a time, and while these are solved the next are made ready; an
    image that has converged costs nothing more.

    Parameters
    ----------
    images : iterable of array_like
        As for :func:`reconstruct`; sizes may differ.
    cameras : Camera or iterable of Camera
        One for all, or one an image.
    mask, walls, known_depth, albedo, depth_range, guide : sequence, optional
        One entry an image, None where it has none.
    callback : callable, optional
        Called as ``callback(iteration, change)`` with the largest change of the images that share launches and have
        not converged; returning True stops these, and all that have not begun.
    light, reflectance, surface, boundary, scheme, ordering, accuracy_order, guide_kind, guide_scale, guide_tolerance
        As for :func:`reconstruct`, the same for all images.
    paint, smoothing, max_iterations, tolerance, stopping, resting, acceleration, max_slope, device, precision, throw
        As for :func:`reconstruct`, the same for all images.

    Returns
    -------
    list of Solution
        In the order of the images. `elapsed` is an image's share.

    Raises
    ------
    InputError
        When a list does not have one entry an image; otherwise as :func:`reconstruct`, naming the image.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scenes = [ps.bump((20, 20), light=ps.FlashLight(), relief=relief) for relief in (0.1, 0.2)]
    >>> solutions = ps.reconstruct_batch([scene.image for scene in scenes], scenes[0].camera, light=ps.FlashLight())
    >>> [solution.status.name for solution in solutions]
    ['CONVERGED', 'CONVERGED']
    """
    began = time.perf_counter()
    settings = complete(options)
    given = _entries("images", images)
    count = len(given)
    lists: dict[str, list[Any]] = {
        "camera": [cameras] * count if isinstance(cameras, Camera) else _entries("cameras", cameras),
        "mask": [None] * count if mask is None else _entries("mask", mask),
        "walls": [None] * count if walls is None else _entries("walls", walls),
        "known_depth": [None] * count if known_depth is None else _entries("known_depth", known_depth),
        "albedo": [None] * count if albedo is None else _entries("albedo", albedo),
        "depth_range": [None] * count if depth_range is None else _entries("depth_range", depth_range),
        "guide": [None] * count if guide is None else _entries("guide", guide),
    }
    for name, entries in lists.items():
        if len(entries) != count:
            named = "cameras" if name == "camera" else name
            raise InputError(
                f"{named} has {len(entries)} entries for {count} images: give one an image.",
                argument=named,
                value=entries,
            )
    require_guide(settings, guided=any(each is not None for each in lists["guide"]))
    device = select_device(settings["device"])
    device.real(settings["precision"])
    chosen = time.perf_counter() - began
    # All before any is solved: a bad image must not be found only after others.
    found: dict[int, Given] = {}
    taken_by: dict[int, Taken] = {}
    seconds = []
    for number, image in enumerate(given):
        began = time.perf_counter()
        with _naming(number, count), concerning(number):
            own = {"image": image, **{name: entries[number] for name, entries in lists.items()}}
            camera = own["camera"]
            if isinstance(camera, Camera) and camera.distortion is not None:
                height, width = np.shape(image)
                own = straighten(**own)
                taken_by[number] = Taken(camera, (height, width))
            found[number] = check(**own, options=settings, whole=False)
        seconds.append(time.perf_counter() - began + chosen / count)

    def ready(number: int) -> Problem:
        began = time.perf_counter()
        with _naming(number, count):
            # What is solved is held no longer than until then.
            problem = Problem.of(found.pop(number))
        seconds[number] += time.perf_counter() - began
        return problem

    callback = settings["callback"]
    watch = None if callback is None else Watch(callback)
    solutions: dict[int, Solution] = {}
    together = pieces([each.window.shape for each in found.values()], device, settings["precision"])
    try:
        for number, solution in solve_in_pieces(device, together, ready, settings, watch):
            elapsed = replace(solution.elapsed, total=solution.elapsed.total + seconds[number])
            solutions[number] = replace(solution, elapsed=elapsed, taken_by=taken_by.get(number))
    except InputError as error:
        # One made ready in vain has its name already.
        raise (error if error.place is None or count == 1 else error.at(f"images[{error.place}]")) from None
    finished = [solutions[number] for number in range(count)]
    if settings["throw"]:
        for number, solution in enumerate(finished):
            _require_convergence(solution, f"images[{number}]: " if count > 1 else "", settings)
    return finished


@contextmanager
def _naming(number: int, count: int) -> Iterator[None]:
    """Put the number of the image before the message of an error, where there are several."""
    try:
        yield
    except (InputError, CameraError) as error:
        raise (error.at(f"images[{number}]") if count > 1 else error) from None
    except MemoryError as error:
        raise InputError(
            f"images[{number}] does not fit into memory ({brief(error)}): reduce its size, cut out a part, or give "
            "fewer images at a time."
        ) from error


def _entries(name: str, given: Any) -> list[Any]:
    if isinstance(given, (str, os.PathLike)):
        raise InputError.about(name, str(given), "is no list: give a list of arrays, one entry an image.")
    if isinstance(given, np.ndarray) and given.ndim == 2:
        raise unlike(
            name,
            given,
            f"is one array of shape {given.shape}: give a list, one entry an image, even if all are the same.",
        )
    try:
        return list(given)
    except Exception as error:  # an object may raise anything
        raise InputError.about(name, given, "is no list: give one entry an image.") from error


def _require_convergence(solution: Solution, which: str, options: Options) -> None:
    if solution.status is not Status.CONVERGED:
        change, distance = solution.changes[-1], solution.distance
        tolerance = math.inf if options["stopping"] == "gain" else tolerance_of(options)
        # Neither where a round of the lamp, or of the second order, was still to come.
        if change > tolerance:
            still = f": max |ΔZ| is still {change:.3g}, above the tolerance {tolerance:g}"
        elif distance > tolerance:
            still = f": Z is still about {distance:.3g} from its limit, above the tolerance {tolerance:g}"
        else:
            still = ""
        raise ConvergenceError(
            f"{which}Not converged after {solution.iterations} iterations{still}. {solution.status.value}", solution
        )
