"""``persfs-cl reconstruct``: one photo to a surface."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer

from persfs_cl.choices import Boundary, Ordering, Scheme, Surface
from persfs_cl.cli.interrupts import stop_on_interrupt
from persfs_cl.cli.options import (
    AlbedoOption,
    DeviceOption,
    DiffuseOption,
    FalloffOption,
    FieldOfViewOption,
    FocalLengthOption,
    GainOption,
    LampOption,
    LightOption,
    P0Option,
    PrecisionOption,
    PrincipalPointOption,
    Q0Option,
    ReflectanceOption,
    RoughnessOption,
    ShininessOption,
    SpecularOption,
    chosen_camera,
    chosen_light,
    chosen_reflectance,
    finite,
    positive,
)
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.progress import progress_line, writing
from persfs_cl.cli.signals import INTERRUPTED
from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import InputError
from persfs_cl.io.photos import Channel, Encoding
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.job import Job, solve_photo
from persfs_cl.pipeline.results import PhotoSolution, write
from persfs_cl.preparation.prepare import Highlights, Normalise
from persfs_cl.shading.light import ParallelLight
from persfs_cl.shading.model import Model
from persfs_cl.solver.reconstruct import Options

_PHOTO, _REGION, _SOLVER = "Brightness of the photo", "Region and known values", "Solver"


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


def _vignetting(text: str) -> Literal["none", "cos4"] | Path:
    laws: dict[str, Literal["none", "cos4"]] = {"none": "none", "cos4": "cos4"}
    return laws.get(text) or Path(text)


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
    p0: P0Option = None,
    q0: Q0Option = None,
    gain: GainOption = None,
    falloff: FalloffOption = None,
    lamp: LampOption = None,
    reflectance: ReflectanceOption = "lambertian",
    roughness: RoughnessOption = None,
    diffuse: DiffuseOption = None,
    specular: SpecularOption = None,
    shininess: ShininessOption = None,
    albedo: AlbedoOption = None,
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
    ambient: Annotated[
        str,
        typer.Option(
            metavar="LEVEL|FILE",
            help="Light that is there without the lamp, or black level, to subtract: a number as the file holds it "
            "(0 to 255 with 8 bits), or a second photo without the lamp, or .npy of linear light.",
            rich_help_panel=_PHOTO,
        ),
    ] = "0",
    vignetting: Annotated[
        str,
        typer.Option(
            metavar="none|cos4|FILE",
            help="Darkening of the lens away from the middle, to undo: cos4 of the angle to the optical axis, or a "
            "photo of an evenly lit white plate, or .npy of linear light.",
            rich_help_panel=_PHOTO,
        ),
    ] = "none",
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
            "keeps the shading equation exact. grey: stretch from the darkest to the brightest, eq. (2) of the paper. "
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
            metavar="FILE",
            help="The same, white where the surface may jump: nothing crosses, and the mesh is cut there. White pixels "
            "get their depth from the side that they belong to.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    known_depth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Depths that are kept, .npy or .tiff, NaN where unknown, in any unit. "
            "Without it, under a parallel light, the edge of the image or mask has depth 1; a flash needs none.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    surface: Annotated[
        Surface,
        typer.Option(
            help="Whether the surface goes away from the camera, or comes toward it, from the known depths inwards. "
            "Under a flash the photo itself tells.",
            rich_help_panel=_REGION,
        ),
    ] = "away",
    boundary: Annotated[
        Boundary,
        typer.Option(
            help="On edges where no depth is known; auto: outflow for lax-friedrichs under a parallel light, "
            "else wall.",
            rich_help_panel=_SOLVER,
        ),
    ] = "auto",
    scheme: Annotated[
        Scheme,
        typer.Option(
            help="lax-friedrichs is the paper's, upwind sharper and faster. auto: the paper's under a parallel light, "
            "upwind under a flash where the material permits it.",
            rich_help_panel=_SOLVER,
        ),
    ] = "auto",
    ordering: Annotated[
        Ordering, typer.Option(help="Order of the pixels in a sweep.", rich_help_panel=_SOLVER)
    ] = "wavefront",
    accuracy_order: Annotated[
        int,
        typer.Option(
            min=1,
            max=2,
            help="2: once converged, upwind is corrected to second order where the surface is smooth.",
            rich_help_panel=_SOLVER,
        ),
    ] = 1,
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
        float | None,
        typer.Option(
            help="Bound on the slope where a pixel is too dark to set one; 30 by default, and 5 for upwind under a "
            "parallel light.",
            callback=positive,
            rich_help_panel=_SOLVER,
        ),
    ] = None,
    device: DeviceOption = None,
    precision: PrecisionOption = "float32",
) -> None:
    """Reconstruct the surface that one photo shows.

    The camera is told by --focal-length or --fov, or else by the photo's EXIF data. Writes depth.npy, depth.tiff,
    mesh.ply, report.json and the pictures depth.png, normals.png, relief.png, rendered.png, comparison.png,
    confidence.png and convergence.png.
    """
    camera = chosen_camera(focal_length, fov, principal_point)
    brightness = Brightness(
        channel,
        encoding,
        _ambient(ambient),
        _vignetting(vignetting),
        highlights,
        saturation,
        clip_highlights,
        mean_filter,
        normalise,
        white_percentile,
    )
    lit_by = chosen_light(light, p0, q0, gain, falloff, lamp)
    material = chosen_reflectance(reflectance, roughness, diffuse, specular, shininess)
    for option, value in (("'--normalise'", normalise), ("'--white-percentile'", white_percentile)):
        if value not in (None, "none") and not isinstance(lit_by, ParallelLight):
            raise typer.BadParameter("under a flash nothing is normalised: leave it out.", param_hint=option)
    if normalise == "none" and white_percentile is not None:
        raise typer.BadParameter("nothing is normalised: leave it out.", param_hint="'--white-percentile'")
    try:
        model = Model.of(lit_by, material)
        options = Options(
            surface=surface,
            boundary=boundary,
            scheme=scheme,
            ordering=ordering,
            precision=precision,
            accuracy_order=accuracy_order,
            max_iterations=max_iterations,
            tolerance=tolerance,
            max_slope=max_slope,
        )
        options.resolved(model, model.scheme(scheme))
    except InputError as error:
        raise WrongOption(error) from error
    job = Job(
        photo,
        camera,
        brightness,
        mask=mask,
        walls=walls,
        known_depth=known_depth,
        albedo=albedo,
        light=lit_by,
        reflectance=material,
        keywords={
            "surface": surface,
            "boundary": boundary,
            "scheme": scheme,
            "ordering": ordering,
            "accuracy_order": accuracy_order,
            "max_iterations": max_iterations,
            "tolerance": tolerance,
            "max_slope": max_slope,
            "device": device,
            "precision": precision,
        },
    )
    check_folder(output, overwrite=overwrite)
    with stop_on_interrupt() as interrupted, progress_line(tolerance, max_iterations) as show:

        def after_iteration(iteration: int, change: float) -> bool:
            show(iteration, change)
            return interrupted()

        result = solve_photo(job, after_iteration)
        stopped = interrupted()
    try:
        with writing():
            files = write(result, output)
    except KeyboardInterrupt:
        stopped = True
        earlier = " Those in the folder are of an earlier run." if any(output.glob("*.png")) else ""
        typer.echo(
            f"persfs-cl: interrupted; depth, mesh and report are still written, the pictures are not.{earlier} Ctrl-C "
            "again to leave without.",
            err=True,
        )
        with writing():
            files = write(result, output, pictures=False)
    for file in files:
        typer.echo(file)
    typer.echo(_summary(result), err=True)
    if stopped:
        raise typer.Exit(INTERRUPTED)


def _summary(result: PhotoSolution) -> str:
    """A few lines for a person: how the run ended, and what to be wary of."""
    solution = result.solution
    grey, photo = result.prepared_errors, result.photo_errors
    said, camera = result.report["photo"], result.report["camera"]
    steps = {
        "clipped": said["clip_highlights"] is not None,
        "highlights filled": said["filled_pixels"] > 0,
        "filtered": said["mean_filter"] > 1,
    }
    prepared = ", ".join(step for step, done in steps.items() if done)
    text = (
        f"{solution.status.name} after {solution.iterations} iteration{'s' * (solution.iterations != 1)} in "
        f"{solution.elapsed.total:.2f} s on {solution.device.name}. {solution.status.value}\n"
        f"Focal length {solution.camera.fx:.6g} pixels, by {camera['source']}: {camera['horizontal_view']:.3g} degrees "
        "from left to right.\n"
        "Photographed again, the surface differs, in grey levels (0 to 255),\n"
    )
    if prepared:
        text += f"  from the prepared photo ({prepared}) by ME {grey.mean:.2f}, RS {grey.root_mean_square:.2f},\n"
    text += f"  from the photo itself by ME {photo.mean:.2f}, RS {photo.root_mean_square:.2f}."
    if clamped := int(solution.clamped.sum()):
        text += (
            f"\n{clamped} pixels are too dark for the light, and only --max-slope bounds their slope: "
            "mask them out if they are shadow or paint."
        )
    if unreached := int(solution.unreached.sum()):
        text += f"\n{unreached} pixels have no depth: no known depth can reach them."
    if solution.walls is not None and not solution.walls.any():
        text += f"\n{said['walls']} has no white pixel where the photo is solved: there are no walls."
    elif solution.walls is not None:
        filled = int((solution.walls & solution.solved).sum())
        text += f"\n{filled} of {int(solution.walls.sum())} pixels on walls have got their depth from one of the sides."
    return text
