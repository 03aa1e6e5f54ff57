"""Options that several commands have, and how their texts become numbers, cameras, lights and materials."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from persfs_cl.choices import Precision
from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import CameraError, InputError
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.shading.light import FlashLight, Light, ParallelLight
from persfs_cl.shading.material import Lambertian, OrenNayar, Phong, Reflectance

LightKind = Literal["parallel", "flash"]
ReflectanceKind = Literal["lambertian", "oren-nayar", "phong"]

_CAMERA, _LIGHT, _MATERIAL, _DEVICE = "Camera", "Light", "Material", "Device"
_EITHER = "'--focal-length' / '--fov'"
_LARGEST_ANGLE = 80.0


def finite(value: float | None) -> float | None:
    """Refuse nan and inf, which Python takes for numbers."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number.")
    return value


def positive(value: float | None) -> float | None:
    """Refuse what is not a finite number above 0."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a finite number above 0.")
    return value


FocalLengthOption = Annotated[
    str | None,
    typer.Option(
        "--focal-length",
        metavar="PX[,PX]",
        help="Focal length in pixels; two numbers, fx,fy, where pixels are not square.",
        rich_help_panel=_CAMERA,
    ),
]
FieldOfViewOption = Annotated[
    float | None,
    typer.Option(
        "--fov",
        metavar="DEGREES",
        help="Horizontal field of view, instead of the focal length.",
        rich_help_panel=_CAMERA,
    ),
]
PrincipalPointOption = Annotated[
    str | None,
    typer.Option(
        "--principal-point",
        metavar="PX,PX",
        help="Column and row where the optical axis meets the image; the middle by default.",
        rich_help_panel=_CAMERA,
    ),
]
LightOption = Annotated[
    LightKind,
    typer.Option(
        "--light",
        help="parallel: a light far away, the paper's s = (-p0, -q0, 1). flash: a lamp at the camera, or close by, as "
        "of a phone or an endoscope.",
        rich_help_panel=_LIGHT,
    ),
]
P0Option = Annotated[
    float | None,
    typer.Option(
        "--p0",
        help="Slope of the parallel light, 0 by default: above 0 the lamp is left of the camera.",
        callback=finite,
        rich_help_panel=_LIGHT,
    ),
]
Q0Option = Annotated[
    float | None,
    typer.Option(
        "--q0",
        help="Slope of the parallel light, 0 by default: above 0 the lamp is above the camera.",
        callback=finite,
        rich_help_panel=_LIGHT,
    ),
]
GainOption = Annotated[
    float | None,
    typer.Option(
        "--gain",
        metavar="BRIGHTNESS",
        help="Of the flash: brightness, in linear light, of a white surface that faces it at distance 1; 1 by default. "
        "It sets the unit of depth.",
        callback=positive,
        rich_help_panel=_LIGHT,
    ),
]
FalloffOption = Annotated[
    bool | None,
    typer.Option(
        "--falloff/--no-falloff",
        help="Whether the flash fades with the square of the distance, as by default, or the photo was corrected for "
        "that.",
        show_default=False,
        rich_help_panel=_LIGHT,
    ),
]
LampOption = Annotated[
    str | None,
    typer.Option(
        "--lamp",
        metavar="X,Y,Z",
        help="Where the flash is, to the right of the camera, below it and in front of it, in units of depth; 0,0,0 by "
        "default. Or as an angle between camera and flash, seen from depth 1: 0,-5deg,0.",
        rich_help_panel=_LIGHT,
    ),
]
ReflectanceOption = Annotated[
    ReflectanceKind,
    typer.Option(
        "--reflectance",
        help="lambertian: perfectly matt. oren-nayar: rough, as plaster. phong: with a highlight, as wet tissue.",
        rich_help_panel=_MATERIAL,
    ),
]
RoughnessOption = Annotated[
    float | None,
    typer.Option(
        "--roughness",
        metavar="RADIANS",
        help="Of oren-nayar, which needs it: spread of the slopes of the facets; 0 is smooth, 0.5 rough.",
        rich_help_panel=_MATERIAL,
    ),
]
DiffuseOption = Annotated[
    float | None,
    typer.Option("--diffuse", help="Of phong: the matt part; 0.7 by default.", rich_help_panel=_MATERIAL),
]
SpecularOption = Annotated[
    float | None,
    typer.Option("--specular", help="Of phong: the highlight; 0.3 by default.", rich_help_panel=_MATERIAL),
]
ShininessOption = Annotated[
    float | None,
    typer.Option(
        "--shininess", help="Of phong: the higher, the smaller the highlight; 10 by default.", rich_help_panel=_MATERIAL
    ),
]
AlbedoOption = Annotated[
    Path | None,
    typer.Option(
        "--albedo",
        metavar="FILE",
        help="Paint: an image of the share of light that each pixel's surface returns, white all of it, or .npy.",
        rich_help_panel=_MATERIAL,
    ),
]
DeviceOption = Annotated[
    str | None,
    typer.Option(
        "--device",
        help="'cpu', 'gpu', a number of 'persfs-cl devices', or part of a name; the first by default.",
        rich_help_panel=_DEVICE,
    ),
]
PrecisionOption = Annotated[Precision, typer.Option("--precision", rich_help_panel=_DEVICE)]


def chosen_camera(focal_length: str | None, fov: float | None, principal_point: str | None) -> CameraChoice:
    """The camera that the options tell of.

    Raises
    ------
    typer.BadParameter
        When a text is no list of numbers, a number is impossible, or both --focal-length and --fov are given.
    """
    if focal_length is not None and fov is not None:
        raise typer.BadParameter("give one of the two, not both.", param_hint=_EITHER)
    length: float | tuple[float, float] | None = None
    if focal_length is not None:
        fx, *fy = _numbers("--focal-length", focal_length, "one number, or two, fx,fy", (1, 2))
        length = (fx, fy[0]) if fy else fx
    point = None
    if principal_point is not None:
        column, row = _numbers("--principal-point", principal_point, "two numbers, column,row", (2,))
        point = column, row
    choice = CameraChoice(length, fov, point)
    if length is not None or fov is not None:
        try:
            choice.of(Path(), (1, 1))
        except CameraError as error:
            raise WrongOption(error, _EITHER) from error
    return choice


def require_focal_length(choice: CameraChoice) -> None:
    """Refuse a command line that leaves the focal length to a photo's EXIF data, where there is no photo.

    Raises
    ------
    typer.BadParameter
        When neither --focal-length nor --fov is given.
    """
    if choice.focal_length is None and choice.fov is None:
        raise typer.BadParameter("give one of the two.", param_hint=_EITHER)


def chosen_light(
    kind: LightKind, p0: float | None, q0: float | None, gain: float | None, falloff: bool | None, lamp: str | None
) -> Light:
    """The light that the options tell of.

    Raises
    ------
    typer.BadParameter
        When an option belongs to the other light, or a number is impossible.
    """
    offset = None if lamp is None else _place_of_lamp(lamp)
    keywords = _own(
        "--light",
        kind,
        {
            "parallel": {"--p0": ("p0", p0), "--q0": ("q0", q0)},
            "flash": {"--gain": ("gain", gain), "--no-falloff": ("falloff", falloff), "--lamp": ("offset", offset)},
        },
    )
    try:
        return ParallelLight(**keywords) if kind == "parallel" else FlashLight(**keywords)
    except InputError as error:
        raise WrongOption(error, "'--light'") from error


def chosen_reflectance(
    kind: ReflectanceKind,
    roughness: float | None,
    diffuse: float | None,
    specular: float | None,
    shininess: float | None,
) -> Reflectance:
    """The material that the options tell of.

    Raises
    ------
    typer.BadParameter
        When an option belongs to another material, one that is needed is missing, or a number is impossible.
    """
    keywords = _own(
        "--reflectance",
        kind,
        {
            "lambertian": {},
            "oren-nayar": {"--roughness": ("roughness", roughness)},
            "phong": {
                "--diffuse": ("diffuse", diffuse),
                "--specular": ("specular", specular),
                "--shininess": ("shininess", shininess),
            },
        },
    )
    if kind == "oren-nayar" and roughness is None:
        raise typer.BadParameter("oren-nayar needs it: 0 is smooth, 0.5 rough.", param_hint="'--roughness'")
    try:
        materials: dict[str, Callable[..., Reflectance]] = {
            "lambertian": Lambertian,
            "oren-nayar": OrenNayar,
            "phong": Phong,
        }
        return materials[kind](**keywords)
    except InputError as error:
        raise WrongOption(error, "'--reflectance'") from error


def _own(option: str, choice: str, given: Mapping[str, Mapping[str, tuple[str, Any]]]) -> dict[str, Any]:
    """Keywords and values of the options that go with a choice; those of other choices must not be given."""
    for other, options in given.items():
        for name, (_, value) in options.items():
            if value is not None and other != choice:
                raise typer.BadParameter(f"goes with {option} {other}, not {choice}: leave it out.", param_hint=name)
    return {keyword: value for keyword, value in given[choice].values() if value is not None}


def _place_of_lamp(text: str) -> tuple[float, ...]:
    """Numbers, or angles such as 5deg between camera and lamp, as seen from depth 1."""
    try:
        parts = [str(_tangent(part)) if part.strip().endswith("deg") else part for part in text.split(",")]
    except ValueError as error:
        message = f"{text!r} is not a place: an angle is a number of degrees between -80 and 80, as in 5deg."
        raise typer.BadParameter(message, param_hint="'--lamp'") from error
    return tuple(_numbers("--lamp", ",".join(parts), "three numbers, right,down,forward", (3,), ""))


def _tangent(angle: str) -> float:
    """Of an angle such as 5deg."""
    degrees = float(angle.strip().removesuffix("deg"))
    # Written so that a NaN is refused too.
    if not abs(degrees) <= _LARGEST_ANGLE:
        raise ValueError(angle)
    return math.tan(math.radians(degrees))


def _numbers(option: str, text: str, meaning: str, counts: tuple[int, ...], unit: str = ", in pixels") -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"{text!r} is not {meaning}{unit}.", param_hint=f"'{option}'")
    return numbers
