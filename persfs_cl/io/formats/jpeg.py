"""JPEG files."""

from __future__ import annotations

from typing import TYPE_CHECKING, BinaryIO

from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat

if TYPE_CHECKING:
    import PIL.Image

SIGNATURE = b"\xff\xd8\xff"


class Jpeg(PillowFormat):
    """JPEG, of one picture or several."""

    name, suffixes = "JPEG", frozenset({".jpg", ".jpeg", ".jpe", ".jfif", ".mpo"})

    def claims(self, source: Source) -> bool:
        """By its first marker."""
        return source.head.startswith(SIGNATURE)

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's, which knows files of several pictures."""
        from PIL import JpegImagePlugin

        return JpegImagePlugin.jpeg_factory(file)

    def picture(self, source: Source, photo: PIL.Image.Image) -> int:
        """A multi-picture JPEG holds the photo first, then its preview or gain map."""
        return source.picture(getattr(photo, "n_frames", 1), "pictures", first=True)
