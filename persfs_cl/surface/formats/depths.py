"""Files of the depth: NumPy, TIFF, OpenEXR, and PNG of 16 bits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.io.export import write_depth, write_levels
from persfs_cl.io.exr import write_exr
from persfs_cl.surface.formats.format import Format, Source

_LEVELS = 2**16 - 1


@dataclass(frozen=True)
class Levels:
    """A depth map in whole levels: depth = offset + scale · level. Level 0 is no surface.

    Attributes
    ----------
    offset, scale : float
        In units of depth.
    levels : ndarray of uint16, shape (height, width)
    """

    offset: float
    scale: float
    levels: NDArray[np.uint16]

    @classmethod
    def of(cls, depth: Array) -> Levels:
        """The nearest is the brightest, as a height; all levels but 0 are used."""
        far, near = (float(of.reduce(depth, axis=None)) for of in (np.fmax, np.fmin))
        if np.isnan(far):
            return cls(0.0, -1.0, np.zeros(depth.shape, np.uint16))
        # Flat ground has one level, and any scale.
        step = (far - near) / (_LEVELS - 1) or 1.0
        heights = (far - depth) / step
        return cls(far + step, -step, np.where(np.isnan(heights), 0.0, np.rint(heights) + 1.0).astype(np.uint16))

    def said(self) -> dict[str, float]:
        """What a reader needs."""
        return {"depth_offset": self.offset, "depth_scale": self.scale}


def _depth(target: Path, source: Source) -> None:
    write_depth(target, source.solution.depth)


def _height(target: Path, source: Source) -> None:
    height = Levels.of(source.solution.depth)
    text = {"Description": "depth = depth_offset + depth_scale * level; level 0 is no surface"}
    write_levels(target, height.levels, {**text, **{name: repr(number) for name, number in height.said().items()}})


DEPTHS = (
    Format("depth.npy", _depth, ("depth", "solution"), alone=True),
    Format("depth.tiff", _depth, ("depth",), alone=True),
    Format("depth.tif", _depth, alone=True),
    Format(
        "depth.exr",
        lambda target, source: write_exr(target, source.solution.depth),
        alone=True,
        packages=("OpenEXR",),
        extra="exr",
    ),
    Format("height.png", _height, about=lambda source: Levels.of(source.solution.depth).said()),
)
