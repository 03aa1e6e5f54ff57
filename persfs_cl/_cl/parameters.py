"""The numbers of an image as kernels read them: one structure, declared here for NumPy and for OpenCL C.

Kernels take ``__global const parameter_set *parameters``, one for each image, and read its fields by name. Grid and
scheme give those of :data:`COMMON`; a light and a material add their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import KernelBuildError

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


def fields_of(names: Iterable[str]) -> tuple[str, ...]:
    """The fields of the structure in their order: those of :data:`COMMON`, and then those of light and material.

    Raises
    ------
    KernelBuildError
        When one of :data:`COMMON` is missing, or there are too many.
    """
    given = list(names)
    fields = (*COMMON, *(name for name in given if name not in COMMON))
    if missing := COMMON.keys() - set(given):
        raise KernelBuildError(f"The parameters lack {', '.join(sorted(missing))}: give all of {', '.join(COMMON)}.")
    if len(fields) > _ROOM:
        raise KernelBuildError(
            f"The parameters {', '.join(fields)} are more than {_ROOM}: let light and material share some, or give the "
            "structure more room."
        )
    return fields


def declaration(names: Iterable[str]) -> str:
    """The structure in OpenCL C, padded to a size that is the same for all."""
    fields = fields_of(names)
    text = "".join(f"    real {name};{_comment(name)}\n" for name in fields)
    padding = f"    real padding[{_ROOM - len(fields)}];\n" if len(fields) < _ROOM else ""
    return f"typedef struct {{\n{text}{padding}}} parameter_set;\n"


def records(parameters: Sequence[Mapping[str, float]], real: np.dtype[np.floating]) -> NDArray[np.void]:
    """The numbers of some images in an array of the structure.

    Raises
    ------
    KernelBuildError
        When they have not all the same fields, or as :func:`fields_of`.
    """
    fields = fields_of(parameters[0])
    if odd := next((numbers for numbers in parameters if set(numbers) != set(fields)), None):
        raise KernelBuildError(f"Images that share launches have other parameters, {', '.join(odd)}: solve them apart.")
    layout = np.dtype(
        {
            "names": fields,
            "formats": [real] * len(fields),
            "offsets": [real.itemsize * place for place in range(len(fields))],
            "itemsize": _ROOM * real.itemsize,
        }
    )
    return np.array([tuple(numbers[name] for name in fields) for numbers in parameters], layout)


def _comment(name: str) -> str:
    return f" /* {COMMON[name]} */" if name in COMMON else ""
