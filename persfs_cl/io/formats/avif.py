"""AVIF files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.io.code_points import CodePoints, code_points_in
from persfs_cl.io.formats.format import Source
from persfs_cl.io.formats.pillow import PillowFormat

if TYPE_CHECKING:
    import PIL.Image

_PROPERTIES = 2**16
"""Bytes within which a file says how it is coded."""


class Avif(PillowFormat):
    """AVIF of 8, 10 or 12 bits."""

    name, suffixes = "AVIF", frozenset({".avif"})

    def claims(self, source: Source) -> bool:
        """By its brands."""
        return bool(source.brands & {b"avif", b"avis"})

    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """Pillow's."""
        from PIL import AvifImagePlugin

        return AvifImagePlugin.AvifImageFile(file)

    def bits(self, source: Source, photo: PIL.Image.Image) -> int:
        """By the properties of the coder (AV1 Codec ISO Media File Format Binding, 2.3.3)."""
        properties = bytes(source.data[:_PROPERTIES])
        place = properties.find(b"av1C")
        flags = properties[place + 6] if 0 <= place < len(properties) - 6 else 0
        return (12 if flags & 0x20 else 10) if flags & 0x40 else 8

    def codes(self, source: Source) -> CodePoints | None:
        """By the box of code points."""
        return code_points_in(bytes(source.data[:_PROPERTIES]))

    def deep(self, source: Source, photo: PIL.Image.Image, picture: int) -> NDArray[Any]:
        """By imagecodecs: Pillow has 8 bits only."""
        import imagecodecs

        return np.asarray(imagecodecs.avif_decode(bytes(source.data), index=picture))
