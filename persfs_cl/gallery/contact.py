"""A contact sheet: photographs and surfaces of many images in one picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from persfs_cl.gallery.chosen import evenly_chosen
from persfs_cl.io.files import atomic_path
from persfs_cl.surface.formats.pictures import PHOTO, SHADED

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

CONTACT = "contact.jpg"
_SIDE = 132
"""Pixels that a picture has at most, across and down."""
_GAP = 2
_MARGIN = 14
_LINE = 18
_HEADING = 34
_PAPER, _INK, _FAINT = (24, 25, 28), (226, 228, 232), (140, 145, 152)
_QUALITY = 87


def write_contact_sheet(
    output: Path, records: Iterable[Mapping[str, Any]], *, title: str = "", most: int = 400
) -> Path | None:
    """Write contact.jpg: photograph and surface of each image side by side, with its name.

    Parameters
    ----------
    output : Path
        Folder with the results, in which the images' folders lie by their names.
    records : iterable of mapping
        Of the manifest, in the order in which they are shown. Those that are not "done", or have no previews among
        their files, are not shown.
    title : str
    most : int
        Of more images so many are shown, evenly chosen; the picture says so.

    Returns
    -------
    Path or None
        The file; None when there is nothing to show.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    from PIL import Image, ImageDraw

    names = (str(record["name"]) for record in records if {PHOTO, SHADED} <= {*(record.get("files") or ())})
    chosen, count = evenly_chosen(names, most)
    if not chosen:
        return None
    across, down = 2 * _SIDE + _GAP + _MARGIN, _SIDE + _LINE + _MARGIN
    # As wide as high, as far as whole images go.
    columns = min(len(chosen), max(1, round(math.sqrt(1.25 * len(chosen) * down / across))))
    rows = -(-len(chosen) // columns)
    size = max(columns * across + _MARGIN, 420), rows * down + _HEADING + _MARGIN
    sheet = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(sheet)
    small, large = _font(12), _font(14)
    shown = f"{count:,} images" if len(chosen) == count else f"{len(chosen):,} of {count:,} images, evenly chosen"
    heading = f"{title}  ·  {shown}" if title else shown
    draw.text((_MARGIN, _MARGIN - 4), _fitted(draw, heading, large, size[0] - 2 * _MARGIN), fill=_INK, font=large)
    for number, name in enumerate(chosen):
        left = _MARGIN + number % columns * across
        top = _HEADING + number // columns * down
        for place, file in enumerate((PHOTO, SHADED)):
            _paste(sheet, output / name / file, left + place * (_SIDE + _GAP), top)
        label = _fitted(draw, _printable(name), small, across - _MARGIN)
        draw.text((left, top + _SIDE + 3), label, fill=_FAINT, font=small)
    target = output / CONTACT
    with atomic_path(target) as temporary:
        sheet.save(temporary, "JPEG", quality=_QUALITY)
    return target


def _paste(sheet: Image, path: Path, left: int, top: int) -> None:
    """Put a picture into the middle of its square; one that cannot be read leaves it empty."""
    from PIL import Image

    try:
        with Image.open(path) as picture:
            picture.draft("RGB", (_SIDE, _SIDE))  # a smaller one is decoded in less time
            shown = picture.convert("RGB")
    except OSError:  # gone since, or damaged: the sheet is of use without it
        return
    scale = _SIDE / max(shown.size)
    width, height = (max(1, round(side * scale)) for side in shown.size)
    shown = shown.resize((width, height), Image.Resampling.BICUBIC)
    sheet.paste(shown, (left + (_SIDE - width) // 2, top + (_SIDE - height) // 2))


def _fitted(draw: ImageDraw, text: str, font: FreeTypeFont, width: float) -> str:
    """The text, or its beginning and end, in so many pixels."""
    if draw.textlength(text, font) <= width:
        return text
    kept = len(text)
    while kept > 1 and draw.textlength(_shortened(text, kept), font) > width:
        kept -= 1
    return _shortened(text, kept)


def _shortened(text: str, kept: int) -> str:
    # What tells files apart is more often at the end.
    start = kept // 3
    return f"{text[:start]}…{text[len(text) - (kept - start) :]}"


def _printable(name: str) -> str:
    """A name with a mark in the place of what no font draws: bytes that are no text, ends of lines and the like."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in name)


def _font(size: int) -> FreeTypeFont:
    """DejaVu Sans as Matplotlib has it: Pillow's own font has few letters but those of English."""
    from PIL import ImageFont

    found = find_spec("matplotlib")
    folder = Path(found.origin).parent if found is not None and found.origin is not None else Path()
    return ImageFont.truetype(str(folder / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"), size)
