"""Launches: images on a device, and the kernels that act on them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.layout import ALIGNMENT
from persfs_cl._cl.parameters import records
from persfs_cl._cl.program import kernel
from persfs_cl._cl.registers import lanes
from persfs_cl._cl.tuning import Tuning
from persfs_cl.errors import DeviceError
from persfs_cl.masks import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, NOWHERE, SWEPT

DIRECTIONS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The four sweeps as (leftwards, upwards), in the paper's order."""

_LAUNCHED_CELLS = 2**22
"""Of the iterations of bands that make one launch: some ten milliseconds, against which a launch is nothing."""
_APART = 32
"""As in kernels/orderings/strip.cl."""
_CELLS_AT_A_TIME = 2**28
"""Cells of iterations that are queued together at least, where that keeps images in the cache: half a second or so."""


@dataclass(frozen=True)
class Grid:
    """One image in numbers, as the kernels want them.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Start values, known values included.
    brightness : ndarray of float64, shape (height, width)
        E.
    flags : ndarray of uint8, shape (height, width)
        See :mod:`persfs_cl.masks`.
    parameters : mapping of str to float
        Of grid, scheme, light and material; see :mod:`persfs_cl._cl.parameters`.
    x_axis, y_axis : ndarray, shapes (3, width) and (3, height)
        Coordinates and the two terms of the viscosity: see kernels/schemes/lax_friedrichs.cl.
    cells, inwards, edges
        See :class:`persfs_cl.solver.domain.Boundary`.
    rim_cells : bool
        Whether the scheme treats cells apart that lack a neighbour, or only wants a missing neighbour to be high.
    """

    log_depth: NDArray[np.float64]
    brightness: NDArray[np.float64]
    flags: NDArray[np.uint8]
    parameters: Mapping[str, float]
    x_axis: NDArray[np.float64]
    y_axis: NDArray[np.float64]
    cells: NDArray[np.int32]
    inwards: NDArray[np.int32]
    edges: int
    rim_cells: bool = True

    def marked_brightness(self, rows: slice) -> NDArray[np.float64]:
        """E as the kernels read it, in some rows: NaN where not swept, its sign set where a neighbour is missing."""
        flags = self.flags[rows]
        swept = (flags & SWEPT) != 0
        marked = np.where(swept, self.brightness[rows], np.nan)
        if self.rim_cells:
            # Not so the others: a NaN with its sign set would send its whole block the slow way.
            on_rim = swept & ((flags & (NO_LEFT | NO_RIGHT | NO_UP | NO_DOWN)) != 0)
            np.negative(marked, out=marked, where=on_rim)
        return marked

    @property
    def outside(self) -> float:
        """The value of what lies around the image."""
        return 0.0 if self.rim_cells else NOWHERE

    @property
    def beside(self) -> NDArray[np.int64]:
        """Pixels left, right, up and down of each boundary cell, or NONE; shape (cells, 4)."""
        width = self.flags.shape[1]
        flags = self.flags.ravel()[self.cells]
        steps = ((NO_LEFT, -1), (NO_RIGHT, 1), (NO_UP, -width), (NO_DOWN, width))
        return np.stack([np.where(flags & bit, NONE, self.cells + step) for bit, step in steps], axis=1)


class Sweeper:
    """Images of one size on a device, and the steps of the iteration. An image that has converged rests.

    Parameters
    ----------
    device : Device
    grids : sequence of Grid
        At least one, all of one shape.
    model : sequence of str
        Kernel files of the model and the scheme.
    ordering : str
        Its variant is chosen for the device.
    precision : {"float32", "float64"}
    tolerance : float
        max |ΔZ| of an iteration at which an image rests.
    linear : bool
        Extrapolate the boundary cells instead of letting the surface flow out.
    lowest : float
        Floor of the extrapolation.
    second_order : bool
        Correct converged values of the upwind scheme to second order.
    only_lower : bool
        With that, let values only fall.
    tuning : Tuning, optional
        In place of the device's own.

    Raises
    ------
    DeviceError
        When the device lacks the precision or the memory.
    """

    def __init__(
        self,
        device: Device,
        grids: Sequence[Grid],
        *,
        model: Sequence[str],
        ordering: str,
        precision: str,
        tolerance: float = 0.0,
        linear: bool = False,
        lowest: float = 0.0,
        second_order: bool = False,
        only_lower: bool = False,
        tuning: Tuning | None = None,
    ) -> None:
        self._device = device
        self._real = device.real(precision)
        self.count = len(grids)
        height, width = grids[0].log_depth.shape
        shape = (height, width)
        self.tuning = tuning or Tuning.of(
            device, ordering, precision, shape, self.count, second_order=second_order, only_lower=only_lower
        )
        self._layout = self.tuning.layout((height, width))
        # The largest float32 that is no more than the tolerance, so that host and device agree on who has met it.
        self._tolerance = np.float32(tolerance)
        if self._tolerance > tolerance:
            self._tolerance = np.nextafter(self._tolerance, np.float32(0.0))
        self._pixels: int = self.count * height * width
        self._sweeps = 0
        # Of bands: half-sweeps and measurements of an image that does not rest, and of these the latter.
        self._stages = self._measured = 0
        self._row = 0
        self._rested = np.zeros(self.count, bool)
        self._rested_at = np.zeros(self.count, np.int32)
        self._begun = False
        self.kernel_seconds = 0.0

        with in_words(device):
            self._upload_all(grids)
            self._linear, self._lowest = int(linear), lowest
            self._make_kernels([*model, *self.tuning.kernels], precision, height, list(grids[0].parameters))

    def _upload_all(self, grids: Sequence[Grid]) -> None:
        layout = self._layout
        stored = layout.store([grid.log_depth.__getitem__ for grid in grids], grids[0].outside, self._real)
        self._log_depth = self._upload(stored)
        self._previous = self._buffer(stored.nbytes)
        reversed_too = self.tuning.in_strips
        columns = np.stack([layout.column_table(grid.x_axis, reversed_too=reversed_too) for grid in grids])
        rows = np.stack([layout.row_table(grid.y_axis) for grid in grids])
        self._parameters = self._upload(records([grid.parameters for grid in grids], self._real))
        self._changes = self._buffer(4 * self.count)
        self._buffers = (
            self._log_depth,
            self._upload(layout.store([grid.marked_brightness for grid in grids], np.nan, self._real)),
            self._upload(layout.store([grid.flags.__getitem__ for grid in grids], 0, np.dtype(np.uint8))),
            self._parameters,
            self._upload(columns.astype(self._real)),
            self._upload(rows.astype(self._real)),
        )
        self._list_boundary(grids)

    def _make_kernels(self, names: Sequence[str], precision: str, height: int, parameters: Sequence[str]) -> None:
        device, layout = self._device, self._layout
        sweeping = (device, names, precision, self.tuning.definitions)
        integer, single = np.int32, np.float32
        begin: list[Any] = [None] * 7 + [integer, single, integer]
        if self.tuning.variant == "wavefront_images":
            self._sync_buffer = self._upload(np.zeros(1, np.int32))
            scalars = [*begin, *[integer] * 7, None, integer, *[None] * 6, integer, single]
            self._iterate = kernel(*sweeping, "iterate", scalars, parameters)
            return
        integers = {
            "lexicographic": 8,
            "wavefront_tiles": 10,
            "wavefront_strips": 8,
            "checkerboard": 3,
            "checkerboard_bands": 7,
            "three_colours": 7,
        }
        scalars = begin + [integer] * integers[self.tuning.variant]
        if self.tuning.variant == "wavefront_strips":
            strips = -(-height // self.tuning.strip_rows)
            self._strips = self.count * strips
            self._sync_buffer = self._upload(np.zeros(1 + (1 + _APART) * self._strips, np.int32))
            scalars += [None, integer]
        if self.tuning.variant == "checkerboard_bands":
            self._bands = -(-height // self.tuning.band_rows)
            self._sync_buffer = self._upload(np.zeros(self.count * (1 + self._bands), np.int32))
            scalars += [None, integer, integer, None]
        self._sweep = kernel(*sweeping, "sweep", scalars, parameters)

        scalars = [None] * 8 + [integer, single, *[integer] * 3, single]
        self._renew = kernel(device, ["boundary", "renew"], precision, None, "renew_boundary", scalars)
        self._renew_items = min(256, _group_size(self._renew, device))

        wide = lanes(device, precision)
        definitions = {"LANES": wide}
        scalars = [None] * 3 + [integer, single, integer, integer]
        self._measure = kernel(device, ["change", "measure"], precision, definitions, "measure", scalars)
        # With vectors each item takes a part of its own: see kernels/shared/measure.cl.
        self._measure_group = (1, 1) if wide > 1 else None
        self._measure_items = max(1, min((1 if wide > 1 else 1024) * device.compute_units, layout.size // 1024))

    @property
    def queued_at_least(self) -> int:
        """How many iterations should be queued together: where images take turns in the cache, not too few."""
        if not self._in_turns:
            return 4
        return max(4, min(64, _CELLS_AT_A_TIME // self._pixels))

    @property
    def _in_turns(self) -> bool:
        """Whether each group takes an image through all iterations of a launch, and then another."""
        bands = self.tuning.variant == "checkerboard_bands" and not self._has_boundary
        return self.tuning.variant == "wavefront_images" or (bands and self.count >= self.tuning.work_groups)

    def run(self, iterations: int) -> NDArray[np.float64]:
        """Iterate: four sweeps, the boundary renewed after each. Waits for the device once, at the end.

        Parameters
        ----------
        iterations : int
            How many to queue. An image skips those after the one that met the tolerance.

        Returns
        -------
        ndarray of float64, shape (iterations, images)
            max |ΔZ| of each iteration, in single precision; 0 for those that were skipped.

        Raises
        ------
        DeviceError
            When the device left work undone.
        """
        with self._device.lock, in_words(self._device), self._until_idle():
            self._begin(iterations)
            stages = self._stages
            if self.tuning.variant == "wavefront_images":
                first = last = self._iterate_images(iterations)
            elif self.tuning.variant == "checkerboard_bands" and not self._has_boundary:
                first, last = self._iterate_bands(iterations)
            else:
                first = None
                for _ in range(iterations):
                    event = self.sweep_in_turn()
                    first = first or event
                    last = self.measure()
            changes = self._changes_host
            cl.enqueue_copy(self._device.queue, changes, self._changes)
            rows = changes[1:]
            met = rows <= self._tolerance
            ended = met.any(axis=0) & ~self._rested
            self._rested |= ended
            self._rested_at[ended] = stages + (self._stages - stages) // iterations * (1 + met[:, ended].argmax(axis=0))
            self._row = 0
            self._check_all_done()
            self.kernel_seconds += 1e-9 * (last.profile.end - first.profile.start)
        return rows.astype(np.float64)

    def sweep_in_turn(self) -> Any:
        """Queue the four sweeps of an iteration, with the renewal of the boundary after each.

        Strips and bands do them in one launch where there is nothing to renew. Returns the event of the first sweep.
        """
        if self.tuning.variant in ("wavefront_strips", "checkerboard_bands") and not self._has_boundary:
            return self.sweep(0, count=4)
        first = None
        for number in range(4):
            event = self.sweep(number)
            first = first or event
            self.renew_boundary()
        return first

    def sweep(self, number: int, *, count: int = 1) -> Any:
        """Queue a sweep of all images; not for the variant "wavefront_images", which runs whole iterations.

        Parameters
        ----------
        number : int
            0 to 3: the direction, see :data:`DIRECTIONS`; those of colours have none.
        count : int
            So many sweeps in turn, up to number 3, by one launch of strips or bands.
        """
        if not self._row:
            self._begin(1)
        layout, tuning, queue = self._layout, self.tuning, self._device.queue
        common = (*self._buffers, self._changes, self._row, self._tolerance, self.count, layout.rows, layout.stride)
        image = (layout.first_row, layout.first_column, layout.height, layout.width)
        if tuning.variant == "checkerboard_bands":
            event = self._launch_bands(self._row, 1, halves=2 * count, measured=0)
        elif tuning.variant == "checkerboard":
            size = (1 if tuning.lanes > 1 else layout.stride // 2, layout.rows - 2, self.count)
            event, _ = [self._sweep(queue, size, None, *common, (layout.parity + half) % 2) for half in range(2)]
        elif tuning.variant == "three_colours":
            size = (layout.width, layout.height, self.count)
            event, *_ = [self._sweep(queue, size, None, *common, *image, third) for third in range(3)]
        elif tuning.variant == "lexicographic":
            event = self._sweep(queue, (self.count,), (1,), *common, *image, *DIRECTIONS[number])
        elif tuning.variant == "wavefront_strips":
            run = (number, count, self._sync_buffer, self._sweeps)
            event = self._sweep(queue, (tuning.work_groups,), (1,), *common, *image, *run)
        else:
            high, wide = tuning.tile
            tile_rows, tile_columns = -(-layout.height // high), -(-layout.width // wide)
            event = None
            for diagonal in range(tile_rows + tile_columns - 1):
                begin = max(0, diagonal - tile_columns + 1)
                tiles = min(diagonal, tile_rows - 1) - begin + 1
                tile = (*DIRECTIONS[number], diagonal, begin)
                launched = self._sweep(queue, (tiles * high, self.count), (high, 1), *common, *image, *tile)
                event = event or launched
        self._sweeps += count
        return event

    def renew_boundary(self) -> None:
        """Queue the renewal of the boundary cells from inside, eq. (12)."""
        if not self._has_boundary:
            return
        self._renew(
            self._device.queue,
            (self._renew_items, self.count),
            (self._renew_items, 1),
            self._log_depth,
            self._parameters,
            *self._boundary,
            self._changes,
            self._row,
            self._tolerance,
            self.count,
            self._layout.size,
            self._linear,
            self._lowest,
        )

    def measure(self) -> Any:
        """Queue the search for the largest change since the last one."""
        event = self._measure(
            self._device.queue,
            (self._measure_items, self.count),
            self._measure_group,
            self._log_depth,
            self._previous,
            self._changes,
            self._row,
            self._tolerance,
            self.count,
            self._layout.size,
        )
        self._row += 1
        return event

    def log_depth(self) -> NDArray[np.floating]:
        """A copy of the values as they are now, shape (images, height, width)."""
        values = np.empty((self.count, self._layout.height, self._layout.width), self._real)
        self.copy_log_depth(values)
        return values

    def copy_log_depth(self, values: Iterable[NDArray[np.floating]]) -> None:
        """Copy the values as they are now into an array of shape (height, width) for each image."""
        layout, queue = self._layout, self._device.queue
        shape = (self.count, layout.rows, layout.stride)
        with in_words(self._device):
            self._check_all_done()
            # What lies in the host's memory already is not copied by this.
            stored, _ = cl.enqueue_map_buffer(queue, self._log_depth, cl.map_flags.READ, 0, shape, self._real)
            try:
                for image, taken in zip(stored, values, strict=True):
                    layout.take(image, taken)
            finally:
                stored.base.release(queue)

    def _begin(self, iterations: int) -> None:
        """Clear the record of changes; its row 0 says which images rest."""
        if not self._begun:
            # Not before there is something to wait for it: the values may lie in memory that an error would free.
            cl.enqueue_copy(self._device.queue, self._previous, self._log_depth)
            self._begun = True
        host = np.zeros((iterations + 1, self.count), np.float32)
        host[0] = np.where(self._rested, -1.0, np.inf)
        if self._changes.size != host.nbytes:
            self._changes = self._buffer(host.nbytes)
        cl.enqueue_copy(self._device.queue, self._changes, host)
        self._changes_host = host
        self._row = 1

    def _iterate_images(self, iterations: int) -> Any:
        layout, groups = self._layout, self.tuning.work_groups
        event = self._iterate(
            self._device.queue,
            (groups,),
            (1,),
            *self._buffers,
            self._changes,
            self._row,
            self._tolerance,
            self.count,
            layout.rows,
            layout.stride,
            layout.first_row,
            layout.first_column,
            layout.height,
            layout.width,
            iterations,
            self._sync_buffer,
            # Every group draws one ticket too many in each launch.
            self._sweeps * (self.count + groups),
            self._previous,
            *self._boundary,
            self._linear,
            self._lowest,
        )
        self._sweeps += 1
        return event

    def _iterate_bands(self, iterations: int) -> tuple[Any, Any]:
        """The first and the last event of so many iterations.

        Where groups share images, a launch has few of them: a group that loses its processor is missing until the next.
        """
        together = iterations if self._in_turns else max(1, _LAUNCHED_CELLS // self._pixels)
        events = []
        for begin in range(0, iterations, together):
            count = min(together, iterations - begin)
            events.append(self._launch_bands(self._row + begin, count, halves=8, measured=1))
        return events[0], events[-1]

    def _launch_bands(self, row: int, iterations: int, *, halves: int, measured: int) -> Any:
        layout, tuning = self._layout, self.tuning
        event = self._sweep(
            self._device.queue,
            (tuning.work_groups,),
            (1,),
            *self._buffers,
            self._changes,
            row,
            self._tolerance,
            self.count,
            layout.rows,
            layout.stride,
            layout.parity,
            iterations,
            halves,
            measured,
            tuning.band_rows,
            self._sync_buffer,
            self._stages,
            self._measured,
            self._previous,
        )
        self._stages += iterations * (halves + measured)
        self._measured += iterations * measured
        return event

    def _check_all_done(self) -> None:
        """Wait for the device, and raise an error where groups that share out the work have left some of it."""
        if self.tuning.variant == "wavefront_strips":
            claims = np.empty(self._strips, np.int32)
            cl.enqueue_copy(self._device.queue, claims, self._sync_buffer, src_offset=claims.itemsize)
            left = (claims != self._sweeps).any()
        elif self.tuning.variant == "checkerboard_bands":
            states = np.empty((self.count, self._bands), np.int32)
            offset = self.count * states.itemsize
            cl.enqueue_copy(self._device.queue, states, self._sync_buffer, src_offset=offset)
            wanted = 2 * np.where(self._rested, self._rested_at, self._stages)
            left = (states != wanted[:, None]).any()
        else:
            return
        if left:
            raise DeviceError(
                f"{self._device} left parts of the image undone: its driver is at fault. Use ordering='lexicographic'."
            )

    def _list_boundary(self, grids: Sequence[Grid]) -> None:
        """Upload the lists of boundary cells; see kernels/shared/boundary.cl."""
        counts = np.array([len(grid.cells) for grid in grids])
        edges = np.array([grid.edges for grid in grids])
        parts = np.stack([np.cumsum(counts) - counts, edges, counts - edges], axis=1).astype(np.int32)
        self._has_boundary = bool(counts.any())

        def listed(name: str) -> NDArray[np.int32]:
            cells = np.concatenate([self._layout.cells(getattr(grid, name)) for grid in grids])
            # OpenCL has no empty buffers; that of a list without cells is never read.
            return cells if self._has_boundary else np.zeros(4, np.int32)

        lists = [self._upload(cells) for cells in (parts, listed("cells"), listed("inwards"), listed("beside"))]
        self._boundary = (*lists, self._buffer(max(1, int(counts.sum())) * self._real.itemsize))

    @contextmanager
    def _until_idle(self) -> Iterator[None]:
        """Not to leave, whatever happens, before the kernels are done with arrays that may then be freed."""
        try:
            yield
        except BaseException:
            self._device.queue.finish()
            raise

    def _upload(self, values: NDArray[Any]) -> cl.Buffer:
        return _upload(self._device, values)

    def _buffer(self, size: int) -> cl.Buffer:
        return _buffer(self._device, size)


def render(
    device: Device,
    model: Sequence[str],
    precision: str,
    log_depth: NDArray[np.floating],
    flags: NDArray[np.uint8],
    parameters: Mapping[str, float],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.floating]:
    """Brightness of a surface, eq. (6); NaN where the flag SWEPT is not set. Shape (height, width)."""
    real = device.real(precision)
    height, width = log_depth.shape
    result = np.empty((height, width), real)
    with device.lock, in_words(device):
        scalars = [None] * 6 + [np.int32] * 2
        rendering = kernel(device, [*model, "render"], precision, None, "render", scalars, list(parameters))
        brightness = _buffer(device, result.nbytes)
        # Named, so that they live until the kernel has run.
        given = [
            _upload(device, log_depth.astype(real)),
            _upload(device, flags),
            _upload(device, records([parameters], real)),
            *(_upload(device, numbers.astype(real)) for numbers in (x, y)),
        ]
        rendering(device.queue, (width, height), None, *given, brightness, width, height)
        cl.enqueue_copy(device.queue, result, brightness)
    return result


def _group_size(launched: cl.Kernel, device: Device) -> int:
    """Largest power of two that the kernel may be launched with as one group."""
    info = cl.kernel_work_group_info.WORK_GROUP_SIZE
    limit: Any = launched.get_work_group_info(info, device.context.devices[0])
    return 1 << (int(limit).bit_length() - 1)


def _upload(device: Device, values: NDArray[Any]) -> cl.Buffer:
    """The values on the device, which may work on the array itself.

    So the array must not be changed afterwards, and the buffer must be kept until the kernels that use it have run.
    """
    host = np.ascontiguousarray(values)
    # A processor works on the array itself, which the buffer keeps alive: no second one to allocate and fill.
    in_place = device.kind == "cpu" and host.flags.writeable and host.ctypes.data % ALIGNMENT == 0
    place = cl.mem_flags.USE_HOST_PTR if in_place else cl.mem_flags.COPY_HOST_PTR
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE | place, hostbuf=host)
    except (cl.MemoryError, cl.LogicError) as error:
        raise _out_of_memory(device, host.nbytes) from error


def _buffer(device: Device, size: int) -> cl.Buffer:
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size)
    except (cl.MemoryError, cl.LogicError) as error:
        raise _out_of_memory(device, size) from error


def _out_of_memory(device: Device, size: int) -> DeviceError:
    return DeviceError(
        f"{device} cannot hold an array of {size / 2**20:.0f} MiB (it has {device.memory / 2**20:.0f} MiB): "
        "use a smaller image, precision='float32', or another device."
    )
