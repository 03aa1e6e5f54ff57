"""Files read whole and written whole: nothing half-finished is ever left under a final name.

What is not finished lies in the same folder under a name that begins with ".persfs-cl-". A process that is killed
leaves it there, and the next one that writes to the folder removes it. No process number can tell whether the process
that made it is still alive: the folder may be shared with other machines, or with containers that count their own.
Instead it holds a lock, which the kernel gives back however the process ends, and knows in every container. Some
network file systems keep locks to each machine, or have none. So what another machine made, or this one before it was
started anew, or what has no lock to try, must also be a day old, far more than the writing of any result takes. That is
why the module is long: writing whole, and taking away what was not, cannot be told apart.
"""

from __future__ import annotations

import errno
import functools
import json
import math
import os
import platform
import re
import shutil
import stat
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import groupby
from pathlib import Path
from typing import Any, BinaryIO

from persfs_cl.errors import InputError
from persfs_cl.wording import marked

try:
    import fcntl
except ImportError:  # Windows; what is open there cannot be removed anyway
    fcntl = None  # type: ignore[assignment]

FilePath = str | os.PathLike[str]

PREFIX = ".persfs-cl-"
"""How the names of what is not finished begin."""
_STEM = re.compile(rf"{re.escape(PREFIX)}(?P<machine>[0-9a-f]{{8}})-[0-9a-f]{{32}}")
"""Name of a lock; those of the files and folders that it stands for go on after it."""
_OLD = 24 * 3600.0
"""Seconds after which what may be in use elsewhere is not."""

_REMEDIES = {
    errno.ENOENT: "Create the folder first, or choose another path.",
    errno.ENOTDIR: "A part of the path before its last is a file, not a folder: choose another path.",
    errno.EISDIR: "The path is a folder: add a file name.",
    errno.EACCES: "Choose a place that you may write to, or change the permissions.",
    errno.EPERM: "Choose a place that you may write to, or change the permissions.",
    errno.EROFS: "The disk is read-only: choose a path on another one.",
    errno.ENOSPC: "Free some space, or choose a path on another disk.",
    errno.EFBIG: "The disk or your limits allow no file of this size: choose a path on another disk.",
    errno.EDQUOT: "Your quota is used up: free some space, or choose a path on another disk.",
    errno.ENAMETOOLONG: "Choose a shorter name.",
}


def as_path(path: FilePath) -> Path:
    """The path, if it is one.

    Raises
    ------
    InputError
        When it is no text and nothing that stands for a path, such as a number, or an empty text, which pathlib takes
        for the current folder.
    """
    if isinstance(path, str) and not path:
        raise InputError("'' is no path: it is empty. Give a name, or '.' for the current folder.")
    try:
        return Path(path)
    except TypeError as error:
        raise InputError(f"{path!r} is no path: give a text or a pathlib.Path.") from error


@contextmanager
def atomic_path(target: FilePath) -> Iterator[Path]:
    """A temporary name to write to, which becomes `target` once the block has ended without an error.

    Whoever looks at `target` sees the old file or the whole new one. The temporary file lies in the same
    folder, with the same suffix, and is removed whenever the block fails, also on Ctrl-C. It is not created
    here, so the permissions of the finished file are those that the umask gives to any new file. What killed
    processes left in the folder is removed first.

    Parameters
    ----------
    target : path
        Final name. A regular file of that name is replaced; through a symbolic link, the file it points to.

    Yields
    ------
    Path
        The temporary name.

    Raises
    ------
    InputError
        When the operating system refuses: the folder is missing or not writable, the disk is full, or
        `target` is a folder or a device. Names `target`, the reason and the remedy.
    """
    final = as_path(target).resolve()
    try:
        # Renaming over a device such as /dev/null would replace it for the whole machine.
        if final.exists() and not final.is_file():
            raise InputError(f"{target} is not a regular file and cannot be replaced: choose another path.")
        if not final.parent.is_dir():
            raise _missing_folder(final.parent)
        with _reserved(final.parent) as stem:
            temporary = final.with_name(f"{stem}-file{final.suffix}")
            try:
                yield temporary
                temporary.replace(final)
            finally:
                temporary.unlink(missing_ok=True)
    except OSError as error:
        raise not_written(target, error) from error


@contextmanager
def filling(
    folder: FilePath, superseded: Callable[[Iterable[str]], Iterable[str]] = lambda _names: ()
) -> Iterator[Path]:
    """A temporary folder whose files become those of `folder` once the block has ended without an error.

    Whatever ends the block early, Ctrl-C included, leaves `folder` and the folders above it as they were. What killed
    processes left in `folder` is removed first.

    Parameters
    ----------
    folder : path
        Made if needed, with the folders above it; files of the same names in it are replaced, others stay.
    superseded : callable
        Is given the names of the new files, and returns those of the others that go when these come.

    Yields
    ------
    Path
        The temporary folder, inside `folder`, so that renaming never crosses file systems.

    Raises
    ------
    InputError
        When the operating system refuses, or `folder` holds a folder of a file's name. Names the file or `folder`,
        the reason and the remedy.
    """
    final = as_path(folder)
    new: list[Path] = []
    try:
        new += [place for place in (final, *final.parents) if not place.exists()]
        final.mkdir(parents=True, exist_ok=True)
        with _reserved(final) as stem, tempfile.TemporaryDirectory(prefix=f"{stem}-", dir=final) as temporary:
            try:
                yield Path(temporary)
            except InputError as error:
                raise InputError(marked(error.parts).replace(temporary, str(final))) from error
            new_files = sorted(Path(temporary).iterdir())
            gone = [final / name for name in superseded([file.name for file in new_files])]
            _move(new_files, final, gone)
    except BaseException as error:
        for place in new:
            with suppress(OSError):
                place.rmdir()
        if isinstance(error, OSError):
            raise not_written(folder, error) from error
        raise


@contextmanager
def staging(folder: FilePath) -> Iterator[Path]:
    """A temporary folder inside another, for things that are renamed to their places below it once they are whole.

    It is removed when the block ends. What killed processes left in `folder` is removed first.

    Parameters
    ----------
    folder : path
        Made if needed, with the folders above it.

    Yields
    ------
    Path

    Raises
    ------
    InputError
        When the operating system refuses.
    """
    final = as_path(folder)
    try:
        final.mkdir(parents=True, exist_ok=True)
        with _reserved(final) as stem:
            temporary = final / f"{stem}-stage"
            temporary.mkdir()
            try:
                yield temporary
            finally:
                shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise not_written(folder, error) from error


def is_temporary(path: Path) -> bool:
    """Whether a file or folder is one that this package works on, or left behind when it was killed: no result."""
    return path.name.startswith(PREFIX)


def remove_leftovers(folder: Path) -> None:
    """Remove what killed processes left in a folder, and nothing that a living one is at work on.

    Parameters
    ----------
    folder : Path
        What cannot be read or removed in it stays.
    """
    with suppress(OSError):
        with os.scandir(folder) as entries:
            left = sorted(entry.name for entry in entries if entry.name.startswith(PREFIX))
        for stem, names in groupby(left, key=_stem):
            with suppress(OSError):
                _remove_unused(folder / stem, [folder / name for name in names if name != stem])


def read_bytes(path: FilePath) -> bytes:
    """The whole content of a file.

    Parameters
    ----------
    path : path

    Returns
    -------
    bytes
        Never empty.

    Raises
    ------
    InputError
        When the file is missing, a folder, a pipe, a socket, a device, unreadable, empty or larger than the memory.
        Names the path, the reason and the remedy.
    """
    with opened(path) as file:
        data = file.read()
    if not data:
        raise _empty(path)
    return data


def read_lines(path: FilePath) -> Iterator[tuple[int, str]]:
    """The lines of a text in UTF-8, with their numbers from 1, without spaces at their ends.

    Raises
    ------
    InputError
        As :func:`read_bytes`, and when it is no UTF-8.
    """
    with opened(path) as file:
        for number, line in enumerate(file, 1):
            try:
                yield number, line.decode("utf-8-sig" if number == 1 else "utf-8").strip()
            except UnicodeDecodeError as error:
                raise InputError(f"{path}, line {number}, is no UTF-8 ({error.reason}): save it as UTF-8.") from error


@contextmanager
def opened(path: FilePath) -> Iterator[BinaryIO]:
    """A block that reads a regular file, which is not empty.

    Raises
    ------
    InputError
        As :func:`read_bytes`, also for what the operating system says inside the block.
    """
    place = as_path(path)
    try:
        with _open(path, place) as file:
            yield file
    except FileNotFoundError as error:
        raise InputError(_missing(str(path))) from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {_explained(error, 'Check the path.')}") from error
    except MemoryError as error:
        raise InputError(f"{path} is larger than the memory: give a smaller file.") from error


def _missing(path: str) -> str:
    """The message about a file that is not there."""
    if address := re.match(r"([A-Za-z][A-Za-z0-9+.-]+):/+", path):
        # A path has lost one of the slashes.
        return (
            f"{address[1]}://{path[address.end() :]} is an address, not a file: download it first, and give the file."
        )
    return f"{path} does not exist: check the spelling and the folder."


def folder_error(path: Path) -> InputError:
    """The error about a folder in place of a file; in one of results the depth is meant."""
    held = next((path / name for name in ("depth.npy", "depth.tiff") if (path / name).is_file()), None)
    return InputError(f"{path} is a folder: {'name a file in it' if held is None else f'give {held}'}.")


def json_text(value: Any, *, indent: int | None = 2) -> str:
    """A value as JSON, which every reader takes: null stands for NaN and infinity, which JSON has not.

    It is indented, or all in one line without blanks when `indent` is None.
    """
    separators = (",", ":") if indent is None else None
    return json.dumps(plain(value), indent=indent, separators=separators, allow_nan=False)


@contextmanager
def _reserved(folder: Path) -> Iterator[str]:
    """How the names of temporary files and folders in a folder are to begin, locked until the block ends."""
    if any(map(is_temporary, (folder, *folder.parents))):
        # Inside of one that is locked: it goes with that.
        yield f"{PREFIX}{uuid.uuid4().hex}"
        return
    remove_leftovers(folder)
    stem, lock = "", None
    try:
        while lock is None:
            stem = f"{PREFIX}{_machine()}-{uuid.uuid4().hex}"
            lock = os.open(folder / stem, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
            if _taken(lock) is False or not (folder / stem).exists():
                # Another process came between, and removed what nobody held yet.
                os.close(lock)
                lock = None
        yield stem
    finally:
        if lock is not None:
            os.close(lock)  # first: network file systems keep what is removed while it is open
            with suppress(OSError):
                (folder / stem).unlink()


def _remove_unused(lock: Path, places: list[Path]) -> None:
    """Remove a lock, and the temporary files and folders that it stands for, if no process holds it."""
    name = _STEM.fullmatch(lock.name)
    handle = None
    try:
        if name is not None:
            # Made before what it stands for and removed after: where it is missing, nobody holds it.
            with suppress(FileNotFoundError):
                handle = os.open(lock, os.O_RDWR)
        taken = True if handle is None else _taken(handle)
        sure = taken and name is not None and name["machine"] == _machine()
        if taken is False or not (sure or all(_is_old(place) for place in (*places, lock) if os.path.lexists(place))):
            return
        for place in (*places, lock):
            if place.is_dir() and not place.is_symlink():
                shutil.rmtree(place)
            else:
                place.unlink(missing_ok=True)
    finally:
        if handle is not None:
            os.close(handle)


def _is_old(place: Path) -> bool:
    return time.time() - place.lstat().st_mtime > _OLD


def _stem(name: str) -> str:
    found = _STEM.match(name)
    return found[0] if found else name


def _taken(lock: int) -> bool | None:
    """Whether this process now holds a lock that is open; None where there are no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


@functools.cache
def _machine() -> str:
    """What tells machines, and their starts, from each other, in eight letters."""
    try:
        text = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii")
    except OSError:  # not Linux
        text = platform.node()
    return uuid.uuid5(uuid.NAMESPACE_OID, text).hex[:8]


def plain(value: Any) -> Any:
    """A value as JSON has it: null stands for NaN and infinity."""
    if isinstance(value, Mapping):
        return {name: plain(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _open(path: FilePath, place: Path) -> BinaryIO:
    try:
        # Asked before it is opened: opening a pipe waits for a writer, and a device may have no end.
        status = place.stat()
    except ValueError as error:
        # A zero byte, or a character that no file name has.
        raise InputError(f"{path!r} is no path ({error}): give another.") from error
    mode = status.st_mode
    if stat.S_ISDIR(mode):
        raise folder_error(place)
    if not stat.S_ISREG(mode):
        raise InputError(f"{path} is {_kind(mode)}, not a regular file: save its content as a file, and give that.")
    if not status.st_size:
        # Some that the kernel makes up, all of them without a size, have no end either.
        raise _empty(path)
    return place.open("rb")


def _kind(mode: int) -> str:
    kinds = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
    return kinds.get(stat.S_IFMT(mode), "something else")


def _move(files: list[Path], folder: Path, gone: list[Path]) -> None:
    targets = [folder / file.name for file in files]
    # All are looked at before the first file is moved.
    for target in targets:
        if target.is_dir():
            raise InputError(f"{target} is a folder and cannot be replaced: choose another path.")

    def move() -> None:
        # First what goes: at no time do old files stand beside new ones that took their place.
        for old in gone:
            old.unlink(missing_ok=True)
        for file, target in zip(files, targets, strict=True):
            if file.exists():
                file.replace(target)

    try:
        move()
    except KeyboardInterrupt:
        # It came when all was made: half of it in place would be neither the old nor the new.
        move()
        raise


def _empty(path: FilePath) -> InputError:
    return InputError(f"{path} is empty (0 bytes): copy or save it again.")


def _missing_folder(folder: Path) -> OSError:
    code = errno.ENOTDIR if any(parent.is_file() for parent in (folder, *folder.parents)) else errno.ENOENT
    return OSError(code, os.strerror(code), str(folder))


def not_written(target: FilePath, error: OSError) -> InputError:
    """The error that says why something cannot be written, with the remedy."""
    # NumPy and tifffile count the bytes that did not fit, but do not say why.
    otherwise = "Choose another path." if error.errno else "The disk is probably full: free some space."
    return InputError(f"{target} cannot be written: {_explained(error, otherwise)}")


def _explained(error: OSError, otherwise: str) -> str:
    reason = error.strerror or str(error)
    return f"{reason}. {_REMEDIES.get(error.errno or 0, otherwise)}"
