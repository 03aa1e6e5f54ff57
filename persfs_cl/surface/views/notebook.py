"""How a notebook shows a surface: its depth, its relief shaded, and the relief to be turned."""

from __future__ import annotations

import base64
import html
import io

import numpy as np
from numpy.typing import NDArray

from persfs_cl.surface.solved import SolvedSurface
from persfs_cl.surface.views.heights import heights
from persfs_cl.surface.views.pages import drawing_script, json_in_page, page_file, parts
from persfs_cl.surface.views.preview import jpeg, photo_jpeg
from persfs_cl.surface.views.reduced import Samples
from persfs_cl.surface.views.shaded import NOTHING, shaded

_LONGEST = 256
"""Pixels of a picture, and of what the relief wears: a notebook keeps all that it shows, of many surfaces."""
_SAMPLES = 128
_GAP = 8
_PAPER = 255


def surface_png(surface: SolvedSurface) -> bytes:
    """Depth and shaded relief side by side, as a PNG file: for what shows pictures, and no pages.

    Parameters
    ----------
    surface : SolvedSurface
        It has a depth somewhere.

    Returns
    -------
    bytes
        A picture of at most 520 x 256 pixels.
    """
    from PIL import Image

    depth, relief = _pictures(surface)
    between = np.full((len(depth), _GAP, 3), _PAPER, np.uint8)
    stream = io.BytesIO()
    picture = Image.fromarray(np.hstack([depth, between, relief]))
    # Two scales of colours, of which 256 are enough, in a third of the bytes.
    picture.quantize(256, dither=Image.Dither.NONE).save(stream, "PNG")
    return stream.getvalue()


def surface_html(surface: SolvedSurface) -> str:
    """Depth and shaded relief, and the relief that turns with the mouse, in some 100 kB.

    The relief is a page of its own, in a frame: what its scripts and styles do stays there, whatever else the notebook
    holds. A notebook that takes frames out, because nobody has trusted it, still shows the pictures.

    Parameters
    ----------
    surface : SolvedSurface
        It has a depth somewhere.

    Returns
    -------
    str
        HTML that refers to nothing outside of it.
    """
    depth, relief = _pictures(surface)
    height, width = depth.shape[:2]
    near, far = np.nanmin(surface.depth), np.nanmax(surface.depth)
    pictures = "".join(
        _figure(words, f'<img alt="{words}" width="{width}" height="{height}" src="{_address(jpeg(pixels))}">')
        for words, pixels in ((f"Depth: {near:.4g} (bright) to {far:.4g}", depth), ("Shaded relief", relief))
    )
    frame = (
        # Those that nobody has scrolled to take none of the few drawing contexts that a browser has.
        '<iframe title="Relief" loading="lazy" sandbox="allow-scripts" width="340" height="256" '
        f'style="border:0;max-width:100%" srcdoc="{html.escape(_view(surface))}"></iframe>'
    )
    return (
        f'<div style="display:flex;flex-wrap:wrap;gap:{_GAP}px;align-items:flex-start">'
        f"{pictures}{_figure('Drag to turn, wheel to zoom', frame)}</div>"
    )


def _figure(words: str, shown: str) -> str:
    caption = f'<figcaption style="font-size:smaller;text-align:center">{words}</figcaption>'
    return f'<figure style="margin:0">{shown}{caption}</figure>'


def _pictures(surface: SolvedSurface) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Pixels of the depth in the colours of depth.png, near bright and far dark, and of the shaded relief."""
    from matplotlib import colormaps

    height, width = surface.depth.shape
    samples = Samples.of((height, width), _LONGEST)
    depth = surface.depth[samples.grid]
    near, far = np.nanmin(surface.depth), np.nanmax(surface.depth)
    share = np.nan_to_num((depth - near) / ((far - near) or 1.0))
    colours = colormaps["viridis_r"](share, bytes=True)[..., :3]
    there = np.isfinite(depth)[..., None]
    coloured = np.where(there, colours, np.array(NOTHING, np.uint8))
    return _enlarged(coloured), _enlarged(shaded(surface, samples))


def _enlarged(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Each pixel as a square of several, where there are few."""
    times = max(1, _LONGEST // max(pixels.shape[:2]))
    return pixels.repeat(times, axis=0).repeat(times, axis=1)


def _view(surface: SolvedSurface) -> str:
    """The page in the frame."""
    room = __package__ or ""
    contents = {
        "heights": json_in_page(heights(surface, "", photo_jpeg(surface, _LONGEST), _SAMPLES)),
        "script": f"{drawing_script()}\n{page_file(room, 'view.js')}",
    }
    return "".join(contents[part] if named else part for named, part in parts(page_file(room, "view.html")))


def _address(picture: bytes) -> str:
    return f"data:image/jpeg;base64,{base64.b64encode(picture).decode('ascii')}"
