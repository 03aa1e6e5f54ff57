"""What one image and its surface look like, in three small files."""

from __future__ import annotations

import io
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from persfs_cl.colour import to_display
from persfs_cl.io.files import atomic_path
from persfs_cl.surface.formats.pictures import PHOTO, PREVIEW, RELIEF, SHADED
from persfs_cl.surface.solved import SolvedSurface
from persfs_cl.surface.views.heights import heights_script
from persfs_cl.surface.views.reduced import Samples
from persfs_cl.surface.views.shaded import shaded

_PREVIEW_LONGEST = 320
_PHOTO_LONGEST = 640
"""The photograph is also what the relief wears, and is looked at more closely."""
_QUALITY = 85


def write_preview(
    folder: Path,
    solution: SolvedSurface,
    colour: NDArray[np.uint8] | None = None,
    *,
    name: str,
    wanted: Collection[str] = PREVIEW,
) -> list[str]:
    """Write a picture of the surface, one of the photograph, and the surface for the page that turns it.

    All are made of some pixels of the image, so that it takes some hundredths of a second whatever the size.

    Parameters
    ----------
    folder : Path
        It exists. Files of the same names are replaced.
    solution : SolvedSurface
    colour : ndarray of uint8, shape (height, width, 3), optional
        The photograph; what was solved is shown in grey when not given.
    name : str
        Of the image, as the page has it.
    wanted : collection of str
        Which of the files.

    Returns
    -------
    list of str
        Names of the files: preview.jpg, at most 320 pixels a side; photo.jpg, at most 640; relief.js, at most 256
        samples a side, see `heights_script`.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    photo = photo_jpeg(solution, _PHOTO_LONGEST, colour) if PHOTO in wanted or RELIEF in wanted else b""
    made: dict[str, Callable[[], bytes]] = {
        SHADED: lambda: jpeg(shaded(solution, Samples.of(_shape(solution), _PREVIEW_LONGEST))),
        PHOTO: lambda: photo,
        RELIEF: lambda: heights_script(solution, name, photo).encode("ascii"),
    }
    files = [file for file in PREVIEW if file in wanted]
    for file in files:
        with atomic_path(folder / file) as temporary:
            temporary.write_bytes(made[file]())
    return files


def photo_jpeg(solution: SolvedSurface, longest: int, colour: NDArray[np.uint8] | None = None) -> bytes:
    """The photograph as a JPEG file of at most so many pixels a side, or what was solved instead."""
    if colour is None:
        samples = Samples.of(_shape(solution), longest)
        return jpeg(to_display(np.nan_to_num(solution.image[samples.grid] / solution.white)))
    return jpeg(colour, -(-max(_shape(solution)) // longest))


def jpeg(pixels: NDArray[np.uint8], block: int = 1) -> bytes:
    """Grey or RGB pixels as a JPEG file, with a pixel for each block of so many a side."""
    from PIL import Image

    picture = Image.fromarray(pixels)
    if block > 1:
        # Whole blocks: several times as fast as any other size.
        picture = picture.reduce(block)
    stream = io.BytesIO()
    picture.save(stream, "JPEG", quality=_QUALITY)
    return stream.getvalue()


def _shape(solution: SolvedSurface) -> tuple[int, int]:
    height, width = solution.depth.shape
    return height, width
