"""Formats of image files: one module each, and a line here."""

from __future__ import annotations

from persfs_cl.io.formats.avif import Avif
from persfs_cl.io.formats.bmp import Bmp
from persfs_cl.io.formats.format import Format
from persfs_cl.io.formats.heic import Heic
from persfs_cl.io.formats.jpeg import Jpeg
from persfs_cl.io.formats.jpeg2000 import Jpeg2000
from persfs_cl.io.formats.png import Png
from persfs_cl.io.formats.raw import Raw
from persfs_cl.io.formats.tiff import Tiff
from persfs_cl.io.formats.webp import WebP

FORMATS: tuple[Format, ...] = (
    Png(),
    Jpeg(),
    Raw(),  # before TIFF, whose signature many of its files have
    Tiff(),
    WebP(),
    Avif(),  # before HEIC, of which many of its files say that they are that too
    Heic(),
    Jpeg2000(),
    Bmp(),
)
"""In the order in which they are asked whether a file is theirs."""
