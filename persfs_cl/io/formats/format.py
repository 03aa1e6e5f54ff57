"""What a format of image files is asked, and the file that it is asked about."""

from __future__ import annotations

import io
import mmap
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import BinaryIO, ClassVar

from persfs_cl.errors import InputError
from persfs_cl.io.raster import Header, Raster
from persfs_cl.io.tiff import SIGNATURES, Directory, read_directories
from persfs_cl.wording import keyword

_HEAD = 64
"""Bytes that tell the formats apart."""


@dataclass(frozen=True, eq=False)
class Source:
    """A file that is read, and what is wanted of it.

    Attributes
    ----------
    path : Path
    data : bytes or mmap
        All of it.
    stream : file or None
        The same as a file, where it is one that is open.
    page : int or None
        Which of its pictures, from 1; None for the only one.
    half_size : bool
        Whether a pixel is to be made of each four of a camera's sensor.
    """

    path: Path
    data: bytes | mmap.mmap
    stream: BinaryIO | None = None
    page: int | None = None
    half_size: bool = False

    @cached_property
    def head(self) -> bytes:
        """Its first bytes."""
        return bytes(self.data[:_HEAD])

    @cached_property
    def brands(self) -> frozenset[bytes]:
        """What a file of boxes (HEIF, AVIF, CR3) says that it is; empty for others."""
        if self.head[4:8] != b"ftyp":
            return frozenset()
        end = min(int.from_bytes(self.head[:4], "big"), len(self.head))
        return frozenset({self.head[8:12], *(self.head[place : place + 4] for place in range(16, end - 3, 4))})

    @cached_property
    def directories(self) -> list[Directory]:
        """Of a TIFF file, walked to their end; empty for others."""
        return read_directories(self.path, self.data) if self.head.startswith(SIGNATURES) else []

    def file(self) -> BinaryIO:
        """As a file, from its beginning."""
        if self.stream is None:
            return io.BytesIO(self.data)
        self.stream.seek(0)
        return self.stream

    def picture(self, count: int, kind: str, *, first: bool = False) -> int:
        """Which of its pictures is wanted, from 0.

        Parameters
        ----------
        count : int
            How many there are.
        kind : str
            What they are called.
        first : bool
            Whether the first is the photo unless another is asked for.

        Raises
        ------
        InputError
            When there are several and none is chosen, or there is none of that number.
        """
        if self.page is None:
            if count == 1 or first:
                return 0
            raise InputError(
                f"{self.path} has {count} {kind}: choose one by {keyword('page')}, from 1 to {count}, or save the one "
                "you want alone."
            )
        if not 1 <= self.page <= count:
            remedy = f"give {keyword('page')} from 1 to {count}" if count > 1 else f"leave {keyword('page')} out"
            raise InputError(
                f"{self.path} has {count} {kind if count > 1 else 'picture'}, there is no page {self.page}: {remedy}.",
                argument="page",
                value=self.page,
            )
        return self.page - 1


class Format(ABC):
    """A format of image files.

    Whatever decoders raise at broken data may be let through: who calls words it.
    """

    name: ClassVar[str]
    """For messages."""
    suffixes: ClassVar[frozenset[str]]
    """Of its files, in small letters."""
    sensor: ClassVar[bool] = False
    """Whether its files hold what a sensor measured, which `half_size` is for."""

    @abstractmethod
    def claims(self, source: Source) -> bool:
        """Whether the file is of this format, by what is in it."""

    @abstractmethod
    def header(self, source: Source) -> Header:
        """What the file says of its samples; refused for what `raster` would refuse it so far."""

    @abstractmethod
    def raster(self, source: Source) -> Raster:
        """The samples."""

    @abstractmethod
    def size(self, source: Source) -> tuple[int, int]:
        """Of the picture, one side and the other, whatever its samples are."""

    @abstractmethod
    def exif(self, source: Source) -> BinaryIO | None:
        """Its EXIF data as a TIFF file, if it has any."""
