"""What an ordering is: one class for each kernel file in kernels/orderings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.image import Image
from persfs_cl._cl.kernel import ROW_GROUP, row_group
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.run import Run
from persfs_cl.errors import KernelBuildError

ALL_ITERATIONS = 2**31 - 1
"""Of :meth:`Ordering.iterations_a_launch`: as many as are queued."""
WORK_GROUP_OF_ONE = (1,)

Self = TypeVar("Self", bound="Ordering")
Grouped = TypeVar("Grouped", bound="InRowGroups")


@dataclass(frozen=True)
class Setup:
    """What an ordering is to be chosen for: images of one size on a device.

    Attributes
    ----------
    device : Device
    precision : {"float32", "float64"}
    shape : tuple of int
    images : int
    second_order, only_lower : bool
        See :class:`Ordering`.
    settles : bool
        See :class:`persfs_cl._cl.image.Image`.
    """

    device: Device
    precision: str
    shape: tuple[int, int]
    images: int
    second_order: bool = False
    only_lower: bool = True
    settles: bool = False


@dataclass(frozen=True)
class Ordering:
    """How the cells of an image are gone through: by which kernel, and how that is launched.

    A subclass names its kernel file and has :meth:`sweep`, or else :meth:`iterate`; the rest is as here unless it says
    otherwise. Its fields are the sizes that the kernel is compiled for and launched with. The results do not depend on
    those, but for `second_order` and `only_lower`.

    Attributes
    ----------
    file : str
        Kernel file, without its suffix, and what the ordering is called.
    function : str
        The kernel in it.
    before : tuple of str
        Kernel files between the scheme's and this one.
    reason : str
        Why a device is given it, in a sentence.
    for_want_of_vectors : bool
        Whether a device gets it since its compiler names no vector registers.
    vectors_down : bool
        Whether vectors run along strips, and want the table of the columns in reverse too.
    single_sweeps : bool
        Whether sweeps can be launched one by one: it has :meth:`sweep`.
    sweeps_together : bool
        Whether one launch may do several sweeps, where no boundary is renewed between them.
    coloured : bool
        Whether cells of one colour follow those of another, and not the bits of the lexicographic order come out.
    serial : bool
        Whether one work-item takes a whole image, cell by cell.
    numbers_a_cell : int
        Numbers that a sweep must move for each cell: it reads Z and E and writes Z.
    corrections : int
        Iterations of second order that may be wanted for each of first order.
    numbers_a_sweep : int
        By which a sweep is counted in its account of changes, see :meth:`last_changes`.
    counts_tiles : bool
        Whether that account is one of tiles, see kernels/shared/tiles.cl, of which changes can be summed up.
    lanes : int
        Cells that a work-item updates at once: see kernels/shared/prelude.cl.
    second_order : bool
        Correct the differences of the upwind scheme to second order.
    only_lower : bool
        Let values only fall; False assigns what a cell is found to have.
    rests : bool
        Leave alone, in each sweep, what cannot change: where neither a part of an image nor what it reads has changed
        since the last sweep in the same direction. Sweeps must then come in turn, in all four directions. An ordering
        that keeps no account of changes has it without effect.
    drifts : bool
        Where tiles rest, let those rest too whose changes add up to no more than a run says: see the kernel of strips.
    """

    file: ClassVar[str]
    function: ClassVar[str] = "sweep"
    before: ClassVar[tuple[str, ...]] = ("update", "cell")
    reason: ClassVar[str]
    for_want_of_vectors: ClassVar[bool] = False
    vectors_down: ClassVar[bool] = False
    single_sweeps: ClassVar[bool] = True
    sweeps_together: ClassVar[bool] = False
    coloured: ClassVar[bool] = False
    serial: ClassVar[bool] = False
    numbers_a_cell: ClassVar[int] = 3
    corrections: ClassVar[int] = 2
    numbers_a_sweep: ClassVar[int] = 1
    counts_tiles: ClassVar[bool] = False

    lanes: int = 1
    second_order: bool = False
    only_lower: bool = True
    rests: bool = False
    drifts: bool = False

    @classmethod
    def of(cls: type[Self], setup: Setup) -> Self:
        """With the usual sizes."""
        return cls(second_order=setup.second_order, only_lower=setup.only_lower)

    @property
    def kernels(self) -> tuple[str, ...]:
        """Kernel files after those of model and scheme."""
        return ("second_order" if self.second_order else "first_order", *self.before, self.file)

    @property
    def definitions(self) -> dict[str, int]:
        """Constants of the program."""
        # What is usual is left to prelude.cl.
        reach = {"REACH": 2} if self.second_order else {}
        return {"LANES": self.lanes, **reach, **({} if self.only_lower else {"ONLY_LOWER": 0})}

    @property
    def account(self) -> dict[str, int]:
        """Which account a kernel keeps of changes, for those that keep one: with sums in it or not."""
        return {"RESTS": (2 if self.drifts else 1) if self.rests else 0}

    @property
    def margin(self) -> int:
        """Cells around an image that its cells read."""
        return 2 if self.second_order else 1

    def layout(self, shape: tuple[int, int]) -> Layout:
        """How an image must lie."""
        return Layout.padded(shape, self.margin, self.margin)

    def counters(self, images: int, layout: Layout) -> int:
        """Length of `sync`, integers that the kernel keeps over the whole run, zero at first; 0 when it has none."""
        return 0

    def last_changes(self, images: Sequence[Image], layout: Layout) -> NDArray[np.int32]:
        """The account that the kernel keeps as `changed`, of which sweep changed a part of an image last.

        Shape (images, ...), asked for where parts rest by it.
        """
        return np.zeros((len(images), 1), np.int32)

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:
        """Queue `count` sweeps, the first in the direction `number`, and give the event of the first launch."""
        raise KernelBuildError(f"{self.file}.cl has no single sweeps: use it for whole iterations.")

    def iterations_a_launch(self, run: Run) -> int:
        """How many whole iterations a launch may do; 0 where it does sweeps."""
        return 0

    def iterate(self, run: Run, iterations: int) -> cl.Event:
        """Queue so many whole iterations, no more than :meth:`iterations_a_launch`, as one launch."""
        raise KernelBuildError(f"{self.file}.cl has no whole iterations: use it for single sweeps.")

    def is_done(self, run: Run) -> bool:
        """Whether the device did all that was queued, as far as the kernel's counters tell; waits for it."""
        return True

    def __str__(self) -> str:
        vectors = [f"{self.lanes} lanes"] if self.lanes > 1 else []
        return ", ".join([self.file, *vectors, *self._sizes()])

    def _sizes(self) -> tuple[str, ...]:
        """The sizes that are its own, in words."""
        return ()


@dataclass(frozen=True)
class InRowGroups(Ordering):
    """An ordering of which each work-item takes a cell, and a work-group neighbouring cells of a row.

    Attributes
    ----------
    group : int
        Work-items of a group, and cells of a part of a row that rests by itself. Vectors are all of one item, and so
        are the rows.
    """

    group: int = ROW_GROUP

    @classmethod
    def of(cls: type[Grouped], setup: Setup) -> Grouped:
        """With groups as large as the device allows."""
        return cls(second_order=setup.second_order, only_lower=setup.only_lower, group=row_group(setup.device))
