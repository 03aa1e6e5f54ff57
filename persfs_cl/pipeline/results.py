"""What comes of a photo, and how it is written to a folder."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.gallery.index import write_index
from persfs_cl.io.account import give_account, superseded
from persfs_cl.io.files import filling
from persfs_cl.metrics import Errors
from persfs_cl.preparation.prepared import PreparedPhoto
from persfs_cl.surface.formats.pictures import PAGE, PREVIEW
from persfs_cl.surface.formats.records import REPORT
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solution import Solution
from persfs_cl.surface.solved import Derived
from persfs_cl.surface.views.preview import write_preview
from persfs_cl.surface.writing import write_files

EVERYTHING = Saving.of("depth,mesh,pictures,page,report,solution")
"""What one photo alone becomes by default."""


@dataclass(frozen=True)
class PhotoSolution:
    """A reconstructed photo.

    Attributes
    ----------
    solution : Solution
    path : Path
        The photo's file.
    colour : ndarray of uint8, shape (height, width, 3)
        Of the photo, for people to look at.
    prepared : PreparedPhoto
        With the maps of saturated pixels, highlights and others.
    unfiltered : ndarray of float64, shape (height, width)
        The photo itself, on the scale of the prepared image.
    report : mapping
        What the report says besides what it says of the solution.
    warnings : tuple of str
        What was said of it on the way, for the report and the page.
    """

    solution: Solution
    path: Path
    colour: NDArray[np.uint8]
    prepared: PreparedPhoto
    unfiltered: Array
    report: Mapping[str, Any]
    warnings: tuple[str, ...] = ()

    @cached_property
    def prepared_residual(self) -> Errors:
        """Difference between the re-rendered image and the one that was solved, in grey levels, 0 to 255."""
        self.compare(Derived(self.solution))
        return self.prepared_residual

    @cached_property
    def photo_residual(self) -> Errors:
        """Difference between the re-rendered image and the photo itself, in grey levels, 0 to 255."""
        self.compare(Derived(self.solution))
        return self.photo_residual

    @cached_property
    def depths(self) -> Mapping[str, float | None]:
        """Least, median and largest depth: "min", "median" and "max"."""
        return Derived(self.solution).depths

    def summary(self, files: Sequence[str]) -> dict[str, Any]:
        """What a table or a page of photos says of this one, whose results are in some files."""
        solution = self.solution
        return {
            "device": str(solution.device),
            "converged": solution.status.name,
            "iterations": solution.iterations,
            "size": solution.depth.shape,
            "files": tuple(files),
            "figures": self._figures(compared="report.json" in files),
        }

    def _figures(self, *, compared: bool) -> dict[str, Any]:
        """Numbers for a table of many photos; the residual, which takes long, only where it is `compared` anyway."""
        solution, camera = self.solution, self.report["camera"]
        depths = self.depths
        figures: dict[str, Any] = {
            "focal_length": [solution.camera.fx, solution.camera.fy],
            "horizontal_view": camera["horizontal_view"],
            "camera_source": camera["source"],
            **{f"depth_{name}": depths[name] for name in ("min", "median", "max")},
            "solved": int(np.count_nonzero(solution.solved)),
            "unreached": int(np.count_nonzero(solution.unreached)),
            "clamped": int(np.count_nonzero(solution.clamped)),
            "at_bound": int(np.count_nonzero(solution.at_bound)),
            "guide": None if solution.guide is None else solution.guide.report(),
        }
        if compared:
            residual = self.photo_residual
            figures |= {"mean_error": residual.mean, "root_mean_square": residual.root_mean_square}
        return figures

    def compare(self, derived: Derived) -> None:
        """Find both residuals from one image, re-rendered or to be so, and what else a report has of it too."""
        # What a camera's white is for E: a highlight may be far brighter than anything that is matt.
        photo, white = self.unfiltered, self.solution.white
        if not np.fmax.reduce(photo, axis=None) <= white:
            photo = np.minimum(photo, white)
        residual = derived.residual(photo)
        self.__dict__.update(
            prepared_residual=derived.prepared_residual, photo_residual=residual, depths=derived.depths
        )


def write(
    solved: PhotoSolution,
    folder: Path,
    saving: Saving,
    *,
    name: str | None = None,
    threads: int = 1,
    inputs: Iterable[Path] | None = None,
) -> list[Path]:
    """Write results to a folder, all that are wanted or none.

    Parameters
    ----------
    solved : PhotoSolution
    folder : Path
    saving : Saving
    name : str, optional
        By which pages call the photo; that of its file when not given.
    threads : int
        How many files are made at a time: with more than one they take more memory than
        :func:`persfs_cl.pipeline.room.bytes_for` says.
    inputs : iterable of Path, optional
        What the photo was solved from. Where it is given, the results take the place of an earlier run's: files that
        this wrote, and that are neither written now nor inputs, go when the new ones come.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    solution, prepared = solved.solution, solved.prepared
    unreliable = {
        "darker than the ambient light": prepared.below_ambient,
        "highlight, left out": prepared.masked,
        "highlight, filled": prepared.filled,
        "bright speck, replaced": prepared.specks,
        "saturated": prepared.saturated,
        "clipped": prepared.clipped,
    }
    title = name or solved.path.name
    derived = Derived(solution, unreliable)

    def report() -> dict[str, Any]:
        solved.compare(derived)
        return {**solved.report, "warnings": list(solved.warnings), "grey_levels_photo": _grey_levels(solved)}

    def gone(names: Iterable[str]) -> Iterable[str]:
        return () if inputs is None else superseded(folder, names, inputs)

    with filling(folder, gone) as temporary:
        written = write_files(
            temporary,
            solution,
            saving,
            derived,
            colour=solved.colour,
            report=report,
            threads=threads,
        )
        if not set(PREVIEW).isdisjoint(saving.files):
            written += write_preview(temporary, solution, solved.colour, name=title, wanted=saving.files)
        if PAGE in saving.files:
            about = {
                **solved.summary([*written, PAGE]),
                "name": "",
                "path": str(solved.path),
                "status": "done",
                "warnings": solved.warnings,
            }
            figures = REPORT if REPORT in written else None
            page = write_index(temporary, [about], title=title, parameters=solution.parameters, elsewhere=figures)
            written.append(page.name)
        if inputs is not None:
            give_account(temporary)
    return [folder / file for file in written]


def _grey_levels(solved: PhotoSolution) -> dict[str, Any]:
    grey = solved.photo_residual
    untouched = {"tone_exponent": 1.0, "ambient": 0.0, "vignetting": "none"}.items() <= solved.report["photo"].items()
    itself = "the photo itself" if untouched else "the photo itself, less tone curve, ambient light and vignetting"
    return {
        "compared_with": f"{itself}, neither clipped nor filtered, with the white of the prepared image",
        "mean_error": grey.mean,
        "root_mean_square": grey.root_mean_square,
    }
