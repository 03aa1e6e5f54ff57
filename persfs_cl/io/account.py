"""An account of the files that a run wrote to a folder, so that a run in its place leaves none of them behind.

It says names and sizes: a file of another size is somebody else's by now, and stays.
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
    sizes = {file.name: file.stat().st_size for file in sorted(folder.iterdir())}
    (folder / ACCOUNT).write_text(json_text({"files": sizes}) + "\n", encoding="utf-8")


def written_before(folder: Path) -> frozenset[str]:
    """Names of the files in a folder that an earlier run wrote, and nobody has changed.

    Without an account that can be read there are none.
    """
    try:
        sizes = json.loads((folder / ACCOUNT).read_bytes())["files"]
        return frozenset(name for name, size in sizes.items() if _is_there(folder, name, size))
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


def _is_there(folder: Path, name: str, size: int) -> bool:
    """Whether a file is in the folder itself, of that size."""
    file = folder / name
    return Path(name).name == name and file.is_file() and not file.is_symlink() and file.stat().st_size == size
