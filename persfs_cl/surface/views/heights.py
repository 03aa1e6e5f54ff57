"""A surface as the page draws it: 16-bit depths of some pixels, in a script that the page loads.

A page on a disk may load scripts from beside it, but may not read files; so the numbers travel in a call of a function
of the page, as text. The photograph goes with them, because a picture loaded from a disk may not become a texture.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.io.files import json_text
from persfs_cl.surface.solved import SolvedSurface
from persfs_cl.surface.views.reduced import Samples

LONGEST = 256
"""Samples along the longer side: as many as 16-bit indices of WebGL can number in a square."""

_HIGHEST = 2**16 - 1


def heights_script(surface: SolvedSurface, name: str, photo: bytes) -> str:
    """A script that hands the page the surface: it calls ``persfsRelief`` with the object of `heights`, in ASCII."""
    return f"persfsRelief({json_text(heights(surface, name, photo), indent=None)});\n"


def heights(surface: SolvedSurface, name: str, photo: bytes, longest: int = LONGEST) -> dict[str, Any]:
    """The surface as the page takes it, ready for JSON.

    ``name``
        Of the image.
    ``size``
        Height and width of the image; ``grid``: of the samples. Sample i of n is pixel floor((i + 1/2) N / n) of N.
    ``focal_length``, ``principal_point``
        (fx, fy) and (cx, cy), in pixels of the image. The point of a pixel is z ((column - cx) / fx, (row - cy) / fy,
        1).
    ``depth``
        Least and largest z of the samples; null when none is solved.
    ``levels``
        Base64 of little-endian 16-bit numbers, row by row: 0 where there is no surface, else 1 for the least z to 65535
        for the largest.
    ``right``, ``down``
        Base64 of bits, the highest first: whether the surface goes on from a sample to the next in the row, of (height,
        width - 1), and in the column, of (height - 1, width). Null where it does wherever both are solved.
    ``photo``
        The photograph, as the address of a JPEG image that holds it.

    Parameters
    ----------
    surface : SolvedSurface
    name : str
    photo : bytes
        A JPEG file.
    longest : int
        Samples along the longer side, at most.
    """
    height, width = surface.depth.shape
    samples = Samples.of((height, width), longest)
    depth = surface.depth[samples.grid]
    solved = np.isfinite(depth)
    right, down = samples.joined(surface.solved, surface.discontinuities)
    levels, extremes = _levels(depth, solved)
    return {
        "name": name,
        "size": [height, width],
        "grid": list(depth.shape),
        "focal_length": [surface.camera.fx, surface.camera.fy],
        "principal_point": list(surface.camera.centre((height, width))),
        "depth": extremes,
        "levels": _text(levels.tobytes()),
        "right": _bits(right, solved[:, :-1] & solved[:, 1:]),
        "down": _bits(down, solved[:-1] & solved[1:]),
        "photo": f"data:image/jpeg;base64,{_text(photo)}",
    }


def _levels(depth: Array, solved: Mask) -> tuple[NDArray[np.uint16], list[float] | None]:
    levels = np.zeros(depth.shape, "<u2")
    if not solved.any():
        return levels, None
    there = depth[solved]
    least, largest = float(there.min()), float(there.max())
    levels[solved] = np.rint((there - least) * ((_HIGHEST - 1) / ((largest - least) or 1.0))) + 1
    return levels, [least, largest]


def _bits(joined: Mask, both_solved: Mask) -> str | None:
    return None if (joined == both_solved).all() else _text(np.packbits(joined).tobytes())


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
