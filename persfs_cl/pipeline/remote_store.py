"""Results at any place that fsspec has a protocol for, and whether an output is such a place or a folder.

Object stores know no renaming: `record.json` comes last, and a result without it is none.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

from persfs_cl.errors import InputError, UnavailableError
from persfs_cl.io.files import FilePath, as_path, not_written
from persfs_cl.pipeline.manifest import FOLDER, Record, file_name
from persfs_cl.pipeline.store import RECORD, FolderStore, Journal, Results, Shelf, Store, record_of
from persfs_cl.wording import brief

if TYPE_CHECKING:
    import fsspec

_PART_SECONDS, _PART_LINES = 30.0, 1000
"""Where files cannot grow, a part of the manifest is written so often."""


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
        try:
            import fsspec

            return fsspec.core.url_to_fs(self.url)  # type: ignore[no-any-return] # fsspec is not typed
        except (ImportError, ValueError) as error:
            raise UnavailableError(f"{self.url} cannot be used ({error}): install what its protocol needs.") from error

    @contextmanager
    def opened(self) -> Iterator[Shelf]:
        """See :class:`Store`."""
        with tempfile.TemporaryDirectory(prefix="persfs-cl-") as stage:
            yield _RemoteShelf(self, *self._place(), Path(stage))

    def results(self) -> Results:
        """See :class:`Store`."""
        system, root = self._place()
        with _refusing(self.url):
            # One listing in place of a question for each photo, which takes as long as a photo does.
            found = system.find(root) if system.exists(root) else []
        return _RemoteResults(self, system, root, {file for file in found if file.endswith(f"/{RECORD}")})

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
        return _PartedJournal(self.url, system, f"{root}/{FOLDER}/{file_name().removesuffix('.jsonl')}")

    def manifests(self) -> Iterator[Iterable[bytes]]:
        """See :class:`Store`."""
        system, root = self._place()
        with _refusing(self.url):
            files = sorted(system.glob(f"{root}/{FOLDER}/*.jsonl"))
        for file in files:
            with _refusing(f"{self.url}/{FOLDER}"):
                lines = system.cat_file(file).splitlines(keepends=True)
            yield lines

    def publish(self, write: Callable[[Path], Iterable[str]]) -> None:
        """See :class:`Store`."""
        system, root = self._place()
        with tempfile.TemporaryDirectory(prefix="persfs-cl-") as folder:
            for file in write(Path(folder)):
                with _refusing(f"{self.url}/{file}"):
                    system.put_file(str(Path(folder) / file), f"{root}/{file}")

    def clean(self) -> None:
        """See :class:`Store`: there are no temporary files there."""


class _RemoteResults:
    def __init__(self, store: RemoteStore, system: Any, root: str, there: set[str]) -> None:
        self._store, self._system, self._root, self._there = store, system, root, there

    def __contains__(self, name: object) -> bool:
        return f"{self._root}/{name}/{RECORD}" in self._there

    def record(self, name: str) -> Record | None:
        if name not in self:
            return None
        with _refusing(f"{self._store.url}/{name}"):
            return record_of(name, self._system.cat_file(f"{self._root}/{name}/{RECORD}"))


class _RemoteShelf(Shelf):
    def __init__(self, store: RemoteStore, system: Any, root: str, stage: Path) -> None:
        self._store, self._system, self._root, self._stage = store, system, root, stage
        self._numbers = count()

    def put(self, name: str, fill: Callable[[Path], Record]) -> Record:
        new = self._stage / f"{next(self._numbers)}"
        place, final = f"{self._store.url}/{name}", f"{self._root}/{name}"
        try:
            new.mkdir()
            record = fill(new)
            with _refusing(place):
                self._send(new, final, record)
        except InputError as error:
            raise type(error)(str(error).replace(str(new), place)) from error
        except OSError as error:
            raise not_written(place, error) from error
        finally:
            shutil.rmtree(new, ignore_errors=True)
        return record

    def _send(self, new: Path, final: str, record: Record) -> None:
        system = self._system
        # What a result before had more of must not stay beside this one. Its record goes first.
        with suppress(FileNotFoundError):
            system.rm_file(f"{final}/{RECORD}")
        if system.exists(final):
            system.rm(final, recursive=True)
        system.makedirs(final, exist_ok=True)
        for file in sorted(new.iterdir()):
            system.put_file(str(file), f"{final}/{file.name}")
        system.pipe_file(f"{final}/{RECORD}", record.line().encode())


class _PartedJournal(Journal):
    def __init__(self, url: str, system: Any, stem: str) -> None:
        self._url, self._system, self._stem = url, system, stem
        self._lines: list[str] = []
        self._parts, self._written = 0, time.monotonic()

    def add(self, record: Record) -> None:
        self._lines.append(record.line())
        if len(self._lines) >= _PART_LINES or time.monotonic() - self._written > _PART_SECONDS:
            self._write()

    def close(self) -> None:
        self._write()

    def _write(self) -> None:
        if not self._lines:
            return
        with _refusing(f"{self._url}/{FOLDER}"):
            self._system.makedirs(self._stem.rpartition("/")[0], exist_ok=True)
            self._system.pipe_file(f"{self._stem}-{self._parts:06}.jsonl", "".join(self._lines).encode())
        self._lines.clear()
        self._parts, self._written = self._parts + 1, time.monotonic()


def store_for(output: FilePath) -> Store:
    """The store of a folder or a URL."""
    text = os.fspath(output) if isinstance(output, (str, os.PathLike)) else output
    if isinstance(text, str) and text.startswith("memory:"):
        raise InputError(f"{text} is in the memory of one process, and others solve the photos: choose another output.")
    if isinstance(text, str) and "://" in text:
        return RemoteStore(text.rstrip("/"))
    return FolderStore(as_path(output))


@contextmanager
def _refusing(place: str) -> Iterator[None]:
    """Whatever a file system of fsspec raises, as an error that names the place: each has errors of its own."""
    try:
        yield
    except (InputError, MemoryError):
        raise
    except OSError as error:
        raise not_written(place, error) from error
    except Exception as error:
        raise InputError(f"{place} cannot be used ({brief(error)}): check the URL, and the rights there.") from error
