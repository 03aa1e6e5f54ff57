"""The scheme that minimises an energy instead of solving the equation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from persfs_cl.arrays import Array, Indices
from persfs_cl.choices import Boundary
from persfs_cl.shading.model import Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.schemes.scheme import Scheme, Updates


@dataclass(frozen=True)
class Regularised(Scheme):
    """The surface of least energy, which image, prior depth and smoothness decide together; see solver/energy/."""

    name: ClassVar[str] = "regularised"
    boundaries: ClassVar[tuple[str, ...]] = ("wall",)
    by_energy: ClassVar[bool] = True
    # A fifth of a percent of the depth is less than noise and prior leave open, and some pixels, most of them in
    # shadow, still creep when all others have long arrived.
    tolerance: ClassVar[float] = 2e-3
    without: ClassVar[tuple[str, ...]] = (
        "boundary",
        "ordering",
        "accuracy_order",
        "acceleration",
        "max_slope",
        "resting",
    )
    why_without: ClassVar[str] = "it minimises an energy over all pixels at once, and sweeps nothing"

    def model(self, light: Light, reflectance: Reflectance) -> Model:
        """See :meth:`Scheme.model`: the energy has all of the light, and takes no rounds."""
        return replace(light.model(reflectance), in_rounds=False)

    def kernels(self, model: Model) -> tuple[str, ...]:
        """See :meth:`Scheme.kernels`."""
        return ("elementary", model.reflectance.kernel, model.light.shading_kernel)

    def boundary(self, light: Light) -> Boundary:
        """See :meth:`Scheme.boundary`: beyond the edge is nothing."""
        return "wall"

    def plain_values(
        self, reference: Updates, rows: Indices, columns: Indices, quadrants: Sequence[tuple[int, int]]
    ) -> list[Array]:
        """There are none: see :mod:`persfs_cl.solver.energy.reference`."""
        raise TypeError(f"The scheme {self.name!r} sweeps nothing")
