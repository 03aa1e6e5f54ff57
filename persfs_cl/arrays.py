"""Types of the arrays that the package passes around."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision."""
Mask = NDArray[np.bool_]
"""A set of pixels: True where one belongs to it."""
Indices = NDArray[np.intp]
"""Places in arrays."""
