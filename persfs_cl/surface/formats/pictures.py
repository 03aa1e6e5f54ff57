"""Pictures of a surface, for people to look at."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from persfs_cl.io.export import display_levels, write_png
from persfs_cl.masks import rim
from persfs_cl.surface import plots
from persfs_cl.surface.formats.format import Format, Source
from persfs_cl.surface.solved import SolvedSurface

_MEMORY = 500
_OUTLINE = (255, 96, 0)
"""Its colour."""

SHADED, PHOTO, RELIEF = "preview.jpg", "photo.jpg", "relief.js"
PREVIEW = (SHADED, PHOTO, RELIEF)
"""What a page with many results shows of one: the surface shaded, the photograph, and the surface to be turned."""
PAGE = "index.html"
"""A page about this result alone, on which it can be turned."""


def _unit_of(surface: SolvedSurface) -> str:
    """Unit of its depth, for labels."""
    return "units of the light's gain" if surface.light.determines_depth else plots.UNIT


def _depth(target: Path, source: Source) -> None:
    plots.depth_picture(target, source.solution.depth, unit=_unit_of(source.solution))


def _normals(target: Path, source: Source) -> None:
    write_png(target, source.derived.normal_colours)


def _relief(target: Path, source: Source) -> None:
    surface = source.solution
    plots.relief_picture(
        target,
        surface.depth,
        surface.camera,
        surface.image,
        unit=_unit_of(surface),
        white=surface.white,
        discontinuities=surface.discontinuities,
    )


def _rendered(target: Path, source: Source) -> None:
    write_png(target, display_levels(source.derived.rendered, source.solution.white))


def _comparison(target: Path, source: Source) -> None:
    plots.comparison_picture(
        target,
        source.solution.image,
        source.derived.rendered,
        white=source.solution.white,
        photo_title="Prepared photograph",
        errors=source.derived.prepared_residual,
    )


def _confidence(target: Path, source: Source) -> None:
    confidence = source.derived.confidence
    plots.confidence_picture(target, confidence.slope_error, confidence.unreliable)


def _convergence(target: Path, source: Source) -> None:
    solution = source.solution
    # A share of the energy is no change of ln z, and 0 draws no line.
    tolerance = 0.0 if solution.parameters["stopping"] == "gain" else solution.parameters["tolerance"]
    plots.convergence_picture(target, solution.changes, tolerance, distance=solution.distance)


def _guide(target: Path, source: Source) -> None:
    if (guide := source.solution.guide) is not None:
        plots.guide_picture(target, guide.departure, source.solution.at_bound)


def _outline(target: Path, source: Source) -> None:
    """The photograph, dark where it is not the surface, and the outline of this."""
    shown, solved = source.rgb.copy(), source.solution.solved
    shown[~solved] = shown[~solved] // 4
    shown[rim(solved)] = _OUTLINE
    write_png(target, shown)


def _picture(
    name: str,
    write: Callable[[Path, Source], None],
    groups: tuple[str, ...] = ("pictures",),
    applies: Callable[[Source], bool] = lambda _: True,
    alone: bool = False,
) -> Format:
    return Format(f"{name}.png", write, groups, "picture", alone=alone, applies=applies, memory=_MEMORY)


PICTURES = (
    _picture("depth", _depth, alone=True),
    _picture("normals", _normals, ("normals", "pictures")),
    _picture("relief", _relief),
    _picture("rendered", _rendered),
    _picture("comparison", _comparison),
    _picture("confidence", _confidence),
    _picture("convergence", _convergence),
    _picture("outline", _outline, applies=lambda source: source.outlined),
    _picture("guide", _guide, applies=lambda source: source.solution.guide is not None),
)
PREVIEWS = (
    *(Format(file, None, ("preview", "page"), "preview") for file in PREVIEW),
    Format(PAGE, None, ("page",), "preview"),
)
