"""``persfs-cl compare``: how far two depth maps, two images, or a depth map and points lie apart."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

from persfs_cl.arrays import Array, Mask
from persfs_cl.errors import InputError
from persfs_cl.io.files import read_bytes
from persfs_cl.io.maps import check_map, read_depth, read_mask
from persfs_cl.io.photos import Channel, Encoding, read_photo
from persfs_cl.io.points import PointErrors, at_points, compare_points, read_points
from persfs_cl.metrics import Errors
from persfs_cl.metrics import compare as measure
from persfs_cl.pipeline.beside import OtherPixels, other_pixels
from persfs_cl.surface.formats.records import CAMERA

Kind = Literal["auto", "depth", "image"]
Alignment = Literal["none", "scale", "range"]


_GUESSES = {"constant": "constant (a flat depth, for comparison)", "1/sqrt(I)": "1/sqrt(I) (for comparison)"}
"""How rows of guesses are labelled."""


def compare(
    first: Annotated[Path, typer.Argument(metavar="A", help="The estimate: a depth map or an image.")],
    second: Annotated[
        Path,
        typer.Argument(
            metavar="B", help="The truth, of the same size; or .csv or .json of points: column, row and depth."
        ),
    ],
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
    photo: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="With points: the photo, to show what errors a depth of 1 / sqrt(brightness) has.",
        ),
    ] = None,
    channel: Annotated[Channel, typer.Option(help="Of the photo.")] = "luminance",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Compare two depth maps or two images: mean and root mean square of the differences, and kin.

    Depth maps are .npy or .tiff, NaN where unknown, and compared in their own unit. Images of all formats
    are compared in linear light, in grey levels from 0 to 255 (--encoding linear: as the numbers stand in the file);
    transparent pixels are left out. ME is the paper's mean error, RS its root mean square.

    With points, such as triangulation gives, the mean of |z - z'| / z' is printed, and Spearman's rank correlation;
    for comparison those of a constant depth, and with --photo of 1 / sqrt(brightness). Points are in pixels of the
    photo, whose lens and size camera.json tells where the depth map A has others; mask and truth may be of either.
    """
    with_points = second.suffix.lower() in (".csv", ".json")
    if photo is not None and not with_points:
        raise typer.BadParameter("only goes with points, .csv or .json: leave it out.", param_hint="'--photo'")
    if with_points:
        if align == "range" or kind == "image":
            raise typer.BadParameter("points have depths: use --align none or scale, and --kind auto or depth.")
        if align == "none":
            _hint_at_scale(first)
        rows = _beside_points(first, second, mask, align == "scale", photo, channel, encoding)
        typer.echo(json.dumps({name: asdict(row) for name, row in rows.items()}) if as_json else _table(rows))
        return
    if kind == "auto":
        images = {".png", ".jpg", ".jpeg"} & {first.suffix.lower(), second.suffix.lower()}
        kind = "image" if images else "depth"
        maps = [path for path in (first, second) if path.suffix.lower() == ".npy"]
        if images and maps:
            raise InputError(f"{maps[0]} is a depth map, and the other file an image: give two of a kind.")
    values, turned = [], 1
    for path in (first, second):
        if kind == "depth":
            values.append(read_depth(path))
        else:
            taken = read_photo(path, encoding=encoding)
            turned = max(turned, taken.orientation)
            opaque = True if taken.mask is None else taken.mask
            values.append(np.where(opaque, 255.0 * taken.image, np.nan))
    shape = (values[0].shape[0], values[0].shape[1])
    other = other_pixels(first, shape) if kind == "depth" else None
    if other is not None and values[1].shape == other.photo_shape != shape:
        values[1] = other.map(values[1])
        _tell_of_photo(first, second)
    if values[1].shape != shape:
        raise InputError(
            f"{first} has shape {shape}, but {second} has {values[1].shape}: give two of the same size"
            f"{'' if other is None else f', or one of the size of the photo, {other.photo_shape}'}."
        )
    inside = None if mask is None else _mask(mask, first, shape, other, orientation=turned)
    if kind == "depth" and align == "none":
        _hint_at_scale(first)
    try:
        errors = measure(*values, mask=inside, align=None if align == "none" else align)
    except InputError as error:
        raise error.at(f"{first}, {second}") from error
    unit = "share of the range" if align == "range" else "grey levels" if kind == "image" else "unit of the depth"
    typer.echo(json.dumps({**asdict(errors), "unit": unit}) if as_json else _text(errors, unit))


def _beside_points(
    depth: Path,
    file: Path,
    mask: Path | None,
    scale: bool,
    photo: Path | None,
    channel: Channel,
    encoding: Encoding,
) -> dict[str, PointErrors]:
    """The errors of a depth map, and of two guesses that take no solver, at the same points."""
    values, points = read_depth(depth), read_points(file)
    shape = (values.shape[0], values.shape[1])
    given, other = points, other_pixels(depth, shape)
    if other is not None:
        points = other.points(points)
        _tell_of_photo(depth, file)
    wanted = np.ones(shape, bool) if mask is None else _mask(mask, depth, shape, other)
    estimate = at_points(np.where(wanted, values, np.nan), points)
    reasons = {
        "outside the depth map": np.isnan(at_points(np.zeros(shape), points)),
        f"outside {mask}": at_points(wanted, points) == 0,
        "where there is no depth": at_points(wanted & np.isnan(values), points) == 1,
    }
    if left_out := {reason: int(np.count_nonzero(which)) for reason, which in reasons.items() if which.any()}:
        counts = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
        typer.echo(f"{sum(left_out.values())} of {len(points)} points are left out: {counts}.", err=True)
    # A guess must not count where there is no depth to compare it with.
    truth = np.where(np.isnan(estimate), np.nan, points[:, 2])
    brightness = None
    if photo is not None:
        image = read_photo(photo, channel=channel, encoding=encoding).image
        expected = shape if other is None else other.photo_shape
        if image.shape != expected:
            told = f"{depth} has" if other is None else f"by the {CAMERA} beside it {depth} comes of one of"
            raise InputError(
                f"{photo} has shape {image.shape}, but {told} shape {expected}: give the photo that it is from."
            )
        # Black would lie at infinity, and is left out.
        brightness = at_points(np.where(image > 0, image, np.nan), given)
    try:
        rows = {
            "depth": compare_points(estimate, truth, scale=scale),
            "constant": compare_points(np.ones_like(truth), truth),
        }
        if brightness is not None:
            rows["1/sqrt(I)"] = compare_points(brightness**-0.5, truth)
    except InputError as error:
        raise error.at(f"{depth}, {file}") from error
    return rows


def _mask(path: Path, depth: Path, shape: tuple[int, int], other: OtherPixels | None, *, orientation: int = 1) -> Mask:
    """The pixels of a depth map, or image, that a mask selects, in whose pixels or the photo's it is."""
    if other is None or other.photo_shape == shape:
        return read_mask(path, shape, orientation=orientation)
    try:
        check_map("mask", path, other.photo_shape)
    except InputError:
        try:
            return read_mask(path, shape)
        except InputError as error:
            raise error.adding(f"The photo's, {other.photo_shape}, does as well.") from None
    _tell_of_photo(depth, path)
    selected: Array = read_mask(path, other.photo_shape).astype(np.float64)
    return np.asarray(other.map(selected) >= 0.5)


def _tell_of_photo(depth: Path, file: Path) -> None:
    typer.echo(
        f"By the {CAMERA} beside it {depth} has other pixels than the photo, of which {file} is taken to be.", err=True
    )


def _hint_at_scale(depth: Path) -> None:
    """Say so where the report in the folder of a depth map tells that nothing has set its unit."""
    # A hint is worth no error: there may be another file of that name.
    with suppress(InputError, ValueError, KeyError, TypeError, RecursionError):
        light = json.loads(read_bytes(depth.with_name("report.json")))["parameters"]["light"]
        if light["gain"] == 1.0:
            typer.echo(
                f"{depth} comes of a flash whose gain was not given, so that its unit is arbitrary: add --align scale, "
                "unless the other is in the same unit.",
                err=True,
            )


def _table(rows: dict[str, PointErrors]) -> str:
    shown = {**dict(zip(rows, rows, strict=True)), **_GUESSES}
    width = max(map(len, (shown[name] for name in rows)))
    lines = [f"{'':{width}} {'mean error':>11} {'rank corr.':>11} {'points':>7} {'scale':>11}"]
    for name, row in rows.items():
        correlation = "-" if row.rank_correlation is None else f"{row.rank_correlation:.4f}"
        lines.append(
            f"{shown[name]:{width}} {row.mean_relative:11.4f} {correlation:>11} {row.count:7} {row.scale:11.6g}"
        )
    return "\n".join(lines)


def _text(errors: Errors, unit: str) -> str:
    rows = {
        "ME": errors.mean,
        "RS": errors.root_mean_square,
        "maximum": errors.maximum,
        "median": errors.median,
    }
    lines = [f"{name:8} {value:.6g}" for name, value in rows.items()]
    return "\n".join([*lines, f"{'pixels':8} {errors.count}", f"{'unit':8} {unit}"])
