"""Fewer pixels of an image, at known places, so that what is drawn of them stands where it belongs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Indices, Mask
from persfs_cl.surface.geometry import Discontinuities


@dataclass(frozen=True, eq=False)
class Samples:
    """Some rows and columns of an image, evenly chosen: sample i of n is pixel floor((i + 1/2) N / n) of N.

    Whole pixels, no means of several: a mean of depths across a jump would lie where no surface is.

    Attributes
    ----------
    rows, columns : ndarray of int
        Pixels, increasing.
    """

    rows: Indices
    columns: Indices

    @classmethod
    def of(cls, shape: tuple[int, int], longest: int) -> Samples:
        """Samples of an image of a shape (height, width), with at most so many along its longer side."""
        longer = max(shape)
        rows, columns = (size if longer <= longest else max(1, round(size * longest / longer)) for size in shape)
        return cls(_chosen(shape[0], rows), _chosen(shape[1], columns))

    @property
    def grid(self) -> tuple[Indices, Indices]:
        """What takes the samples from an image: ``image[samples.grid]``."""
        return self.rows[:, None], self.columns

    def joined(self, solved: Mask, discontinuities: Discontinuities | None) -> tuple[Mask, Mask]:
        """Whether the surface goes on from each sample to the next one, in its row and in its column.

        It does where all pixels from one to the other are solved, with no interruption between them.

        Parameters
        ----------
        solved : ndarray of bool, shape (height, width)
        discontinuities : Discontinuities or None

        Returns
        -------
        right : ndarray of bool, shape (rows, columns - 1)
        down : ndarray of bool, shape (rows - 1, columns)
        """
        in_rows, in_columns = solved[self.rows], solved[:, self.columns].T
        cut_rows, cut_columns = (
            (None, None)
            if discontinuities is None
            else (discontinuities.right[self.rows], discontinuities.down[:, self.columns].T)
        )
        return _unbroken(in_rows, cut_rows, self.columns), _unbroken(in_columns, cut_columns, self.rows).T


def _chosen(size: int, count: int) -> Indices:
    return (2 * np.arange(count) + 1) * size // (2 * count)


def _unbroken(solved: Mask, cut: Mask | None, places: Indices) -> Mask:
    """Along rows: whether nothing interrupts the way from each of some places to the next."""
    broken = np.cumsum(~solved, axis=1, dtype=np.int32)
    if cut is not None:
        broken[:, 1:] += np.cumsum(cut, axis=1, dtype=np.int32)
    # The sums differ by what lies after a place, up to the next and with it; the place itself is asked apart.
    return np.asarray((np.diff(broken[:, places], axis=1) == 0) & solved[:, places[:-1]])
