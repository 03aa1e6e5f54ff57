"""What every scheme answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from persfs_cl.arrays import Array, Indices
from persfs_cl.choices import Boundary
from persfs_cl.shading.model import Light, Model
from persfs_cl.shading.reflectance import Reflectance

MAX_SLOPE = 30.0


class Updates(Protocol):
    """New values of cells in plain NumPy, see :class:`persfs_cl.solver.reference.Reference`."""

    def lax_friedrichs(self, rows: Indices, columns: Indices) -> Array:
        """By the paper's scheme."""

    def upwind(self, rows: Indices, columns: Indices, leftwards: int, upwards: int) -> Array:
        """From the two neighbours that a sweep visits before."""


@dataclass(frozen=True)
class Scheme(ABC):
    """What every scheme answers. A scheme has no state.

    Attributes
    ----------
    name : str
        What users type.
    boundaries : tuple of str
        What may hold on the edge of the image and mask.
    highest_order : int
        Of accuracy.
    same_iterates : bool
        Whether kernels and reference have the same values after each sweep, and not only in the limit.
    accelerates : bool
        Whether it takes so many iterations that coarser grids or mixtures pay, and has one limit from wherever it
        begins.
    settles : bool
        Whether most cells soon keep their value, so that it pays to keep account of which still change.
    why_no_other_boundary : str
        For who asks for one that is not among them.
    by_energy : bool
        Whether it minimises an energy, see :mod:`persfs_cl.solver.energy`, and sweeps nothing.
    tolerance : float
        Bound of the distance from its limit when none is given; `stopping="gain"` has its own.
    without : tuple of str
        Keywords that mean nothing to it. A value is refused that is not the default, which commands give anyway.
    why_without : str
        For who gives one of them all the same.
    outside : float or None
        Value of cells that are not there, for schemes that only want it to be high; None for those that treat cells
        apart which lack a neighbour.
    """

    name: ClassVar[str]
    boundaries: ClassVar[tuple[str, ...]]
    why_no_other_boundary: ClassVar[str] = "this scheme has no such boundary"
    highest_order: ClassVar[int] = 1
    same_iterates: ClassVar[bool] = True
    outside: ClassVar[float | None] = None
    by_energy: ClassVar[bool] = False
    tolerance: ClassVar[float] = 1e-5
    without: ClassVar[tuple[str, ...]] = ("paint", "smoothing")
    why_without: ClassVar[str] = "it takes the image at its word"
    accelerates: ClassVar[bool] = False
    settles: ClassVar[bool] = False

    @abstractmethod
    def model(self, light: Light, reflectance: Reflectance) -> Model:
        """The Hamiltonian of a material in a light for this scheme; InputError when there is none."""

    @abstractmethod
    def kernels(self, model: Model) -> tuple[str, ...]:
        """Kernel files of the model and of this scheme, in the order in which they are composed."""

    @abstractmethod
    def boundary(self, light: Light) -> Boundary:
        """What ``boundary="auto"`` is."""

    def max_slope(self, light: Light) -> float:
        """The bound of the slope when none is given."""
        return MAX_SLOPE

    @abstractmethod
    def plain_values(
        self, reference: Updates, rows: Indices, columns: Indices, quadrants: Sequence[tuple[int, int]]
    ) -> list[Array]:
        """Candidates for new values of some cells by the reference, which lets each value only fall."""
