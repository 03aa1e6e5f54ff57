"""Files of a surface made together: each thing that several need once, and pictures that fail left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.checks import warn
from persfs_cl.errors import InputError
from persfs_cl.surface.formats import FORMATS
from persfs_cl.surface.formats.format import Format, Kind, Source
from persfs_cl.surface.jobs import Jobs
from persfs_cl.surface.outcome import Outcome
from persfs_cl.surface.plots.canvas import prepare_to_draw
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solved import Derived
from persfs_cl.wording import marked


def write_files(
    folder: Path,
    solution: Outcome,
    saving: Saving,
    derived: Derived,
    *,
    colour: NDArray[np.uint8] | None = None,
    report: Callable[[], Mapping[str, Any]] = dict,
    threads: int = 1,
) -> list[str]:
    """Write files of a surface, all but previews.

    Parameters
    ----------
    folder : Path
        Exists, and is not looked at by others before everything is in it.
    solution : Outcome
    saving : Saving
    derived : Derived
        Of the solution. It is released as soon as nothing needs it: a mesh takes much memory too.
    colour
        As for :meth:`persfs_cl.Solution.save`.
    report : callable
        Returns further entries for the report, where there is one.
    threads : int
        How many files are made at a time. With one, the memory for a mesh is taken when that for all else is free.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    wanted = [FORMATS[file] for file in saving.files]

    def whole_report() -> dict[str, Any]:
        said = {one.file: one.about(source) for one in wanted if one.about is not None}
        return {**report(), **({"files": said} if said else {})}

    source = Source(
        solution,
        derived,
        colour=colour,
        report=whole_report,
        mesh_faces=saving.mesh_faces,
        block=saving.block,
    )
    makers = {
        one: partial(one.write, folder / one.file, source)
        for one in wanted
        if one.write is not None and one.applies(source)
    }

    def of_kind(*kinds: Kind) -> dict[str, Callable[[], None]]:
        return {one.file: make for one, make in makers.items() if one.kind in kinds}

    meshes, data = of_kind("mesh", "solid"), of_kind("data")

    lost: dict[str, InputError] = {}

    def write_meshes() -> None:
        for file, make in meshes.items():
            try:
                make()
            except InputError as error:
                # A surface may have none, or not of that size; a full disk has room for no other file either.
                if isinstance(error.__cause__, OSError):
                    raise
                lost[file] = error

    with Jobs(threads) as jobs:
        # It takes longest, so that it is begun first.
        last = jobs.add(write_meshes) if meshes else None
        results = [jobs.add(make) for make in data.values()]
        pictures = draw_all(of_kind("picture"), jobs)
        for result in results:
            result()
        derived.release()
        if last is not None:
            last()
    written = [*data, *pictures, *(file for file in meshes if file not in lost)]
    if lost and not written:
        raise next(iter(lost.values()))
    if not makers and all(one.write is not None for one in wanted):
        raise InputError(f"There is no {' and no '.join(saving.files)} of this surface: give other items to save.")
    for one in wanted:
        if one.file in saving.named and not one.applies(source):
            lost[one.file] = InputError("there is none of this surface, so leave it out.")
    for file, error in lost.items():
        warn(f"{file} could not be made: {marked(error.parts)} All other files are complete without it.")
    return written


def load_libraries(saving: Saving) -> None:
    """Import what files are made with, which takes long: for a thread, while there is no surface yet."""
    kinds = {FORMATS[file].kind for file in saving.files}
    # Whoever needs what is missing says so.
    with suppress(Exception):
        if "picture" in kinds:
            prepare_to_draw()
        if "mesh" in kinds and saving.mesh_faces is not None:
            import fast_simplification  # noqa: F401  # slow


def write_file(target: Path, kind: Format, source: Source) -> None:
    """Write one file by itself, under any name.

    Raises
    ------
    InputError
        When it cannot be written.
    """
    kind.require()
    if kind.write is not None:
        kind.write(target, source)


def draw_all(drawings: Mapping[str, Callable[[], None]], jobs: Jobs) -> list[str]:
    """Draw pictures, and say which; one that cannot be drawn is left out, with a warning, for nothing depends on it.

    Parameters
    ----------
    drawings : mapping of str to callable
        By the file's name, what draws it.
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
    results = {file: jobs.add(draw) for file, draw in drawings.items()}
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
