"""The numbers of a lens: checked once, and told as they were given."""

from __future__ import annotations

from dataclasses import astuple, fields
from typing import Any

import numpy as np

from persfs_cl.checks import finite_numbers
from persfs_cl.errors import CameraError

MOST = 1e6
"""A coefficient that is larger is none."""


class Lens:
    """A lens by a model of its own: a frozen dataclass whose fields are its numbers."""

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            found = finite(value)
            if found is None or len(found) != 1:
                raise CameraError.about(
                    "distortion",
                    value,
                    f"is impossible for {field.name} of {type(self).__name__}: give a number between -{MOST:,.0f} and "
                    f"{MOST:,.0f}, as a calibration finds it, or 0 where it is not known.",
                )
            object.__setattr__(self, field.name, found[0])

    def __repr__(self) -> str:
        names = (field.name for field in fields(self))  # type: ignore[arg-type]
        said = zip(names, self.coefficients, strict=False)
        return f"{type(self).__name__}({', '.join(f'{name}={value}' for name, value in said)})"

    @property
    def coefficients(self) -> tuple[float, ...]:
        """The numbers that tell it, in their order."""
        return astuple(self)  # type: ignore[call-overload,no-any-return]


def finite(given: Any) -> tuple[float, ...] | None:
    """Numbers, none of which is too large for a coefficient; None where they are no such."""
    # OpenCV's own functions return them as a row or a column.
    flat = given.ravel() if isinstance(given, np.ndarray) and given.size == max(given.shape, default=1) else given
    found = finite_numbers(flat)
    return None if found is None or not found or max(map(abs, found)) > MOST else found
