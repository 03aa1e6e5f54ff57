"""Files of the normals: the numbers, and maps in the colours that artists' programs take."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.io.export import write_array, write_png
from persfs_cl.surface.formats.format import Format, Source

_UP, _DOWN = -1.0, 1.0
"""Sign that y of camera axes, which points down, has in green."""


def _map(green: float, bits: int) -> Format:
    """A normal map besides `normals.png`, whose green is up, in 8 bits."""
    kind = np.uint16 if bits == 16 else np.uint8

    def write(target: Path, source: Source) -> None:
        normals: Array = source.derived.normals
        levels = np.empty(normals.shape, kind)
        for rows in row_blocks(source.shape):
            # No direction at all is in the middle, as in normals.png.
            components = np.nan_to_num(normals[rows] * (1.0, green, -1.0), nan=0.0)
            levels[rows] = (np.clip(components, -1.0, 1.0) + 1.0) * (0.5 * np.iinfo(kind).max) + 0.5
        write_png(target, levels)

    convention = "" if green == _UP else "-directx"
    return Format(f"normals{convention}{'-16' if bits == 16 else ''}.png", write)


NORMALS = (
    Format(
        "normals.npy",
        lambda target, source: write_array(target, source.derived.normals.astype(np.float32)),
    ),
    _map(_UP, 16),
    _map(_DOWN, 8),
    _map(_DOWN, 16),
)
