"""``persfs-cl compare``: how far two depth maps, or two images, lie apart."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from persfs_cl.errors import InputError
from persfs_cl.images import Encoding, read_depth, read_mask, read_photo
from persfs_cl.metrics import Errors
from persfs_cl.metrics import compare as measure

Kind = Literal["auto", "depth", "image"]
Alignment = Literal["none", "scale", "range"]


def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="The estimate: a depth map or an image.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="The truth, of the same size.")],
    mask: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Image, white where to compare, or .npy of bool.")
    ] = None,
    align: Annotated[
        Alignment,
        typer.Option(
            help="What may differ. scale: one factor, as depth under a parallel light is known up to one. "
            "range: both are stretched to [0, 1], as in the paper's Table 1."
        ),
    ] = "none",
    kind: Annotated[
        Kind, typer.Option(help="What the files hold. auto: images if one is a PNG or JPEG, otherwise depth.")
    ] = "auto",
    encoding: Annotated[
        Encoding, typer.Option(help="Of images. auto: integers are sRGB, floats are linear light.")
    ] = "auto",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Compare two depth maps or two images: mean and root mean square of the differences, and kin.

    Depth maps are .npy or .tiff, NaN where unknown, and compared in their own unit. Images are PNG, JPEG or TIFF,
    and compared in linear light, in grey levels from 0 to 255 (--encoding linear: as the numbers stand in the file);
    transparent pixels are left out. ME is the paper's mean error, RS its root mean square.
    """
    if kind == "auto":
        images = {".png", ".jpg", ".jpeg"} & {first.suffix.lower(), second.suffix.lower()}
        kind = "image" if images else "depth"
    values = []
    for path in (first, second):
        if kind == "depth":
            values.append(read_depth(path))
        else:
            photo = read_photo(path, encoding=encoding)
            opaque = True if photo.mask is None else photo.mask
            values.append(np.where(opaque, 255.0 * photo.image, np.nan))
    shape = (values[0].shape[0], values[0].shape[1])
    if values[1].shape != shape:
        raise InputError(f"{first} has shape {shape}, but {second} has {values[1].shape}: give two of the same size.")
    inside = None if mask is None else read_mask(mask, shape)
    try:
        errors = measure(*values, mask=inside, align=None if align == "none" else align)
    except InputError as error:
        raise InputError(f"{first}, {second}: {error}") from error
    unit = "share of the range" if align == "range" else "grey levels" if kind == "image" else "unit of the depth"
    typer.echo(json.dumps({**asdict(errors), "unit": unit}) if as_json else _text(errors, unit))


def _text(errors: Errors, unit: str) -> str:
    rows = {
        "ME": errors.mean,
        "RS": errors.root_mean_square,
        "maximum": errors.maximum,
        "median": errors.median,
    }
    lines = [f"{name:8} {value:.6g}" for name, value in rows.items()]
    return "\n".join([*lines, f"{'pixels':8} {errors.count}", f"{'unit':8} {unit}"])
