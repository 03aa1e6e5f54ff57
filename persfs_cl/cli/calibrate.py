"""``persfs-cl calibrate``: light, material, tone and lens from photos of known surfaces."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from persfs_cl.arrays import Array
from persfs_cl.calibration.calibrate import calibrate as fit_photographs
from persfs_cl.calibration.pairs import Normals
from persfs_cl.calibration.parameters import WORDS, Assumed, usual, words_of
from persfs_cl.calibration.result import Calibration
from persfs_cl.cli.brightness import chosen_brightness
from persfs_cl.cli.calibrated import calibrated
from persfs_cl.cli.choosers import takes
from persfs_cl.cli.config import configurable
from persfs_cl.cli.options import chosen_camera, chosen_device, chosen_light, chosen_reflectance
from persfs_cl.cli.output import check_file
from persfs_cl.cli.settings import settings_of
from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import InputError
from persfs_cl.guide.guide import Points
from persfs_cl.io.files import atomic_path
from persfs_cl.io.maps import read_depth, read_mask
from persfs_cl.io.photos import Photo, read_photo
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.guides import GuideFile
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.options import Options

_MAPS = (".npy", ".tif", ".tiff")
_NOT_WRITTEN = ("fit", "normals", "mask", "device", "overwrite", "output", "config", "dump_config")
"""Options that are about the calibration itself, or about these very photos."""


@configurable
@takes(
    camera=chosen_camera,
    light=chosen_light,
    reflectance=chosen_reflectance,
    brightness=chosen_brightness,
    keywords=chosen_device,
)
def calibrate(
    ctx: typer.Context,
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="PHOTO TRUTH...",
            help="Photos, and after each what is known of its depth: a depth map of its size, .npy or .tiff, NaN where "
            "unknown; or points, .csv or .json of column, row and depth, .ply or COLMAP's points3D.txt.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="TOML file to write, for --config of reconstruct.")
    ],
    *,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    fit: Annotated[
        str | None,
        typer.Option(
            metavar="WORD,...",
            help=f"What is sought, of {', '.join(WORDS)}; by default the gain of a flash, direction and white of a "
            "parallel light. All else is as other options have it, and what is sought begins there.",
        ),
    ] = None,
    normals: Annotated[
        Normals,
        typer.Option(
            help="Whose slopes are believed where a depth map is dense: its own, or, where it is noisy or coarse, "
            "those of the surface that is reconstructed. Points have no slopes."
        ),
    ] = "auto",
    mask: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Image, white on the surface, or .npy of bool: one for all photos, or one for each in their order.",
        ),
    ] = None,
    camera: CameraChoice,
    light: Light,
    reflectance: Reflectance,
    brightness: Brightness,
    keywords: Options,
) -> None:
    """Fit light, material, tone curve and lens to photos whose depth is known, once for all photos to come.

    The file holds options of reconstruct and batch, for their --config, with the standard errors as comments. What the
    photos cannot tell is said, and stays as it was.
    """
    if len(files) % 2:
        raise typer.BadParameter(
            f"an odd number of files, {len(files)}, makes no pairs: give each photo, and after it its truth.",
            param_hint="'PHOTO TRUTH...'",
        )
    if brightness.normalise is not None or brightness.white_percentile is not None:
        raise typer.BadParameter(
            "a calibration is by linear light as it is: leave it out; --fit white seeks the white level.",
            param_hint="'--normalise' / '--white-percentile'",
        )
    photos, truths, masks = files[::2], files[1::2], mask or []
    if len(masks) not in (0, 1, len(photos)):
        raise typer.BadParameter(
            f"{len(masks)} masks for {len(photos)} photos: give one for all, or one for each.", param_hint="'--mask'"
        )
    sought = usual(light) if fit is None else fit
    try:
        words_of(sought, Assumed(light, reflectance))
    except InputError as error:
        raise WrongOption(error, "'--fit'") from error
    check_file(output, (".toml",), overwrite=overwrite)
    read = [_read(photo, truth, brightness, camera) for photo, truth in zip(photos, truths, strict=True)]
    shapes = [(photo.image.shape[0], photo.image.shape[1]) for photo, _ in read]
    preparations = [
        brightness.preparation(shape, orientation=photo.orientation)
        for shape, (photo, _) in zip(shapes, read, strict=True)
    ]
    inside = [
        read_mask(file, shape, orientation=photo.orientation)
        for file, shape, (photo, _) in zip(
            masks if len(masks) == len(photos) else masks * len(photos), shapes, read, strict=False
        )
    ]
    with _steps() as show:
        calibration = fit_photographs(
            read,
            [camera.of(path, shape)[0] for path, shape in zip(photos, shapes, strict=True)],
            fit=sought,
            light=light,
            reflectance=reflectance,
            preparation=preparations[0],
            white_level=brightness.white_level,
            mask=inside or None,
            normals=normals,
            device=keywords["device"],
            callback=show,
        )
    given = settings_of(ctx.command.callback, ctx.command.params, _NOT_WRITTEN)
    lines = {setting.name: list(setting.lines(ctx.params[setting.parameter]))[-1] for setting in given.values()}
    text = calibrated(calibration, {name: line for name, line in lines.items() if not line.startswith("#")}, photos)
    with atomic_path(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    typer.echo(output)
    console = Console(stderr=True, width=None if sys.stderr.isatty() else 120, markup=False, highlight=False)
    for part in _told(calibration):
        console.print(part)


def _read(path: Path, truth: Path, brightness: Brightness, camera: CameraChoice) -> tuple[Photo, Array | Points]:
    photo = read_photo(
        path,
        channel=brightness.channel,
        encoding=brightness.encoding,
        keep_nan=True,
        page=brightness.page,
        half_size=brightness.half_size,
    )
    shape = (photo.image.shape[0], photo.image.shape[1])
    if truth.suffix.lower() in _MAPS:
        return photo, read_depth(truth, shape, orientation=photo.orientation)
    return photo, GuideFile(truth).read(path, camera.of(path, shape)[0], shape, orientation=photo.orientation)


@contextmanager
def _steps() -> Iterator[Callable[[int, float], object] | None]:
    """A line on standard error with the step of the fit, if that is a terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    with Console(stderr=True).status("fitting") as line:
        yield lambda step, error: line.update(f"step {step}, median error {error:.2%}")


def _told(calibration: Calibration) -> Iterator[Any]:
    """What a person wants to know."""
    if calibration.values:
        table = Table(box=box.SIMPLE)
        for column in ("fitted", "value", "standard error"):
            table.add_column(column, justify="left" if column == "fitted" else "right")
        for name, value in calibration.values.items():
            table.add_row(name, f"{value:.6g}", f"{calibration.uncertainties[name]:.2g}")
        yield table
    for name, reason in calibration.reasons.items():
        yield f"Not told: {name}. {reason[0].upper()}{reason[1:]}."
    for what in ("depth", "brightness"):
        before, after = getattr(calibration.before, what), getattr(calibration.after, what)
        if before is not None and after is not None:
            yield (
                f"Mean error of the {what}: {before:.3%} before, {after:.3%} after, cross-validated over "
                f"{calibration.validation}."
            )
