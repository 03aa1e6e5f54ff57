"""What an ordering by which parts of an image rest begins with: which parts there are to sweep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.layout import Layout
from persfs_cl.masks import SWEPT


def first_account(
    images: Sequence[Image],
    layout: Layout,
    part: tuple[int, int],
    *,
    before: int,
    border: int,
    first_column: int = 0,
    last_column: int = 0,
) -> NDArray[np.int32]:
    """The numbers of the sweeps that changed the parts of images last, before the first one.

    Parameters
    ----------
    images : sequence of Image
    layout : Layout
        Of the largest of them.
    part : (int, int)
        Rows and columns of a part.
    before : int
        The number of what came before the first sweep.
    border : int
        Parts around those of an image.
    first_column, last_column : int
        Columns that parts have before the images, and up to which they go at least.

    Returns
    -------
    ndarray of int32, shape (images, rows, columns)
        0 for parts in which nothing is swept, and around those of the image.
    """
    high, wide = part
    across = max(first_column + layout.width, last_column)
    # Of all rows of a part together first, which are reduced many at a time.
    swept = np.zeros((len(images), -(-layout.height // high), -(-across // wide) * wide), np.uint8)
    for image, lines in zip(images, swept, strict=True):
        rows, columns = image.flags.shape
        for line, top in zip(lines, range(0, rows, high), strict=False):
            flags = image.flags[top : top + high]
            np.bitwise_or.reduce(flags, axis=0, out=line[first_column : first_column + columns])
    swept &= SWEPT
    parts = swept.reshape(len(images), swept.shape[1], -1, wide).any(axis=3)
    return np.pad(np.where(parts, before, 0).astype(np.int32), ((0, 0), (border, border), (border, border)))
