"""The numbers of an image as kernels read them: one structure, declared here for NumPy and for OpenCL C.

Kernels take ``__global const parameter_set *parameters``, one for each image, and read its fields by name. Grid and
scheme give those of :data:`COMMON`; a light and a material add their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

COMMON = {
    "half_inverse_dx": "1 / (2 dx)",
    "half_inverse_dy": "1 / (2 dy)",
    "step_x": "largest climb of Z between horizontal neighbours",
    "step_y": "largest climb of Z between vertical neighbours",
    "steepest": "largest slope |dZ/dx|, |dZ/dy|",
    "sign": "+1 where Z is solved for, -1 for W = -Z",
}
"""Fields that every program has, and what they are."""

_ROOM = 16
"""Reals of the structure, so that programs which read the common fields alone serve every model."""


def structure(names: Iterable[str], real: np.dtype[np.floating]) -> np.dtype[np.void]:
    """The structure whose fields have these names, each a `real`, padded to a size that is the same for all.

    Raises
    ------
    ValueError
        When a name is there twice, or there are too many.
    """
    fields = list(names)
    offsets = [real.itemsize * place for place in range(len(fields))]
    # NumPy refuses fields that do not fit, and those of the same name.
    return np.dtype(
        {"names": fields, "formats": [real] * len(fields), "offsets": offsets, "itemsize": _ROOM * real.itemsize}
    )


def declaration(names: Sequence[str]) -> str:
    """The same structure in OpenCL C."""
    fields = "".join(f"    real {name};{_comment(name)}\n" for name in names)
    padding = f"    real padding[{_ROOM - len(names)}];\n" if len(names) < _ROOM else ""
    return f"typedef struct {{\n{fields}{padding}}} parameter_set;\n"


def records(parameters: Sequence[Mapping[str, float]], real: np.dtype[np.floating]) -> NDArray[np.void]:
    """The numbers of some images, which all have the same fields, in an array of the structure."""
    return np.array([tuple(numbers.values()) for numbers in parameters], structure(parameters[0], real))


def _comment(name: str) -> str:
    return f" /* {COMMON[name]} */" if name in COMMON else ""
