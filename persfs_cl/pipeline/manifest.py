"""What has become of every image of a batch, as lines of JSON that only ever grow.

Each run writes a file of its own, and so does each share of a run, so that no two processes write to one. A process
that is killed leaves at most its last line unfinished: that line is passed over when the file is read. Of several lines
about one image the latest counts.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from datetime import datetime, timezone
from functools import cache, lru_cache
from importlib.metadata import version
from typing import Any, Literal, NamedTuple

from persfs_cl.errors import PersfsError
from persfs_cl.io.files import plain
from persfs_cl.wording import Spelling

FOLDER = "manifest"
"""Where the files are, below the output."""

Stamps = dict[str, tuple[int, int]]
"""Size in bytes, and time of the last change in nanoseconds, of each file that an image was solved from."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """What has become of one image.

    Attributes
    ----------
    name : str
        Its folder below the output.
    path : str
        Its file.
    status : {"done", "failed"}
    error : mapping or None
        "kind" and "message" of what failed.
    warnings : tuple of str
    input_hash : str
        Of the bytes of all its files; empty where they could not be read.
    stamps : mapping
        Of these files: while size and time stay, so does the hash.
    parameter_hash : str
        Of everything else that the result depends on.
    version : str
        Of the package.
    device : str
    converged : str
        Name of the :class:`persfs_cl.Status`.
    iterations : int
    size : (int, int) or None
        (height, width).
    seconds : mapping
        That each step took.
    finished : str
        When, in UTC, by ISO 8601.
    files : tuple of str
        What was written to its folder.
    figures : mapping
        Numbers for tables.
    """

    name: str
    path: str
    status: Literal["done", "failed"]
    error: Mapping[str, str] | None = None
    warnings: tuple[str, ...] = ()
    input_hash: str = ""
    stamps: Stamps = field(default_factory=dict)
    parameter_hash: str = ""
    version: str = ""
    device: str = ""
    converged: str = ""
    iterations: int = 0
    size: tuple[int, int] | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    finished: str = ""
    files: tuple[str, ...] = ()
    figures: Mapping[str, Any] = field(default_factory=dict)

    def line(self) -> str:
        """The record as one line of JSON, with its end."""
        return json.dumps(plain(asdict(self)), allow_nan=False) + "\n"

    @classmethod
    def read(cls, line: str | bytes) -> Record | None:
        """The record of a line; None where it is none, or not the whole of one."""
        try:
            entries = json.loads(line)
            known = {name: entries[name] for name in entries.keys() & {one.name for one in fields(cls)}}
            for name in ("warnings", "files"):
                known[name] = tuple(known.get(name, ()))
            known["stamps"] = {name: (size, time) for name, (size, time) in known.get("stamps", {}).items()}
            texts = [known[name] for name in ("name", "path", "status", "finished", "parameter_hash", "input_hash")]
            return cls(**known) if all(isinstance(text, str) for text in texts) else None
        except (ValueError, TypeError, AttributeError, KeyError, RecursionError):
            return None


class Known(NamedTuple):
    """What a run must remember of each image that an earlier one was given; small, for there may be millions."""

    status: str
    input_hash: str
    parameter_hash: str
    stamps: Stamps
    finished: str
    path: str
    files: tuple[str, ...]

    @classmethod
    def of(cls, record: Record) -> Known:
        """Of a record."""
        return cls(
            record.status,
            record.input_hash,
            record.parameter_hash,
            record.stamps,
            record.finished,
            record.path,
            _one_for_all(record.files),
        )


@lru_cache(maxsize=256)
def _one_for_all(files: tuple[str, ...]) -> tuple[str, ...]:
    """The same names as one object: most images of a batch have them."""
    return files


@cache
def package_version() -> str:
    """The version that is installed: looked up once, for that reads files."""
    return version("persfs-cl")


def now() -> str:
    """The time in UTC, by ISO 8601, to the microsecond."""
    return datetime.now(timezone.utc).isoformat(timespec="microseconds")


def as_entry(error: PersfsError, spelling: Spelling = str) -> dict[str, str]:
    """What a record says of an error."""
    return {"kind": type(error).__name__, "message": error.worded(spelling)}


def file_name() -> str:
    """A name for the file of one run, unlike all others; they sort by time."""
    return f"{datetime.now(timezone.utc):%Y%m%dT%H%M%S.%f}-{os.getpid()}-{secrets.token_hex(4)}.jsonl"


def records_of(lines: Iterable[bytes]) -> Iterator[Record]:
    """The records of a file's lines, without those that were not finished."""
    for line in lines:
        if record := Record.read(line):
            yield record


def latest(files: Iterable[Iterable[bytes]]) -> dict[str, Known]:
    """What is known of each image, by its name."""
    known: dict[str, Known] = {}
    for lines in files:
        for record in records_of(lines):
            before = known.get(record.name)
            if before is None or before.finished <= record.finished:
                known[record.name] = Known.of(record)
    return known


def latest_records(files: Iterable[Iterable[bytes]], known: Mapping[str, Known]) -> Iterator[Record]:
    """The records that `known` was taken from: a second reading, so that they need not be held."""
    told = set()
    for lines in files:
        for record in records_of(lines):
            about = known.get(record.name)
            if about is not None and about.finished == record.finished and record.name not in told:
                told.add(record.name)
                yield record
