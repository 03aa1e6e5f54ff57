"""Which results are written, and where they go, checked before the work."""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Annotated

import typer

from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import InputError
from persfs_cl.io.account import ACCOUNT
from persfs_cl.io.files import is_temporary
from persfs_cl.surface.formats import FORMATS, GROUPS
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solid import Block

_OPTION = "'--output' / '-o'"
_PANEL = "Results"

SaveOption = Annotated[
    str,
    typer.Option(
        metavar="ITEM,...",
        help=f"What is written: {', '.join(GROUPS)}, or single files: "
        f"{', '.join(file for file, one in FORMATS.items() if one.kind not in ('picture', 'preview'))}.",
        rich_help_panel=_PANEL,
    ),
]
MeshFacesOption = Annotated[
    int,
    typer.Option(
        metavar="N",
        help="A mesh of more triangles is simplified to at most so many; 0 keeps all.",
        rich_help_panel=_PANEL,
    ),
]
SolidOption = Annotated[
    bool,
    typer.Option(
        "--solid",
        help="Write solid.stl too: a watertight block in millimetres, ready to print. With --save solid.3mf, as 3MF.",
        rich_help_panel=_PANEL,
    ),
]
WidthOption = Annotated[
    float,
    typer.Option(metavar="MM", help="Larger horizontal side of what is printed.", rich_help_panel=_PANEL),
]
BaseOption = Annotated[
    float,
    typer.Option(metavar="MM", help="Thickness below the deepest point of what is printed.", rich_help_panel=_PANEL),
]
DEFAULT_WIDTH, DEFAULT_BASE = Block.width, Block.base


def chosen_saving(save: str, mesh_faces: int, *, solid: bool, width: float, base: float) -> Saving:
    """What `--save`, `--mesh-faces`, `--solid`, `--width` and `--base` ask for.

    Raises
    ------
    WrongOption
        When an item is unknown or cannot be written here, a number too small, or a size is given for no solid.
    """
    try:
        saving = Saving.of(f"{save},solid" if solid else save, mesh_faces, width=width, base=base)
    except InputError as error:
        raise WrongOption(error) from error
    if saving.block != Block() and not saving.has_solid:
        raise typer.BadParameter("a size is for what is printed: add --solid.", param_hint="'--width' / '--base'")
    return saving


def check_folder(folder: Path, *, overwrite: bool, own: Collection[str] | None = None) -> None:
    """Refuse a folder that results cannot go to. Creates nothing.

    Parameters
    ----------
    folder : Path
    overwrite : bool
        Whether it may hold something.
    own : collection of str, optional
        Of a command without --overwrite: names of what it may hold, hidden files besides.

    Raises
    ------
    typer.BadParameter
        When it is a file or lies under one, cannot be written to, or holds something already.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise typer.BadParameter(f"{folder} is a file: name a folder.", param_hint=_OPTION)
        if folder.exists() and not overwrite:
            held = [path for path in folder.iterdir() if not _is_unseen(path)]
            if own is not None and [path for path in held if path.name not in own and not path.name.startswith(".")]:
                raise typer.BadParameter(f"the folder {folder} holds other things: choose another.", param_hint=_OPTION)
            if own is None and held:
                raise typer.BadParameter(
                    f"the folder {folder} is not empty: choose another, or add --overwrite.", param_hint=_OPTION
                )
        _check_writable(folder)
    except OSError as error:
        raise typer.BadParameter(f"{folder} cannot be written: {error.strerror}.", param_hint=_OPTION) from error


def check_inputs(folder: Path, saving: Saving, inputs: Iterable[Path]) -> None:
    """Refuse a folder in which a result would take the place of something that it is made from.

    Raises
    ------
    typer.BadParameter
        Naming the file that would be replaced.
    """
    read = {file.resolve() for file in inputs}
    for name in saving.files:
        if (folder / name).resolve() in read:
            raise typer.BadParameter(
                f"{folder / name} is an input, and a result has this name: choose another folder, or leave {name} out "
                "of --save.",
                param_hint=_OPTION,
            )


def check_file(file: Path, suffixes: tuple[str, ...], *, overwrite: bool) -> None:
    """Refuse a file name that a result cannot be written under. Creates nothing.

    Raises
    ------
    typer.BadParameter
        When its suffix is not one of `suffixes`, its folder is missing or cannot be written to, or it exists.
    """
    if file.suffix.lower() not in suffixes:
        raise typer.BadParameter(f"{file} must end in one of {', '.join(suffixes)}.", param_hint=_OPTION)
    try:
        if file.exists() and not overwrite:
            raise typer.BadParameter(f"{file} exists: choose another name, or add --overwrite.", param_hint=_OPTION)
        if not file.parent.is_dir():
            raise typer.BadParameter(f"{file.parent} is not a folder: create it first.", param_hint=_OPTION)
        _check_writable(file.parent)
    except OSError as error:
        raise typer.BadParameter(f"{file} cannot be written: {error.strerror}.", param_hint=_OPTION) from error


def _is_unseen(path: Path) -> bool:
    """Whether a file in a folder is there for the package alone."""
    return is_temporary(path) or path.name == ACCOUNT


def _check_writable(folder: Path) -> None:
    """Try it: permissions alone do not tell of read-only disks and special folders."""
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    with tempfile.TemporaryFile(dir=existing):
        pass
