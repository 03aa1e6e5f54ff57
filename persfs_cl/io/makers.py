"""Camera raw files, recognised by what is in them."""

from __future__ import annotations

from collections.abc import Sequence

from persfs_cl.io.tiff import DNG_VERSION, MAKE, PHOTOMETRIC, SUB_IFDS, Directory

SUFFIXES = frozenset(
    {
        ".3fr",
        ".arw",
        ".cr2",
        ".cr3",
        ".crw",
        ".dcr",
        ".dng",
        ".erf",
        ".fff",
        ".iiq",
        ".kdc",
        ".mef",
        ".mos",
        ".mrw",
        ".nef",
        ".nrw",
        ".orf",
        ".pef",
        ".raf",
        ".rw2",
        ".sr2",
        ".srf",
        ".srw",
        ".x3f",
    }
)
"""Of camera raw files, in small letters."""

SENSORS = (32803, 34892)
"""Colour models of what a sensor measured: a colour filter array, and three colours a pixel."""
# What stands at which byte.
_MAGIC: tuple[tuple[int, bytes, str], ...] = (
    (8, b"CR\x02", "Canon CR2"),
    (4, b"ftypcrx ", "Canon CR3"),
    (6, b"HEAPCCDR", "Canon CRW"),
    (0, b"IIRO", "Olympus ORF"),
    (0, b"IIRS", "Olympus ORF"),
    (0, b"MMOR", "Olympus ORF"),
    (0, b"FUJIFILMCCD-RAW", "Fujifilm RAF"),
    (0, b"IIU\0", "Panasonic RW2"),
    (8, b"IIII", "Phase One IIQ"),
    (8, b"MMMM", "Phase One IIQ"),
    (0, b"FOVb", "Sigma X3F"),
    (0, b"\0MRM", "Minolta MRW"),
)
_MAKERS = {
    "nikon": "Nikon NEF",
    "sony": "Sony ARW",
    "pentax": "Pentax PEF",
    "ricoh": "Pentax PEF",
    "samsung": "Samsung SRW",
    "hasselblad": "Hasselblad 3FR",
    "kodak": "Kodak DCR",
    "eastman": "Kodak DCR",
    "epson": "Epson ERF",
    "leaf": "Leaf MOS",
    "mamiya": "Mamiya MEF",
}


def raw_kind(data: bytes, pages: Sequence[Directory]) -> str | None:
    """Which kind of camera raw file it is; None where it is none.

    Parameters
    ----------
    data : bytes
        The first 64, or more.
    pages : sequence of Directory
        Of a TIFF file.
    """
    for start, magic, kind in _MAGIC:
        if data.startswith(magic, start):
            return kind
    if not pages:
        return None
    directories = [directory for page in pages for directory in page.walk()]
    if any(DNG_VERSION in directory.tags for directory in directories):
        return "Adobe DNG"
    first = pages[0]
    sensor = any(directory.number(PHOTOMETRIC) in SENSORS for directory in directories)
    maker = first.text(MAKE)
    # Some makers' sensor images have numbers for a colour model that are nobody else's.
    preview = bool(maker) and first.reduced and SUB_IFDS in first.tags
    if not sensor and not preview:
        return None
    known = (kind for name, kind in _MAKERS.items() if maker.lower().startswith(name))
    return next(known, f"of {maker}" if maker else "of a colour filter array")
