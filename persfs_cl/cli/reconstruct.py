"""``persfs-cl reconstruct``: one photo to a surface."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Annotated, Any

import numpy as np
import typer

from persfs_cl.cli.brightness import chosen_brightness
from persfs_cl.cli.choosers import takes
from persfs_cl.cli.config import configurable
from persfs_cl.cli.interrupts import stop_on_interrupt
from persfs_cl.cli.memory import keep_freed_memory
from persfs_cl.cli.options import (
    AlbedoOrFitOption,
    FarOption,
    GuideOption,
    GuideUnitOption,
    MaskErodeOption,
    MaskOption,
    NearOption,
    SizeOption,
    chosen_albedo,
    chosen_bounds,
    chosen_camera,
    chosen_guide,
    chosen_keywords,
    chosen_light,
    chosen_mask,
    chosen_reflectance,
    refuse_unguided,
    require_together,
)
from persfs_cl.cli.output import (
    DEFAULT_BASE,
    DEFAULT_WIDTH,
    BaseOption,
    MeshFacesOption,
    SaveOption,
    SolidOption,
    WidthOption,
    check_folder,
    check_inputs,
    chosen_saving,
)
from persfs_cl.cli.progress import progress_line, writing
from persfs_cl.cli.spelling import source_of_camera, spelling
from persfs_cl.cli.status import INPUT_FAILED, INTERRUPTED
from persfs_cl.errors import spelled
from persfs_cl.guide.fit import GuideFit
from persfs_cl.io.account import superseded, written_before
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.darkness import MANY
from persfs_cl.pipeline.job import Job, prepare, read_job, solve
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.plan import sources
from persfs_cl.pipeline.results import PhotoSolution, write
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.complete import default_tolerance
from persfs_cl.solver.options import Options
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.surface.jobs import threads_for
from persfs_cl.surface.outcome import Status
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, Saving
from persfs_cl.surface.writing import load_libraries
from persfs_cl.told import overhearing

_REGION = "Region and known values"

_MOST, _UNLIKE, _DETAIL = 0.95, 4.0, 0.05
"""Share of pixels whose difference from a guide is told; and the noises, and the share of the depth, beyond which it is
no detail that the guide lacks."""


@configurable
@takes(
    require_together,
    camera=chosen_camera,
    brightness=chosen_brightness,
    light=chosen_light,
    reflectance=chosen_reflectance,
    keywords=chosen_keywords,
)
def reconstruct(
    photo: Annotated[
        Path, typer.Argument(metavar="PHOTO", help="PNG, JPEG, TIFF, camera raw, WebP, AVIF, HEIC, JPEG 2000 or BMP.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results, made if needed.")
    ],
    *,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier run's results; files that are of none stay.")
    ] = False,
    camera: CameraChoice,
    light: Light,
    reflectance: Reflectance,
    albedo: AlbedoOrFitOption = None,
    brightness: Brightness,
    mask: MaskOption = None,
    mask_erode: MaskErodeOption = 0,
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
    near: NearOption = None,
    far: FarOption = None,
    guide: GuideOption = None,
    guide_unit: GuideUnitOption = 1.0,
    size: SizeOption = None,
    save: SaveOption = "depth,mesh,pictures,page,report,solution",
    mesh_faces: MeshFacesOption = DEFAULT_MESH_FACES,
    solid: SolidOption = False,
    width: WidthOption = DEFAULT_WIDTH,
    base: BaseOption = DEFAULT_BASE,
    keywords: Options,
    ctx: typer.Context,
) -> None:
    """Reconstruct the surface that one photo shows.

    The camera is told by --focal-length or --fov, or else by the photo's EXIF data. Writes what --save names: by
    default depth.npy, depth.tiff, solution.npz, report.json, mesh.ply, the pictures depth.png, normals.png, relief.png,
    rendered.png, comparison.png, confidence.png, convergence.png and with a guide guide.png, and index.html, a page on
    which the relief can be turned, with preview.jpg, photo.jpg and relief.js.
    """
    saving = chosen_saving(save, mesh_faces, solid=solid, width=width, base=base)
    paint = chosen_albedo(albedo)
    refuse_unguided(keywords, light, reflectance, albedo=paint, guide_unit=guide_unit, guided=guide is not None)
    nearest, farthest = chosen_bounds(near, far)
    job = Job(
        photo,
        camera,
        brightness,
        mask=chosen_mask(mask),
        mask_erode=mask_erode,
        walls=walls,
        known_depth=known_depth,
        albedo=paint,
        near=nearest,
        far=farthest,
        guide=chosen_guide(guide, guide_unit),
        light=light,
        reflectance=reflectance,
        keywords=keywords,
        size=size,
    )
    check_folder(output, overwrite=overwrite)
    inputs = tuple(sources(job).values())
    check_inputs(output, saving, inputs)
    if camera.table is not None:
        # Only that of an earlier run may make room for this run's, which says the same; where none comes, it stays.
        if camera.table.name not in written_before(output):
            check_inputs(output, saving, (camera.table,))
        inputs += (camera.table,)
    keep_freed_memory()
    tolerance, stopping = keywords["tolerance"], keywords["stopping"]
    if tolerance is None:
        tolerance = default_tolerance(keywords["scheme"], stopping)
    line = progress_line(tolerance, keywords["max_iterations"], stopping)
    with stop_on_interrupt() as interrupted, line as show, overhearing() as said:

        def after_iteration(iteration: int, change: float) -> bool:
            show(iteration, change)
            return interrupted()

        read = read_job(job)
        if threads_for(read.photo.image.size) > 1:
            Thread(target=load_libraries, args=(saving,)).start()
        result = solve(prepare(read), after_iteration)
        # It takes memory that files are made in.
        del read
        stopped = interrupted()
    spell = spelling(ctx.command.params)
    result = replace(result, warnings=tuple(dict.fromkeys(spelled(each, spell) for each in said)))
    try:
        with writing():
            files = write(result, output, saving, threads=threads_for(result.solution.depth.size), inputs=inputs)
    except KeyboardInterrupt:
        stopped = True
        saving = saving.without("pictures", "page")
        if not saving.files:
            raise
        given = {file.resolve() for file in inputs}
        others = {file.name for file in output.glob("*.png") if file.resolve() not in given}
        foreign = others - superseded(output, saving.files, inputs)
        remark = " PNG files in the folder are not of this run." if foreign else ""
        typer.echo(
            f"persfs-cl: interrupted; {_listed(saving)} still written, the pictures are not.{remark} Ctrl-C again to "
            "leave without.",
            err=True,
        )
        with writing():
            files = write(result, output, saving, threads=threads_for(result.solution.depth.size), inputs=inputs)
    for file in files:
        typer.echo(file)
    typer.echo(_summary(result, {file.name for file in files}), err=True)
    if _is_by_gain_1(light, ctx):
        typer.echo(
            f"--lamp counts in the unit of --gain 1, in which the median depth is {result.depths['median']:.4g}; "
            "angles of --lamp are as seen from depth 1.",
            err=True,
        )
    if stopped:
        raise typer.Exit(INTERRUPTED)
    # A warning has said why.
    if saving.lacking(file.name for file in files):
        raise typer.Exit(INPUT_FAILED)


def _listed(saving: Saving) -> str:
    """What is written, and the verb that goes with it."""
    names = sorted({Path(file).stem for file in saving.files})
    return f"{', '.join(names[:-1])} and {names[-1]} are" if len(names) > 1 else f"{names[0]} is"


def _distance(distance: float) -> str:
    """How far the depth is from what further iterations would come to, in words."""
    if math.isnan(distance):
        return ""
    return f"By the rate of the last iterations, further ones would change the depth by up to {100 * distance:.1g} %.\n"


def _mask(said: Mapping[str, Any], files: Collection[str]) -> str:
    """What a mask that was found has of the photo, in words."""
    if said["mask"] != "auto":
        return ""
    count = said["mask_pixels"]
    see = ", see outline.png" if "outline.png" in files else ""
    return f"The mask: {count} pixels ({100 * count / math.prod(said['size']):.2g} %){see}.\n"


def _is_by_gain_1(light: Light, ctx: typer.Context) -> bool:
    """Whether the lamp has a place in lengths whose unit nobody told."""
    source = ctx.get_parameter_source("gain")
    return light.off_axis and source is not None and source.name == "DEFAULT"


def _of_guide(fit: GuideFit, *, bounded: bool) -> str:
    """What became of the guide: a bound of the surface in the sweeps, a prior of it where energy is least."""
    gain = "" if fit.gain is None else f"the gain is {fit.gain:.4g}, "
    text = (
        f"Of the guide: {fit.used} of {fit.cells} values used, {gain}noise {100 * fit.noise:.2g} % of the depth; "
        "the surface "
    )
    if bounded:
        return f"{text}may be {100 * fit.tolerance:.2g} % nearer than it."
    apart = np.abs(fit.departure[np.isfinite(fit.departure)])
    if not apart.size:
        return f"{text}has no pixel in common with it."
    most = float(np.quantile(apart, _MOST))
    text += f"differs from it by up to {100 * math.expm1(most):.2g} % at {100 * _MOST:.0f} % of the pixels."
    if most > max(_UNLIKE * fit.tolerance, _DETAIL):
        text += " That is far more than the noise: check the light's direction, the camera, and --guide-unit."
    return text


def _summary(result: PhotoSolution, files: Collection[str]) -> str:
    """A few lines for a person: how the run ended, and what to be wary of."""
    solution = result.solution
    grey, photo = result.prepared_residual, result.photo_residual
    said, camera = result.report["photo"], result.report["camera"]
    steps = {
        "specks replaced": said["speck_pixels"] > 0,
        "clipped": said["clip_highlights"] is not None,
        "highlights filled": said["filled_pixels"] > 0,
        "denoised": said["denoise"] > 0,
        "filtered": said["mean_filter"] > 1,
    }
    prepared = ", ".join(step for step, done in steps.items() if done)
    text = (
        f"{solution.status.name} after {solution.iterations} iteration{'s' * (solution.iterations != 1)} in "
        f"{solution.elapsed.total:.2f} s on {solution.device.name}. {solution.status.value}\n"
        f"{_distance(solution.distance)}"
        f"{_mask(said, files)}"
        f"Focal length {solution.camera.fx:.6g} pixels, by {source_of_camera(camera['source'])}: "
        f"{camera['horizontal_view']:.3g} degrees from left to right.\n"
        "Re-rendered, the surface differs, in grey levels (0 to 255),\n"
    )
    if prepared:
        text += f"  from the prepared photo ({prepared}) by ME {grey.mean:.2f}, RS {grey.root_mean_square:.2f},\n"
    text += f"  from the photo itself by ME {photo.mean:.2f}, RS {photo.root_mean_square:.2f}."
    clamped, solved = int(solution.clamped.sum()), int(solution.solved.sum())
    # Of more, a warning has told.
    if 0 < clamped <= MANY * solved:
        text += (
            f"\n{clamped} pixels, {100 * clamped / solved:.2g} % of those with a depth, are too dark for the light, "
            "and only --max-slope bounds their slope: mask them out if they are shadow or paint."
        )
    if (fit := solution.guide) is not None:
        text += f"\n{_of_guide(fit, bounded=not SCHEMES[solution.parameters['scheme']].by_energy)}"
    elif said["guide"] is not None and solution.status is Status.STOPPED:
        text += "\nThe guide was not used yet when the run was ended."
    if at_bound := int(solution.at_bound.sum()):
        text += f"\n{at_bound} pixels lie on a bound of the depth, and not where the photo has them."
    if unreached := int(solution.unreached.sum()):
        text += f"\n{unreached} pixels have no depth: no known depth can reach them."
    if solution.walls is not None and not solution.walls.any():
        text += f"\n{said['walls']} has no white pixel where the photo is solved: there are no walls."
    elif solution.walls is not None:
        filled = int((solution.walls & solution.solved).sum())
        text += f"\n{filled} of {int(solution.walls.sum())} pixels on walls have got their depth from one of the sides."
    return text
