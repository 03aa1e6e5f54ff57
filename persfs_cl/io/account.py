"""An account of the files that a run wrote to a folder, so that a run in its place leaves none of them behind.

It says names, sizes and times of the last change: a file of another size or time is somebody else's by now, and stays.
Renaming keeps the time, and so the account may be given before the files come to their place.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from persfs_cl.io.files import json_text

ACCOUNT = ".persfs-cl.json"
"""Its name in the folder; hidden, for nobody but the next run reads it."""


def give_account(folder: Path) -> None:
    """Write the account of all files that are in a folder.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    stamps = {file.name: _stamp(file) for file in sorted(folder.iterdir())}
    (folder / ACCOUNT).write_text(json_text({"files": stamps}) + "\n", encoding="utf-8")


def written_before(folder: Path) -> frozenset[str]:
    """Names of the files in a folder that an earlier run wrote, and nobody has changed.

    Without an account that can be read there are none.
    """
    try:
        stamps = json.loads((folder / ACCOUNT).read_bytes())["files"]
        return frozenset(name for name, stamp in stamps.items() if _is_there(folder, name, stamp))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return frozenset()


def superseded(folder: Path, written: Iterable[str], inputs: Iterable[Path] = ()) -> frozenset[str]:
    """Names of the files of an earlier run that are of no use beside those of this one.

    Parameters
    ----------
    folder : Path
    written : iterable of str
        Names of what this run writes.
    inputs : iterable of Path
        What this run has read. It stays, though an earlier run made it.
    """
    read = {file.resolve() for file in inputs}
    old = written_before(folder) - {*written}
    return frozenset(name for name in old if (folder / name).resolve() not in read)


def _is_there(folder: Path, name: str, stamp: list[int]) -> bool:
    """Whether a file is in the folder itself, and has that stamp."""
    file = folder / name
    return Path(name).name == name and file.is_file() and not file.is_symlink() and _stamp(file) == stamp


def _stamp(file: Path) -> list[int]:
    """Its size in bytes, and when its content was last changed, in nanoseconds."""
    status = file.stat()
    return [status.st_size, status.st_mtime_ns]
