"""BMP files."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat

if TYPE_CHECKING:
    import PIL.Image

_HEADERS = (12, 16, 40, 52, 56, 64, 108, 124)
"""Bytes that the headers of its versions have."""


class Bmp(PillowFormat):
    """Windows bitmaps."""

    name, suffixes = "BMP", frozenset({".bmp", ".dib"})

    def claims(self, source: Source) -> bool:
        """By two letters, which texts may begin with, and the size of what follows them."""
        return source.head.startswith(b"BM") and int.from_bytes(source.head[14:18], "little") in _HEADERS

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's."""
        from PIL import BmpImagePlugin

        return BmpImagePlugin.BmpImageFile(file)
