"""What the keywords of :func:`persfs_cl.reconstruct` that are words may be."""

from __future__ import annotations

from typing import Literal

Surface = Literal["away", "toward"]
Boundary = Literal["auto", "outflow", "extrapolate", "fixed", "wall"]
Stopping = Literal["distance", "change", "gain"]
Precision = Literal["float32", "float64"]
GuideKind = Literal["depth", "inverse"]
GuideScale = Literal["fixed", "fit", "affine"]
