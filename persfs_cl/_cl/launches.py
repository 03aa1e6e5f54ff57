"""Launches: images on a device, and the kernels that act on them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.layout import ALIGNMENT, Layout
from persfs_cl._cl.program import program
from persfs_cl.domain import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, NONE, NOWHERE, SWEPT
from persfs_cl.errors import DeviceError

DIRECTIONS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The four sweeps as (leftwards, upwards), in the paper's order."""

_PARAMETERS = 16
_CPU_LANES = 8
_BANDS = 3
_APART = 32
"""As in kernels/strip.cl."""
_CACHED_PIXELS = 2**20
"""An image of this size, with its brightness, stays in a processor's second-level cache, or nearly."""
_SMALL_PIXELS = 2**16
"""Up to this size launches cost more than what a second processor saves."""
_CELLS_AT_A_TIME = 2**28
"""Cells of iterations that are queued together at least, where that keeps images in the cache: half a second or so."""


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
    rim_cells : bool
        Whether the scheme treats cells apart that lack a neighbour, or only wants a missing neighbour to be high.
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
    rim_cells: bool = True

    def marked_brightness(self, real: np.dtype[Any]) -> NDArray[np.floating]:
        """E as the kernels read it: NaN where not swept, with its sign set where a neighbour is missing."""
        swept = (self.flags & SWEPT) != 0
        marked: NDArray[np.floating] = self.brightness.astype(real)
        marked[~swept] = np.nan
        if not self.rim_cells:
            return marked
        # Not so the others: a NaN with its sign set would send its whole block the slow way.
        on_rim = swept & ((self.flags & (NO_LEFT | NO_RIGHT | NO_UP | NO_DOWN)) != 0)
        marked[on_rim] = -marked[on_rim]
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
        How many run along strips, or over images, at a time.
    polls : int
        After so many a work-group that waits for another hands its strip back: some hundred microseconds.
    images_at_a_time : int or None
        So many images share a launch, and go through all queued iterations before the next; None is all.
    second_order : bool
        Correct the differences of the upwind scheme to second order.
    only_lower : bool
        Let the corrected values only fall.
    """

    variant: str
    lanes: int = 1
    bands: int = 1
    work_groups: int = 1
    polls: int = 4000
    images_at_a_time: int | None = None
    second_order: bool = False
    only_lower: bool = False

    @classmethod
    def of(
        cls, device: Device, ordering: str, shape: tuple[int, int], images: int, *, second_order: bool = False
    ) -> Tuning:
        """What suits a device, and a number of images of one size.

        Strips want few work-groups, each with one item and wide vectors: what a CPU is good at. Elsewhere the wavefront
        goes tile by tile, with many items.
        """
        if second_order:
            # These visit cells one by one: the wider stencil and its case distinctions are not for vectors.
            variants = {"checkerboard": "three_colours", "wavefront": "wavefront_tiles"}
            return cls(variants.get(ordering, ordering), second_order=True)
        on_cpu = device.kind == "cpu"
        if ordering == "checkerboard":
            if not on_cpu:
                return cls("checkerboard")
            # Each sweep goes through all images that share its launch: too many of them, and none is in the cache.
            together = max(1, 2 * _CACHED_PIXELS // (shape[0] * shape[1]))
            return cls("checkerboard", lanes=_CPU_LANES, images_at_a_time=together)
        if ordering == "lexicographic":
            return cls("lexicographic")
        if not on_cpu:
            return cls("wavefront_tiles")
        pixels = shape[0] * shape[1]
        # A group that waits keeps its processor: more groups than processors would only be in each other's way.
        groups = min(device.compute_units, _processors())
        if pixels <= _SMALL_PIXELS or (images >= groups and pixels <= _CACHED_PIXELS):
            return cls("wavefront_images", _CPU_LANES, _BANDS, min(images, groups))
        return cls("wavefront_strips", _CPU_LANES, _BANDS, groups)

    @property
    def definitions(self) -> dict[str, int]:
        """Constants of the program."""
        sizes = {"TILE_ROWS": 32, "TILE_COLUMNS": 64} if self.variant == "wavefront_tiles" else {}
        if self.second_order:
            sizes["ONLY_LOWER"] = int(self.only_lower)
        strips = {"BANDS": self.bands, "POLLS": self.polls} if self.in_strips else {}
        return {"LANES": self.lanes, **sizes, **strips}

    @property
    def kernels(self) -> tuple[str, ...]:
        """Kernel files after those of model and scheme."""
        before = {
            "wavefront_images": ("strip", "boundary", "change"),
            "wavefront_strips": ("strip",),
            "checkerboard": (),
        }
        cell = "second_order" if self.second_order else "cell"
        return (*before.get(self.variant, (cell,)), self.variant)

    @property
    def in_strips(self) -> bool:
        """Whether vectors run along strips."""
        return self.variant in ("wavefront_strips", "wavefront_images")

    def layout(self, shape: tuple[int, int]) -> Layout:
        """How an image must lie for this variant."""
        if self.variant == "checkerboard":
            return Layout.columns_apart(shape, self.lanes)
        if not self.in_strips:
            margin = 2 if self.second_order else 1
            return Layout.padded(shape, margin, margin)
        # The last strip may reach past the image; lanes lean out by a strip's height and a block.
        strip = 8 * self.bands
        return Layout.padded(shape, -shape[0] % strip + 1, strip + 8)


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
        chosen = tuning or Tuning.of(device, ordering, shape, self.count, second_order=second_order)
        self.tuning = replace(chosen, only_lower=only_lower) if only_lower else chosen
        self._layout = layout = self.tuning.layout((height, width))
        # The largest float32 that is no more than the tolerance, so that host and device agree on who has met it.
        self._tolerance = np.float32(tolerance)
        if self._tolerance > tolerance:
            self._tolerance = np.nextafter(self._tolerance, np.float32(0.0))
        self._sweeps = 0
        self._row = 0
        self._rested = np.zeros(self.count, bool)
        self.kernel_seconds = 0.0

        sweeping = program(device, [*model, *self.tuning.kernels], precision, self.tuning.definitions)
        stored = self._stack([layout.store(grid.log_depth, grid.outside, self._real) for grid in grids])
        self._log_depth = self._upload(stored)
        self._previous = self._buffer(stored.nbytes)
        cl.enqueue_copy(device.queue, self._previous, self._log_depth)
        numbers = self._stack([_numbers(grid.parameters) for grid in grids])
        reversed_too = self.tuning.in_strips
        columns = self._stack([layout.column_table(grid.x_axis, reversed_too=reversed_too) for grid in grids])
        rows = self._stack([layout.row_table(grid.y_axis) for grid in grids])
        self._parameters = self._upload(numbers.astype(self._real))
        self._changes = self._buffer(4 * self.count)
        self._buffers = (
            self._log_depth,
            self._upload(self._stack([self._stored_brightness(grid) for grid in grids])),
            self._upload(self._stack([layout.store(grid.flags, 0, np.dtype(np.uint8)) for grid in grids])),
            self._parameters,
            self._upload(columns.astype(self._real)),
            self._upload(rows.astype(self._real)),
        )
        self._list_boundary(grids)
        self._linear, self._lowest = int(linear), lowest

        integer, single = np.int32, np.float32
        begin: list[Any] = [None] * 7 + [integer, single, integer]
        if self.tuning.variant == "wavefront_images":
            self._sync_buffer = self._upload(np.zeros(1, np.int32))
            self._iterate = cl.Kernel(sweeping, "iterate")
            self._iterate.set_scalar_arg_dtypes([*begin, *[integer] * 7, None, integer, *[None] * 6, integer, single])
            return
        self._sweep = cl.Kernel(sweeping, "sweep")
        integers = {
            "lexicographic": 8,
            "wavefront_tiles": 10,
            "wavefront_strips": 8,
            "checkerboard": 3,
            "three_colours": 7,
        }
        scalars = begin + [integer] * integers[self.tuning.variant]
        if self.tuning.variant == "wavefront_strips":
            strips = -(-height // (8 * self.tuning.bands))
            self._strips = self.count * strips
            self._sync_buffer = self._upload(np.zeros(1 + (1 + _APART) * self._strips, np.int32))
            scalars += [None, integer]
        self._sweep.set_scalar_arg_dtypes(scalars)

        self._renew = cl.Kernel(program(device, ["boundary", "renew"], precision), "renew_boundary")
        self._renew.set_scalar_arg_dtypes([None] * 8 + [integer, single, *[integer] * 3, single])
        self._renew_items = min(256, _group_size(self._renew, device))

        on_cpu = device.kind == "cpu"
        lanes = {"LANES": _CPU_LANES if on_cpu else 1}
        self._measure = cl.Kernel(program(device, ["change", "measure"], precision, lanes), "measure")
        self._measure.set_scalar_arg_dtypes([None] * 3 + [integer, single, integer, integer])
        self._measure_items = max(1, min((1 if on_cpu else 1024) * device.compute_units, layout.size // 1024))

    @property
    def queued_at_least(self) -> int:
        """How many iterations should be queued together: where images take turns in the cache, not too few."""
        tuning = self.tuning
        if tuning.variant != "wavefront_images" and (tuning.images_at_a_time or self.count) >= self.count:
            return 4
        return max(4, min(16, _CELLS_AT_A_TIME // (self.count * self._layout.height * self._layout.width)))

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
        with self._device.lock, self._until_idle():
            self._begin(iterations)
            if self.tuning.variant == "wavefront_images":
                first = last = self._iterate_images(iterations)
            else:
                first = None
                together = self.tuning.images_at_a_time or self.count
                for begin in range(0, self.count, together):
                    images = range(begin, min(begin + together, self.count))
                    self._row = 1
                    for _ in range(iterations):
                        event = self.sweep_in_turn(images)
                        first = first or event
                        last = self.measure(images)
            changes = self._changes_host
            cl.enqueue_copy(self._device.queue, changes, self._changes)
            self._check_strips()
            self.kernel_seconds += 1e-9 * (last.profile.end - first.profile.start)
        rows = changes[1:]
        self._rested |= (rows <= self._tolerance).any(axis=0)
        self._row = 0
        return rows.astype(np.float64)

    def sweep_in_turn(self, images: range | None = None) -> Any:
        """Queue the four sweeps of an iteration, with the renewal of the boundary after each.

        Strips do them in one launch where there is nothing to renew. `images` as for :meth:`sweep`; the event of the
        first sweep is returned.
        """
        if self.tuning.variant == "wavefront_strips" and not self._has_boundary:
            return self.sweep(0, count=4)
        first = None
        for number in range(4):
            event = self.sweep(number, images)
            first = first or event
            self.renew_boundary(images)
        return first

    def sweep(self, number: int, images: range | None = None, *, count: int = 1) -> Any:
        """Queue a sweep; not for the variant "wavefront_images", which runs whole iterations.

        Parameters
        ----------
        number : int
            0 to 3: the direction, see :data:`DIRECTIONS`; the checkerboard begins with red and black in turn.
        images : range, optional
            Which; all when not given. "wavefront_strips" takes all.
        count : int
            So many sweeps in turn, up to number 3, by one launch of "wavefront_strips".
        """
        if not self._row:
            self._begin(1)
        layout, tuning, queue = self._layout, self.tuning, self._device.queue
        chosen = images or range(self.count)
        common = (*self._buffers, self._changes, self._row, self._tolerance, self.count, layout.rows, layout.stride)
        image = (layout.first_row, layout.first_column, layout.height, layout.width)
        if tuning.variant == "checkerboard":
            vectors = 1 if tuning.lanes > 1 else layout.stride // 2
            size, offset = (vectors, layout.rows - 2, len(chosen)), (0, 0, chosen.start)
            stored_parity = layout.first_row + layout.first_column
            colours = [(stored_parity + number + half) % 2 for half in range(2)]
            event, _ = [self._sweep(queue, size, None, *common, c, global_offset=offset) for c in colours]
        elif tuning.variant == "three_colours":
            size, offset = (layout.width, layout.height, len(chosen)), (0, 0, chosen.start)
            colours = [(number + third) % 3 for third in range(3)]
            event, *_ = [self._sweep(queue, size, None, *common, *image, c, global_offset=offset) for c in colours]
        elif tuning.variant == "lexicographic":
            event = self._sweep(
                queue, (len(chosen),), (1,), *common, *image, *DIRECTIONS[number], global_offset=(chosen.start,)
            )
        elif tuning.variant == "wavefront_strips":
            groups = (tuning.work_groups,)
            run = (number, count, self._sync_buffer, self._sweeps)
            event = self._sweep(queue, groups, (1,), *common, *image, *run)
        else:
            high, wide = tuning.definitions["TILE_ROWS"], tuning.definitions["TILE_COLUMNS"]
            tile_rows, tile_columns = -(-layout.height // high), -(-layout.width // wide)
            event = None
            for diagonal in range(tile_rows + tile_columns - 1):
                begin = max(0, diagonal - tile_columns + 1)
                tiles = min(diagonal, tile_rows - 1) - begin + 1
                tile = (*DIRECTIONS[number], diagonal, begin)
                items = (tiles * high, len(chosen))
                launched = self._sweep(queue, items, (high, 1), *common, *image, *tile, global_offset=(0, chosen.start))
                event = event or launched
        self._sweeps += count
        return event

    def renew_boundary(self, images: range | None = None) -> None:
        """Queue the renewal of the boundary cells from inside, eq. (12), of some images or all."""
        if not self._has_boundary:
            return
        chosen = images or range(self.count)
        self._renew(
            self._device.queue,
            (self._renew_items, len(chosen)),
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
            global_offset=(0, chosen.start),
        )

    def measure(self, images: range | None = None) -> Any:
        """Queue the search for the largest change since the last one, of some images or all."""
        chosen = images or range(self.count)
        event = self._measure(
            self._device.queue,
            (self._measure_items, len(chosen)),
            (1, 1) if self._device.kind == "cpu" else None,
            self._log_depth,
            self._previous,
            self._changes,
            self._row,
            self._tolerance,
            self.count,
            self._layout.size,
            global_offset=(0, chosen.start),
        )
        self._row += 1
        return event

    def log_depth(self) -> NDArray[np.floating]:
        """A copy of the values as they are now, shape (images, height, width)."""
        layout, queue = self._layout, self._device.queue
        self._check_strips()
        shape = (self.count, layout.rows, layout.stride)
        # What lies in the host's memory already is not copied by this.
        stored, _ = cl.enqueue_map_buffer(queue, self._log_depth, cl.map_flags.READ, 0, shape, self._real)
        try:
            values = np.empty((self.count, layout.height, layout.width), self._real)
            for image, taken in zip(stored, values, strict=True):
                layout.take(image, taken)
        finally:
            stored.base.release(queue)
        return values

    def _begin(self, iterations: int) -> None:
        """Clear the record of changes; its row 0 says which images rest."""
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

    def _check_strips(self) -> None:
        if self.tuning.variant != "wavefront_strips":
            return
        claims = np.empty(self._strips, np.int32)
        cl.enqueue_copy(self._device.queue, claims, self._sync_buffer, src_offset=claims.itemsize)
        if (claims != self._sweeps).any():
            raise DeviceError(
                f"{self._device} left strips of the image undone: its driver is at fault. Use ordering='checkerboard'."
            )

    def _list_boundary(self, grids: Sequence[Grid]) -> None:
        """Upload the lists of boundary cells; see kernels/boundary.cl."""
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

    def _stored_brightness(self, grid: Grid) -> NDArray[Any]:
        return self._layout.store(grid.marked_brightness(self._real), np.nan, self._real)

    @staticmethod
    def _stack(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
        return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)

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
    parameters: Sequence[float],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.floating]:
    """Brightness of a surface, eq. (6); NaN where the flag SWEPT is not set. Shape (height, width)."""
    real = device.real(precision)
    height, width = log_depth.shape
    result = np.empty((height, width), real)
    with device.lock:
        kernel = cl.Kernel(program(device, [*model, "render"], precision), "render")
        kernel.set_scalar_arg_dtypes([None] * 6 + [np.int32] * 2)
        brightness = _buffer(device, result.nbytes)
        # Named, so that they live until the kernel has run.
        given = [
            _upload(device, log_depth.astype(real)),
            _upload(device, flags),
            *(_upload(device, numbers.astype(real)) for numbers in (_numbers(parameters), x, y)),
        ]
        kernel(device.queue, (width, height), None, *given, brightness, width, height)
        cl.enqueue_copy(device.queue, result, brightness)
    return result


def _processors() -> int:
    """Processors that this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux only
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _numbers(parameters: Sequence[float]) -> NDArray[np.float64]:
    """One image's part of the buffer of parameters."""
    return np.pad(np.asarray(parameters, dtype=np.float64), (0, _PARAMETERS - len(parameters)))


def _group_size(kernel: cl.Kernel, device: Device) -> int:
    """Largest power of two that the kernel may be launched with as one group."""
    info = cl.kernel_work_group_info.WORK_GROUP_SIZE
    limit: Any = kernel.get_work_group_info(info, device.context.devices[0])
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
