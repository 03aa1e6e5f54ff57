"""Files read whole and written whole: nothing half-finished is ever left under a final name."""

from __future__ import annotations

import errno
import os
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from persfs_cl.errors import InputError

FilePath = str | os.PathLike[str]

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
        When it is no text and nothing that stands for a path, such as a number.
    """
    try:
        return Path(path)
    except TypeError as error:
        raise InputError(f"{path!r} is no path: give a text or a pathlib.Path.") from error


@contextmanager
def atomic_path(target: FilePath) -> Iterator[Path]:
    """A temporary name to write to, which becomes `target` once the block has ended without an error.

    Whoever looks at `target` sees the old file or the whole new one. The temporary file lies in the same
    folder, with the same suffix, and is removed whenever the block fails, also on Ctrl-C. It is not created
    here, so the permissions of the finished file are those that the umask gives to any new file.

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

    Examples
    --------
    >>> with atomic_path("depth.npy") as temporary:
    ...     np.save(temporary, depth)
    """
    final = as_path(target).resolve()
    temporary = final.with_name(f".{uuid.uuid4().hex}{final.suffix}")
    try:
        # Renaming over a device such as /dev/null would replace it for the whole machine.
        if final.exists() and not final.is_file():
            raise InputError(f"{target} is not a regular file and cannot be replaced: choose another path.")
        if not final.parent.is_dir():
            raise _missing_folder(final.parent)
        try:
            yield temporary
            temporary.replace(final)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise _not_written(target, error) from error


@contextmanager
def filling(folder: FilePath) -> Iterator[Path]:
    """A temporary folder whose files become those of `folder` once the block has ended without an error.

    Whatever ends the block early, Ctrl-C included, leaves `folder` and the folders above it as they were.

    Parameters
    ----------
    folder : path
        Made if needed, with the folders above it; files of the same names in it are replaced, others stay.

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
        with tempfile.TemporaryDirectory(prefix=".persfs-cl-", dir=final) as temporary:
            try:
                yield Path(temporary)
            except InputError as error:
                raise InputError(str(error).replace(temporary, str(final))) from error
            _move(list(Path(temporary).iterdir()), final)
    except BaseException as error:
        for place in new:
            with suppress(OSError):
                place.rmdir()
        if isinstance(error, OSError):
            raise _not_written(folder, error) from error
        raise


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
        When the file is missing, a folder, unreadable or empty. Names the path, the reason and the remedy.
    """
    try:
        data = as_path(path).read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist: check the spelling and the folder.") from error
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder: name a file in it.") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read: {_explained(error, 'Check the path.')}") from error
    except ValueError as error:  # of characters that no name may have
        raise InputError(f"{str(path)!r} is no path ({error}): check the spelling.") from error
    if not data:
        raise InputError(f"{path} is empty (0 bytes): copy or save it again.")
    return data


def _move(files: list[Path], folder: Path) -> None:
    targets = [folder / file.name for file in files]
    # All are looked at before the first file is moved.
    for target in targets:
        if target.is_dir():
            raise InputError(f"{target} is a folder and cannot be replaced: choose another path.")
    for file, target in zip(files, targets, strict=True):
        file.replace(target)


def _missing_folder(folder: Path) -> OSError:
    code = errno.ENOTDIR if any(parent.is_file() for parent in (folder, *folder.parents)) else errno.ENOENT
    return OSError(code, os.strerror(code), str(folder))


def _not_written(target: FilePath, error: OSError) -> InputError:
    # NumPy and tifffile count the bytes that did not fit, but do not say why.
    otherwise = "Choose another path." if error.errno else "The disk is probably full: free some space."
    return InputError(f"{target} cannot be written: {_explained(error, otherwise)}")


def _explained(error: OSError, otherwise: str) -> str:
    reason = error.strerror or str(error)
    return f"{reason}. {_REMEDIES.get(error.errno or 0, otherwise)}"
