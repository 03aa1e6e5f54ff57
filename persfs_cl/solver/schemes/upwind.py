"""The scheme that solves each cell exactly from its neighbours upwind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from persfs_cl.arrays import Array, Indices
from persfs_cl.choices import Boundary
from persfs_cl.errors import InputError
from persfs_cl.masks import NOWHERE
from persfs_cl.shading.model import Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.schemes.scheme import Scheme, Updates
from persfs_cl.wording import keyword

MAX_SLOPE_UPWIND = 5.0
"""Where the equation sets no bound, which this scheme takes at its word: a surface seen at 11 degrees from grazing."""


@dataclass(frozen=True)
class Upwind(Scheme):
    """A few iterations, and several times less error than the paper's; by its nature nothing flows in from outside."""

    name: ClassVar[str] = "upwind"
    boundaries: ClassVar[tuple[str, ...]] = ("fixed", "wall")
    why_no_other_boundary: ClassVar[str] = "by this scheme nothing flows in from outside anyway"
    highest_order: ClassVar[int] = 2
    same_iterates: ClassVar[bool] = False
    outside: ClassVar[float | None] = NOWHERE
    settles: ClassVar[bool] = True

    def model(self, light: Light, reflectance: Reflectance) -> Model:
        """See :meth:`Scheme.model`."""
        light.model(reflectance)
        if not reflectance.monotone:
            raise InputError.about(
                "scheme",
                self.name,
                f"with {keyword('reflectance', reflectance)}: this material is not brightest face on, so that a "
                f"brightness belongs to two angles. Use {keyword('scheme', 'lax-friedrichs')}.",
            )
        return light.upwind_model(reflectance)

    def kernels(self, model: Model) -> tuple[str, ...]:
        """See :meth:`Scheme.kernels`."""
        return (*model.kernels, *model.upwind)

    def boundary(self, light: Light) -> Boundary:
        """See :meth:`Scheme.boundary`."""
        return "wall"

    def max_slope(self, light: Light) -> float:
        """See :meth:`Scheme.max_slope`."""
        return super().max_slope(light) if light.bounds_slope else MAX_SLOPE_UPWIND

    def plain_values(
        self, reference: Updates, rows: Indices, columns: Indices, quadrants: Sequence[tuple[int, int]]
    ) -> list[Array]:
        """See :meth:`Scheme.plain_values`."""
        return [reference.upwind(rows, columns, *quadrant) for quadrant in quadrants]
