"""PNG files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat
from persfs_cl.io.remarks import heard_on_standard_error

if TYPE_CHECKING:
    import PIL.Image

SIGNATURE = b"\x89PNG\r\n\x1a\n"


class Png(PillowFormat):
    """PNG: grey, palette or colour of 1 to 16 bits."""

    name, suffixes = "PNG", frozenset({".png"})

    def claims(self, source: Source) -> bool:
        """By its signature."""
        return source.head.startswith(SIGNATURE)

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's."""
        from PIL import PngImagePlugin

        return PngImagePlugin.PngImageFile(file)

    def bits(self, source: Source, photo: PIL.Image.Image) -> int:
        """Which have this place in every PNG."""
        return 16 if source.head[24] == 16 else 8

    def deep(self, source: Source, photo: PIL.Image.Image, picture: int) -> NDArray[Any]:
        """By imagecodecs: Pillow would drop the lower half of 16-bit colours."""
        import imagecodecs

        if getattr(photo, "n_frames", 1) > 1:
            raise InputError(
                f"{source.path} is an animation of 16 bits, of which picture {picture + 1} cannot be told from the "
                "others: save the one you want alone."
            )
        with heard_on_standard_error():
            return np.asarray(imagecodecs.png_decode(bytes(source.data)))

    def exif_block(self, source: Source, photo: PIL.Image.Image) -> bytes:
        """Wherever they are: for what may follow the pixels, Pillow would decode these."""
        return super().exif_block(source, photo) or _late_exif(source)


def _late_exif(source: Source) -> bytes:
    """The EXIF data behind the pixels; the chunks before are passed over."""
    place = len(SIGNATURE)
    while True:
        head = source.data[place : place + 8]
        if len(head) < 8 or head[4:] == b"IEND":
            return b""
        size = int.from_bytes(head[:4], "big")
        if head[4:] == b"eXIf":
            return bytes(source.data[place + 8 : place + 8 + size])
        place += size + 12
