"""``persfs-cl batch``: any number of photos to surfaces."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from persfs_cl.cli.alike import Alike
from persfs_cl.cli.batch_progress import Tally, progress_bar
from persfs_cl.cli.brightness import chosen_brightness
from persfs_cl.cli.choosers import takes
from persfs_cl.cli.config import configurable
from persfs_cl.cli.interrupts import stop_on_interrupt
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
    chosen_saving,
)
from persfs_cl.cli.settings import MayBePath
from persfs_cl.cli.spelling import WrongOption, in_a_line, source_of_camera, spelling
from persfs_cl.cli.status import INPUT_FAILED, INTERRUPTED
from persfs_cl.errors import InputError, PersfsError
from persfs_cl.io.video import frame_slice
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.cameras import read_cameras
from persfs_cl.pipeline.headers import look
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.pages import publish, title_of
from persfs_cl.pipeline.plan import DEFAULT_ITEMS, Plan
from persfs_cl.pipeline.remote_store import store_for
from persfs_cl.pipeline.run import Again, Batch, BatchResult
from persfs_cl.pipeline.shards import Shard, as_shard
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workforce import workforce
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.options import Options
from persfs_cl.surface.saving import DEFAULT_MESH_FACES
from persfs_cl.told import hearing
from persfs_cl.wording import Spelling


def _scheduler(text: str) -> str | Path:
    """Addresses have a colon before the port."""
    return text if ":" in text else Path(text)


_INPUTS, _REGION, _AGAIN, _WORK = "Inputs", "Region and known values", "Running again", "Work"
_FOLDERS = {"mask": "masks", "guide": "guides"}
"""What is one for all photos or, by another option, in a folder with one for each."""
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


@configurable
@takes(
    require_together,
    camera=chosen_camera,
    brightness=chosen_brightness,
    light=chosen_light,
    reflectance=chosen_reflectance,
    keywords=chosen_keywords,
)
def batch(
    ctx: typer.Context,
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATHS...",
            help="Photos, folders with photos, patterns such as 'in/**/*.jpg', videos, or lists: .txt files with a "
            "path a line, - for one on standard input.",
        ),
    ],
    output: Annotated[
        str,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results, or a URL that fsspec writes to."),
    ],
    *,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Say what would be done, and which photos headers show to be unusable; do nothing."
        ),
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Do all photos, whatever was done before.", rich_help_panel=_AGAIN)
    ] = False,
    skip_existing: Annotated[
        bool,
        typer.Option(
            "--skip-existing",
            help="Do none that has results, though its file or the options have changed.",
            rich_help_panel=_AGAIN,
        ),
    ] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Do only those that failed before.", rich_help_panel=_AGAIN)
    ] = False,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="START:STOP:STEP", help="Which frames of videos; all by default.", rich_help_panel=_INPUTS
        ),
    ] = None,
    camera: CameraChoice,
    cameras: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Table of cameras, .csv or .json, by the paths of photos; or COLMAP's cameras.txt, beside images.txt.",
            rich_help_panel="Camera",
        ),
    ] = None,
    light: Light,
    reflectance: Reflectance,
    albedo: AlbedoOrFitOption = None,
    brightness: Brightness,
    mask: MaskOption = None,
    masks: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder with a mask for each photo: that of a/b.jpg is a/b.jpg.png.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    mask_erode: MaskErodeOption = 0,
    walls: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="One for all: white where the surface may jump.", rich_help_panel=_REGION),
    ] = None,
    known_depth: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="One for all: depths that are kept, NaN where unknown.", rich_help_panel=_REGION
        ),
    ] = None,
    near: NearOption = None,
    far: FarOption = None,
    guide: GuideOption = None,
    guides: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder with a guide for each photo: that of a/b.jpg is a/b.jpg.npy, or has another suffix.",
            rich_help_panel=_REGION,
        ),
    ] = None,
    guide_unit: GuideUnitOption = 1.0,
    size: SizeOption = None,
    save: SaveOption = DEFAULT_ITEMS,
    mesh_faces: MeshFacesOption = DEFAULT_MESH_FACES,
    solid: SolidOption = False,
    width: WidthOption = DEFAULT_WIDTH,
    base: BaseOption = DEFAULT_BASE,
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="I/N",
            help="Do the I-th of N shares, on as many machines that share the output.",
            rich_help_panel=_WORK,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Have it done by the workers of this scheduler of Dask, those with the resource 'device': its "
            "address, or the file that it describes itself in.",
            rich_help_panel=_WORK,
        ),
        MayBePath(_scheduler),
    ] = None,
    memory: Annotated[
        str | None,
        typer.Option(
            metavar="BYTES",
            help="What photos in work may take together, such as 8G; half of the memory by default.",
            rich_help_panel=_WORK,
        ),
    ] = None,
    keywords: Options,
) -> None:
    """Reconstruct the surfaces that many photos show.

    Every photo has a folder of results, named after it: those of IN/a/b.png, where IN is given, are in DIR/a/b.png.
    DIR/index.html shows all of them. The same command again does what is missing, failed or has changed. --device all
    uses every device.
    """
    options = {"--overwrite": overwrite, "--skip-existing": skip_existing, "--retry-failed": retry_failed}
    if len(chosen := [option for option, is_given in options.items() if is_given]) > 1:
        raise typer.BadParameter("give one of these, not several.", param_hint=" / ".join(f"'{one}'" for one in chosen))
    kinds: dict[str, Again] = {"--overwrite": "all", "--skip-existing": "none", "--retry-failed": "failed"}
    again: Again = kinds[chosen[0]] if chosen else "changed"
    if cameras is not None and camera != CameraChoice():
        raise typer.BadParameter(
            "give a table, or one camera for all by --focal-length, --fov or --principal-point, not both.",
            param_hint="'--cameras'",
        )
    if mask is not None and masks is not None:
        raise typer.BadParameter(
            "give one mask for all, or a folder of them, not both.", param_hint="'--mask' / '--masks'"
        )
    saving = chosen_saving(save, mesh_faces, solid=solid, width=width, base=base)
    share, room = _share(shard), _bytes(memory)
    paint, guided = chosen_albedo(albedo), guide is not None or guides is not None
    refuse_unguided(keywords, light, reflectance, albedo=paint, guide_unit=guide_unit, guided=guided)
    try:
        frame_slice(frames)
    except InputError as error:
        raise WrongOption(error) from error
    if guide is not None and guides is not None:
        raise typer.BadParameter(
            "give one guide for all, or a folder of them, not both.", param_hint="'--guide' / '--guides'"
        )
    nearest, farthest = chosen_bounds(near, far)
    plan = Plan(
        camera=camera,
        cameras=None if cameras is None else read_cameras(cameras),
        masks=masks,
        mask=chosen_mask(mask),
        mask_erode=mask_erode,
        walls=walls,
        known_depth=known_depth,
        albedo=paint,
        near=nearest,
        far=farthest,
        guides=guides,
        guide=chosen_guide(guide, guide_unit),
        guide_unit=guide_unit,
        size=size,
        brightness=brightness,
        light=light,
        reflectance=reflectance,
        keywords=keywords,
        saving=saving,
        spelling=spelling(
            ctx.command.params,
            instead={one: all_of_them for one, all_of_them in _FOLDERS.items() if ctx.params[all_of_them] is not None},
        ),
    )
    plan.require_files()
    store = store_for(output)
    root = store.root if isinstance(store, FolderStore) else None
    if root is not None and root.exists() and not root.is_dir():
        raise typer.BadParameter(f"{root} is a file: name a folder.", param_hint="'--output' / '-o'")
    try:
        listing = list_inputs(paths, output=root, masks=masks, frames=frames)
    except InputError as error:
        raise WrongOption(error) from error
    whole = Batch(listing, plan, store, again=again, shard=share)
    if dry_run:
        _look(whole, plan.spelling)
        return
    tally = Tally(plan.spelling, saving)
    if not listing.inputs:
        # Such as a path with a slip in it: nothing is made for that.
        slips = Alike(every_name=True)
        for place, why in listing.problems:
            slips.add(place, Path(place), in_a_line(why, plan.spelling))
        for line in slips.lines():
            typer.echo(line, err=True)
        if slips.more:
            typer.echo(f"and {slips.more} more.", err=True)
        raise typer.Exit(INPUT_FAILED)
    try:
        workers = workforce(plan, store, keywords["device"], room, scheduler)
    except InputError as error:
        raise WrongOption(error) from error
    try:
        with stop_on_interrupt("what is in hand is dropped.") as interrupted:
            interrupted()
            with progress_bar(whole, tally) as show:
                for result in whole.results(workers, interrupted):
                    tally.add(result)
                    show(f"{store}/{result.name}" if result.error is None else "")
            stopped = interrupted()
        tally.skipped, tally.lacking_before = whole.skipped, whole.lacking
        typer.echo(tally.told(), err=True, nl=False)
        try:
            names = publish(store, listing.inputs, title=title_of(paths), parameters=plan.parameters())
        except InputError:
            typer.echo(tally.summary(), err=True)
            raise
    except KeyboardInterrupt:
        tally.skipped = whole.skipped
        typer.echo(f"persfs-cl: {tally.left(whole.total)}", err=True)
        raise typer.Exit(INTERRUPTED) from None
    typer.echo(f"{tally.summary()} See {store}/{names[0]}.", err=True)
    if stopped:
        typer.echo(f"persfs-cl: {tally.left(whole.total)}", err=True)
        raise typer.Exit(INTERRUPTED)
    if tally.failed or tally.lacking or tally.lacking_before:
        raise typer.Exit(INPUT_FAILED)


def _look(whole: Batch, spell: Spelling) -> None:
    """Say of every photo what would be done with it, as far as headers tell.

    Raises
    ------
    typer.Exit
        When some cannot be used.
    """
    usable = failed = 0
    pixels = 0.0
    failures, warnings = Alike(every_name=True), Alike(every_name=False)
    for one in whole.pending():
        if isinstance(one, BatchResult):
            name, path, error = one.name, one.path, one.error
        else:
            name, path, error = one.name, one.job.path, None
            try:
                with hearing() as said:
                    found = look(one.job)
            except PersfsError as refusal:
                error = refusal
            else:
                for text in dict.fromkeys(in_a_line(heard.warning, spell) for heard in said):
                    warnings.add(name, path, text)
                usable, pixels = usable + 1, pixels + found.megapixels
                height, width = found.size
                source = source_of_camera(found.camera_source)
                camera = f"{found.camera.fx:.6g} px, {found.horizontal_view:.3g} degrees, by {source}"
                mask = one.job.mask or "no mask"
                typer.echo(f"{name}\t{width} x {height}\t{camera}\t{mask}")
        if error is not None:
            failed += 1
            failures.add(name, path, in_a_line(error, spell))
    for line in (*warnings.lines("warning: "), *failures.lines()):
        typer.echo(line, err=True)
    if failures.more:
        typer.echo(f"and {failures.more} more.", err=True)
    parts = [f"{usable} would be done, {pixels:.4g} million pixels"]
    parts += [f"{whole.skipped} were done before"] * bool(whole.skipped)
    parts += [f"{failed} cannot be used"] * bool(failed)
    typer.echo(f"{', '.join(parts)}. Nothing was done.", err=True)
    if failed:
        raise typer.Exit(INPUT_FAILED)


def _share(text: str | None) -> Shard | None:
    if text is None:
        return None
    numbers = re.fullmatch(r"\s*(\d{1,9})\s*/\s*(\d{1,9})\s*", text)
    if numbers is None:
        raise typer.BadParameter(f"{text!r} is no share: give 2/8 for the second of eight.", param_hint="'--shard'")
    try:
        return as_shard((int(numbers[1]), int(numbers[2])))
    except InputError as error:
        raise WrongOption(error, "'--shard'") from error


def _bytes(text: str | None) -> int | None:
    if text is None:
        return None
    found = re.fullmatch(r"\s*(\d{1,15}(?:\.\d{1,6})?)\s*([KMGT]?)(?:i?B)?\s*", text, re.IGNORECASE)
    size = int(float(found[1]) * _UNITS[found[2].upper()]) if found else 0
    if size < 1:
        raise typer.BadParameter(f"{text!r} is no size: give bytes, such as 8G or 500M.", param_hint="'--memory'")
    return size
