"""From photographs of known surfaces to light, material, tone and lens: the entry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl._cl.device import Device
from persfs_cl._cl.selection import select_device
from persfs_cl.calibration.evidence import BySurface, ByTruth, Evidence
from persfs_cl.calibration.pairs import Normals, Pair, pair_of
from persfs_cl.calibration.parameters import Assumed, parameters_of, usual, words_of
from persfs_cl.calibration.result import Calibration, CalibrationErrors
from persfs_cl.calibration.search import Progress, Search
from persfs_cl.calibration.validation import validated
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_number, check_choice, unlike, warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.guide.guide import Points
from persfs_cl.io.photos import Photo
from persfs_cl.preparation.correct import cosine_power
from persfs_cl.preparation.prepare import Preparation
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.lights import require_light
from persfs_cl.shading.materials import require_reflectance
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword

_WORSE = 0.1
"""Mean error from which on a fit is said to be worse than what it began with."""


def calibrate(
    pairs: Iterable[tuple[Any, ArrayLike | Points]],
    camera: Camera | Sequence[Camera],
    *,
    fit: str | Iterable[str] | None = None,
    light: Light = FlashLight(),
    reflectance: Reflectance = Lambertian(),
    preparation: Preparation = Preparation(),
    white_level: float | None = None,
    mask: ArrayLike | Sequence[ArrayLike | None] | None = None,
    normals: Normals = "auto",
    device: int | str | Device | None = None,
    callback: Progress | None = None,
) -> Calibration:
    """Fit light, material, tone and lens to photographs of surfaces that are known.

    All photographs share what is fitted. Where a truth is dense its slopes are believed, and the brightness that it
    would have is compared with the photograph. Where single points are known the surface is reconstructed again for
    each value that is tried, and its depth is compared with theirs: no slope is taken from points.

    Parameters
    ----------
    pairs : iterable of (photo, truth)
        A photo is a :class:`Photo` as :func:`read_photo` returns it, or an array of linear light, shape (H, W), NaN
        where there is none. A truth is a depth map of that shape, NaN where unknown, or :class:`Points`, or points of
        shape (n, 3), the column, row and depth of each, as :func:`persfs_cl.io.read_points` returns them. Light that
        fades with distance is told by either, any other by a map alone.
    camera : Camera or sequence of Camera
        One for all, or one a photo.
    fit : str or iterable of str
        What is sought, a text with commas between: "gain" of a flash; "white", the level of light that is E = 1, of a
        parallel light; "direction", p0 and q0 of a parallel light; "exponent" of a tone curve; "lamp", the place of a
        flash; "vignetting", the power of the cosine; "roughness" of `OrenNayar`; "gloss", the highlight and shininess
        of `Phong`, whose sum of diffuse and specular part is held. Left out, it is the gain of a flash, or direction
        and white level of a parallel light.
    light, reflectance
        From where the fit begins; what is not sought is taken from them.
    preparation : Preparation
        Likewise for the exponent and the vignetting, and what else is done to the photos.
    white_level : float, optional
        Likewise for the white level of a parallel light. Left out, each photo has its own, the 99.5th percentile.
    mask : array_like of bool, shape (H, W), or sequence of such, optional
        Pixels of the surface, one mask for all or one a photo.
    normals : {"auto", "truth", "solution"}
        Whose slopes are believed where the truth is dense: its own, or those of the surface that is reconstructed. Take
        "solution" where a dense truth is noisy or coarse, and the light determines depth.
    device : optional
        As for :func:`reconstruct`.
    callback : callable, optional
        Called as ``callback(step, residual)`` before each step of the fit, with the median relative error.

    Returns
    -------
    Calibration
        What the photographs cannot tell is said in `reasons`, and not guessed.

    Raises
    ------
    InputError
        When a photo, a truth or a mask cannot be used, or does not fit the others; when a word of `fit` is unknown or
        belongs to another light or material; when there are fewer known depths than numbers to be found.
    CameraError
        When a camera does not fit its photo.

    Warns
    -----
    UserWarning
        When the fit does not settle, or photographs, or parts of one, contradict each other.

    Notes
    -----
    The fit is by least squares of relative errors, with Tukey's weights, so that outliers do not count. Photographs are
    reduced to 256 pixels along the longer side.

    Examples
    --------
    A flash, a little off the axis, and a camera with a tone curve, from 60 points:

    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> lamp = ps.FlashLight(gain=0.8, offset=(0.1, 0.0, 0.0))
    >>> scene = ps.bump((48, 48), light=lamp, surface="toward", relief=0.4)
    >>> photo = scene.image ** (1 / 1.2)
    >>> rows, columns = np.random.default_rng(0).integers(3, 45, (2, 60))
    >>> points = np.stack([columns, rows, scene.depth[rows, columns]], axis=1)
    >>> calibration = ps.calibrate([(photo, points)], scene.camera, fit="gain,exponent,lamp")
    >>> abs(calibration.exponent - 1.2) < 0.03, abs(calibration.light.gain - 0.8) < 0.02
    (True, True)
    """
    given = _pairs(pairs)
    unknown = require_light(light).unknown
    # It begins at 1.
    light = light.of_unit_gain if unknown else light
    if callback is not None and not callable(callback):
        raise InputError.about("callback", callback, "cannot be called: give a function of step and error.")
    require_reflectance(reflectance)
    if not isinstance(preparation, Preparation):
        raise InputError.about("preparation", preparation, "is none: give Preparation(...), or leave it out.")
    check_choice("normals", normals, Normals)
    if white_level is not None:
        white_level = as_number("white_level", white_level, above=0.0, what="a brightness")
    law = preparation.vignetting if isinstance(preparation.vignetting, str) else None
    power = (cosine_power(law) if law else None) or 0.0
    start = Assumed(light, reflectance, preparation.tone_exponent, power, white_level)
    words, reasons = words_of(usual(light) if fit is None else fit, start)
    if unknown is not None and unknown not in words:
        raise InputError.about("fit", fit, f"leaves out {unknown}, which is not known: add it, or give its value.")
    if "vignetting" in words and law is None:
        raise InputError.about(
            "fit", "vignetting", "is known by the white plate of the preparation: leave one of them out."
        )
    bare = preparation if law is None else replace(preparation, vignetting="none")
    chosen = select_device(device)
    prepared = []
    for number, ((photo, truth), own_camera, own_mask) in enumerate(
        zip(given, _each_camera(camera, len(given)), _each_mask(mask, len(given)), strict=True)
    ):
        try:
            prepared.append(pair_of(photo, truth, own_camera, bare, own_mask, normals))
        except (InputError, CameraError) as error:
            if isinstance(photo, Photo):
                raise error.at(photo.path) from None
            raise (error.at(f"pairs[{number}]") if len(given) > 1 else error) from None
    search = Search(
        [_evidence(pair, light, chosen) for pair in prepared],
        parameters_of(words, start, _typical_depth(prepared)),
        start,
    )
    found = search.found(callback)
    if not found.fitted.converged:
        warn(
            "The calibration did not settle: its numbers still changed when the fit ended. Do not rely on them. Seek "
            f"less by {keyword('fit')}, begin nearer by {keyword('light')}, or give more depths."
        )
    best = search.assumed(found.parameters, found.fitted.numbers)
    before, after, parts = validated(search, found, chosen)
    _warn_of_worse(before, after, parts)
    vignetting = preparation.vignetting if best.vignetting == power else f"cos{best.vignetting:.6f}"
    return Calibration(
        best.light,
        best.reflectance,
        replace(preparation, tone_exponent=best.exponent, vignetting=vignetting),
        best.white,
        {
            one.name: one.value(float(number))
            for one, number in zip(found.parameters, found.fitted.numbers, strict=True)
        },
        {one.name: error for one, error in zip(found.parameters, found.errors, strict=True)},
        reasons | found.reasons,
        before,
        after,
        parts,
        found.fitted.converged,
    )


def _warn_of_worse(before: CalibrationErrors, after: CalibrationErrors, parts: str) -> None:
    for what in ("depth", "brightness"):
        was, now = getattr(before, what), getattr(after, what)
        if was is not None and now is not None and now > max(was, _WORSE):
            warn(
                f"Cross-validated over {parts}, the fit explains the {what} worse than what it began with: "
                f"{now:.2%} off in place of {was:.2%}. Photographs, or parts of one, contradict each other, or too "
                "much is sought: see that each truth is of its photo, and that all were taken alike, or seek less by "
                f"{keyword('fit')}."
            )
            return


def _evidence(pair: Pair, light: Light, device: Device) -> Evidence:
    """By the true slopes where there are some, else by the surface that is reconstructed.

    Raises
    ------
    InputError
        When the light wants slopes, and the truth has none.
    """
    if pair.dense is not None:
        return ByTruth(pair, pair.dense)
    if light.determines_depth:
        return BySurface(pair, device)
    raise InputError(
        f"{keyword('truth')} has no slopes that can be believed, and under {keyword('light', light)} the brightness "
        "tells of nothing else: give a dense depth map, whose pixels have known neighbours, and no "
        f"{keyword('normals', 'solution')}.",
        argument="truth",
    )


def _typical_depth(pairs: Sequence[Pair]) -> float:
    return float(np.median(np.concatenate([pair.points[:, 2] for pair in pairs])))


def _pairs(given: Any) -> list[tuple[Any, Any]]:
    try:
        pairs = [tuple(pair) for pair in given]
    except TypeError as error:
        raise InputError.about("pairs", given, "is no list: give [(photo, truth), ...].") from error
    if not pairs:
        raise InputError.about("pairs", given, "is empty: give at least one (photo, truth).")
    for number, pair in enumerate(pairs):
        if len(pair) != 2:
            raise InputError(
                f"{keyword('pairs')}[{number}] has {len(pair)} entries: give a photo and what is known of its depth.",
                argument="pairs",
                value=given,
            )
    return [(photo, truth) for photo, truth in pairs]


def _each_camera(given: Any, count: int) -> list[Camera]:
    cameras = [given] * count if isinstance(given, Camera) or not isinstance(given, (list, tuple)) else list(given)
    if len(cameras) != count:
        raise InputError(
            f"{keyword('camera')} has {len(cameras)} entries for {count} photos: give one for all, or one a photo.",
            argument="camera",
            value=given,
        )
    for one in cameras:
        require_camera(one)
    return cameras


def _each_mask(given: Any, count: int) -> list[Any]:
    if not isinstance(given, (list, tuple)) or (given and np.ndim(given[0]) == 1):
        return [given] * count
    if len(given) != count:
        raise unlike("mask", given, f"has {len(given)} entries for {count} photos: give one for all, or one a photo.")
    return list(given)
