"""What the formats that Pillow opens have in common."""

from __future__ import annotations

import io
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.code_points import CodePoints
from persfs_cl.io.formats.format import Format, Source
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.raster import Header, Raster, exif_orientation, unsigned, upright, upright_shape

if TYPE_CHECKING:
    import PIL.Image

_EXIF_ORIENTATION = 274


class PillowFormat(Format):
    """A format that Pillow opens, and decodes where its samples have 8 bits."""

    @abstractmethod
    def plugin(self, file: BinaryIO) -> PIL.Image.Image:
        """The file as Pillow's plugin for the format opens it, its pixels not yet decoded."""

    def bits(self, source: Source, photo: PIL.Image.Image) -> int:
        """Of a sample."""
        return 8

    def deep(self, source: Source, photo: PIL.Image.Image, picture: int) -> NDArray[Any]:
        """The samples where they have more than 8 bits, which Pillow would cut."""
        raise NotImplementedError

    def codes(self, source: Source) -> CodePoints | None:
        """What the file says of its numbers, where it has no profile."""
        return None

    def picture(self, source: Source, photo: PIL.Image.Image) -> int:
        """Which picture of several is wanted, from 0."""
        return source.picture(getattr(photo, "n_frames", 1), "pictures, an animation")

    def exif_block(self, source: Source, photo: PIL.Image.Image) -> bytes:
        """The EXIF data, without decoding pixels."""
        block = photo.info.get("exif")
        return block if isinstance(block, bytes) else b""

    def opened(self, source: Source) -> PIL.Image.Image:
        """The file as Pillow opens it; refused when it has too many pixels."""
        # Not by PIL.Image.open, whose own limit on pixels, warned of and then enforced, is the same on every machine.
        photo = self.plugin(source.file())
        require_pixels(source.path, (photo.height, photo.width))
        return photo

    def header(self, source: Source) -> Header:
        """As the file's beginning says."""
        from PIL import Image

        with self.opened(source) as photo:
            self.picture(source, photo)
            bits = self.bits(source, photo)
            _require_mode(source, photo)
            # Without its pixels: Pillow's own way decodes a PNG file for what may follow them.
            orientation = exif_orientation(Image.Image.getexif(photo).get(_EXIF_ORIENTATION))
            shape = upright_shape((photo.height, photo.width), orientation)
        return Header(shape, bits, unsigned(bits), orientation)

    def raster(self, source: Source) -> Raster:
        """Decoded."""
        with self.opened(source) as photo:
            picture, bits = self.picture(source, photo), self.bits(source, photo)
            _require_mode(source, photo)
            orientation = exif_orientation(photo.getexif().get(_EXIF_ORIENTATION))
            space = photo.info.get("icc_profile") or self.codes(source)
            if bits > 8:
                samples = self.deep(source, photo, picture)
            else:
                if picture:
                    photo.seek(picture)
                samples = np.asarray(photo.convert(_flat_mode(photo)))
        if samples.ndim == 2:
            samples = samples[..., None]
        return Raster(upright(samples, orientation), bits, orientation, space)

    def size(self, source: Source) -> tuple[int, int]:
        """By Pillow."""
        with self.opened(source) as photo:
            return photo.size

    def exif(self, source: Source) -> BinaryIO | None:
        """By Pillow, which finds them."""
        with self.opened(source) as photo:
            block = self.exif_block(source, photo).removeprefix(b"Exif\0\0")
            return io.BytesIO(block) if block else None


def _require_mode(source: Source, photo: PIL.Image.Image) -> None:
    if photo.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "RGBX", "I;16", "I;16B", "I"):
        raise InputError(f"{source.path} has the colour model {photo.mode}: save it as grey or RGB.")


def _flat_mode(photo: PIL.Image.Image) -> str:
    """The mode that shows the picture's samples as they are."""
    grey = photo.mode in ("1", "L", "LA")
    if photo.has_transparency_data:
        return "LA" if grey else "RGBA"
    return "L" if grey else "RGB"
