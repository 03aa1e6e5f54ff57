"""Results written to files: meshes, reports and pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from persfs_cl.checks import warn
from persfs_cl.errors import InputError
from persfs_cl.io.files import atomic_path, json_text

if TYPE_CHECKING:
    import trimesh


def write_mesh(target: Path, mesh: trimesh.Trimesh) -> None:
    """Write a mesh, in the format that the suffix names."""
    with atomic_path(target) as temporary:
        mesh.export(temporary)


def write_json(target: Path, *entries: Mapping[str, Any] | None) -> None:
    """Write mappings as one JSON object; of equal names the last one counts."""
    merged = {name: value for some in entries for name, value in (some or {}).items()}
    with atomic_path(target) as temporary:
        temporary.write_text(json_text(merged) + "\n", encoding="utf-8")


def draw_all(folder: Path, drawings: Mapping[str, Callable[[Path], None]]) -> list[str]:
    """Draw pictures, and say which; one that cannot be drawn is left out, with a warning, for nothing depends on it.

    Parameters
    ----------
    folder : Path
        Where they become files, NAME.png.
    drawings : mapping of str to callable
        By the name, what draws to a path.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    drawn = []
    for name, draw in drawings.items():
        file = f"{name}.png"
        try:
            draw(folder / file)
        except Exception as error:  # whatever a library that draws raises
            # A full disk has room for no other file either: the user chooses another.
            if isinstance(error, InputError) and isinstance(error.__cause__, OSError):
                raise
            warn(
                f"{file} could not be drawn ({type(error).__name__}: {' '.join(str(error).split())}): depth, mesh, "
                "report and other pictures are complete without it."
            )
        else:
            drawn.append(file)
    return drawn
