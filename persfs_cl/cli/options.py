"""What several commands have: camera, light, material, paint, and the keywords of a reconstruction."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, Literal, Optional, cast, get_args

import typer

from persfs_cl.camera import COMMON_VIEWS
from persfs_cl.cli.choosers import with_signature
from persfs_cl.cli.kinds import kind_chooser
from persfs_cl.cli.numbers import finite_numbers
from persfs_cl.cli.settings import MayBePath
from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import CameraError, InputError
from persfs_cl.lens.distortion import Distortion, as_distortion
from persfs_cl.lens.models import MODELS
from persfs_cl.pipeline.bounds import checked_bounds
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.frames import LEAST_SIZE
from persfs_cl.pipeline.guides import GuideFile, require_guided
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.complete import complete
from persfs_cl.solver.options import DESCRIBED, Option, Options
from persfs_cl.surface.formats.records import CAMERA

_CAMERA, _LIGHT, _MATERIAL, _REGION = "Camera", "Light", "Material", "Region and known values"
_EITHER = "'--focal-length' / '--fov'"

AlbedoOption = Annotated[
    Path | None,
    typer.Option(
        "--albedo",
        metavar="FILE",
        help="Paint: an image of the share of light that each pixel's surface returns, white all of it, or .npy.",
        rich_help_panel=_MATERIAL,
    ),
]


def _albedo(text: str) -> Path | Literal["fit"]:
    return "fit" if text == "fit" else Path(text)


AlbedoOrFitOption = Annotated[
    str | None,
    typer.Option(
        "--albedo",
        metavar="FILE|fit",
        help="Paint: an image of the share of light that each pixel's surface returns, white all of it, or .npy. fit "
        "finds it, with a guide and --scheme regularised.",
        rich_help_panel=_MATERIAL,
    ),
    MayBePath(_albedo),
]


def chosen_albedo(text: str | None) -> Path | Literal["fit"] | None:
    """What the option tells."""
    return None if text is None else _albedo(text)


def _mask(text: str) -> Path | Literal["auto"]:
    return "auto" if text == "auto" else Path(text)


MaskOption = Annotated[
    str | None,
    typer.Option(
        "--mask",
        metavar="FILE|auto",
        help="Image, white where to solve, or .npy of bool; auto finds the object where it stands out from a dark "
        "background. Transparent pixels of the photo are left out too.",
        rich_help_panel=_REGION,
    ),
    MayBePath(_mask),
]
MaskErodeOption = Annotated[
    int,
    typer.Option(
        "--mask-erode",
        metavar="PX",
        min=0,
        help="Leave out so many pixels along the outline of the mask.",
        rich_help_panel=_REGION,
    ),
]


def chosen_mask(text: str | None) -> Path | Literal["auto"] | None:
    """What the option tells."""
    return None if text is None else _mask(text)


def _bound(text: str) -> float | Path:
    try:
        return float(text)
    except ValueError:
        return Path(text)


NearOption = Annotated[
    str | None,
    typer.Option(
        "--near",
        metavar="DEPTH|FILE",
        help="No pixel is nearer than this: a number, or .npy or .tiff of one for each pixel, NaN where unknown.",
        rich_help_panel=_REGION,
    ),
    MayBePath(_bound),
]
FarOption = Annotated[
    str | None,
    typer.Option(
        "--far",
        metavar="DEPTH|FILE",
        help="No pixel is farther than this. With one of both nothing is taken to have depth 1.",
        rich_help_panel=_REGION,
    ),
    MayBePath(_bound),
]


def chosen_bounds(near: str | None, far: str | None) -> tuple[float | Path | None, float | Path | None]:
    """What the two options tell.

    Raises
    ------
    typer.BadParameter
        When a number is no depth, or they leave none between them.
    """
    try:
        nearest, farthest = checked_bounds(*(None if text is None else _bound(text) for text in (near, far)))
    except InputError as error:
        raise WrongOption(error) from error
    return nearest, farthest


SizeOption = Annotated[
    int | None,
    typer.Option(
        "--size",
        metavar="PX",
        min=LEAST_SIZE,
        help="Solve with the longer side reduced to so many pixels, by means over areas; camera, mask, guide and all "
        "that goes with the photo follow.",
        rich_help_panel=_CAMERA,
    ),
]

GuideOption = Annotated[
    Path | None,
    typer.Option(
        "--guide",
        metavar="FILE",
        help="What is coarsely known of the depth: a map of any size, .npy, .tiff, .png or .exr, or points, .csv, "
        ".json, .ply or COLMAP's points3D.txt.",
        rich_help_panel=_REGION,
    ),
]
GuideUnitOption = Annotated[
    float,
    typer.Option(
        "--guide-unit",
        metavar="UNIT",
        help="What its numbers are multiplied by: 0.001 for millimetres where depths are in metres.",
        rich_help_panel=_REGION,
    ),
]


def chosen_guide(file: Path | None, unit: float) -> GuideFile | None:
    """What the two options tell.

    Raises
    ------
    typer.BadParameter
        When the unit is none.
    """
    try:
        return None if file is None else GuideFile(file, unit)
    except InputError as error:
        raise WrongOption(error) from error


def require_together(
    *, keywords: Options, light: Light, reflectance: Reflectance, brightness: Brightness, **_others: object
) -> None:
    """Refuse options that contradict each other, whatever else is given.

    Raises
    ------
    typer.BadParameter
        When the light leaves nothing to normalise, or does not fit the other keywords, or these each other.
    """
    for option, value in (
        ("'--normalise'", brightness.normalise),
        ("'--white-percentile'", brightness.white_percentile),
        ("'--white-level'", brightness.white_level),
    ):
        if value not in (None, "none") and not light.normalised:
            raise typer.BadParameter("under a flash nothing is normalised: leave it out.", param_hint=option)
    try:
        complete({**keywords, "light": light, "reflectance": reflectance})
    except InputError as error:
        raise WrongOption(error) from error


def refuse_unguided(
    keywords: Options,
    light: Light,
    reflectance: Reflectance,
    *,
    albedo: Path | Literal["fit"] | None,
    guide_unit: float,
    guided: bool,
) -> None:
    """Refuse what wants a guide, or tells of it, where there is none, before any file is read.

    Raises
    ------
    typer.BadParameter
        When a light, an albedo or an option wants a guide and there is none.
    """
    options = complete({**keywords, "light": light, "reflectance": reflectance})
    if light.unknown is not None and not guided:
        raise typer.BadParameter(
            f"it is unknown, and found from a guide only: give '--guide', or the {light.unknown}.",
            param_hint=f"'--{light.unknown}'",
        )
    try:
        require_guided(options, albedo, guide_unit, guided=guided)
    except InputError as error:
        raise WrongOption(error) from error


def chosen_camera(
    focal_length: Annotated[
        str | None,
        typer.Option(
            "--focal-length",
            metavar="PX[,PX]",
            help="Focal length in pixels; two numbers, fx,fy, where pixels are not square.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(
            "--fov",
            metavar="DEGREES",
            help="Horizontal field of view, instead of the focal length.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
    principal_point: Annotated[
        str | None,
        typer.Option(
            "--principal-point",
            metavar="PX,PX",
            help="Column and row where the optical axis meets the image; the middle by default.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
    distortion: Annotated[
        str | None,
        typer.Option(
            "--distortion",
            metavar="K1,K2,P1,P2[,K3...]",
            help="How the lens bends lines, by OpenCV's coefficients; fisheye:K1,K2,K3,K4 for a fisheye lens, with "
            "four more numbers for its thin prism; fov:W for COLMAP's FOV, rad_tan_thin_prism_fisheye:... for that "
            "model of COLMAP's. The photo and all that goes with it are straightened.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
    camera: Annotated[
        Path | None,
        typer.Option(
            "--camera",
            metavar="FILE",
            help="The camera, instead: .yaml or .json as OpenCV writes them, or COLMAP's cameras.txt.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
) -> CameraChoice:
    """The camera that the options tell of.

    Raises
    ------
    typer.BadParameter
        When a text is no list of numbers, a number is impossible, or both --focal-length and --fov are given.
    PersfsError
        When the file of a camera cannot be used.
    """
    if camera is not None:
        if any(value is not None for value in (focal_length, fov, principal_point, distortion)):
            raise typer.BadParameter(
                "give a file, or the camera by the other options, not both.", param_hint="'--camera'"
            )
        return CameraChoice.of_file(camera)
    if focal_length is not None and fov is not None:
        raise typer.BadParameter("give one of the two, not both.", param_hint=_EITHER)
    length: float | tuple[float, float] | None = None
    if focal_length is not None:
        fx, *fy = finite_numbers("--focal-length", focal_length, "one number, or two, fx,fy, in pixels", (1, 2))
        length = (fx, fy[0]) if fy else fx
    point = None
    if principal_point is not None:
        column, row = finite_numbers("--principal-point", principal_point, "two numbers, column,row, in pixels", (2,))
        point = column, row
    try:
        choice = CameraChoice(length, fov, point, distortion=_distortion(distortion))
        if length is not None or fov is not None:
            choice.of(Path(), (1, 1))
    except CameraError as error:
        raise WrongOption(error, "'--distortion'" if error.argument == "distortion" else _EITHER) from error
    return choice


def _distortion(text: str | None) -> Distortion | None:
    """Coefficients with commas between, those of another lens behind the name of its model."""
    if text is None:
        return None
    name, colon, numbers = text.partition(":")
    if colon and name in MODELS:
        model = MODELS[name]
        # The last may be left out.
        counts = range(1, max(model.counts) + 1)
        most = f"up to {counts[-1]} numbers, " if len(counts) > 1 else ""
        return model.kind(*finite_numbers("--distortion", numbers, f"{most}{model.wanted}, behind {name}:", counts))
    meaning = f"4, 5, 8, 12 or 14 numbers, or {': or '.join(MODELS)}: and its numbers"
    return as_distortion(finite_numbers("--distortion", text, meaning, (4, 5, 8, 12, 14)))


def require_focal_length(choice: CameraChoice, depth: Path) -> None:
    """Refuse a command line that leaves the focal length to a photo's EXIF data, where there is only a depth map.

    Raises
    ------
    typer.BadParameter
        When neither --focal-length nor --fov is given.
    """
    if choice.focal_length is None and choice.fov is None:
        beside = depth.with_name(CAMERA)
        other = f", or --camera {beside}" if beside.is_file() else ""
        raise typer.BadParameter(
            f"give one of the two, in pixels or in degrees{other}. {COMMON_VIEWS}", param_hint=_EITHER
        )


chosen_light = kind_chooser("light", LIGHTS, _LIGHT)
chosen_reflectance = kind_chooser("reflectance", MATERIALS, _MATERIAL, naming=True)


def keyword_chooser(*names: str) -> Callable[..., Options]:
    """The chooser of keywords of :func:`persfs_cl.reconstruct`, checked one by one.

    Parameters
    ----------
    *names : str
        Which; all that the command has when none is named.
    """
    wanted = {name: about for name, about in DESCRIBED.items() if about[1].in_command and (not names or name in names)}

    def choose(**values: Any) -> Options:
        return cast("Options", values)  # each was checked

    return with_signature(choose, [_keyword(name, *about) for name, about in wanted.items()])


def _keyword(name: str, kind: Any, option: Option) -> Parameter:
    def check(value: Any) -> Any:
        try:
            return option.check(name, value)
        except InputError as error:
            raise WrongOption(error) from error

    named: Any = kind
    metavar = None
    choices = option.choices or tuple
    if str in get_args(kind):
        named = Optional[str]  # noqa: UP045  # whatever else it may be, it can be said by a text
    elif kind is str and option.choices:
        # The table that they come from may grow, and so they are checked when they are given.
        metavar = f"<{'|'.join(option.choices())}>"
    spelled = name.replace("_", "-")
    typed = typer.Option(
        f"--{spelled}/--no-{spelled}" if kind is bool else f"--{spelled}",
        metavar=metavar,
        help=option.help or None,
        callback=check,
        autocompletion=None if option.choices is None else lambda: list(choices()),
        rich_help_panel=option.panel,
    )
    return Parameter(name, Parameter.KEYWORD_ONLY, default=option.default, annotation=Annotated[named, typed])


chosen_device = keyword_chooser("device")
chosen_device_and_precision = keyword_chooser("device", "precision")
chosen_keywords = keyword_chooser()
