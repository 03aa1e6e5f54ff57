"""JPEG 2000 files."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat

if TYPE_CHECKING:
    import PIL.Image

_BOXES, _CODESTREAM = b"\0\0\0\x0cjP  \r\n\x87\n", b"\xff\x4f\xff\x51"


class Jpeg2000(PillowFormat):
    """JPEG 2000, as a file of boxes or as its codestream alone."""

    name, suffixes = "JPEG 2000", frozenset({".jp2", ".j2k", ".j2c", ".jpc", ".jpx", ".jpf"})

    def claims(self, source: Source) -> bool:
        """By its first box or marker."""
        return source.head.startswith((_BOXES, _CODESTREAM))

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's."""
        from PIL import Jpeg2KImagePlugin

        return Jpeg2KImagePlugin.Jpeg2KImageFile(file)

    def bits(self, source: Source, photo: PIL.Image.Image) -> int:
        """By the codestream, whose size must be that of the boxes, which the pixels were counted by."""
        place = source.data.find(_CODESTREAM)
        right, bottom, left, top = struct.unpack_from(">4I", source.data, place + 8)
        (count,) = struct.unpack_from(">H", source.data, place + 40)
        if place < 0 or (right - left, bottom - top) != photo.size:
            raise InputError(f"{source.path} is broken: it says two different sizes of itself. Save or copy it again.")
        depths = set(source.data[place + 42 : place + 42 + 3 * count : 3])
        if len(depths) != 1 or max(depths) > 15:
            told = ", ".join(f"{'-' if depth > 127 else ''}{depth % 128 + 1}" for depth in sorted(depths))
            raise InputError(
                f"{source.path} has samples of {told} bits (- for signed ones): save it with unsigned 8 or 16 bits."
            )
        return depths.pop() + 1

    def deep(self, source: Source, photo: PIL.Image.Image, picture: int) -> NDArray[Any]:
        """By imagecodecs: Pillow has colours of 8 bits only."""
        import imagecodecs

        return np.asarray(imagecodecs.jpeg2k_decode(bytes(source.data)))
