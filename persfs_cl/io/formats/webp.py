"""WebP files."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat

if TYPE_CHECKING:
    import PIL.Image


class WebP(PillowFormat):
    """WebP, lossy or not."""

    name, suffixes = "WebP", frozenset({".webp"})

    def claims(self, source: Source) -> bool:
        """By its container."""
        return source.head[:4] == b"RIFF" and source.head[8:12] == b"WEBP"

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's."""
        from PIL import WebPImagePlugin

        return WebPImagePlugin.WebPImageFile(file)
