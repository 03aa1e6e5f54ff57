"""What is known of a surface before its shading is looked at: a depth that may err."""

from __future__ import annotations

from dataclasses import dataclass

from persfs_cl.arrays import Array

MOST = 64.0
"""Pixels that a number counts as where the image does not tell the depth."""


@dataclass(frozen=True)
class Prior:
    """A depth that may err, and by how much.

    Of a coarse map that is interpolated, the tolerance at a pixel is that of its numbers and that of the interpolation
    between them, together: tolerance² = noise² + |slope|² spacing² / 12.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Z = ln z, NaN where nothing is known.
    tolerance : ndarray of float64, shape (height, width)
        Of Z, above 0; infinite where a value is no more than a guess, NaN where nothing is known.
    spacing : float
        Of the numbers that it was made of, in pixels. So far apart errors have nothing to do with each other.
    counts : float
        Pixels that each of these numbers counts as, at most.
    """

    log_depth: Array
    tolerance: Array
    spacing: float = 1.0
    counts: float = MOST

    @property
    def weight(self) -> float:
        """Of a pixel of the prior."""
        return min(1.0, self.counts / self.spacing**2)
