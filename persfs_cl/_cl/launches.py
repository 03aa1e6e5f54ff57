"""Launches: one image's arrays on a device, and the kernels that act on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.program import program
from persfs_cl.errors import DeviceError

DIRECTIONS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The four sweeps as (leftwards, upwards), in the paper's order."""

_TILE_ROWS = 32
_TILE_COLUMNS = 64


class Sweeper:
    """Log depth of one image on a device, and the steps of an iteration.

    Parameters
    ----------
    device : Device
    model, scheme, ordering : str
        Names of the kernel files.
    precision : {"float32", "float64"}
    log_depth : ndarray, shape (height, width)
        Start values, known values included.
    brightness : ndarray, shape (height, width)
        E.
    flags : ndarray of uint8, shape (height, width)
        See :mod:`persfs_cl.domain`.
    parameters : sequence of float
        Grid and model parameters in the order of the kernels.
    cells, inwards, edges : see :class:`persfs_cl.domain.Boundary`
    linear : bool
        Extrapolate the boundary cells instead of letting the surface flow out.
    lowest : float
        Floor of the extrapolation.

    Raises
    ------
    DeviceError
        When the device lacks the precision or the memory.
    """

    def __init__(
        self,
        device: Device,
        *,
        model: str,
        scheme: str,
        ordering: str,
        precision: str,
        log_depth: NDArray[np.floating],
        brightness: NDArray[np.floating],
        flags: NDArray[np.uint8],
        parameters: Sequence[float],
        cells: NDArray[np.int32],
        inwards: NDArray[np.int32],
        edges: int,
        linear: bool,
        lowest: float,
    ) -> None:
        self._device = device
        self._real = device.real(precision)
        self.height, self.width = log_depth.shape
        self._ordering = ordering
        definitions = {"TILE_ROWS": _TILE_ROWS, "TILE_COLUMNS": _TILE_COLUMNS} if ordering == "wavefront" else {}
        sweeping = program(device, [model, scheme, "cell", ordering], precision, definitions)
        common = program(device, ["boundary", "change"], precision)

        self._log_depth = _upload(device, log_depth, self._real)
        self._previous = _upload(device, log_depth, self._real)
        self._parameters = _upload(device, np.asarray(parameters), self._real)
        flag_buffer = _upload(device, flags, np.dtype(np.uint8))

        self._sweep = cl.Kernel(sweeping, "sweep")
        integers = {"lexicographic": 4, "wavefront": 6, "checkerboard": 3}[ordering]
        self._sweep.set_scalar_arg_dtypes([None] * 4 + [np.int32] * integers)
        self._sweep_buffers = (self._log_depth, _upload(device, brightness, self._real), flag_buffer, self._parameters)

        self._renew: cl.Kernel | None = None
        if len(cells):
            self._renew = cl.Kernel(common, "renew_boundary")
            self._renew.set_scalar_arg_dtypes([None] * 6 + [np.int32] * 4 + [self._real])
            self._renew_arguments = (
                self._log_depth,
                flag_buffer,
                self._parameters,
                _upload(device, cells, np.dtype(np.int32)),
                _upload(device, inwards, np.dtype(np.int32)),
                _buffer(device, len(cells) * self._real.itemsize),
                self.width,
                edges,
                len(cells) - edges,
                int(linear),
                lowest,
            )
            self._renew_items = min(256, _group_size(self._renew, device))

        self._change = cl.Kernel(common, "change")
        self._change.set_scalar_arg_dtypes([None] * 4 + [np.uint32])
        self._change_items = min(64, _group_size(self._change, device))
        groups = max(1, min(4 * device.compute_units, log_depth.size // (4 * self._change_items)))
        self._largest = np.empty(groups, self._real)
        self._largest_buffer = _buffer(device, self._largest.nbytes)
        self.kernel_seconds = 0.0
        self._first: Any = None

    def iterate(self) -> float:
        """Run the four sweeps, renewing the boundary after each.

        Returns
        -------
        float
            max |ΔZ| over the iteration.
        """
        with self._device.lock:
            for number, (leftwards, upwards) in enumerate(DIRECTIONS):
                self.sweep(number, leftwards, upwards)
                self.renew_boundary()
            return self.change()

    def sweep(self, number: int, leftwards: int, upwards: int) -> None:
        """Run one sweep.

        Parameters
        ----------
        number : int
            Position in the iteration, 0 to 3; the checkerboard begins with red and black in turn.
        leftwards, upwards : {0, 1}
            Direction; without meaning for the checkerboard.
        """
        size = (self.width, self.height)
        if self._ordering == "lexicographic":
            self._launch(self._sweep, (1,), (1,), *self._sweep_buffers, *size, leftwards, upwards)
        elif self._ordering == "checkerboard":
            for colour in (number % 2, (number + 1) % 2):
                cells = ((self.width + 1) // 2, self.height)
                self._launch(self._sweep, cells, None, *self._sweep_buffers, *size, colour)
        else:
            rows = -(-self.height // _TILE_ROWS)
            columns = -(-self.width // _TILE_COLUMNS)
            for diagonal in range(rows + columns - 1):
                first = max(0, diagonal - columns + 1)
                tiles = min(diagonal, rows - 1) - first + 1
                arguments = (*size, leftwards, upwards, diagonal, first)
                self._launch(self._sweep, (tiles * _TILE_ROWS,), (_TILE_ROWS,), *self._sweep_buffers, *arguments)

    def renew_boundary(self) -> None:
        """Renew the boundary cells from inside, eq. (12)."""
        if self._renew is not None:
            items = (self._renew_items,)
            self._launch(self._renew, items, items, *self._renew_arguments)

    def change(self) -> float:
        """max |ΔZ| since the last call; waits for the device."""
        items = self._change_items
        event = self._launch(
            self._change,
            (len(self._largest) * items,),
            (items,),
            self._log_depth,
            self._previous,
            self._largest_buffer,
            cl.LocalMemory(items * self._real.itemsize),
            self.height * self.width,
        )
        cl.enqueue_copy(self._device.queue, self._largest, self._largest_buffer)
        self.kernel_seconds += 1e-9 * (event.profile.end - self._first.profile.start)
        self._first = None
        return float(self._largest.max())

    def log_depth(self) -> NDArray[np.floating]:
        """A copy of the values as they are now, shape (height, width)."""
        values = np.empty((self.height, self.width), self._real)
        cl.enqueue_copy(self._device.queue, values, self._log_depth)
        return values

    def _launch(self, kernel: cl.Kernel, size: tuple[int, ...], group: tuple[int, ...] | None, *arguments: Any) -> Any:
        event = kernel(self._device.queue, size, group, *arguments)
        if self._first is None:
            self._first = event
        return event


def render(
    device: Device,
    model: str,
    precision: str,
    log_depth: NDArray[np.floating],
    flags: NDArray[np.uint8],
    parameters: Sequence[float],
) -> NDArray[np.floating]:
    """Brightness of a surface, eq. (6); NaN where the flag SWEPT is not set. Shape (height, width)."""
    real = device.real(precision)
    height, width = log_depth.shape
    result = np.empty((height, width), real)
    with device.lock:
        kernel = cl.Kernel(program(device, [model, "render"], precision), "render")
        kernel.set_scalar_arg_dtypes([None] * 4 + [np.int32] * 2)
        brightness = _buffer(device, result.nbytes)
        kernel(
            device.queue,
            (width, height),
            None,
            _upload(device, log_depth, real),
            _upload(device, flags, np.dtype(np.uint8)),
            _upload(device, np.asarray(parameters), real),
            brightness,
            width,
            height,
        )
        cl.enqueue_copy(device.queue, result, brightness)
    return result


def _group_size(kernel: cl.Kernel, device: Device) -> int:
    """Largest power of two that the kernel may be launched with as one group."""
    info = cl.kernel_work_group_info.WORK_GROUP_SIZE
    limit: Any = kernel.get_work_group_info(info, device.context.devices[0])
    return 1 << (int(limit).bit_length() - 1)


def _upload(device: Device, values: NDArray[Any], kind: np.dtype[Any]) -> cl.Buffer:
    host = np.ascontiguousarray(values, dtype=kind)
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
