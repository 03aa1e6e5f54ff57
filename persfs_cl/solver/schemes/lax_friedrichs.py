"""The paper's scheme."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from persfs_cl.arrays import Array, Indices
from persfs_cl.choices import Boundary
from persfs_cl.shading.model import Light, Model
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.schemes.scheme import Scheme, Updates


@dataclass(frozen=True)
class LaxFriedrichs(Scheme):
    """Eq. (11): it takes any Hamiltonian, smears, and needs many iterations."""

    name: ClassVar[str] = "lax-friedrichs"
    boundaries: ClassVar[tuple[str, ...]] = ("outflow", "extrapolate", "fixed", "wall")
    accelerates: ClassVar[bool] = True

    def model(self, light: Light, reflectance: Reflectance) -> Model:
        """See :meth:`Scheme.model`."""
        return light.model(reflectance)

    def kernels(self, model: Model) -> tuple[str, ...]:
        """See :meth:`Scheme.kernels`."""
        return (*model.kernels, "lax_friedrichs")

    def boundary(self, light: Light) -> Boundary:
        """See :meth:`Scheme.boundary`."""
        return light.boundary

    def plain_values(
        self,
        reference: Updates,
        rows: Indices,
        columns: Indices,
        quadrants: Sequence[tuple[int, int]],
    ) -> list[Array]:
        """See :meth:`Scheme.plain_values`."""
        return [reference.lax_friedrichs(rows, columns)]
