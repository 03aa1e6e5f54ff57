"""``persfs-cl render``: the forward model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from persfs_cl.cli.choosers import takes
from persfs_cl.cli.numbers import positive
from persfs_cl.cli.options import (
    AlbedoOption,
    chosen_camera,
    chosen_device_and_precision,
    chosen_light,
    chosen_reflectance,
    require_focal_length,
)
from persfs_cl.cli.output import check_file
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.export import write_grey
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.options import Options
from persfs_cl.surface.render import render as photograph

Bits = Literal["8", "16"]
_IMAGE = "Image"


@takes(
    light=chosen_light,
    reflectance=chosen_reflectance,
    camera=chosen_camera,
    keywords=chosen_device_and_precision,
)
def render(
    depth: Annotated[
        Path, typer.Argument(metavar="DEPTH", help="A depth map, .npy or .tiff, NaN where there is no surface.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="IMAGE", help="PNG or TIFF file to write.")],
    *,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    camera: CameraChoice,
    light: Light,
    reflectance: Reflectance,
    albedo: AlbedoOption = None,
    mask: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Image, white where to render, or .npy of bool.")
    ] = None,
    bits: Annotated[Bits, typer.Option(help="Bits per pixel.", rich_help_panel=_IMAGE)] = "8",
    encoding: Annotated[
        Literal["srgb", "linear"],
        typer.Option(
            help="srgb is what viewers and 'reconstruct' expect; linear writes numbers in proportion to the light.",
            rich_help_panel=_IMAGE,
        ),
    ] = "srgb",
    white: Annotated[
        float | None,
        typer.Option(
            metavar="BRIGHTNESS",
            help="What becomes white, and cuts what is brighter; 1 under a parallel light, under a flash the brightest "
            "value by default.",
            callback=positive,
            rich_help_panel=_IMAGE,
        ),
    ] = None,
    keywords: Options,
) -> None:
    """Photograph a depth map: the forward model, eq. (6), and its kin for other lights and materials.

    Pixels without surface, and those turned away from the light, are black.
    """
    require_focal_length(camera, depth)
    check_file(output, (".png", ".tif", ".tiff"), overwrite=overwrite)
    values = read_depth(depth)
    shape = (values.shape[0], values.shape[1])
    inside = None if mask is None else read_mask(mask, shape)
    shares = None if albedo is None else read_light(albedo, shape)
    pinhole, _ = camera.of(depth, shape)
    try:
        image = photograph(
            values,
            pinhole,
            light=light,
            reflectance=reflectance,
            mask=inside,
            albedo=shares,
            device=keywords["device"],
            precision=keywords["precision"],
        )
    except (InputError, CameraError) as error:
        raise error.at(depth) from error
    if white is None:
        white = 1.0 if light.normalised else float(np.nanmax(image))
    write_grey(output, image / white, 8 if bits == "8" else 16, encoding=encoding)
    typer.echo(output)
    if not light.normalised:
        gain = getattr(light, "gain", None)
        remedy = "" if gain is None else f" To reconstruct from this file, give --gain {gain / white:.6g}."
        typer.echo(f"White is a brightness of {white:g}.{remedy}", err=True)
