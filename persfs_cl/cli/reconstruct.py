"""``persfs-cl reconstruct``: one photo to a surface."""

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
    finite,
    positive,
)
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.photo import Brightness, Normalise, PhotoSolution, solve_photo
from persfs_cl.cli.progress import INTERRUPTED, progress_line, stop_on_interrupt, writing
from persfs_cl.images import Channel, Encoding
from persfs_cl.light import ParallelLight
from persfs_cl.solution import Status

Surface = Literal["away", "toward"]
Boundary = Literal["auto", "outflow", "extrapolate", "fixed", "wall"]
Scheme = Literal["auto", "lax-friedrichs"]
Ordering = Literal["wavefront", "checkerboard", "lexicographic"]

_PHOTO, _REGION, _SOLVER = "Brightness of the photo", "Region and known values", "Solver"


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise typer.BadParameter(f"{value} has no middle pixel: give an odd number.")
    return value


def _percentile(value: float | None) -> float | None:
    if value is not None and not 0 < value <= 100:
        raise typer.BadParameter(f"{value} is not a percentile: give a number above 0, at most 100.")
    return value


def reconstruct(
    photo: Annotated[Path, typer.Argument(metavar="PHOTO", help="A PNG, JPEG or TIFF file.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results, made if needed.")
    ],
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace earlier results in a folder that is not empty.")
    ] = False,
    focal_length: FocalLengthOption = None,
    fov: FieldOfViewOption = None,
    principal_point: PrincipalPointOption = None,
    light: LightOption = "parallel",
    p0: P0Option = 0.0,
    q0: Q0Option = 0.0,
    channel: Annotated[
        Channel, typer.Option(help="What of a colour photo is used.", rich_help_panel=_PHOTO)
    ] = "luminance",
    encoding: Annotated[
        Encoding,
        typer.Option(
            help="What the file's numbers are. auto: integers are sRGB, floats are linear light.",
            rich_help_panel=_PHOTO,
        ),
    ] = "auto",
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
        Normalise,
        typer.Option(
            help="linear: divide by the brightest value (99.5th percentile), which keeps the shading equation exact. "
            "grey: stretch from the darkest to the brightest, eq. (2) of the paper. none: the photo is E already.",
            rich_help_panel=_PHOTO,
        ),
    ] = "linear",
    mask: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Image, white where to solve, or .npy of bool. Transparent pixels of the photo are left out too.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    walls: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The same, white where the surface may jump: nothing crosses.", rich_help_panel=_REGION
        ),
    ] = None,
    known_depth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Depths that are kept, .npy or .tiff, NaN where unknown, in any unit. "
            "Without it the edge of the image or mask has depth 1.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    surface: Annotated[
        Surface,
        typer.Option(
            help="Whether the surface goes away from the camera, or comes toward it, from the known depths inwards.",
            rich_help_panel=_REGION,
        ),
    ] = "away",
    boundary: Annotated[
        Boundary, typer.Option(help="On edges where no depth is known; auto: outflow.", rich_help_panel=_SOLVER)
    ] = "auto",
    scheme: Annotated[Scheme, typer.Option(rich_help_panel=_SOLVER)] = "auto",
    ordering: Annotated[
        Ordering, typer.Option(help="Order of the pixels in a sweep.", rich_help_panel=_SOLVER)
    ] = "wavefront",
    max_iterations: Annotated[int, typer.Option(min=1, help="Of four sweeps each.", rich_help_panel=_SOLVER)] = 2000,
    tolerance: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Ends when ln depth changes by no more in an iteration.",
            callback=finite,
            rich_help_panel=_SOLVER,
        ),
    ] = 1e-5,
    max_slope: Annotated[
        float,
        typer.Option(
            help="Bound on the slope where a pixel is too dark to set one.", callback=positive, rich_help_panel=_SOLVER
        ),
    ] = 30.0,
    device: DeviceOption = None,
    precision: PrecisionOption = "float32",
) -> None:
    """Reconstruct the surface that one photo shows.

    The camera is told by --focal-length or --fov, or else by the photo's EXIF data. Writes depth.npy, depth.tiff,
    mesh.ply, report.json and the pictures depth.png, normals.png, relief.png, rendered.png, comparison.png and
    convergence.png.
    """
    del light  # the only one yet
    camera = CameraOptions.parse(focal_length, fov, principal_point)
    check_folder(output, overwrite=overwrite)
    with stop_on_interrupt() as interrupted, progress_line(tolerance, max_iterations) as show:

        def after_iteration(iteration: int, change: float) -> bool:
            show(iteration, change)
            return interrupted()

        result = solve_photo(
            photo,
            camera,
            Brightness(channel, encoding, clip_highlights, mean_filter, normalise),
            mask=mask,
            walls=walls,
            known_depth=known_depth,
            light=ParallelLight(p0, q0),
            surface=surface,
            boundary=boundary,
            scheme=scheme,
            ordering=ordering,
            max_iterations=max_iterations,
            tolerance=tolerance,
            max_slope=max_slope,
            device=device,
            precision=precision,
            callback=after_iteration,
        )
    with writing():
        files = result.save(output)
    for file in files:
        typer.echo(file)
    typer.echo(_summary(result), err=True)
    if result.solution.status is Status.STOPPED:
        raise typer.Exit(INTERRUPTED)


def _summary(result: PhotoSolution) -> str:
    """A few lines for a person: how the run ended, and what to be wary of."""
    solution = result.solution
    grey, photo = solution.grey_errors(), result.photo_errors()
    text = (
        f"{solution.status.name} after {solution.iterations} iterations in {solution.elapsed.total:.2f} s on "
        f"{solution.device.name}. {solution.status.value}\n"
        "Photographed again, the surface differs, in grey levels (0 to 255),\n"
        f"  from the prepared photo (clipped, filtered, normalised) by ME {grey.mean:.2f}, "
        f"RS {grey.root_mean_square:.2f},\n"
        f"  from the photo itself by ME {photo.mean:.2f}, RS {photo.root_mean_square:.2f}."
    )
    if clamped := int(solution.clamped.sum()):
        text += (
            f"\n{clamped} pixels are too dark for the light, and only --max-slope bounds their slope: "
            "mask them out if they are shadow or paint."
        )
    if unreached := int(solution.unreached.sum()):
        text += f"\n{unreached} pixels have no depth: no known depth can reach them."
    return text
