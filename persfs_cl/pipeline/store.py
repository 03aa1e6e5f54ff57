"""Where the results of a batch go, and the usual place, a folder.

A result is there whole or not at all: it is made elsewhere and renamed.
"""

from __future__ import annotations

import os
import shutil
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, Protocol

from persfs_cl.errors import InputError
from persfs_cl.io.files import not_written, remove_leftovers, staging
from persfs_cl.pipeline.manifest import FOLDER, Record, file_name

RECORD = "record.json"
"""The line of the manifest about a result, in its folder: what is complete stays known, whatever becomes of the run."""

_FLUSHED_EVERY = 1.0
"""Seconds after which what was written of the manifest is made to reach the disk."""


class Shelf(ABC):
    """A store that is open for writing, in one process."""

    @abstractmethod
    def put(self, name: str, fill: Callable[[Path], Record]) -> Record:
        """Put a result in its place, in place of an earlier one.

        Parameters
        ----------
        name : str
        fill : callable
            Called with an empty folder, to which it writes the files; returns the record.

        Raises
        ------
        InputError
            When the place takes no files.
        """


class Journal(ABC):
    """A file of the manifest that is being written."""

    @abstractmethod
    def add(self, record: Record) -> None:
        """Add a line."""

    @abstractmethod
    def close(self) -> None:
        """Add no more."""


class Results(Protocol):
    """Which results are there, whole."""

    def __contains__(self, name: object) -> bool:
        """Whether there is one of a name."""

    def record(self, name: str) -> Record | None:
        """What is noted in it; None where there is none."""


class Store(ABC):
    """A place for results; it may be pickled."""

    @abstractmethod
    def opened(self) -> Any:
        """A context manager that gives a :class:`Shelf`."""

    @abstractmethod
    def results(self) -> Results:
        """What is there now."""

    @abstractmethod
    def records(self, names: Sequence[str]) -> dict[str, Record]:
        """The records of some results, of those that are there and complete: a few of many."""

    @abstractmethod
    def journal(self) -> Journal:
        """A new file of the manifest."""

    @abstractmethod
    def manifests(self) -> Iterator[Iterable[bytes]]:
        """The lines of each file of the manifest, the oldest first."""

    @abstractmethod
    def publish(self, write: Callable[[Path], Iterable[str]]) -> None:
        """Let a function write some files to a folder, and put them beside the results."""

    @abstractmethod
    def clean(self) -> None:
        """Remove what processes that were killed left behind."""


def record_of(name: str, line: bytes) -> Record | None:
    """The record of a result; none of one that somebody copied to another name."""
    record = Record.read(line)
    return record if record is not None and record.name == name else None


@dataclass(frozen=True)
class FolderStore(Store):
    """Results in a folder, which may be shared with other machines.

    Attributes
    ----------
    root : Path
    """

    root: Path

    def __str__(self) -> str:
        return str(self.root)

    @contextmanager
    def opened(self) -> Iterator[Shelf]:
        """See :class:`Store`."""
        with staging(self.root) as stage:
            yield _FolderShelf(self.root, stage)

    def results(self) -> Results:
        """See :class:`Store`."""
        return _FolderResults(self.root)

    def records(self, names: Sequence[str]) -> dict[str, Record]:
        """See :class:`Store`."""
        found = {}
        for name in names:
            with suppress(OSError):  # mostly, there is none yet
                if (record := Record.read((self.root / name / RECORD).read_bytes())) is not None:
                    found[name] = record
        return found

    def journal(self) -> Journal:
        """See :class:`Store`."""
        return _GrowingJournal(self.root / FOLDER / file_name())

    def manifests(self) -> Iterator[Iterable[bytes]]:
        """See :class:`Store`."""
        for file in sorted((self.root / FOLDER).glob("*.jsonl")):
            with file.open("rb") as lines:
                yield lines

    def publish(self, write: Callable[[Path], Iterable[str]]) -> None:
        """See :class:`Store`."""
        write(self.root)

    def clean(self) -> None:
        """See :class:`Store`."""
        remove_leftovers(self.root)


class _FolderResults:
    def __init__(self, root: Path) -> None:
        self._root = root

    def __contains__(self, name: object) -> bool:
        return (self._root / str(name) / RECORD).is_file()

    def record(self, name: str) -> Record | None:
        try:
            return record_of(name, (self._root / name / RECORD).read_bytes())
        except OSError:
            return None


class _FolderShelf(Shelf):
    def __init__(self, root: Path, stage: Path) -> None:
        self._root, self._stage = root, stage
        self._numbers = count()

    def put(self, name: str, fill: Callable[[Path], Record]) -> Record:
        final = self._root / name
        new = self._stage / f"{next(self._numbers)}"
        try:
            new.mkdir()
            record = fill(new)
            (new / RECORD).write_text(record.line(), encoding="utf-8")
            _settle(new)
            final.parent.mkdir(parents=True, exist_ok=True)
            old = self._stage / f"{new.name}-old"
            # Whoever is killed between the two leaves no result here, and the photo is done again.
            if _is_result(final):
                final.rename(old)
            new.rename(final)
            shutil.rmtree(old, ignore_errors=True)
        except InputError as error:
            raise type(error)(str(error).replace(str(new), str(final))) from error
        except OSError as error:
            raise not_written(final, error) from error
        finally:
            shutil.rmtree(new, ignore_errors=True)
        return record


class _GrowingJournal(Journal):
    def __init__(self, file: Path) -> None:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            self._handle = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
        except OSError as error:
            raise not_written(file, error) from error
        self._file, self._flushed, self._empty = file, time.monotonic(), True

    def add(self, record: Record) -> None:
        self._empty = False
        try:
            data = record.line().encode()
            while data:
                data = data[os.write(self._handle, data) :]
            if time.monotonic() - self._flushed > _FLUSHED_EVERY:
                os.fsync(self._handle)
                self._flushed = time.monotonic()
        except OSError as error:
            raise not_written(self._file, error) from error

    def close(self) -> None:
        with suppress(OSError):  # some file systems cannot
            os.fsync(self._handle)
        os.close(self._handle)
        if self._empty:
            self._file.unlink(missing_ok=True)


def _is_result(place: Path) -> bool:
    """Whether there is something of a batch where a result is to be; refused is what somebody else put there.

    Raises
    ------
    InputError
        Then.
    """
    try:
        with os.scandir(place) as entries:
            kinds = {entry.name: entry.is_dir() for entry in entries}
    except FileNotFoundError:
        return False
    except NotADirectoryError:
        kinds = {"": True}
    if kinds and (RECORD not in kinds or any(kinds.values())):
        raise InputError(f"{place} holds something else than a result: move it away, or choose another output.")
    return True


def _settle(folder: Path) -> None:
    """Have the files on the disk: else a power cut may keep their names, and the line of the manifest, alone."""
    for file in folder.iterdir():
        handle = os.open(file, os.O_RDWR)
        try:
            with suppress(OSError):  # some file systems cannot
                os.fsync(handle)
        finally:
            os.close(handle)
