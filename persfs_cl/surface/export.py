"""Results written to files: meshes, arrays, reports and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.checks import warn
from persfs_cl.errors import InputError
from persfs_cl.guide.fit import GuideFit
from persfs_cl.io.export import display_levels, write_png
from persfs_cl.io.files import atomic_path, json_text
from persfs_cl.surface import plots as pictures
from persfs_cl.surface.jobs import Jobs
from persfs_cl.surface.solved import Derived, SolvedSurface

if TYPE_CHECKING:
    import trimesh


def write_mesh(target: Path, mesh: trimesh.Trimesh) -> None:
    """Write a mesh, in the format that the suffix names."""
    with atomic_path(target) as temporary:
        mesh.export(temporary)


def write_array(target: Path, values: NDArray[Any]) -> None:
    """Write an array as .npy."""
    with atomic_path(target) as temporary:
        np.save(temporary, values, allow_pickle=False)


def write_json(target: Path, *entries: Mapping[str, Any] | None) -> None:
    """Write mappings as one JSON object; of equal names the last one counts."""
    merged = {name: value for some in entries for name, value in (some or {}).items()}
    with atomic_path(target) as temporary:
        temporary.write_text(json_text(merged) + "\n", encoding="utf-8")


def unit_of(surface: SolvedSurface) -> str:
    """Unit of its depth, for labels."""
    return "units of the light's gain" if surface.light.determines_depth else pictures.UNIT


def drawings(
    surface: SolvedSurface,
    derived: Derived,
    changes: Array,
    tolerance: float,
    distance: float,
    guide: GuideFit | None = None,
) -> dict[str, Callable[[Path], None]]:
    """The pictures of a surface: by the file's name, what draws to a path.

    Parameters
    ----------
    surface : SolvedSurface
    derived : Derived
        Of the surface; what no picture needs that is drawn is not computed.
    changes : ndarray of float64, shape (iterations,)
        max |ΔZ| over each iteration.
    tolerance : float
        Which ends the iteration.
    distance : float
        From the limit, as estimated.
    guide : GuideFit, optional
        Without it there is no picture of one.
    """
    unit, white = unit_of(surface), surface.white
    of_guide = {}
    if guide is not None:
        of_guide["guide.png"] = lambda path: pictures.guide_picture(path, guide.departure, surface.at_bound)
    return {
        "depth.png": lambda path: pictures.depth_picture(path, surface.depth, unit=unit),
        "normals.png": lambda path: write_png(path, derived.normal_colours),
        "relief.png": lambda path: pictures.relief_picture(
            path,
            surface.depth,
            surface.camera,
            surface.image,
            unit=unit,
            white=white,
            discontinuities=surface.discontinuities,
        ),
        "rendered.png": lambda path: write_png(path, display_levels(derived.rendered, white)),
        "comparison.png": lambda path: pictures.comparison_picture(
            path,
            surface.image,
            derived.rendered,
            white=white,
            photo_title="Prepared photograph",
            errors=derived.prepared_residual,
        ),
        "confidence.png": lambda path: pictures.confidence_picture(
            path, derived.confidence.slope_error, derived.confidence.unreliable
        ),
        "convergence.png": lambda path: pictures.convergence_picture(path, changes, tolerance, distance=distance),
        **of_guide,
    }


def draw_all(folder: Path, drawings: Mapping[str, Callable[[Path], None]], jobs: Jobs) -> list[str]:
    """Draw pictures, and say which; one that cannot be drawn is left out, with a warning, for nothing depends on it.

    Parameters
    ----------
    folder : Path
        Where they become files.
    drawings : mapping of str to callable
        By the file's name, what draws to a path.
    jobs : Jobs
        Which of them are done at a time.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    results = {file: jobs.add(partial(draw, folder / file)) for file, draw in drawings.items()}
    drawn = []
    for file, result in results.items():
        try:
            result()
        except Exception as error:  # whatever a library that draws raises
            # A full disk has room for no other file either: the user chooses another.
            if isinstance(error, InputError) and isinstance(error.__cause__, OSError):
                raise
            warn(
                f"{file} could not be drawn ({type(error).__name__}: {' '.join(str(error).split())}): all other files "
                "are complete without it."
            )
        else:
            drawn.append(file)
    return drawn
