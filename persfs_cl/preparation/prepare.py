"""From a photograph to the light that the surface sends, and from there to E.

The steps, in the order in which light meets them backwards: undo a tone curve, subtract what is there without the lamp,
divide by what the lens lets through, deal with highlights, smooth. The result is linear light on the scale of the
photo, as a light with fall-off needs it. For a parallel light it is then normalised to E in [0, 1].
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_array, as_floats, as_number, check_choice
from persfs_cl.errors import InputError
from persfs_cl.io.photos import Photo
from persfs_cl.preparation.correct import (
    MOST_POWER,
    cosine_power,
    cosine_vignetting,
    divide_vignetting,
    subtract_ambient,
)
from persfs_cl.preparation.denoise import MOST_DENOISING, denoise
from persfs_cl.preparation.highlights import dilate, fill_smoothly, find_specular
from persfs_cl.preparation.normalise import checked, clip_highlights, mean_filter
from persfs_cl.preparation.prepared import PreparedPhoto
from persfs_cl.preparation.specks import without_specks
from persfs_cl.wording import brief, keyword

Highlights = Literal["keep", "mask", "fill"]

_SATURATED = 0.98
"""Share of the largest number of a file from which a sample counts as saturated; JPEG blurs the exact end."""
_HALO = 2
"""Pixels around a highlight that go with it."""
LEAST_EXPONENT, MOST_EXPONENT = 0.1, 10.0
"""Beyond, a tone curve leaves black and white, or one grey."""


@dataclass(frozen=True, eq=False)
class Preparation:
    """What is done to a photo before its shading is believed. By default, nothing.

    Parameters
    ----------
    ambient : float or array_like, shape (H, W)
        Light that is there without the lamp, and the black level. A number is one of the file's own, such as a grey
        level from 0 to 255 of an 8-bit photo, and is decoded as the photo is. An array is linear light: a second
        photograph without the lamp, as :func:`persfs_cl.read_image` gives it for the same channel.
    vignetting : str or array_like, shape (H, W)
        Darkening of the lens away from the middle: "none"; a power of the cosine between viewing ray and optical axis,
        such as "cos4", the law of simple lenses, or "cos2.5"; or linear light from an evenly lit white plate, of which
        only the shape counts: its largest value is where the lens lets everything through.
    despeckle : bool
        Whether small bright specks, such as hot pixels, are replaced by what surrounds them, see
        :func:`persfs_cl.preparation.specks.replace_specks`.
    highlights : {"keep", "mask", "fill"}
        What becomes of saturated pixels and shiny spots, and two pixels around them: nothing, they are left out, or
        they are filled from their surroundings. What is left out makes holes in the mask, on whose edges
        :func:`persfs_cl.reconstruct` assumes z = 1 under a parallel light unless `known_depth` is given.
    saturation : float, optional
        Number, of the file's own, from which on a pixel is saturated. Left out, it is 98 % of the largest that the
        file can hold; no pixel of a file of floats then is.
    clip_highlights : float, optional
        Percentile above which brightness is cut; see :func:`persfs_cl.clip_highlights`.
    denoise : float
        From 0, nothing, to 5: noise is taken out without smoothing across edges, see
        :func:`persfs_cl.preparation.denoise.denoise`; 0.8 is usual.
    mean_filter : int
        Side of the window in pixels; 1 is no filter.
    tone_exponent : float
        From 0.1 to 10: the photo's light is raised to this power before all other steps, to undo a tone curve that the
        camera has applied besides sRGB. Ambient light and white plate come from the same camera, and are raised too.

    Raises
    ------
    InputError
        When a choice is unknown, or `ambient`, `saturation` or `tone_exponent` is an impossible number.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> preparation = ps.Preparation(ambient=12, highlights="fill")
    >>> preparation.ambient, preparation.highlights, preparation.vignetting
    (12.0, 'fill', 'none')
    """

    ambient: float | ArrayLike = 0.0
    vignetting: str | ArrayLike = "none"
    despeckle: bool = False
    highlights: Highlights = "keep"
    saturation: float | None = None
    clip_highlights: float | None = None
    denoise: float = 0.0
    mean_filter: int = 1
    tone_exponent: float = 1.0

    def __post_init__(self) -> None:
        check_choice("highlights", self.highlights, Highlights)
        law = self.vignetting if isinstance(self.vignetting, str) else None
        known = law is not None and (law == "none" or cosine_power(law) is not None)
        if not known and (law is not None or as_array("vignetting", self.vignetting).ndim == 0):
            raise InputError.about(
                "vignetting",
                self.vignetting,
                f"is unknown: give 'none', a power of the cosine up to {MOST_POWER:g}, such as 'cos4', or an array.",
            )
        exponent = as_number(
            "tone_exponent",
            self.tone_exponent,
            least=LEAST_EXPONENT,
            most=MOST_EXPONENT,
            what="an exponent",
            hint=", 1 for light that is linear already",
        )
        object.__setattr__(self, "tone_exponent", exponent)
        strength = as_number(
            "denoise", self.denoise, least=0.0, most=MOST_DENOISING, what="a strength", hint=", such as 0.8"
        )
        object.__setattr__(self, "denoise", strength)
        for name in ("ambient", "saturation"):
            value = getattr(self, name)
            if value is None or (name == "ambient" and not isinstance(value, str) and as_array(name, value).ndim):
                continue
            object.__setattr__(self, name, as_number(name, value, least=0.0, what="a brightness"))

    def __repr__(self) -> str:
        # Only what is done: the rest would fill lines.
        said = (
            f"{field.name}={'<array>' if isinstance(value, np.ndarray) else brief(value)}"
            for field in fields(self)
            if isinstance(value := getattr(self, field.name), np.ndarray) or value != field.default
        )
        return f"Preparation({', '.join(said)})"


def prepare_photo(
    photo: Photo, camera: Camera, preparation: Preparation = Preparation(), *, mask: ArrayLike | None = None
) -> PreparedPhoto:
    """The light that a surface sends, from a photo of it.

    Parameters
    ----------
    photo : Photo
        As :func:`persfs_cl.read_photo` returns it.
    camera : Camera
        For the law of vignetting.
    preparation : Preparation
    mask : array_like of bool, shape (H, W), optional
        Pixels that count; no others are looked at. By default those of the photo that are not transparent.

    Returns
    -------
    PreparedPhoto

    Raises
    ------
    InputError
        When an array has another shape or cannot be used; when nothing is brighter than the ambient light, or only
        highlights are.
    CameraError
        When the camera does not fit the photo.
    UnavailableError
        When noise is to be taken out, and scikit-image is not installed.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> photo = ps.read_photo(files("persfs_cl") / "data" / "coin.png", channel="green")
    >>> camera = ps.Camera(focal_length=576.0)
    >>> prepared = ps.prepare_photo(photo, camera, ps.Preparation(vignetting="cos4", highlights="fill"))
    >>> solution = ps.reconstruct(prepared.light, camera, light=ps.FlashLight(), mask=prepared.mask)
    >>> solution.status.name, solution.depth.shape
    ('CONVERGED', (72, 72))
    """
    if not isinstance(photo, Photo):
        raise InputError.about(
            "photo",
            photo,
            "is no Photo: give read_photo(path), or use clip_highlights, mean_filter and normalise_linear on an array.",
        )
    if not isinstance(preparation, Preparation):
        raise InputError.about("preparation", preparation, "is none: give Preparation(...), or leave it out.")
    require_camera(camera)
    for name, number in (("ambient", preparation.ambient), ("saturation", preparation.saturation)):
        if isinstance(number, float) and photo.white is not None and number > photo.white:
            raise InputError.about(
                name,
                number,
                f"is more than {photo.white:g}, the largest number in a photo of {photo.bits} bits: give a number as "
                "the file holds it.",
                written=f"{number:g}",
            )
    values, inside = checked(photo.image, photo.mask if mask is None else mask)
    exponent = preparation.tone_exponent
    light = _raised(values, exponent, inside)
    light, below = _without_ambient(photo, light, preparation, inside)
    light = _without_vignetting(light, camera, preparation, inside)
    unfiltered = light

    level = preparation.saturation
    if level is None and photo.white is not None:
        level = _SATURATED * photo.white
    nowhere = np.zeros_like(inside)
    saturated = nowhere if level is None else inside & (photo.largest_sample >= level)
    specks = specular = masked = filled = clipped = nowhere
    if preparation.despeckle:
        light, specks = without_specks(light, inside)
    if preparation.highlights != "keep":
        # In the colour of which the surface itself has least, the colour of the lamp stands out most.
        specular = find_specular(_raised(_decoded(photo, photo.smallest_sample), exponent, inside), mask=inside)
        masked = inside & dilate(saturated | specular, _HALO)
        if preparation.highlights == "fill":
            highlights = masked
            light, masked = fill_smoothly(light, highlights, mask=inside)
            filled = highlights & ~masked
        inside = inside & ~masked
        if not inside.any():
            raise InputError(
                f"All of the {np.count_nonzero(masked)} pixels are highlights or next to one: take "
                f"{keyword('highlights', 'keep')}, expose the photo less, or say from which number on a pixel is "
                f"saturated, {keyword('saturation')}."
            )
    # Before smoothing, which would spread a highlight over its neighbours.
    if preparation.clip_highlights is not None:
        light, clipped = clip_highlights(light, mask=inside, percentile=preparation.clip_highlights)
    if preparation.denoise:
        light = denoise(light, preparation.denoise, mask=inside)
    if preparation.mean_filter != 1:
        if preparation.mean_filter > min(light.shape):
            size = f"{light.shape[1]} × {light.shape[0]} pixels"
            raise InputError.about(
                "mean_filter", preparation.mean_filter, f"is larger than the photo, {size}: give a smaller width."
            )
        light = mean_filter(light, preparation.mean_filter, inside)
    report = {
        "tone_exponent": exponent,
        "ambient": preparation.ambient if isinstance(preparation.ambient, float) else "an array",
        "below_ambient_pixels": int(np.count_nonzero(below)),
        "vignetting": preparation.vignetting if isinstance(preparation.vignetting, str) else "an array",
        "saturation": level,
        "saturated_pixels": None if level is None else int(np.count_nonzero(saturated)),
        "despeckle": preparation.despeckle,
        "speck_pixels": int(np.count_nonzero(specks)),
        "highlights": preparation.highlights,
        "specular_pixels": None if preparation.highlights == "keep" else int(np.count_nonzero(specular)),
        "masked_pixels": int(np.count_nonzero(masked)),
        "filled_pixels": int(np.count_nonzero(filled)),
        "clip_highlights": preparation.clip_highlights,
        "clipped_pixels": int(np.count_nonzero(clipped)),
        "denoise": preparation.denoise,
        "mean_filter": preparation.mean_filter,
    }
    return PreparedPhoto(light, unfiltered, inside, below, saturated, specks, specular, masked, filled, clipped, report)


def _decoded(photo: Photo, samples: NDArray[Any]) -> Array:
    """Linear light of numbers of the file."""
    if photo.white is None:
        return photo.linear(samples)
    # A table of every possible one costs far less than a power for each pixel.
    levels = photo.linear(np.arange(photo.white + 1))
    return np.asarray(levels[samples])


def _raised(light: Array, exponent: float, inside: Mask) -> Array:
    """Light without a tone curve; what is outside may hold anything."""
    return light if exponent == 1.0 else np.asarray(np.power(light, exponent, out=light.copy(), where=inside))


def _without_ambient(photo: Photo, values: Array, preparation: Preparation, inside: Mask) -> tuple[Array, Mask]:
    ambient, exponent = preparation.ambient, preparation.tone_exponent
    if isinstance(ambient, float):
        if ambient == 0:
            return values, np.zeros_like(inside)
        offset: ArrayLike = photo.linear(ambient) ** exponent
    else:
        if photo.channel == "max":
            raise InputError(
                "Of the largest of three colours, the light of the lamp cannot be told by subtraction: read photo and "
                "ambient light with another channel, or give the ambient light as one number.",
                argument="ambient",
                value=ambient,
            )
        offset = _raised_map("ambient", ambient, preparation)
    light, below = subtract_ambient(values, offset, mask=inside)
    if not (light[inside] > 0).any():
        raise InputError("No pixel is brighter than the ambient light: nothing is left. Give a smaller one.")
    return light, below


def _raised_map(name: str, given: ArrayLike, preparation: Preparation) -> ArrayLike:
    """Ambient light or a white plate, without the tone curve; what cannot be raised stays, and is refused later."""
    if preparation.tone_exponent == 1.0:
        return given
    values = as_floats(name, given)
    return np.asarray(np.power(values, preparation.tone_exponent, out=values.copy(), where=values > 0.0))


def _without_vignetting(light: Array, camera: Camera, preparation: Preparation, inside: Mask) -> Array:
    vignetting = preparation.vignetting
    if isinstance(vignetting, str):
        power = cosine_power(vignetting)
        if power is None:
            return light
        shape = (inside.shape[0], inside.shape[1])
        return divide_vignetting(light, cosine_vignetting(camera, shape, power), mask=inside)
    share = as_array("vignetting", _raised_map("vignetting", vignetting, preparation))
    flat = divide_vignetting(light, share, mask=inside)
    # Another exposure of the plate must not change the scale of the light, which a lamp's gain refers to.
    flat[inside] *= share.max(where=inside, initial=0)
    return flat
