"""Where the results of a batch go: a folder, or any place that fsspec has a protocol for.

A result is there whole or not at all. In a folder it is made elsewhere and renamed. Object stores know no renaming:
there `record.json` comes last, and a result without it is none.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from persfs_cl.errors import InputError, UnavailableError
from persfs_cl.io.files import FilePath, as_path, not_written, staging
from persfs_cl.pipeline.manifest import FOLDER, Record, file_name

if TYPE_CHECKING:
    import fsspec

RECORD = "record.json"
"""The line of the manifest about a result, in its folder: what is complete stays known, whatever becomes of the run."""

_FLUSHED_EVERY = 1.0
"""Seconds after which what was written of the manifest is made to reach the disk."""
_PART_SECONDS, _PART_LINES = 30.0, 1000
"""Where files cannot grow, a part of the manifest is written so often."""


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


class Store(ABC):
    """A place for results; it may be pickled."""

    @abstractmethod
    def opened(self) -> Any:
        """A context manager that gives a :class:`Shelf`."""

    @abstractmethod
    def finder(self) -> Callable[[str], Record | None]:
        """A function that gives the record of a result that is there, and complete, by its name."""

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

    def finder(self) -> Callable[[str], Record | None]:
        """See :class:`Store`."""

        def find(name: str) -> Record | None:
            try:
                return Record.read((self.root / name / RECORD).read_bytes())
            except OSError:
                return None

        return find

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
            yield _lines(file)

    def publish(self, write: Callable[[Path], Iterable[str]]) -> None:
        """See :class:`Store`."""
        write(self.root)


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
            final.parent.mkdir(parents=True, exist_ok=True)
            old = self._stage / f"{new.name}-old"
            with suppress(FileNotFoundError):
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
        self._file, self._flushed = file, time.monotonic()

    def add(self, record: Record) -> None:
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


@dataclass(frozen=True)
class RemoteStore(Store):
    """Results at a URL.

    Attributes
    ----------
    url : str
        As fsspec has it: protocol://place.
    """

    url: str

    def __str__(self) -> str:
        return self.url

    def _place(self) -> tuple[fsspec.AbstractFileSystem, str]:
        import fsspec  # noqa: PLC0415 - not needed by everyone who imports this module

        try:
            return fsspec.core.url_to_fs(self.url)  # type: ignore[no-any-return] # fsspec is not typed
        except (ImportError, ValueError) as error:
            raise UnavailableError(f"{self.url} cannot be used ({error}): install what its protocol needs.") from error

    @contextmanager
    def opened(self) -> Iterator[Shelf]:
        """See :class:`Store`."""
        with tempfile.TemporaryDirectory(prefix="persfs-cl-") as stage:
            yield _RemoteShelf(self, *self._place(), Path(stage))

    def finder(self) -> Callable[[str], Record | None]:
        """See :class:`Store`."""
        system, root = self._place()
        # One listing in place of a question for each photo, which takes as long as a photo does.
        there = set(system.find(root)) if system.exists(root) else set()

        def find(name: str) -> Record | None:
            place = f"{root}/{name}/{RECORD}"
            return Record.read(system.cat_file(place)) if place in there else None

        return find

    def records(self, names: Sequence[str]) -> dict[str, Record]:
        """See :class:`Store`."""
        system, root = self._place()
        # All at once where the protocol can, and without a meaning for brackets and stars in names.
        found = system.cat_ranges([f"{root}/{name}/{RECORD}" for name in names], None, None, on_error="return")
        read = {name: Record.read(data) for name, data in zip(names, found, strict=True) if isinstance(data, bytes)}
        return {name: record for name, record in read.items() if record is not None}

    def journal(self) -> Journal:
        """See :class:`Store`."""
        system, root = self._place()
        return _PartedJournal(system, f"{root}/{FOLDER}/{file_name().removesuffix('.jsonl')}")

    def manifests(self) -> Iterator[Iterable[bytes]]:
        """See :class:`Store`."""
        system, root = self._place()
        for file in sorted(system.glob(f"{root}/{FOLDER}/*.jsonl")):
            yield system.cat_file(file).splitlines(keepends=True)

    def publish(self, write: Callable[[Path], Iterable[str]]) -> None:
        """See :class:`Store`."""
        system, root = self._place()
        with tempfile.TemporaryDirectory(prefix="persfs-cl-") as folder:
            for file in write(Path(folder)):
                system.put_file(str(Path(folder) / file), f"{root}/{file}")


class _RemoteShelf(Shelf):
    def __init__(self, store: RemoteStore, system: Any, root: str, stage: Path) -> None:
        self._store, self._system, self._root, self._stage = store, system, root, stage
        self._numbers = count()

    def put(self, name: str, fill: Callable[[Path], Record]) -> Record:
        new = self._stage / f"{next(self._numbers)}"
        final = f"{self._root}/{name}"
        try:
            new.mkdir()
            record = fill(new)
            with suppress(FileNotFoundError):
                self._system.rm_file(f"{final}/{RECORD}")
            self._system.makedirs(final, exist_ok=True)
            for file in sorted(new.iterdir()):
                self._system.put_file(str(file), f"{final}/{file.name}")
            # A name that nobody reads would not do: it must be either not there or whole.
            self._system.pipe_file(f"{final}/{RECORD}", record.line().encode())
        except InputError as error:
            raise type(error)(str(error).replace(str(new), f"{self._store.url}/{name}")) from error
        except OSError as error:
            raise not_written(f"{self._store.url}/{name}", error) from error
        finally:
            shutil.rmtree(new, ignore_errors=True)
        return record


class _PartedJournal(Journal):
    def __init__(self, system: Any, stem: str) -> None:
        self._system, self._stem = system, stem
        self._lines: list[str] = []
        self._parts, self._written = 0, time.monotonic()

    def add(self, record: Record) -> None:
        self._lines.append(record.line())
        if len(self._lines) >= _PART_LINES or time.monotonic() - self._written > _PART_SECONDS:
            self._write()

    def close(self) -> None:
        self._write()

    def _write(self) -> None:
        if self._lines:
            self._system.makedirs(self._stem.rpartition("/")[0], exist_ok=True)
            self._system.pipe_file(f"{self._stem}-{self._parts:06}.jsonl", "".join(self._lines).encode())
        self._lines.clear()
        self._parts, self._written = self._parts + 1, time.monotonic()


def store_for(output: FilePath) -> Store:
    """The store of a folder or a URL."""
    text = os.fspath(output) if isinstance(output, (str, os.PathLike)) else output
    if isinstance(text, str) and "://" in text:
        return RemoteStore(text.rstrip("/"))
    return FolderStore(as_path(output))


def _lines(file: Path) -> Iterator[bytes]:
    with file.open("rb") as handle:
        yield from _whole(handle)


def _whole(handle: BinaryIO) -> Iterator[bytes]:
    yield from handle
