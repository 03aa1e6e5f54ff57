"""The caches of compiled kernels, made fit for use before OpenCL sees them.

PoCL lists no device when it cannot write to its cache, and ends the process when the disk is full or when a kernel in
the cache is cut short; pyopencl fails at the first kernel when its own cache cannot be written to or is damaged. The
former cannot be caught, so all of it is looked for first.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import sqlite3
import stat
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from persfs_cl.errors import DeviceError

_POCL, _ALL = "POCL_CACHE_DIR", "XDG_CACHE_HOME"
_POCL_NEEDS, _PYOPENCL_NEEDS = 2**23, 2**16
"""Bytes that must be free: a few programs' worth, and a few lines about the arguments of kernels."""
_FILES_NEEDED = 64
"""Files and folders that must be free, where the disk counts them: a few programs' worth too."""
_FORGOTTEN = 3600.0
"""Seconds after which PoCL's temporary files are no longer in use."""
_LONGEST_LOOK = 0.5
"""Seconds, so that a huge cache, or a slow disk, does not delay the start by more."""
_ELF64_SECTIONS = struct.Struct("<40xQ10xHH")
"""Of an ELF header: where the table of sections begins, the size of an entry, and how many there are."""
_BITCODE_BLOCK = struct.Struct("<II")
"""What a block of LLVM's bitcode begins with: its kind, never zero, and how many words follow."""
_BITCODE, _ELF64 = b"BC\xc0\xde", b"\x7fELF\x02\x01"
_OTHER_FORMS = (b"\xde\xc0\x17\x0b", b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
"""Beginnings of what LLVM and linkers write on other machines: wrapped bitcode, other ELF files, and those of macOS."""


def prepare_caches() -> list[str]:
    """See to it that the caches can be used, or name ones of this process's own in the environment.

    What is damaged in them is removed, and so are the empty files that PoCL leaves behind.

    Returns
    -------
    list of str
        What to warn of: a folder that cannot be used, so that kernels are compiled again in each process.

    Raises
    ------
    DeviceError
        When no temporary folder can be used either.
    """
    root = _root()
    pocl, arguments, binaries = pocl_cache(), root / "pytools", root / "pyopencl"
    unusable = []
    if problem := _problem(pocl, _POCL_NEEDS) or _clean_pocl(pocl):
        unusable.append((pocl, _POCL, problem))
    else:
        # Also where the other variable is about to change.
        os.environ[_POCL] = str(pocl)
    # Elsewhere pyopencl's caches lie in the system's own places, and no variable moves them.
    for folder in (arguments, binaries) if sys.platform == "linux" else ():
        if problem := _problem(folder, _PYOPENCL_NEEDS):
            unusable.append((folder, _ALL, problem))
            break  # one variable moves both
    else:
        _clean_pyopencl(arguments)
    said = []
    for folder, variable, problem in unusable:
        os.environ[variable] = _in_place_of(folder, problem, variable)
        said.append(
            f"The kernel cache {folder} cannot be used ({problem}): kernels are compiled anew in this run. Make the "
            f"folder writable or free some space, or name another one in the environment variable {variable}."
        )
    return said


def _in_place_of(folder: Path, problem: str, variable: str) -> str:
    """A folder that goes with this process."""
    try:
        private = tempfile.mkdtemp(prefix="persfs-cl-kernels-")
        atexit.register(_remove, private, os.getpid())
        found = _problem(Path(private), _POCL_NEEDS)
        neither = found and f"{private}: {found}"
    except OSError as error:
        neither = error.strerror or str(error)
    if neither:
        raise DeviceError(
            f"Compiled kernels can be kept neither in {folder} ({problem}) nor in a temporary folder ({neither}): name "
            f"a folder that can be written to, with {_POCL_NEEDS / 2**20:.0f} MiB free, in the environment variable "
            f"{variable}, or TMPDIR."
        )
    return private


def _remove(folder: str, owner: int) -> None:
    # A forked child, which ends first, does what its parent meant to do at its end.
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)


def pocl_cache() -> Path:
    """Where PoCL keeps compiled kernels."""
    chosen = os.environ.get(_POCL)
    return Path(chosen) if chosen else _root() / "pocl" / "kcache"


def cache_folders(folder: Path) -> dict[str, str]:
    """Environment that moves every cache of compiled kernels into a folder."""
    names = (_ALL, _POCL, "CUDA_CACHE_PATH")
    for name in names:
        (folder / name).mkdir(exist_ok=True)
    return {name: str(folder / name) for name in names}


def _root() -> Path:
    if chosen := os.environ.get(_ALL):
        return Path(chosen)
    return Path(os.path.expanduser("~")) / ".cache"  # noqa: PTH111  # Path's own raises where there is no home


def _problem(folder: Path, needed: int) -> str | None:
    """Why so many bytes could not be written there; None when they can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(needed))
            file.flush()
        if hasattr(os, "statvfs"):
            disk = os.statvfs(folder)
            if disk.f_files and disk.f_favail < _FILES_NEEDED:
                return "the disk has room for no more files"
    except OSError as error:
        return error.strerror or str(error)
    return None


def _clean_pocl(folder: Path) -> str | None:
    """Remove programs and kernels that are cut short, and the empty files that PoCL has left behind.

    Returns
    -------
    str or None
        Why PoCL must not use the folder: something damaged, of another user say, could not be removed.
    """
    long_ago = time.time() - _FORGOTTEN
    for file in folder.glob("tempfile_*"):
        # Another process may be faster, or own it.
        with contextlib.suppress(OSError):
            status = file.stat()
            if status.st_size == 0 and status.st_mtime < long_ago:
                file.unlink()
    end = time.monotonic() + _LONGEST_LOOK
    for program, file in _compiled(folder):
        if time.monotonic() > end:
            break
        if not _is_whole(file):
            shutil.rmtree(program, ignore_errors=True)
            if program.exists():
                return f"{program} in it is damaged, and cannot be removed"
    return None


def _compiled(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Folders of programs, each with a file in it: XX/program/program.bc or XX/program/kernel/size/kernel.so."""
    for program in folder.glob("??/*"):
        yield program, program / "program.bc"
        for kernel in program.glob("*/*/*.so"):
            yield program, kernel


def _is_whole(file: Path) -> bool:
    """Whether a shared library or a file of bitcode has the length that it says itself, and an end.

    A machine that lost its power leaves files of the right length whose end, or all, is zeros.
    """
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            return False
        with file.open("rb", buffering=0) as opened:
            size, begin = os.fstat(opened.fileno()).st_size, opened.read(64)
            if begin.startswith(_BITCODE):
                end, kind = len(_BITCODE), 1
                while kind and end + _BITCODE_BLOCK.size <= size:
                    opened.seek(end)
                    kind, words = _BITCODE_BLOCK.unpack(opened.read(_BITCODE_BLOCK.size))
                    end += _BITCODE_BLOCK.size + 4 * words
                return bool(kind) and end == size
            if begin.startswith(_ELF64) and len(begin) == 64:
                sections, entry, count = _ELF64_SECTIONS.unpack_from(begin)
                end = sections + entry * count
                opened.seek(max(0, end - entry))
                return end <= size and any(opened.read(entry))
    except OSError:  # not there, or another's
        return True
    return begin.startswith(_OTHER_FORMS)


def _clean_pyopencl(folder: Path) -> None:
    """Remove databases that cannot be read."""
    for file in folder.glob("pdict-*pyopencl*.sqlite"):
        try:
            with contextlib.closing(sqlite3.connect(file, timeout=1)) as database:
                whole = database.execute("PRAGMA quick_check(1)").fetchone() == ("ok",)
        except sqlite3.OperationalError:  # in use
            continue
        except sqlite3.DatabaseError:
            whole = False
        if not whole:
            with contextlib.suppress(OSError):  # removed meanwhile, or another's
                file.unlink()
