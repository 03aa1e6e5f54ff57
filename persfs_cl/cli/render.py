"""``persfs-cl render``: the forward model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from persfs_cl.cli.options import (
    CameraOptions,
    DeviceOption,
    FieldOfViewOption,
    FocalLengthOption,
    LightOption,
    P0Option,
    PrecisionOption,
    PrincipalPointOption,
    Q0Option,
)
from persfs_cl.cli.output import check_file
from persfs_cl.errors import CameraError, InputError
from persfs_cl.forward import render as photograph
from persfs_cl.images import read_depth, read_mask, write_grey
from persfs_cl.light import ParallelLight

Bits = Literal["8", "16"]
_IMAGE = "Image"


def render(
    depth: Annotated[
        Path, typer.Argument(metavar="DEPTH", help="A depth map, .npy or .tiff, NaN where there is no surface.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="IMAGE", help="PNG or TIFF file to write.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    focal_length: FocalLengthOption = None,
    fov: FieldOfViewOption = None,
    principal_point: PrincipalPointOption = None,
    light: LightOption = "parallel",
    p0: P0Option = 0.0,
    q0: Q0Option = 0.0,
    mask: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Image, white where to render, or .npy of bool.")
    ] = None,
    bits: Annotated[Bits, typer.Option(help="Bits per pixel.", rich_help_panel=_IMAGE)] = "8",
    encoding: Annotated[
        Literal["srgb", "linear"],
        typer.Option(
            help="srgb is what viewers and 'reconstruct' expect; linear writes E times the white value.",
            rich_help_panel=_IMAGE,
        ),
    ] = "srgb",
    device: DeviceOption = None,
    precision: PrecisionOption = "float32",
) -> None:
    """Photograph a depth map: the forward model, eq. (6).

    Pixels without surface, and those turned away from the light, are black.
    """
    del light  # the only one yet
    camera = CameraOptions.parse(focal_length, fov, principal_point)
    camera.require()
    check_file(output, (".png", ".tif", ".tiff"), overwrite=overwrite)
    values = read_depth(depth)
    shape = (values.shape[0], values.shape[1])
    inside = None if mask is None else read_mask(mask, shape)
    pinhole = camera.camera(depth, shape)
    try:
        image = photograph(
            values, pinhole, light=ParallelLight(p0, q0), mask=inside, device=device, precision=precision
        )
    except (InputError, CameraError) as error:
        raise type(error)(f"{depth}: {error}") from error
    write_grey(output, image, 8 if bits == "8" else 16, encoding=encoding)
    typer.echo(output)
