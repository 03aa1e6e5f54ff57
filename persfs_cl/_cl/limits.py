"""Bounds of the values of images, as the kernels keep to them: see kernels/README.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.layout import Layout


def constants_of(images: Sequence[Image], *, may_rise: bool) -> dict[str, int]:
    """What programs are compiled with for these images: LIMITS where one of them has bounds, else nothing.

    Only values that may rise can come to a bound from below.
    """
    bounded = any(image.limits is not None for image in images)
    return {"LIMITS": 2 if may_rise else 1} if bounded else {}


def stored_limits(images: Sequence[Image], layout: Layout, kind: np.dtype[Any], sides: int) -> NDArray[Any]:
    """Bounds from below of all images, then those from above if `sides` are two; a number where there are none."""
    if not sides:
        return np.full(1, np.nan, kind)
    none = np.array(np.nan)
    bounds = [
        np.broadcast_to(none, image.log_depth.shape) if image.limits is None else image.limits[side]
        for side in range(sides)
        for image in images
    ]
    return layout.store([each.__getitem__ for each in bounds], np.nan, kind, [each.shape for each in bounds])
