"""One run at a time on a folder of results, or its shares beside each other.

The lock is one of the kernel: it ends with the processes that hold it, however they end.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from persfs_cl.errors import InputError
from persfs_cl.io.files import not_written
from persfs_cl.pipeline.manifest import FOLDER
from persfs_cl.pipeline.shards import Shard

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_PATIENCE = 5.0
"""Seconds: a run that was killed may have processes that are ending."""


@contextmanager
def claimed(root: Path, shard: Shard | None) -> Iterator[tuple[int, ...]]:
    """Hold a folder of results for one run, or for one share of it, until the block ends.

    Parameters
    ----------
    root : Path
        Made if needed.
    shard : (int, int) or None
        Shares of one division run beside each other; everything else excludes each other.

    Yields
    ------
    tuple of int
        File descriptors: a process that inherits them holds the folder too.

    Raises
    ------
    InputError
        When another run holds it.
    """
    folder = root / FOLDER
    handles: list[int] = []
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            handles.append(os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o666))
            if shard is not None:
                handles.append(os.open(folder / f"lock-{shard[0]}-of-{shard[1]}", os.O_RDWR | os.O_CREAT, 0o666))
        except OSError as error:
            raise not_written(folder, error) from error
        if fcntl is not None:
            if not _taken(handles[0], fcntl.LOCK_EX if shard is None else fcntl.LOCK_SH):
                raise _refused("Another run", root)
            if shard is not None and not _taken(handles[1], fcntl.LOCK_EX):
                raise _refused(f"Another run of the share {shard[0]}/{shard[1]}", root)
            if shard is not None and (other := _other_division(folder, shard)):
                raise _refused(f"The share {other} of another division", root)
        yield tuple(handles)
    finally:
        for handle in handles:
            os.close(handle)


def _refused(whose: str, root: Path) -> InputError:
    return InputError(
        f"{whose} is at work on {root}: wait for its end, choose another folder, or give each run a share of its own, "
        "1/2 and 2/2 for two."
    )


def _other_division(folder: Path, shard: Shard) -> str:
    """The lock of a share, of as many as this one is not, that somebody holds."""
    for lock in sorted(folder.glob("lock-*-of-*")):
        _, number, _, count = lock.name.split("-")
        if count == str(shard[1]):
            continue
        handle = os.open(lock, os.O_RDWR)
        try:
            # Shared: others that look at the same time must not take each other for holders.
            fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return f"{number}/{count}"
        except OSError:  # a file system without locks
            return ""
        finally:
            os.close(handle)
    return ""


def _taken(handle: int, kind: int) -> bool:
    until = time.monotonic() + _PATIENCE
    while True:
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > until:
                return False
            time.sleep(0.05)
        except OSError:  # a file system without locks
            return True
        else:
            return True
