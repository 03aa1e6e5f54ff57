"""How a photo becomes the image that is solved."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.errors import InputError
from persfs_cl.io.maps import read_light
from persfs_cl.io.photos import Channel, Encoding
from persfs_cl.preparation.prepare import Highlights, Preparation
from persfs_cl.preparation.prepared import Normalise, PreparedPhoto
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword

_UPRIGHT = 1e-6
"""By how much less than 1 E of level ground is at least."""
_DARKENING = ("clip_highlights", "mean_filter", "ambient", "highlights")
"""What can take the shading away."""


@dataclass(frozen=True)
class Brightness:
    """How a photo becomes linear light and, for a parallel light, E.

    Attributes
    ----------
    channel, encoding, page, half_size
        As for :func:`persfs_cl.io.photos.read_photo`.
    ambient, vignetting, despeckle, highlights, saturation, clip_highlights, denoise, mean_filter, tone_exponent
        As for :class:`persfs_cl.preparation.prepare.Preparation`, with files instead of arrays.
    normalise : {"linear", "level", "grey", "none"} or None
        Divide by the brightest value, or so that the median is that of level ground, stretch by eq. (2), or leave as it
        is. None is "linear" for a parallel light;
        for others nothing is normalised.
    white_percentile, white_level : float or None
        The `percentile` and the `white` of :meth:`persfs_cl.preparation.prepared.PreparedPhoto.normalised`.
    """

    channel: Channel = "luminance"
    encoding: Encoding = "auto"
    ambient: float | Path = 0.0
    vignetting: str | Path = "none"
    despeckle: bool = True
    highlights: Highlights = "keep"
    saturation: float | None = None
    clip_highlights: float | None = None
    denoise: float = 0.0
    mean_filter: int = 1
    normalise: Normalise | None = None
    white_percentile: float | None = None
    white_level: float | None = None
    tone_exponent: float = 1.0
    page: int | None = None
    half_size: bool = False

    def preparation(self, shape: tuple[int, int], *, orientation: int = 1) -> Preparation:
        """The same with arrays of the photo's shape, read from the files; `orientation` is the photo's.

        Raises
        ------
        InputError
            When a file cannot be used, or a number is impossible.
        """
        files = {
            name: read_light(
                file,
                shape,
                channel=self.channel,
                encoding=self.encoding,
                orientation=orientation,
                half_size=self.half_size,
            )
            for name, file in (("ambient", self.ambient), ("vignetting", self.vignetting))
            if isinstance(file, Path)
        }
        numbers = {name: getattr(self, name) for name in Preparation.__dataclass_fields__}
        return Preparation(**(numbers | files))

    def applied(
        self, prepared: PreparedPhoto, light: Light, reflectance: Reflectance
    ) -> tuple[Array, Array, dict[str, Any]]:
        """The image to solve, the photo itself on the same scale, and what was done, for the report.

        The second is less ambient light and without vignetting, but neither clipped nor filled nor filtered; where E is
        1, what is brighter is 1.

        Raises
        ------
        InputError
            When there is no shading, or the light is no parallel one and a normalisation is asked for.
        """
        image, mask = prepared.light, prepared.mask
        if _is_even(image, mask):
            clipping, smoothing, ambient, highlights = map(keyword, _DARKENING)
            raise InputError(
                f"the brightness is the same everywhere after {clipping} and {smoothing} (and {ambient} and "
                f"{highlights}): there is no shading left to reconstruct from. Clip or smooth less."
            )
        done = {"channel": self.channel, **prepared.report}
        done |= {name: str(file) for name, file in vars(self).items() if isinstance(file, Path)}
        if light.normalised:
            normalised = prepared.normalised(
                self.normalise or "linear",
                percentile=self.white_percentile,
                white=self.white_level,
                level=_of_level_ground(light, reflectance) if self.normalise == "level" else None,
            )
            return normalised.image, normalised.unfiltered, {**done, **normalised.report}
        whites = [name for name in ("white_percentile", "white_level") if getattr(self, name) is not None]
        if self.normalise not in (None, "none") or whites:
            name = whites[0] if whites else "normalise"
            raise InputError(
                f"only a parallel light takes an image between 0 and 1: leave out {keyword('normalise')}, "
                f"{keyword('white_percentile')} and {keyword('white_level')}.",
                argument=name,
                value=getattr(self, name),
            )
        return image, prepared.unfiltered, {**done, "normalise": "none"}


def _is_even(image: Array, mask: Mask) -> bool:
    """Whether more than one pixel is wanted, and all that are have the same value."""
    first, count = None, 0
    for rows in row_blocks((image.shape[0], image.shape[1])):
        values = image[rows][mask[rows]]
        if values.size and first is None:
            first = values[0]
        if (values != first).any():
            return False
        count += values.size
    return count > 1


def _of_level_ground(light: Light, reflectance: Reflectance) -> float:
    """E of a surface that faces the camera, on the optical axis.

    Raises
    ------
    InputError
        When it is the brightest there is, so that a median says nothing of it.
    """
    level = float(light.brightness(0.0, 0.0, 0.0, 0.0, 0.0, reflectance))
    if not 0.0 < level < 1.0 - _UPRIGHT:
        raise InputError.about(
            "normalise",
            "level",
            "is for an oblique light, under which level ground is darker than what faces it: tell the light's "
            f"direction, or take {keyword('normalise', 'linear')}.",
        )
    return level
