"""Files that guide a reconstruction: coarse maps of the depth, and points, of one photo."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.checks import as_number
from persfs_cl.errors import InputError
from persfs_cl.guide.guide import Points
from persfs_cl.io.clouds import read_cloud
from persfs_cl.io.colmap import read_colmap_points
from persfs_cl.io.files import opened
from persfs_cl.io.maps import read_numbers
from persfs_cl.io.points import read_points
from persfs_cl.solver.complete import require_guide
from persfs_cl.solver.given import require_albedo_to_fit
from persfs_cl.solver.options import Options
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.wording import keyword

_MAPS = (".npy", ".tiff", ".tif", ".exr", ".png")
SUFFIXES = (*_MAPS, ".csv", ".json", ".ply", ".txt")
"""Of files that are guides, in the order in which they are looked for."""


@dataclass(frozen=True)
class GuideFile:
    """A file, and the unit of its numbers.

    Parameters
    ----------
    path : Path
        A map: `.npy`, `.tiff`, `.png`, `.exr`. Points: `.csv` or `.json` of column, row and depth, `.ply` in the
        camera's axes, or COLMAP's `points3D.txt` with `images.txt`, and `cameras.txt` if there is
        one, beside it.
    unit : float
        What its numbers are multiplied by: 0.001 for millimetres where depths are in metres.

    Raises
    ------
    InputError
        When the unit is not a finite number above 0.
    """

    path: Path
    unit: float = 1.0

    def __post_init__(self) -> None:
        unit = as_number("guide_unit", self.unit, above=0.0, what="a unit", hint=", such as 0.001 for millimetres")
        object.__setattr__(self, "unit", unit)

    @property
    def beside(self) -> tuple[Path, ...]:
        """Other files that it is read with."""
        if self.path.suffix.lower() != ".txt":
            return ()
        cameras = self.path.with_name("cameras.txt")
        return (self.path.with_name("images.txt"), *((cameras,) if cameras.exists() else ()))

    def check(self) -> None:
        """Refuse a file that is missing, empty, or no guide by its name.

        Raises
        ------
        InputError
            Naming it.
        """
        if self.path.suffix.lower() not in SUFFIXES:
            raise InputError(
                f"{self.path} is no guide by its name: give a map, {', '.join(_MAPS)}, or points, .csv, .json, .ply or "
                "COLMAP's points3D.txt."
            )
        for file in (self.path, *self.beside):
            with opened(file):
                pass

    def read(self, photo: Path, camera: Camera, shape: tuple[int, int], *, orientation: int = 1) -> Array | Points:
        """What it says of a photo, of some height and width and EXIF orientation.

        Raises
        ------
        InputError
            When it cannot be read, or says nothing of the photo.
        """
        self.check()
        suffix = self.path.suffix.lower()
        if suffix in _MAPS:
            return self.unit * read_numbers(self.path, shape, orientation=orientation)
        if suffix == ".ply":
            seen = _projected(self.path, read_cloud(self.path), camera, shape)
        elif suffix == ".txt":
            seen = read_colmap_points(self.path, photo, shape, orientation=orientation)
        else:
            seen = read_points(self.path)
        return Points(seen[:, 0], seen[:, 1], self.unit * seen[:, 2])


def require_guided(options: Options, albedo: Path | Literal["fit"] | None, guide_unit: float, *, guided: bool) -> None:
    """Refuse what is said of a guide, or wants one, where there is none, before any file is read.

    Parameters
    ----------
    options : Options
        Complete, see :func:`persfs_cl.solver.complete.complete`.
    albedo : Path, "fit" or None
    guide_unit : float
    guided : bool
        Whether there is a guide.

    Raises
    ------
    InputError
        Naming the keyword.
    """
    require_guide(options, guided=guided)
    if not guided and guide_unit != 1.0:
        raise InputError.about("guide_unit", guide_unit, f"is without {keyword('guide')}: give one, or leave it out.")
    if albedo == "fit":
        require_albedo_to_fit("fit", SCHEMES[options["scheme"]], options["paint"], guided=guided)


def _projected(path: Path, points: Array, camera: Camera, shape: tuple[int, int]) -> Array:
    """Column, row and depth of points in front of the camera, in its axes."""
    x, y, z = points[np.isfinite(points).all(axis=1) & (points[:, 2] > 0.0)].T
    if z.size == 0:
        raise InputError(
            f"{path} has none of its {len(points)} points in front of the camera: give them in its axes, x to the "
            "right, y down, z forward."
        )
    return np.column_stack([camera.pixels(np.column_stack([x / z, y / z]), shape), z])
