"""The device's part of the multigrid method: an image on a hierarchy of grids, and cycles through these.

See kernels/multigrid/. One image has buffers and launches of its own, whatever others are solved with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.buffers import allocate, upload
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.image import Image
from persfs_cl._cl.kernel import ROW_GROUP, in_row_groups, kernel, row_group
from persfs_cl._cl.parameters import records
from persfs_cl._cl.registers import WIDEST, lanes
from persfs_cl.masks import SWEPT

NUMBERS_A_PIXEL = 12
"""What it takes on the device, all levels together: seven arrays of all levels, and two of the finest."""
LEAST_CELLS = 5
"""Of an axis of the coarsest level."""
ABSENT, SOLVED, KNOWN = 0, 1, 2
"""What a cell is."""

HALF_SWEEPS = 8
"""Of an iteration, which updates every cell four times."""
COARSEST_ITERATIONS = 20
"""Of the coarsest level in a cycle."""
FIRST_ITERATIONS = 60
"""Of the coarsest level alone, with which the surface begins."""
FIRST_CYCLES = 2
"""Of each level but the finest, from what the coarser one has come to."""

_OF_VECTORS = ("relax_colour", "find_residual", "largest_changes")
_OF_CELLS = (
    "coarsen",
    "take_own_weights",
    "restrict_level",
    "freeze_level",
    "correct_level",
    "interpolate_level",
    "cycle_small_levels",
    "solve_small_levels",
)
"""Kernels."""

_AXIS_PLANES, _STEP_PLANES = 5, 4
"""Of the tables, see kernels/multigrid/grid_level.cl."""
_GIVEN = {
    "ABSENT": ABSENT,
    "SOLVED": SOLVED,
    "KNOWN": KNOWN,
    "AXIS_PLANES": _AXIS_PLANES,
    "STEP_PLANES": _STEP_PLANES,
}
"""To all programs."""
_SMALL = 48**2
"""Cells of a level up to which a launch of its own would take longer than its work."""
_VECTORS = 8
"""Work-items of a work-group that take vectors: those of small levels are few."""
_GROUP = 256
"""Work-items, at most, that share the small levels."""
_BORDER = WIDEST
"""Stored columns before and behind a level, since a vector may reach past the end of a row. Of rows one is enough."""
_STEEPNESS = 2.0
"""Slope with which the coarsest level begins."""


Part = tuple[slice, slice] | tuple[NDArray[np.intp], ...]
"""Indices of some rows and columns of an image."""


def part_of(rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Part:
    """Indices of rows and columns, as slices if possible: these copy nothing."""
    slices = tuple(slice(int(places[0]), int(places[-1]) + 1) for places in (rows, columns))
    if all(found.stop - found.start == len(places) for found, places in zip(slices, (rows, columns), strict=True)):
        return slices[0], slices[1]
    return np.ix_(rows, columns)


@dataclass(frozen=True)
class Steps:
    """An axis of cells and that of the next coarser level, with ends at the same places.

    Attributes
    ----------
    spacing : float
        Of the coarse cells, in fine ones.
    coarse, share : ndarray, shape (cells,)
        The first of the two coarse cells between which a fine cell lies, and the share of the other.
    fine, fine_share : ndarray, shape (coarse cells,)
        The same of fine cells for a coarse one.
    first : ndarray of int, shape (coarse cells,)
        The first fine cell that is interpolated from a coarse one.
    nearest : ndarray of int, shape (coarse cells + 1,)
        The first fine cell that is nearest to a coarse one; and how many there are.
    """

    spacing: float
    coarse: NDArray[np.int64]
    share: NDArray[np.float64]
    fine: NDArray[np.int64]
    fine_share: NDArray[np.float64]
    first: NDArray[np.int64]
    nearest: NDArray[np.int64]

    @classmethod
    def of(cls, cells: int) -> Steps:
        """Of an axis of so many cells, 2 at least."""
        count = coarse_cells(cells)
        # In whole numbers, since the shares of cells that lie upon each other are 0 and not rounding.
        coarse, above = _divided(np.arange(cells, dtype=np.int64) * (count - 1), cells - 1, count)
        fine, below = _divided(np.arange(count, dtype=np.int64) * (cells - 1), count - 1, cells)
        nearest = (2 * np.arange(cells, dtype=np.int64) * (count - 1) + cells - 1) // (2 * (cells - 1))
        numbers = np.arange(count)
        reached = coarse + (above > 0.0)
        return cls(
            spacing=(cells - 1) / (count - 1),
            coarse=coarse,
            share=above,
            fine=fine,
            fine_share=below,
            first=np.searchsorted(reached, numbers),
            nearest=np.searchsorted(nearest, np.arange(count + 1)),
        )

    def sampled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of the fine cells, at the coarse ones."""
        return (1.0 - self.fine_share) * values[self.fine] + self.fine_share * values[self.fine + 1]

    @property
    def cells(self) -> int:
        """Of the coarser axis."""
        return len(self.first)


def coarse_cells(cells: int) -> int:
    """Cells of the next coarser axis."""
    return cells // 2 + 1


def _divided(numerators: NDArray[np.int64], denominator: int, count: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Quotients, at most `count` - 2, and what they leave, as shares of 1."""
    whole = np.minimum(numerators // denominator, count - 2)
    return whole, (numerators - whole * denominator) / denominator


def coarse_kinds(kinds: NDArray[np.uint8], down: Steps, across: Steps) -> NDArray[np.uint8]:
    """What the cells of the next coarser level are.

    Known where a known cell is nearest to it, else absent where an absent one is, else solved. So every solved cell
    has all its neighbours again.
    """

    def reduced(reduction: np.ufunc) -> NDArray[np.uint8]:
        rows = reduction.reduceat(kinds, down.nearest[:-1], axis=0)
        return np.asarray(reduction.reduceat(rows, across.nearest[:-1], axis=1))

    highest = reduced(np.maximum)
    return np.where(highest == KNOWN, highest, reduced(np.minimum))


@dataclass(frozen=True)
class Level:
    """What a grid of the hierarchy is made of.

    Attributes
    ----------
    kinds : ndarray of uint8, shape (height, width)
    x_axis, y_axis : ndarray, shapes (3, width) and (3, height)
        See :class:`persfs_cl._cl.image.Image`.
    parameters : mapping of str to float
        See :mod:`persfs_cl._cl.parameters`.
    """

    kinds: NDArray[np.uint8]
    x_axis: NDArray[np.float64]
    y_axis: NDArray[np.float64]
    parameters: Mapping[str, float]

    @property
    def height(self) -> int:
        """Of the grid."""
        return len(self.kinds)

    @property
    def width(self) -> int:
        """Of the grid."""
        return len(self.kinds[0])

    @property
    def stride(self) -> int:
        """Of its stored rows."""
        return -(-self.width // _BORDER) * _BORDER + 2 * _BORDER

    @property
    def size(self) -> int:
        """Stored cells."""
        return self.stride * (self.height + 2)

    @property
    def inside(self) -> tuple[slice, slice]:
        """The grid in its stored rows."""
        return slice(1, 1 + self.height), slice(_BORDER, _BORDER + self.width)

    def stored(self, values: NDArray[Any], dtype: Any, around: float) -> NDArray[Any]:
        """Values of its cells, with the border."""
        result = np.full((self.height + 2, self.stride), around, dtype)
        result[self.inside] = values
        return result


class Multigrid:
    """An image on a hierarchy of grids.

    Parameters
    ----------
    device : Device
    image : Image
        Of which every cell that is swept has all its neighbours.
    levels : sequence of Level
        From fine to coarse, two at least; the last is small.
    part : indices
        Of the image, which make the finest level.
    model : sequence of str
        Kernel files of the model and the scheme.
    precision : {"float32", "float64"}

    Attributes
    ----------
    kernel_seconds : float
        What the launches have taken by the device's own clock.

    Raises
    ------
    DeviceError
        When the device lacks the precision or the memory.
    """

    def __init__(
        self,
        device: Device,
        image: Image,
        levels: Sequence[Level],
        *,
        part: Part,
        model: Sequence[str],
        precision: str,
    ) -> None:
        self._device, self._levels = device, levels
        self._real = device.real(precision)
        self._last = len(levels) - 1
        large = [number for number, level in enumerate(levels) if level.kinds.size > _SMALL]
        # The finest is measured, and the coarsest has no coarser one.
        self._small = min(max([0, *large]) + 1, self._last)
        self._lanes = lanes(device, precision)
        # It would do one cell after another anyway.
        self._alone = device.is_pocl and device.kind == "cpu"
        self.kernel_seconds = 0.0
        fields = list(image.parameters)
        with device.lock, in_words(device):
            vectors = [*model, "change", "grid_level", "relax_level"], {"LANES": self._lanes, **_GIVEN}
            cells = (
                [*model, "grid_level", "transfer", "small_levels"],
                {
                    "LANES": 1,
                    "ALONE": int(self._alone),
                    "HALF_SWEEPS": HALF_SWEEPS,
                    **_GIVEN,
                },
            )
            self._kernels = {
                name: kernel(device, files, precision, definitions, name, fields)
                for names, (files, definitions) in ((_OF_VECTORS, vectors), (_OF_CELLS, cells))
                for name in names
            }
            with self._timed():
                self._upload(image, part)
                for number in range(1, len(levels)):
                    self._of_cells("coarsen", number)
        highest = image.log_depth[part][levels[0].kinds == KNOWN].max()
        coarsest = levels[-1]
        across, down = (0.5 / coarsest.parameters[f"half_inverse_d{axis}"] for axis in "xy")
        self._above = float(highest) + _STEEPNESS * max(across, down) * max(coarsest.kinds.shape)

    def _upload(self, image: Image, part: Part) -> None:
        """The arrays of all levels, one behind the other, and the tables."""
        device, real, levels = self._device, self._real, self._levels
        begins = np.cumsum([0, *(level.size for level in levels)], dtype=np.int64)
        total, finest = int(begins[-1]), levels[0]
        kinds = np.concatenate([level.stored(level.kinds, np.uint8, ABSENT).ravel() for level in levels])
        brightness = np.where((image.flags[part] & SWEPT) != 0, image.brightness[part], np.nan)
        axes, steps, places = _tables(levels, begins)
        shades = np.full(total, np.nan, real)
        shades[: finest.size] = finest.stored(brightness, real, np.nan).ravel()
        self._values: dict[str, Any] = {
            "brightness": upload(device, shades),
            "kinds": upload(device, kinds),
            "axes": upload(device, axes.astype(real)),
            "steps": upload(device, steps),
            "levels": upload(device, places),
            "parameters": upload(device, records([level.parameters for level in levels], real)),
            "changes": allocate(device, finest.height * real.itemsize),
            "coarsest_iterations": COARSEST_ITERATIONS,
        }
        for name in ("values", "residual", "before", "source", "weights_x", "weights_y"):
            self._values[name] = self._zeros(total)
        self._now = self._values["values"]
        cl.enqueue_copy(device.queue, self._now, finest.stored(image.log_depth[part], real, 0.0))
        # Those of the finest level change places: what a cycle begins with must be kept to measure it.
        self._rooms = [self._now, self._values["residual"], *(self._zeros(finest.size) for _ in range(2))]

    def _zeros(self, count: int) -> cl.Buffer:
        """So many numbers, and some that may be read behind them."""
        buffer = allocate(self._device, (count + _BORDER) * self._real.itemsize)
        cl.enqueue_fill_buffer(self._device.queue, buffer, np.zeros(1, self._real), 0, buffer.size)
        return buffer

    @contextmanager
    def _timed(self) -> Iterator[None]:
        """Launches, waited for at the end whatever happens: arrays that are uploaded may be freed then."""
        self._events: list[cl.Event] = []
        try:
            yield
        finally:
            self._device.queue.finish()
        if self._events:
            self.kernel_seconds += 1e-9 * (self._events[-1].profile.end - self._events[0].profile.start)

    def _launch(self, name: str, size: tuple[int, ...], group: tuple[int, ...], **own: Any) -> None:
        event = self._kernels[name].launch(self._device, size, group, {**self._values, **own})
        self._events = [*self._events[:1], event]

    def _of_cells(self, name: str, level: int, **own: Any) -> None:
        """A launch with a work-item for each cell of a level."""
        grid = self._levels[level]
        self._launch(name, *in_row_groups(row_group(self._device), grid.width, grid.height), level=level, **own)

    def _of_vectors(self, name: str, level: int, **own: Any) -> None:
        """A launch with a work-item for each vector of a level."""
        grid = self._levels[level]
        items = -(-grid.width // self._lanes)
        group = min(row_group(self._device), _VECTORS if self._lanes > 1 else ROW_GROUP)
        self._launch(name, *in_row_groups(group, items, grid.height), level=level, **own)

    def _of_small(self, name: str, **own: Any) -> None:
        """A launch for the small levels."""
        most = 1 if self._alone else min(_GROUP, self._kernels[name].largest_group(self._device))
        self._launch(name, (most,), (most,), first=self._small, last=self._last, **own)

    def start(self) -> float:
        """Give the finest level the surface of the coarser ones.

        Returns
        -------
        float
            max |W|; at least 1e30 where values are not finite.
        """
        with self._device.lock, in_words(self._device), self._timed():
            self._of_small(
                "solve_small_levels", first_iterations=FIRST_ITERATIONS, cycles=FIRST_CYCLES, above=self._above
            )
            for level in range(self._small - 1, -1, -1):
                self._of_cells("interpolate_level", level)
                self._of_cells("take_own_weights", level)
                for _ in range(FIRST_CYCLES if level else 0):
                    self._cycle(level, with_source=0)
            # Nothing was put there yet.
            return self._largest_change(self._rooms[-1])

    def smooth(self) -> float:
        """The first half of a cycle, an iteration of the finest level.

        Returns
        -------
        float
            max |ΔW|; at least 1e30 where values are not finite.
        """
        with self._device.lock, in_words(self._device), self._timed():
            self._before = self._now
            one, self._now = self._free()[:2]
            self._relax(0, self._before, one, self._now, with_source=0)
            return self._largest_change(self._before)

    def correct(self) -> tuple[float, float]:
        """The second half of a cycle: what the coarser levels say, and an iteration.

        Returns
        -------
        change, change_of_cycle : float
            max |ΔW| of the iteration and of the whole cycle; at least 1e30 where values are not finite.
        """
        with self._device.lock, in_words(self._device), self._timed():
            uncorrected = self._now
            one, corrected = self._free()
            self._of_vectors("find_residual", 0, values=uncorrected, residual=one, with_source=0)
            self._to_coarser(0, uncorrected, one)
            self._cycle(1, with_source=1)
            self._of_cells("correct_level", 0, uncorrected=uncorrected, corrected=corrected)
            self._relax(0, corrected, one, uncorrected, with_source=0)
            return self._largest_change(corrected), self._largest_change(self._before)

    def _free(self) -> list[cl.Buffer]:
        """Rooms of the finest level whose values are not wanted any more."""
        return [room for room in self._rooms if room is not self._now and room is not self._before]

    def _relax(self, level: int, values: cl.Buffer, one: cl.Buffer, other: cl.Buffer, *, with_source: int) -> None:
        """An iteration: from `values` by way of `one` into `other`, which may be where they came from."""
        rooms = [values, *[one, other] * (HALF_SWEEPS // 2)]
        for half in range(HALF_SWEEPS):
            given = {"values": rooms[half], "relaxed_values": rooms[half + 1], "colour": half % 2}
            self._of_vectors("relax_colour", level, with_source=with_source, **given)

    def _cycle(self, level: int, *, with_source: int) -> None:
        """A cycle of a level but the finest, and all coarser ones, from the values that they have."""
        if level == self._small:
            self._of_small("cycle_small_levels")
            return
        values, room = self._values["values"], self._values["residual"]
        self._relax(level, values, room, values, with_source=with_source)
        self._of_vectors("find_residual", level, with_source=with_source)
        self._to_coarser(level, values, room)
        self._cycle(level + 1, with_source=1)
        self._of_cells("correct_level", level, uncorrected=values, corrected=values)
        self._relax(level, values, room, values, with_source=with_source)

    def _to_coarser(self, level: int, values: cl.Buffer, residual: cl.Buffer) -> None:
        """Give the next coarser level its equation."""
        self._of_cells("restrict_level", level + 1, fine_values=values, residual=residual)
        self._of_cells("freeze_level", level + 1)

    def _largest_change(self, before: cl.Buffer) -> float:
        """Of the finest level as it is now, since it was like that."""
        found = np.empty(self._levels[0].height, self._real)
        size = in_row_groups(1 if self._device.kind == "cpu" else row_group(self._device), len(found))
        self._launch("largest_changes", *size, level=0, values=self._now, values_before=before)
        cl.enqueue_copy(self._device.queue, found, self._values["changes"])
        return float(found.max())

    def log_depth(self) -> NDArray[np.floating]:
        """The values of the part as they are now."""
        finest = self._levels[0]
        stored = np.empty((finest.height + 2, finest.stride), self._real)
        with self._device.lock, in_words(self._device):
            cl.enqueue_copy(self._device.queue, stored, self._now)
        return stored[finest.inside]


def _tables(
    levels: Sequence[Level], begins: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Numbers of the columns and rows of all levels, and where each level lies; see kernels/multigrid/grid_level.cl."""
    axes: list[NDArray[np.float64]] = []
    steps: list[NDArray[np.int32]] = []
    places, begin = [], 0
    for number, level in enumerate(levels):
        place = [int(begins[number]) + level.stride + _BORDER, level.width, level.height, level.stride]
        finer = levels[max(number - 1, 0)]
        for axis, length, fine in (
            (level.x_axis, level.stride, finer.width),
            (level.y_axis, level.height + 1, finer.height),
        ):
            cells = axis.shape[1]
            numbers, whole = np.zeros((_AXIS_PLANES, length)), np.zeros((_STEP_PLANES, length), np.int32)
            numbers[:3, :cells] = axis
            if number + 1 < len(levels):
                down = Steps.of(cells)
                numbers[3, :cells], whole[0, :cells] = down.share, down.coarse
            if number:
                up = Steps.of(fine)
                numbers[4, :cells], whole[1, :cells], whole[2, :cells] = up.fine_share, up.fine, up.first
                whole[3, : cells + 1] = up.nearest
            place.append(begin)
            begin += length
            axes.append(numbers.ravel())
            steps.append(whole.ravel())
        places.append(place)
    return np.concatenate(axes), np.concatenate(steps), np.array(places, np.int32)
