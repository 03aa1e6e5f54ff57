"""One image and its maps, checked before any work is done with them, and cut to what is needed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import masks
from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_mask
from persfs_cl.choices import Precision
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.guide.fit import band
from persfs_cl.guide.guide import Guide
from persfs_cl.maps import as_albedo, as_array_of_image, as_known_depth
from persfs_cl.shading.model import Extremes, Model
from persfs_cl.solver.bounds import DepthRange
from persfs_cl.solver.domain import Domain, lay_out
from persfs_cl.solver.inputs import (
    light_for,
    require_image,
    require_relief,
    require_scale,
    require_shading,
    warn_of_background,
    warn_of_steep_outline,
)
from persfs_cl.solver.options import Options
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.solver.schemes.scheme import Scheme
from persfs_cl.solver.window import Window
from persfs_cl.surface.discontinuities import REACH
from persfs_cl.wording import keyword

_MOST_LIGHT = 1e100
"""What a pixel may hold that is not solved, and be no NaN."""

_MOST_NOISE = 2.0
"""By which factor noise may make an image brighter than any surface is, where that is not taken at its word."""

_MARGIN = 2
"""Pixels around those to solve that these may read: at second order, and on the boundary."""

_MARGIN_OF_WALLS = REACH + 3
"""The same where depth is continued onto walls."""

_MARGIN_IN_ROUNDS = 17
"""The same where an image is corrected by the slopes found, smoothed as in :mod:`persfs_cl.solver.rounds`."""


@dataclass(frozen=True)
class KnownBeyond:
    """Known pixels of an image of which some lie outside the window.

    Attributes
    ----------
    known : ndarray of bool, shape of the image
    depth : ndarray of float64, shape of the image
        Where it is known; else anything.
    """

    known: Mask
    depth: Array


@dataclass(frozen=True)
class Given:
    """One image and its maps, checked: what can be solved.

    Attributes
    ----------
    photograph : ndarray of float64, shape of the image
        As given; anything where there is nothing to solve.
    albedo : ndarray of float64, shape of the image, or None
        By which the photograph was divided.
    fits_albedo : bool
        Whether it is to be found along with the surface.
    camera : Camera
    window : Window
        The part of the image that is solved. Arrays that are not of the shape of the image are of its (height, width).
    image : ndarray of float64, shape (height, width)
        E, or the brightness under a flash, of the surface without its albedo.
    extremes : Extremes
        Of it, at the pixels to solve.
    known_depth : ndarray of float64, shape (height, width)
        NaN where unknown.
    known_beyond : KnownBeyond or None
        None where all known pixels are in the window.
    walls : ndarray of bool, shape (height, width), or None
        Pixels of walls that belong to the surface: inside the mask, or of known depth. None where no walls are given.
    depth_range : DepthRange or None
        Of the image, between which it is solved.
    given_range : DepthRange or None
        Of the image, as the user gave it.
    guide : Guide or None
        Its cells are of the window.
    precision : {"float32", "float64"}
        Of the values on the device.
    known_values : ndarray of float64, shape (n,)
        W of the known pixels, in the order of the image.
    seen : ndarray of bool, shape (n,)
        Which of these have a neighbour that is solved.
    sign : float
        +1 for a surface going away from the known values, W = Z; -1 for one coming towards the camera, W = -Z.
    offset : ndarray of float64, shape (height, width)
        What the unknown has more than Z = ln z, see :meth:`persfs_cl.shading.model.Model.offset`.
    max_slope : float
    domain : Domain
    grid, image_grid : PixelGrid
        Of the window, and of the image.
    model : Model
    scheme : Scheme
    """

    photograph: Array
    albedo: Array | None
    fits_albedo: bool
    camera: Camera
    window: Window
    image: Array
    extremes: Extremes
    known_depth: Array
    known_beyond: KnownBeyond | None
    walls: Mask | None
    depth_range: DepthRange | None
    given_range: DepthRange | None
    guide: Guide | None
    precision: Precision
    known_values: Array
    seen: Mask
    sign: float
    offset: Array
    max_slope: float
    domain: Domain
    grid: PixelGrid
    image_grid: PixelGrid
    model: Model
    scheme: Scheme


def check(
    image: ArrayLike,
    camera: Camera,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    albedo: ArrayLike | str | None = None,
    depth_range: Any = None,
    guide: Any = None,
    *,
    options: Options,
    whole: bool,
) -> Given:
    """Check an image and its maps; see :func:`persfs_cl.reconstruct` for the parameters.

    The options are complete, see :func:`persfs_cl.solver.complete.complete`. The `whole` image is solved, or the part
    that the solution depends on.

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
    light, scheme = options["light"], SCHEMES[options["scheme"]]
    photograph, usual = _copied(require_image(image))
    shape = photograph.shape
    image_grid = camera.grid(shape)
    camera.warn_if_off_image(shape)
    wanted = np.ones(shape, bool) if mask is None else as_mask("mask", as_array_of_image("mask", mask), shape)
    barriers = None if walls is None else as_mask("walls", as_array_of_image("walls", walls), shape)
    told = None
    if guide is not None:
        wanted_of_guide = wanted if barriers is None else wanted & ~barriers
        told = Guide.of(guide, wanted_of_guide, options["guide_kind"], options["guide_scale"])
    require_scale(light, told, options["guide_scale"], others=known_depth is not None or depth_range is not None)
    fits_albedo = require_albedo_to_fit(albedo, scheme, options["paint"], guided=told is not None)
    sign = 1.0 if options["surface"] == "away" else -1.0
    depths, given_at = (None, None) if known_depth is None else as_known_depth("known_depth", known_depth, shape)
    within = None if depth_range is None else DepthRange.of(depth_range, shape)
    if within is not None:
        depths = within.with_known(depths)
        given_at = None if depths is None else ~np.isnan(depths)
    given_range = within
    if told is not None and options["guide_scale"] == "fixed":
        if light.unknown is not None:
            light = light_for(light, told, photograph, image_grid, options["reflectance"])
        elif not (light.determines_depth or scheme.by_energy):
            # The photograph says nothing of the level: the first surface lies near the guide.
            near_guide = (within or DepthRange.none(shape)).within(*band(told.cells, options["guide_tolerance"]))
            within = near_guide if given_at is None else near_guide.but(given_at)
    model = scheme.model(light, options["reflectance"])
    # Where none of them is given.
    assumed = depths is None and within is None
    # An energy holds to a guide as it goes.
    assumed = assumed and not (scheme.by_energy and told is not None)
    if assumed and scheme.by_energy and not light.determines_depth:
        raise InputError(
            f"Nothing anchors the depth: under {keyword('light', light)} {keyword('scheme', scheme.name)} wants "
            f"{keyword('known_depth')}, {keyword('guide')} or {keyword('depth_range')}. Give one of them, take "
            "another scheme, or photograph with a flash that fades.",
            argument="known_depth",
        )
    if given_at is not None:
        known = given_at
    else:
        known = masks.rim(wanted) if assumed and light.flat_rim else np.zeros(shape, bool)
    if assumed and wanted.any() and not (wanted & ~known).any():
        raise InputError(
            f"All {int(wanted.sum())} pixels lie on the edge of the image or mask, where z = 1 is assumed, and none is "
            f"left to solve: give {keyword('known_depth')}.",
            argument="known_depth",
        )
    window = Window.whole(shape)
    if not (whole or scheme.by_energy) and (mask is not None or depths is not None):
        window = _window(wanted, known, model, assumed=assumed, walled=walls is not None)
    layout = lay_out(
        wanted,
        known,
        barriers,
        options["boundary"],
        held=None if within is None else within.anchors(sign),
        needs_known=not (light.determines_depth or (scheme.by_energy and told is not None)),
        window=window,
    )
    on_walls = None if barriers is None else barriers & (wanted | known)
    kept = known if barriers is None else known & ~barriers
    reflecting = None
    if albedo is not None and not fits_albedo:
        used = kept | window.spread(layout.solved, False)
        reflecting = as_albedo("albedo", albedo, used if on_walls is None else used | on_walls)
    # Pixels that are not solved may hold anything: what is no brightness must not be taken for one.
    if not usual:
        photograph[~window.spread(layout.solved, False) & ~(np.abs(photograph) <= _MOST_LIGHT)] = np.nan
    brightness = window.cut(photograph)
    if reflecting is not None:
        with np.errstate(over="ignore"):
            brightness = brightness / window.cut(reflecting)
    name = "image" if reflecting is None else "image / albedo"
    extremes = require_shading(brightness, layout.solved, model, _brightest(model, image_grid, scheme), name)
    if assumed and light.flat_rim:
        inside = window.cut(wanted)
        looked_at = inside if barriers is None else inside & ~window.cut(barriers)
        warn_of_steep_outline(brightness, looked_at, inside, light, options["reflectance"])
    if light.determines_depth:
        model.check_scale(extremes, image_grid)
        warn_of_background(brightness, layout.solved, extremes)

    grid = window.grid(image_grid)
    offset = model.offset(grid)
    known_depths = _assumed(window.cut(known)) if depths is None else window.cut(depths)
    depths_inside = known_depths[layout.known]
    # Those that no solved pixel sees must not spoil the level that keeps single precision for the relief.
    seen = _beside(layout.solved, layout.known)
    require_relief(depths_inside[seen])
    beyond = None
    if depths is not None and np.count_nonzero(kept) > depths_inside.size:
        beyond = KnownBeyond(kept, depths)
    return Given(
        photograph=photograph,
        albedo=reflecting,
        fits_albedo=fits_albedo,
        camera=camera,
        window=window,
        image=brightness,
        extremes=extremes,
        known_depth=known_depths,
        known_beyond=beyond,
        walls=None if on_walls is None else window.cut(on_walls),
        depth_range=within,
        given_range=given_range,
        guide=None if told is None else replace(told, cells=told.cells.cut(window.cut)),
        precision=options["precision"],
        known_values=sign * (np.log(depths_inside) + offset[layout.known]),
        seen=seen,
        sign=sign,
        offset=offset,
        max_slope=cast("float", options["max_slope"]),
        domain=layout,
        grid=grid,
        image_grid=image_grid,
        model=model,
        scheme=scheme,
    )


def require_albedo_to_fit(albedo: ArrayLike | str | None, scheme: Scheme, paint: str | float, *, guided: bool) -> bool:
    """Whether the albedo is to be found; InputError when it is a word, and cannot be."""
    if not isinstance(albedo, str):
        return False
    if albedo != "fit":
        raise InputError.about("albedo", albedo, "is no array: give 'fit', or read_light(path, shape) of a path.")
    if not scheme.by_energy:
        raise InputError.about(
            "albedo",
            albedo,
            f"with {keyword('scheme', scheme.name)}, which takes the image at its word: give "
            f"{keyword('scheme', 'regularised')}.",
        )
    if not guided:
        raise InputError.about(
            "albedo",
            albedo,
            f"without {keyword('guide')}: shading alone does not tell paint from shape. Give one, or the albedo "
            "itself.",
        )
    if paint != "plain":
        raise InputError.about(
            "paint",
            paint,
            f"with {keyword('albedo', 'fit')}, which finds how far paint varies. Leave {keyword('paint')} out.",
        )
    return True


def _assumed(known: Mask) -> Array:
    """Depths where none is given: 1 at known pixels, NaN elsewhere."""
    return np.where(known, 1.0, np.nan) if known.any() else np.broadcast_to(np.nan, known.shape)


def _brightest(model: Model, grid: PixelGrid, scheme: Scheme) -> float:
    """The largest value that an image may have; an energy only wonders at what noise has made brighter."""
    return (_MOST_NOISE if scheme.by_energy else 1.0) * model.brightest(grid)


def _copied(image: NDArray[np.floating]) -> tuple[Array, bool]:
    """A copy, so that the solution stays what it is whatever the user does; and whether all of it may be brightness."""
    copy = np.empty(image.shape)
    unusual = []

    def take(rows: slice) -> None:
        block = copy[rows]
        # Longer types hold numbers that become infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            block[:] = image[rows]
        if not (block.min() >= -_MOST_LIGHT and block.max() <= _MOST_LIGHT):
            unusual.append(rows)

    in_row_blocks(take, image.shape)
    return copy, not unusual


def _window(wanted: Mask, known: Mask, model: Model, *, assumed: bool, walled: bool) -> Window:
    """The part of an image that its solution depends on, where known values are `assumed` or given.

    The outline of the mask is looked at where they are assumed. Walls, and the image that is corrected by what was
    found, have to do with all that has a depth.
    """
    needed = wanted if assumed else wanted & ~known
    if walled or model.in_rounds:
        needed = wanted | known
    if not needed.any():
        return Window.whole((wanted.shape[0], wanted.shape[1]))
    margins = (_MARGIN, _MARGIN_OF_WALLS if walled else 0, _MARGIN_IN_ROUNDS if model.in_rounds else 0)
    return Window.around(needed, max(margins))


def _beside(solved: Mask, known: Mask) -> Mask:
    """Which known pixels, in the order of the image, have a neighbour that is solved."""
    found = {0: np.zeros(0, bool)}

    def look(rows: slice) -> None:
        here = known[rows]
        if here.any():
            found[rows.start] = masks.Neighbours.of(solved, rows).any[here]

    in_row_blocks(look, known.shape)
    return np.concatenate([found[begin] for begin in sorted(found)])
