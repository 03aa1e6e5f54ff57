"""Launches: images on a device, and the kernels that act on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.layout import NONE, Layout
from persfs_cl._cl.program import program
from persfs_cl.errors import DeviceError

DIRECTIONS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The four sweeps as (leftwards, upwards), in the paper's order."""

_SWEPT = 1
_MISSING = 2 | 4 | 8 | 16
_PARAMETERS = 16


@dataclass(frozen=True)
class Grid:
    """One image in numbers, as the kernels want them.

    Attributes
    ----------
    log_depth : ndarray, shape (height, width)
        Start values, known values included.
    brightness : ndarray, shape (height, width)
        E.
    flags : ndarray of uint8, shape (height, width)
        See :mod:`persfs_cl.domain`.
    parameters : sequence of float
        Grid and model parameters in the order of kernels/prelude.cl.
    x_axis, y_axis : ndarray, shapes (3, width) and (3, height)
        Coordinates and the two terms of the viscosity: see kernels/lax_friedrichs.cl.
    cells, inwards, edges
        See :class:`persfs_cl.domain.Boundary`.
    """

    log_depth: NDArray[np.floating]
    brightness: NDArray[np.floating]
    flags: NDArray[np.uint8]
    parameters: Sequence[float]
    x_axis: NDArray[np.float64]
    y_axis: NDArray[np.float64]
    cells: NDArray[np.int32]
    inwards: NDArray[np.int32]
    edges: int

    @property
    def marked_brightness(self) -> NDArray[np.floating]:
        """E as the kernels read it: NaN where not swept, with its sign set where a neighbour is missing."""
        marked = np.where(self.flags & _SWEPT, self.brightness, np.nan)
        on_rim = (self.flags & _MISSING) != 0
        marked[on_rim] = -marked[on_rim]
        return marked

    @property
    def beside(self) -> NDArray[np.int64]:
        """Pixels left, right, up and down of each boundary cell, or NONE; shape (cells, 4)."""
        width = self.flags.shape[1]
        flags = self.flags.ravel()[self.cells]
        steps = ((2, -1), (4, 1), (8, -width), (16, width))
        return np.stack([np.where(flags & bit, NONE, self.cells + step) for bit, step in steps], axis=1)


@dataclass(frozen=True)
class Tuning:
    """How the sweeps are laid out on a device; the results do not depend on it.

    Attributes
    ----------
    variant : str
        Kernel file of the sweep.
    lanes : int
        Cells a work-item updates at once.
    bands : int
        Vectors a strip of the wavefront is high.
    work_groups : int
        How many run along strips at a time.
    """

    variant: str
    lanes: int = 1
    bands: int = 1
    work_groups: int = 1

    @classmethod
    def of(cls, device: Device, ordering: str, height: int) -> Tuning:
        """What suits a device.

        Strips want few work-groups with wide vectors, and groups that may wait for each other: a CPU runs a group to
        its end without interruption by others. Elsewhere the wavefront goes tile by tile, without waiting.
        """
        on_cpu = device.kind == "cpu"
        lanes = 8 if on_cpu else 1
        if ordering == "checkerboard":
            return cls("checkerboard", lanes=lanes)
        if ordering == "wavefront" and on_cpu:
            bands = 4 if height > 256 else 2
            return cls("wavefront_strips", lanes=lanes, bands=bands, work_groups=device.compute_units)
        return cls("wavefront_tiles" if ordering == "wavefront" else "lexicographic")

    @property
    def definitions(self) -> dict[str, int]:
        """Constants of the program."""
        sizes = {"wavefront_tiles": {"TILE_ROWS": 32, "TILE_COLUMNS": 64}, "wavefront_strips": {"BANDS": self.bands}}
        return {"LANES": self.lanes, **sizes.get(self.variant, {})}

    def layout(self, shape: tuple[int, int]) -> Layout:
        """How an image must lie for this variant."""
        if self.variant == "checkerboard":
            return Layout.columns_apart(shape, self.lanes)
        return Layout.padded(shape, 8 * self.bands + 8 if self.variant == "wavefront_strips" else 1)


class Sweeper:
    """Images of one size on a device, and the steps of the iteration. An image that has converged rests.

    Parameters
    ----------
    device : Device
    grids : sequence of Grid
        At least one, all of one shape.
    model, scheme, ordering : str
        Names of the kernel files; the ordering's variant is chosen for the device.
    precision : {"float32", "float64"}
    tolerance : float
        max |ΔZ| of an iteration at which an image rests.
    linear : bool
        Extrapolate the boundary cells instead of letting the surface flow out.
    lowest : float
        Floor of the extrapolation.
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
        model: str,
        scheme: str,
        ordering: str,
        precision: str,
        tolerance: float = 0.0,
        linear: bool = False,
        lowest: float = 0.0,
        tuning: Tuning | None = None,
    ) -> None:
        self._device = device
        self._real = device.real(precision)
        self.count = len(grids)
        height, width = grids[0].log_depth.shape
        self.tuning = tuning or Tuning.of(device, ordering, height)
        self._layout = layout = self.tuning.layout((height, width))
        # The largest float32 that is no more than the tolerance, so that host and device agree on who has met it.
        self._tolerance = np.float32(tolerance)
        if self._tolerance > tolerance:
            self._tolerance = np.nextafter(self._tolerance, np.float32(0.0))
        self._sweeps = 0
        self._row = 0
        self._rested = np.zeros(self.count, bool)
        self.kernel_seconds = 0.0

        sweeping = program(device, [model, scheme, "cell", self.tuning.variant], precision, self.tuning.definitions)
        boundary = program(device, ["boundary"], precision)
        measure = program(device, ["change"], precision, {"LANES": 8 if device.kind == "cpu" else 1})

        stored = self._stack([layout.store(grid.log_depth, 0.0, self._real) for grid in grids])
        self._log_depth = self._upload(stored)
        self._previous = self._upload(stored)
        strips = self.tuning.variant == "wavefront_strips"
        numbers = self._stack([_numbers(grid.parameters) for grid in grids])
        self._parameters = self._upload(numbers.astype(self._real))
        self._changes = self._buffer(4 * self.count)
        self._sweep = cl.Kernel(sweeping, "sweep")
        self._sweep_buffers = (
            self._log_depth,
            self._upload(self._stack([layout.store(grid.marked_brightness, np.nan, self._real) for grid in grids])),
            self._upload(self._stack([layout.store(grid.flags, 0, np.dtype(np.uint8)) for grid in grids])),
            self._parameters,
            self._upload(
                self._stack([layout.column_table(grid.x_axis, reversed_too=strips) for grid in grids]).astype(
                    self._real
                )
            ),
            self._upload(self._stack([layout.row_table(grid.y_axis) for grid in grids]).astype(self._real)),
        )
        integers = {"lexicographic": 8, "wavefront_tiles": 10, "checkerboard": 3, "wavefront_strips": 8}
        scalars: list[Any] = [None] * 7 + [np.int32, np.float32] + [np.int32] * integers[self.tuning.variant]
        if strips:
            strip_count = -(-height // (8 * self.tuning.bands))
            self._sync = np.zeros(2 + self.count * strip_count, np.int32)
            self._sync_buffer = self._upload(self._sync)
            scalars += [None, np.int32, np.int32]
        self._sweep.set_scalar_arg_dtypes(scalars)
        self._prepare_boundary(boundary, grids, linear, lowest)

        self._change = cl.Kernel(measure, "change")
        self._change.set_scalar_arg_dtypes([None] * 3 + [np.int32, np.float32, np.int32])
        per_unit = 1 if device.kind == "cpu" else 1024
        self._change_items = max(1, min(per_unit * device.compute_units, layout.size // 1024))

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
            When work-groups waited for each other in vain.
        """
        with self._device.lock:
            self._begin(iterations)
            first: Any = None
            for _ in range(iterations):
                for number in range(4):
                    event = self.sweep(number)
                    first = first or event
                    self.renew_boundary()
                last = self._measure()
            changes = self._changes_host
            cl.enqueue_copy(self._device.queue, changes, self._changes)
            self._check_waits()
            self.kernel_seconds += 1e-9 * (last.profile.end - first.profile.start)
        rows = changes[1:]
        self._rested |= (rows <= self._tolerance).any(axis=0)
        self._row = 0
        return rows.astype(np.float64)

    def sweep(self, number: int) -> Any:
        """Queue one sweep of all images.

        Parameters
        ----------
        number : int
            0 to 3: the direction, see :data:`DIRECTIONS`; the checkerboard begins with red and black in turn.
        """
        if not self._row:
            self._begin(1)
        layout, tuning, queue = self._layout, self.tuning, self._device.queue
        common = (*self._sweep_buffers, self._changes, self._row, self._tolerance, layout.rows, layout.stride)
        image = (layout.first_row, layout.first_column, layout.height, layout.width)
        if tuning.variant == "checkerboard":
            size = (layout.stride // 2 // tuning.lanes, layout.rows - 2, self.count)
            stored_parity = layout.first_row + layout.first_column
            event = self._sweep(queue, size, None, *common, (stored_parity + number) % 2)
            self._sweep(queue, size, None, *common, (stored_parity + number + 1) % 2)
        elif tuning.variant == "lexicographic":
            event = self._sweep(queue, (self.count,), (1,), *common, *image, *DIRECTIONS[number])
        elif tuning.variant == "wavefront_strips":
            groups = (tuning.work_groups,)
            run = (self._sync_buffer, self.count, self._sweeps)
            event = self._sweep(queue, groups, (1,), *common, *image, *DIRECTIONS[number], *run)
        else:
            high, wide = tuning.definitions["TILE_ROWS"], tuning.definitions["TILE_COLUMNS"]
            tile_rows, tile_columns = -(-layout.height // high), -(-layout.width // wide)
            event = None
            for diagonal in range(tile_rows + tile_columns - 1):
                begin = max(0, diagonal - tile_columns + 1)
                tiles = min(diagonal, tile_rows - 1) - begin + 1
                tile = (*DIRECTIONS[number], diagonal, begin)
                launched = self._sweep(queue, (tiles * high, self.count), (high, 1), *common, *image, *tile)
                event = event or launched
        self._sweeps += 1
        return event

    def renew_boundary(self) -> None:
        """Queue the renewal of the boundary cells from inside, eq. (12)."""
        if self._renew is not None:
            items = self._renew_items
            self._renew(
                self._device.queue,
                (items, self.count),
                (items, 1),
                self._log_depth,
                self._parameters,
                *self._renew_buffers,
                self._changes,
                self._row,
                self._tolerance,
                *self._renew_scalars,
            )

    def log_depth(self) -> NDArray[np.floating]:
        """A copy of the values as they are now, shape (images, height, width)."""
        stored = np.empty((self.count, self._layout.rows, self._layout.stride), self._real)
        cl.enqueue_copy(self._device.queue, stored, self._log_depth)
        self._check_waits()
        return np.stack([self._layout.take(values) for values in stored])

    def _begin(self, iterations: int) -> None:
        """Clear the record of changes; its row 0 says which images rest."""
        host = np.zeros((iterations + 1, self.count), np.float32)
        host[0] = np.where(self._rested, -1.0, np.inf)
        if self._changes.size != host.nbytes:
            self._changes = self._buffer(host.nbytes)
        cl.enqueue_copy(self._device.queue, self._changes, host)
        self._changes_host = host
        self._row = 1

    def _measure(self) -> Any:
        event = self._change(
            self._device.queue,
            (self._change_items, self.count),
            None if self._device.kind == "gpu" else (1, 1),
            self._log_depth,
            self._previous,
            self._changes,
            self._row,
            self._tolerance,
            self._layout.size,
        )
        self._row += 1
        return event

    def _check_waits(self) -> None:
        if self.tuning.variant != "wavefront_strips":
            return
        cl.enqueue_copy(self._device.queue, self._sync[:2], self._sync_buffer)
        if self._sync[1]:
            raise DeviceError(
                f"{self._device}: a work-group waited for another in vain. The processor is overloaded, or the device "
                "does not run work-groups side by side: try again, or use ordering='checkerboard'."
            )

    def _prepare_boundary(self, program: cl.Program, grids: Sequence[Grid], linear: bool, lowest: float) -> None:
        counts = np.array([len(grid.cells) for grid in grids])
        self._renew: cl.Kernel | None = None
        if not counts.any():
            return
        edges = np.array([grid.edges for grid in grids])
        begins = np.cumsum(counts) - counts
        layout = self._layout
        self._renew = cl.Kernel(program, "renew_boundary")
        scalars = [np.int32, np.float32, np.int32, np.int32, np.float32]
        self._renew.set_scalar_arg_dtypes([None] * 8 + scalars)
        self._renew_items = min(256, _group_size(self._renew, self._device))
        self._renew_buffers = (
            self._upload(np.stack([begins, edges, counts - edges], axis=1).astype(np.int32)),
            self._upload(np.concatenate([layout.cells(grid.cells) for grid in grids])),
            self._upload(np.concatenate([layout.cells(grid.inwards) for grid in grids])),
            self._upload(np.concatenate([layout.cells(grid.beside) for grid in grids])),
            self._buffer(int(counts.sum()) * self._real.itemsize),
        )
        self._renew_scalars = (layout.size, int(linear), lowest)

    @staticmethod
    def _stack(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)

    def _upload(self, values: NDArray[Any]) -> cl.Buffer:
        return _upload(self._device, values)

    def _buffer(self, size: int) -> cl.Buffer:
        return _buffer(self._device, size)


def render(
    device: Device,
    model: str,
    precision: str,
    log_depth: NDArray[np.floating],
    flags: NDArray[np.uint8],
    parameters: Sequence[float],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.floating]:
    """Brightness of a surface, eq. (6); NaN where the flag SWEPT is not set. Shape (height, width)."""
    real = device.real(precision)
    height, width = log_depth.shape
    result = np.empty((height, width), real)
    with device.lock:
        kernel = cl.Kernel(program(device, [model, "render"], precision), "render")
        kernel.set_scalar_arg_dtypes([None] * 6 + [np.int32] * 2)
        brightness = _buffer(device, result.nbytes)
        kernel(
            device.queue,
            (width, height),
            None,
            _upload(device, log_depth.astype(real)),
            _upload(device, flags),
            *(_upload(device, numbers.astype(real)) for numbers in (_numbers(parameters), x, y)),
            brightness,
            width,
            height,
        )
        cl.enqueue_copy(device.queue, result, brightness)
    return result


def _numbers(parameters: Sequence[float]) -> NDArray[np.float64]:
    """One image's part of the buffer of parameters."""
    return np.pad(np.asarray(parameters, dtype=np.float64), (0, _PARAMETERS - len(parameters)))


def _group_size(kernel: cl.Kernel, device: Device) -> int:
    """Largest power of two that the kernel may be launched with as one group."""
    info = cl.kernel_work_group_info.WORK_GROUP_SIZE
    limit: Any = kernel.get_work_group_info(info, device.context.devices[0])
    return 1 << (int(limit).bit_length() - 1)


def _upload(device: Device, values: NDArray[Any]) -> cl.Buffer:
    host = np.ascontiguousarray(values)
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR, hostbuf=host)
    except cl.MemoryError as error:
        raise _out_of_memory(device, host.nbytes) from error


def _buffer(device: Device, size: int) -> cl.Buffer:
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size)
    except cl.MemoryError as error:
        raise _out_of_memory(device, size) from error


def _out_of_memory(device: Device, size: int) -> DeviceError:
    return DeviceError(
        f"{device} cannot hold an array of {size / 2**20:.0f} MiB (it has {device.memory / 2**20:.0f} MiB): "
        "use a smaller image, precision='float32', or another device."
    )
