"""What comes of a photo, and how it is written to a folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.io.files import filling
from persfs_cl.io.photos import Photo
from persfs_cl.metrics import Errors
from persfs_cl.preparation.prepare import PreparedPhoto
from persfs_cl.surface.solution import Solution

_WITHOUT_PICTURES = ("depth.npy", "depth.tiff", "mesh.ply", "report.json")


@dataclass(frozen=True)
class PhotoSolution:
    """A reconstructed photo.

    Attributes
    ----------
    solution : Solution
    photo : Photo
    prepared : PreparedPhoto
        With the maps of saturated pixels, highlights and others.
    unfiltered : ndarray of float64, shape (height, width)
        The photo itself, on the scale of the prepared image.
    report : mapping
        What the report says besides what it says of the solution.
    """

    solution: Solution
    photo: Photo
    prepared: PreparedPhoto
    unfiltered: Array
    report: Mapping[str, Any]

    @cached_property
    def prepared_residual(self) -> Errors:
        """Difference between the re-rendered image and the one that was solved, in grey levels, 0 to 255."""
        return self.solution.residual()

    @cached_property
    def photo_residual(self) -> Errors:
        """Difference between the re-rendered image and the photo itself, in grey levels, 0 to 255."""
        # What a camera's white is for E: a highlight may be far brighter than anything that is matt.
        return self.solution.residual(np.minimum(self.unfiltered, self.solution.white))


def write(solved: PhotoSolution, folder: Path, *, pictures: bool = True) -> list[Path]:
    """Write all results to a folder, or none.

    Parameters
    ----------
    solved : PhotoSolution
    folder : Path
    pictures : bool
        False leaves them out; depth, mesh and report remain.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    grey = solved.photo_residual
    untouched = {"ambient": 0.0, "vignetting": "none"}.items() <= solved.report["photo"].items()
    itself = "the photo itself" if untouched else "the photo itself, less ambient light and vignetting"
    levels = {
        "compared_with": f"{itself}, neither clipped nor filtered, with the white of the prepared image",
        "mean_error": grey.mean,
        "root_mean_square": grey.root_mean_square,
    }
    report = {**solved.report, "grey_levels_photo": levels}
    unreliable = {
        "darker than the ambient light": solved.prepared.below_ambient,
        "highlight, left out": solved.prepared.masked,
        "highlight, filled": solved.prepared.filled,
        "saturated": solved.prepared.saturated,
        "clipped": solved.prepared.clipped,
    }
    keywords: dict[str, Any] = {"colour": solved.photo.colour, "report": report, "unreliable": unreliable}
    if pictures:
        return solved.solution.save(folder, **keywords, folder=True)
    with filling(folder) as temporary:
        for name in _WITHOUT_PICTURES:
            solved.solution.save(temporary / name, **keywords)
    return [folder / name for name in _WITHOUT_PICTURES]
