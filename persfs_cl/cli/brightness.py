"""Options that say how a photo becomes the image that is solved."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from persfs_cl.cli.numbers import positive
from persfs_cl.cli.settings import MayBePath
from persfs_cl.io.photos import Channel, Encoding
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.preparation.correct import cosine_power
from persfs_cl.preparation.denoise import MOST_DENOISING
from persfs_cl.preparation.prepare import LEAST_EXPONENT, MOST_EXPONENT, Highlights
from persfs_cl.preparation.prepared import Normalise

_PHOTO = "Brightness of the photo"


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise typer.BadParameter(f"{value} has no middle pixel: give an odd number.")
    return value


def _percentile(value: float | None) -> float | None:
    if value is not None and not 0 < value <= 100:
        raise typer.BadParameter(f"{value} is not a percentile: give a number above 0, at most 100.")
    return value


def _ambient(text: str) -> float | Path:
    try:
        number = float(text)
    except ValueError:
        return Path(text)
    if not (math.isfinite(number) and number >= 0):
        raise typer.BadParameter(f"{text} is no brightness: give 0 or more, or a file.", param_hint="'--ambient'")
    return number


def _vignetting(text: str) -> str | Path:
    return text if text == "none" or cosine_power(text) is not None else Path(text)


def _exponent(value: float) -> float:
    if not LEAST_EXPONENT <= value <= MOST_EXPONENT:
        raise typer.BadParameter(f"{value} is no exponent: give a number from {LEAST_EXPONENT:g} to {MOST_EXPONENT:g}.")
    return value


def chosen_brightness(
    channel: Annotated[
        Channel, typer.Option(help="What of a colour photo is used.", rich_help_panel=_PHOTO)
    ] = "luminance",
    encoding: Annotated[
        Encoding,
        typer.Option(
            help="What the file's numbers are. auto: as its colour profile says; else integers are sRGB, floats are "
            "linear light, and camera raw files in any case.",
            rich_help_panel=_PHOTO,
        ),
    ] = "auto",
    page: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            help="Which page of a TIFF file, or picture of an animation, from 1; needed where there are several.",
            rich_help_panel=_PHOTO,
        ),
    ] = None,
    half_size: Annotated[
        bool,
        typer.Option(
            "--half-size",
            help="One pixel of each square of four of a camera raw file, without interpolating colours. The camera, "
            "mask and all that goes with the photo are of half the size then; raw dark frames and flat fields are "
            "halved with it.",
            rich_help_panel=_PHOTO,
        ),
    ] = False,
    ambient: Annotated[
        str,
        typer.Option(
            metavar="LEVEL|FILE",
            help="Light that is there without the lamp, or black level, to subtract: a number as the file holds it "
            "(0 to 255 with 8 bits), or a second photo without the lamp, or .npy of linear light.",
            rich_help_panel=_PHOTO,
        ),
        MayBePath(_ambient),
    ] = "0",
    vignetting: Annotated[
        str,
        typer.Option(
            metavar="none|cosN|FILE",
            help="Darkening of the lens away from the middle, to undo: cos4 for the fourth power of the cosine to the "
            "optical axis, or another power, or a photo of an evenly lit white plate, or .npy of linear light.",
            rich_help_panel=_PHOTO,
        ),
        MayBePath(_vignetting),
    ] = "none",
    tone_exponent: Annotated[
        float,
        typer.Option(
            metavar="G",
            help="Raise linear light to this power, to undo a tone curve that the camera has applied.",
            callback=_exponent,
            rich_help_panel=_PHOTO,
        ),
    ] = 1.0,
    despeckle: Annotated[
        bool,
        typer.Option(
            "--despeckle/--no-despeckle",
            help="Replace bright specks of up to 3 pixels, such as hot pixels, by what surrounds them.",
            rich_help_panel=_PHOTO,
        ),
    ] = True,
    highlights: Annotated[
        Highlights,
        typer.Option(
            help="Saturated pixels and shiny spots, and two pixels around them. mask: not solved, nothing crosses. "
            "fill: smoothly, from around them.",
            rich_help_panel=_PHOTO,
        ),
    ] = "keep",
    saturation: Annotated[
        float | None,
        typer.Option(
            metavar="LEVEL",
            help="Number, as the file holds it, from which on a pixel is saturated; by default 98 % of the largest "
            "that there can be, and in a file of floats none.",
            callback=positive,
            rich_help_panel=_PHOTO,
        ),
    ] = None,
    clip_highlights: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENTILE",
            help="Cut what is brighter than this percentile: shiny spots, which a matt surface does not have. "
            "What is cut counts as facing the light.",
            callback=_percentile,
            rich_help_panel=_PHOTO,
        ),
    ] = None,
    denoise: Annotated[
        float,
        typer.Option(
            metavar="STRENGTH",
            min=0.0,
            max=MOST_DENOISING,
            help="Take out noise, but smooth across no edge: 0 is off, 0.8 usual.",
            rich_help_panel=_PHOTO,
        ),
    ] = 0.0,
    mean_filter: Annotated[
        int,
        typer.Option(
            metavar="PX",
            min=1,
            help="Smooth over a square of this odd width; 1 is off.",
            callback=_odd,
            rich_help_panel=_PHOTO,
        ),
    ] = 1,
    normalise: Annotated[
        Normalise | None,
        typer.Option(
            help="For a parallel light. linear, the default: divide by the brightest value (99.5th percentile), which "
            "keeps the shading equation exact. level: so that the median brightness is that of level ground, for open "
            "ground under an oblique light. grey: stretch from the darkest to the brightest, eq. (2) of the paper. "
            "none: the photo is E already.",
            rich_help_panel=_PHOTO,
        ),
    ] = None,
    white_percentile: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENTILE",
            help="The brightest value is this percentile, and what is brighter becomes 1; 99.5 with "
            "--normalise linear, 100 with grey.",
            callback=_percentile,
            rich_help_panel=_PHOTO,
        ),
    ] = None,
    white_level: Annotated[
        float | None,
        typer.Option(
            metavar="BRIGHTNESS",
            help="For a parallel light, instead of a percentile: brightness, in linear light, of a white surface that "
            "faces it.",
            callback=positive,
            rich_help_panel=_PHOTO,
        ),
    ] = None,
) -> Brightness:
    """What the options tell of the brightness.

    Raises
    ------
    typer.BadParameter
        When one is impossible, or goes with another choice.
    """
    if normalise == "none" and white_percentile is not None:
        raise typer.BadParameter("nothing is normalised: leave it out.", param_hint="'--white-percentile'")
    if white_level is not None and (normalise not in (None, "linear") or white_percentile is not None):
        raise typer.BadParameter(
            "goes with --normalise linear, instead of --white-percentile: leave one of them out.",
            param_hint="'--white-level'",
        )
    return Brightness(
        channel,
        encoding,
        _ambient(ambient),
        _vignetting(vignetting),
        despeckle,
        highlights,
        saturation,
        clip_highlights,
        denoise,
        mean_filter,
        normalise,
        white_percentile,
        white_level,
        tone_exponent,
        page,
        half_size,
    )
