"""The directories of a TIFF file, walked before any decoder is let near it."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath

SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
BIG_SIGNATURES = (b"II+\0", b"MM\0+")
"""Of BigTIFF, whose offsets have 64 bits."""

# Tags, by the names that the TIFF, DNG and EXIF standards give them.
NEW_SUBFILE_TYPE, IMAGE_WIDTH, IMAGE_LENGTH, BITS_PER_SAMPLE = 254, 256, 257, 258
COMPRESSION, PHOTOMETRIC, MAKE, ORIENTATION, SAMPLES_PER_PIXEL = 259, 262, 271, 274, 277
TILE_WIDTH, TILE_LENGTH, IMAGE_DEPTH, TILE_DEPTH = 322, 323, 32997, 32998
SUB_IFDS, DNG_VERSION = 330, 50706
_CHILDREN = {SUB_IFDS: "sub-directory", 34665: "EXIF directory", 34853: "GPS directory", 40965: "EXIF directory"}

# struct's code of a TIFF type; texts and undefined bytes stay bytes, fractions are pairs.
_CODES = {1: "B", 2: "s", 3: "H", 4: "I", 5: "2I", 6: "b", 7: "s", 8: "h", 9: "i", 10: "2i", 11: "f", 12: "d"}
_CODES |= {13: "I", 16: "Q", 17: "q", 18: "Q"}
# Real files have tens of tags and, pages refused as they are, a handful of directories.
_MOST_TAGS, _MOST_DIRECTORIES, _MOST_VALUES = 4096, 1000, 64


@dataclass(frozen=True)
class Directory:
    """One directory of tags: a page, a reduced copy or a part of one, or EXIF data.

    Attributes
    ----------
    tags : mapping of int to (tuple of numbers, or bytes)
        The first values of each tag of a known type whose values lie in the file; texts as bytes.
    parts : list of Directory
        Those that its tags SubIFDs, ExifIFD and the like point to.
    """

    tags: Mapping[int, tuple[float, ...] | bytes]
    parts: list[Directory] = field(default_factory=list)

    def number(self, tag: int, default: int = 0) -> int:
        """The tag's only or first value as a whole number; `default` where it is none."""
        values = self.tags.get(tag, ())
        return int(values[0]) if isinstance(values, tuple) and values and isinstance(values[0], int) else default

    def text(self, tag: int) -> str:
        """The tag's text, or nothing."""
        values = self.tags.get(tag, b"")
        return values.split(b"\0")[0].decode("latin-1").strip() if isinstance(values, bytes) else ""

    @property
    def reduced(self) -> bool:
        """Whether it is a smaller copy of another."""
        return bool(self.number(NEW_SUBFILE_TYPE) & 1)

    def walk(self) -> Iterator[Directory]:
        """Itself and all that lie below it."""
        yield self
        for part in self.parts:
            yield from part.walk()


def read_directories(path: FilePath, data: bytes | mmap.mmap) -> list[Directory]:
    """The pages of a TIFF file, or of EXIF data, with what hangs from them.

    What lies outside the file is left to the decoder, which says it better.

    Parameters
    ----------
    path : path
        Named in errors.
    data : bytes or mmap
        The whole file, which begins with one of `SIGNATURES`.

    Raises
    ------
    InputError
        When a directory points back to itself or to one that led to it, or there are impossibly many directories,
        tags or values.
    """
    return _Walk(path, data).pages()


class _Walk:
    def __init__(self, path: FilePath, data: bytes | mmap.mmap) -> None:
        self.path, self.data = path, data
        self.order = "<" if data[:2] == b"II" else ">"
        self.big = data[:4] in BIG_SIGNATURES
        self.found: dict[int, Directory] = {}
        self.promised = 0

    def pages(self) -> list[Directory]:
        """The chain of the main directories."""
        chain: dict[int, Directory] = {}
        position = self._read("Q" if self.big else "I", 8 if self.big else 4)
        while position:
            if position in chain:
                self._refuse_loop("page", position)
            page = self._directory(position, {**dict.fromkeys(chain, "page"), position: "page"})
            if page is None:
                break
            chain[position] = page
            count, start, length = self._extent(position)
            position = self._read("Q" if self.big else "I", start + count * length) or 0
        return list(chain.values())

    def _directory(self, position: int, above: Mapping[int, str]) -> Directory | None:
        if position in self.found:
            return self.found[position]
        count, start, length = self._extent(position)
        if not count and start > len(self.data):
            return None
        if count > _MOST_TAGS:
            raise self._broken(f"its directory at byte {position} promises {count} tags")
        tags = {}
        for place in range(start, start + count * length, length):
            entry = self._entry(place)
            if entry is not None:
                tags[entry[0]] = entry[1]
        directory = self.found[position] = Directory(tags)
        if len(self.found) > _MOST_DIRECTORIES:
            raise self._broken(f"it has more than {_MOST_DIRECTORIES} directories")
        for tag, kind in _CHILDREN.items():
            for child in tags.get(tag, ()):
                if not isinstance(child, int) or not child:
                    continue
                if child in above:
                    self._refuse_loop(kind, child)
                part = self._directory(child, {**above, child: kind})
                if part is not None:
                    directory.parts.append(part)
        return directory

    def _extent(self, position: int) -> tuple[int, int, int]:
        """Number of tags, where they begin, and the bytes of each; no tags where the directory is cut off."""
        head, length = (8, 20) if self.big else (2, 12)
        count = self._read("Q" if self.big else "H", position)
        return (0, len(self.data) + 1, length) if count is None else (count, position + head, length)

    def _entry(self, place: int) -> tuple[int, tuple[float, ...] | bytes] | None:
        """A tag and its first values; None when it is not of this world."""
        try:
            tag, kind, count = struct.unpack_from(self.order + ("HHQ" if self.big else "HHI"), self.data, place)
        except struct.error:
            return None
        code = _CODES.get(kind)
        if code is None:
            return None
        size = struct.calcsize("=" + code) * count
        room = 8 if self.big else 4
        where: int | None = place + (12 if self.big else 8)
        if size > room:
            where = self._read("Q" if self.big else "I", place + room + 4)
            if where is None or where + size > len(self.data):
                return None
            # Decoders make a number of every value, in each tag anew.
            self.promised += size
            if self.promised > 2 * len(self.data):
                raise self._broken("its tags promise more values than it holds")
        few = min(count, _MOST_VALUES)
        form = f"{self.order}{few}s" if code == "s" else f"{self.order}{few * int(code[:-1] or 1)}{code[-1]}"
        try:
            values = struct.unpack_from(form, self.data, where or 0)
        except struct.error:
            return None
        return tag, values[0] if code == "s" else values

    def _read(self, code: str, position: int) -> int | None:
        try:
            number: int = struct.unpack_from(self.order + code, self.data, position)[0]
        except (struct.error, OverflowError):
            return None
        return number

    def _refuse_loop(self, kind: str, position: int) -> None:
        raise self._broken(f"its {kind} at byte {position} points back to itself, in a loop without end")

    def _broken(self, why: str) -> InputError:
        return InputError(f"{self.path} is broken: {why}. Save or copy it again.")
