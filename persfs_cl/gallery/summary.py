"""A table of all images for spreadsheets and scripts: summary.csv."""

from __future__ import annotations

import csv
import io
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from persfs_cl.io.files import atomic_path

SUMMARY = "summary.csv"
_Record = Mapping[str, Any]


def _entry(*path: str | int) -> Callable[[_Record], Any]:
    """What finds an entry of a record within others; None where there is none."""

    def find(record: _Record) -> Any:
        found: Any = record
        for step in path:
            try:
                found = found[step]
            except (KeyError, IndexError, TypeError):
                return None
        return found

    return find


_COLUMNS: Mapping[str, Callable[[_Record], Any]] = {
    "name": _entry("name"),
    "path": _entry("path"),
    "status": _entry("status"),
    "error_kind": _entry("error", "kind"),
    "error": _entry("error", "message"),
    "warnings": lambda record: "\n".join(record.get("warnings") or ()),
    "height": _entry("size", 0),
    "width": _entry("size", 1),
    "converged": _entry("converged"),
    # A photograph that failed had none, whatever number its record begins with.
    "iterations": lambda record: record.get("iterations") if record.get("converged") else None,
    **{
        name: _entry("figures", name)
        for name in (
            *("solved", "unreached", "clamped", "at_bound", "depth_min", "depth_median", "depth_max"),
            *("mean_error", "root_mean_square", "horizontal_view"),
        )
    },
    "focal_length_x": _entry("figures", "focal_length", 0),
    "focal_length_y": _entry("figures", "focal_length", 1),
    **{f"seconds_{step}": _entry("seconds", step) for step in ("read", "prepare", "solve", "write")},
    "device": _entry("device"),
    "finished": _entry("finished"),
    "input_hash": _entry("input_hash"),
    "parameter_hash": _entry("parameter_hash"),
    "version": _entry("version"),
}


def write_summary(output: Path, records: Iterable[Mapping[str, Any]]) -> Path:
    """Write summary.csv: a row for each image, sorted by name.

    Text is in quotes and numbers are not; what an image has not is empty. Names of files are written as they are, byte
    for byte. Rows are sorted on disk, so that the memory it takes does not grow with their number.

    Parameters
    ----------
    output : Path
        Folder that exists.
    records : iterable of mapping
        Of the manifest, in any order.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    target = output / SUMMARY
    # What a database without a name holds, it keeps in a temporary file of its own, and sorts there.
    with (
        atomic_path(target) as temporary,
        closing(sqlite3.connect("")) as database,
        temporary.open("w", encoding="utf-8", errors="surrogateescape", newline="") as file,
    ):
        file.write(_line(_COLUMNS))
        database.execute("CREATE TABLE rows (name BLOB, line BLOB)")
        database.executemany("INSERT INTO rows VALUES (?, ?)", _rows(records))
        for (line,) in database.execute("SELECT line FROM rows ORDER BY name"):
            file.write(os.fsdecode(line))
    return target


def _rows(records: Iterable[_Record]) -> Iterator[tuple[bytes, bytes]]:
    for record in records:
        yield os.fsencode(record["name"]), os.fsencode(_line(find(record) for find in _COLUMNS.values()))


def _line(cells: Iterable[Any]) -> str:
    stream = io.StringIO(newline="")
    csv.writer(stream, quoting=csv.QUOTE_NONNUMERIC).writerow(["" if cell is None else cell for cell in cells])
    return stream.getvalue()
