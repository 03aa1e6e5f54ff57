"""Options that several commands have, and how their texts become numbers and cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from persfs_cl.camera import Camera
from persfs_cl.errors import CameraError

Precision = Literal["float32", "float64"]

_CAMERA, _LIGHT, _DEVICE = "Camera", "Light", "Device"
_EITHER = "'--focal-length' / '--fov'"


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
    Literal["parallel"],
    typer.Option("--light", help="A light far away, the paper's s = (-p0, -q0, 1).", rich_help_panel=_LIGHT),
]
P0Option = Annotated[
    float,
    typer.Option(
        "--p0",
        help="Slope of the light: above 0 the lamp is left of the camera.",
        callback=finite,
        rich_help_panel=_LIGHT,
    ),
]
Q0Option = Annotated[
    float,
    typer.Option(
        "--q0",
        help="Slope of the light: above 0 the lamp is above the camera.",
        callback=finite,
        rich_help_panel=_LIGHT,
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


@dataclass(frozen=True)
class CameraOptions:
    """What the command line says of the camera.

    Attributes
    ----------
    focal_length : float, (float, float) or None
        In pixels.
    fov : float or None
        Horizontal, in degrees.
    principal_point : (float, float) or None
        Column and row in pixels.
    """

    focal_length: float | tuple[float, float] | None
    fov: float | None
    principal_point: tuple[float, float] | None

    @classmethod
    def parse(cls, focal_length: str | None, fov: float | None, principal_point: str | None) -> CameraOptions:
        """Read the texts of the options.

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
        options = cls(length, fov, point)
        if length is not None or fov is not None:
            try:
                options.camera(Path(), (1, 1))
            except CameraError as error:
                raise typer.BadParameter(str(error), param_hint=_EITHER) from error
        return options

    def require(self) -> None:
        """Refuse a command line that leaves the focal length to a photo's EXIF data, where there is no photo.

        Raises
        ------
        typer.BadParameter
            When neither --focal-length nor --fov is given.
        """
        if self.focal_length is None and self.fov is None:
            raise typer.BadParameter("give one of the two.", param_hint=_EITHER)

    def camera(self, path: Path, shape: tuple[int, int]) -> Camera:
        """The camera of an image.

        Parameters
        ----------
        path : Path
            The image's file; its EXIF data say the focal length where the options do not.
        shape : (int, int)
            (height, width) of the image.

        Raises
        ------
        CameraError
            When the EXIF data lack the focal length.
        """
        if self.focal_length is not None:
            return Camera(self.focal_length, self.principal_point)
        if self.fov is not None:
            return Camera.from_fov(self.fov, shape, self.principal_point)
        return replace(Camera.from_exif(path), principal_point=self.principal_point)


def _numbers(option: str, text: str, meaning: str, counts: tuple[int, ...]) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"{text!r} is not {meaning}, in pixels.", param_hint=f"'{option}'")
    return numbers
