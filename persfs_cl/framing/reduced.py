"""Fewer pixels, each the mean of those that it covers."""

from __future__ import annotations

from typing import Any

import numpy as np

from persfs_cl.arrays import Array, Indices
from persfs_cl.camera import Camera
from persfs_cl.framing.frame import Frame


def reduced_shape(shape: tuple[int, int], longest: int) -> tuple[int, int]:
    """(height, width) with the longer side reduced to so many pixels; no image is enlarged.

    Examples
    --------
    >>> from persfs_cl.framing.reduced import reduced_shape
    >>> reduced_shape((3000, 4000), 1024), reduced_shape((30, 40), 1024)
    ((768, 1024), (30, 40))
    """
    if longest >= max(shape):
        return shape
    height, width = (max(1, round(side * longest / max(shape))) for side in shape)
    return height, width


class Reduced(Frame):
    """An image of fewer pixels over the same view.

    Parameters
    ----------
    camera : Camera
        Of the old image.
    old_shape, shape : (int, int)
        (height, width) of the old image and of the new one, which is no larger.
    """

    def __init__(self, camera: Camera, old_shape: tuple[int, int], shape: tuple[int, int]) -> None:
        self.old_shape, self.shape = old_shape, shape
        down, across = (new / old for new, old in zip(shape, old_shape, strict=True))
        column, row = camera.centre(old_shape)
        middle = ((column + 0.5) * across - 0.5, (row + 0.5) * down - 0.5)
        self.camera = Camera((camera.fx * across, camera.fy * down), middle, camera.distortion)
        self._scale = np.array([across, down])

    def mean(self, values: Array) -> Array:
        """See :class:`Frame`."""
        down, across = (_shares(old, new) for old, new in zip(self.old_shape, self.shape, strict=True))
        return np.asarray((across @ (down @ values).T).T)

    def least(self, values: Array) -> Array:
        """See :class:`Frame`."""
        for axis, (old, new) in enumerate(zip(self.old_shape, self.shape, strict=True)):
            begin, end = _spans(old, new)
            # The last of an axis has no end of its own: a row behind it that is never least.
            behind = [(0, 1) if axis == one else (0, 0) for one in range(2)]
            padded = np.pad(values, behind, constant_values=np.inf)
            pairs = np.stack([begin, end], axis=1).ravel()
            values = np.minimum.reduceat(padded, pairs, axis=axis)[:: 2 if axis == 0 else 1, :: 2 if axis == 1 else 1]
        return values

    def placed(self, places: Array) -> Array:
        """See :class:`Frame`."""
        return np.asarray((places + 0.5) * self._scale - 0.5)

    def guide(self, guide: Array) -> Array:
        """See :class:`Frame`: a map of any size is one of the same view already."""
        return guide


def _spans(old: int, new: int) -> tuple[Indices, Indices]:
    """First old pixel that each new one covers a part of, and the one behind the last."""
    number = np.arange(new)
    return (number * old) // new, -(-(number + 1) * old // new)


def _shares(old: int, new: int) -> Any:
    """Share that each old pixel has of each new one: a sparse matrix of shape (new, old)."""
    from scipy.sparse import csr_array  # slow to import

    begin, end = _spans(old, new)
    counts = end - begin
    row = np.repeat(np.arange(new), counts)
    column = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + np.repeat(begin, counts)
    # In parts of which a new pixel has `old` and an old one `new`.
    covered = np.minimum((column + 1) * new, (row + 1) * old) - np.maximum(column * new, row * old)
    return csr_array((covered / old, (row, column)), shape=(new, old))
