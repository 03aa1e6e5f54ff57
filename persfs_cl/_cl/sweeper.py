"""Images on a device, and the iteration over them: four sweeps, the boundary renewed, the largest change found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.anderson import Mixer
from persfs_cl._cl.buffers import allocate, upload
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.image import Image
from persfs_cl._cl.kernel import in_row_groups, kernel, row_group
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.limits import constants_of, stored_limits
from persfs_cl._cl.orderings import ordering_for
from persfs_cl._cl.orderings.ordering import ALL_ITERATIONS, Ordering, Setup
from persfs_cl._cl.parameters import records
from persfs_cl._cl.registers import lanes
from persfs_cl._cl.run import Run
from persfs_cl.errors import DeviceError
from persfs_cl.masks import SWEPT
from persfs_cl.wording import keyword

_CELLS_AT_A_TIME = 2**28
"""Cells of iterations that are queued together at least, where that keeps images in the cache: half a second or so."""
_MOST_SWEPT = 0.75
"""Share of the pixels: with more an account of changes costs what it spares, by schemes that do not settle."""
_LOWEST = 0.0
"""Floor of the extrapolation of the boundary."""


class Sweeper:
    """Images of about one size on a device, and the steps of the iteration. An image that has converged rests.

    Parameters
    ----------
    device : Device
    images : sequence of Image
        At least one. Those smaller than the largest take as long.
    model : sequence of str
        Kernel files of the model and the scheme.
    ordering : str or Ordering
        A name of :data:`persfs_cl._cl.orderings.ORDERINGS`, of which what suits the device is chosen; or the very
        ordering, with sizes of its own, which then says itself of which order it is.
    precision : {"float32", "float64"}
    tolerance : float
        max |ΔZ| of an iteration at which an image rests.
    linear : bool
        Extrapolate the boundary cells instead of letting the surface flow out.
    second_order : bool
        Correct converged values of the upwind scheme to second order.
    only_lower : bool
        Let values only fall; False assigns what a cell is found to have.
    rests : bool
        Leave alone what cannot change, as long as no boundary is renewed between the sweeps, and where there is enough
        of it: by schemes that settle, and where much of the images is not swept. The values are the same. False
        computes every cell in every sweep, as is necessary where values change between these.
    resting : float
        Where tiles rest, let those rest too around which no value has changed by more than this since they were swept.

    Attributes
    ----------
    count : int
        Images.
    ordering : Ordering
    kernel_seconds : float
        What the launches of :meth:`run` have taken by the device's own clock.

    Raises
    ------
    DeviceError
        When the device lacks the precision or the memory.
    """

    def __init__(
        self,
        device: Device,
        images: Sequence[Image],
        *,
        model: Sequence[str],
        ordering: str | Ordering,
        precision: str,
        tolerance: float = 0.0,
        linear: bool = False,
        second_order: bool = False,
        only_lower: bool = True,
        rests: bool = True,
        resting: float = 0.0,
    ) -> None:
        self._device = device
        self._real = device.real(precision)
        self.count = len(images)
        shapes = [image.log_depth.shape for image in images]
        height, width = (max(lengths) for lengths in zip(*shapes, strict=True))
        if isinstance(ordering, str):
            setup = Setup(device, precision, (height, width), self.count, second_order, only_lower, images[0].settles)
            ordering = ordering_for(ordering, setup)
        has_boundary = any(len(image.cells) for image in images)
        self._limits = constants_of(images, may_rise=not only_lower)
        rests = rests and not has_boundary and _has_what_rests(images, height * width)
        drifts = rests and resting > 0.0 and ordering.counts_tiles
        self.ordering = ordering = replace(ordering, rests=rests, drifts=drifts)
        self._layout = ordering.layout((height, width))
        self._tolerance = _rounded_down(tolerance)
        self._rested = np.zeros(self.count, bool)
        self._changes = np.zeros((1, self.count), np.float32)
        self.kernel_seconds = 0.0
        with in_words(device):
            values = self._uploaded(images)
            values |= {"resting": resting, "tolerance": self._tolerance, "linear": int(linear), "lowest": _LOWEST}
            files, fields = [*model, *ordering.kernels], list(images[0].parameters)
            definitions = {**ordering.definitions, **self._limits}
            self._run = Run(
                device=device,
                kernel=kernel(device, files, precision, definitions, ordering.function, fields),
                layout=self._layout,
                images=self.count,
                has_boundary=has_boundary,
                values=values,
            )
            self._make_kernels(precision)

    def _uploaded(self, images: Sequence[Image]) -> dict[str, Any]:
        """What kernels may take as arguments, by name."""
        device, layout, real = self._device, self._layout, self._real
        shapes = [image.log_depth.shape for image in images]
        # The values before an iteration too: a device's own copy would come later, and from one thread on a processor.
        begin = [image.log_depth.__getitem__ for image in images]
        stored, before = layout.store_copies(2, begin, images[0].outside or 0.0, real, shapes)
        brightness = layout.store([image.marked_brightness for image in images], np.nan, real, shapes)
        flags = layout.store([image.flags.__getitem__ for image in images], 0, np.dtype(np.uint8), shapes)
        reversed_too = self.ordering.vectors_down
        columns = np.stack([layout.column_table(image.x_axis, reversed_too=reversed_too) for image in images])
        rows = np.stack([layout.row_table(image.y_axis) for image in images])
        values = {
            "log_depth": upload(device, stored),
            "previous": upload(device, before),
            "brightness": upload(device, brightness),
            "flags": upload(device, flags),
            "limits": upload(device, stored_limits(images, layout, real, self._limits.get("LIMITS", 0))),
            "parameters": upload(device, records([image.parameters for image in images], real)),
            "column_table": upload(device, columns.astype(real)),
            "row_table": upload(device, rows.astype(real)),
            "changes": allocate(device, self._changes.nbytes),
            "iteration": 0,
            "images": self.count,
            "size": layout.size,
            "rows": layout.rows,
            "stride": layout.stride,
            "first_row": layout.first_row,
            "first_column": layout.first_column,
            "height": layout.height,
            "width": layout.width,
            **_boundary(device, images, layout, real),
        }
        if counters := self.ordering.counters(self.count, layout):
            values["sync"] = upload(device, np.zeros(counters, np.int32))
        none = np.zeros((self.count, 1), np.int32)
        account = self.ordering.last_changes(images, layout) if self.ordering.rests else none
        values["changed"] = upload(device, account)
        values["drift"] = upload(device, np.zeros(account.shape if self.ordering.drifts else none.shape, real))
        return values

    def _make_kernels(self, precision: str) -> None:
        """Those that follow sweeps in launches of their own."""
        device = self._device
        if self._run.has_boundary and self.ordering.single_sweeps:
            self._renew = kernel(device, ["boundary", "renew"], precision, self._limits, "renew_boundary")
            self._renew_items = min(256, self._renew.largest_group(device))
        if self.ordering.single_sweeps:
            tiled = self.ordering.rests and self.ordering.counts_tiles
            # Tiles are as large as the ordering has them.
            wide = self.ordering.lanes if tiled else lanes(device, precision)
            files = ["change", "tiles", "measure_tiles"] if tiled else ["change", "measure"]
            self._measure = kernel(device, files, precision, {"LANES": wide}, "measure")
            # With vectors each item takes a part of its own: see kernels/shared/measure.cl.
            group, most = (1, 1) if wide > 1 else (row_group(device), 1024)
            items = max(1, min(most * device.compute_units, self._layout.size // 1024))
            self._measure_launch = in_row_groups(group, items, self.count)

    @property
    def variant(self) -> str:
        """What the ordering is called on the device."""
        return self.ordering.file

    def mixer(self) -> Mixer:
        """To accelerate the iteration by what it came to before."""
        return Mixer(self._run, self._real.name)

    @property
    def queued_at_least(self) -> int:
        """How many iterations should be queued together: where images take turns in the cache, not too few."""
        if self.ordering.iterations_a_launch(self._run) < ALL_ITERATIONS:
            return 4
        return max(4, min(64, _CELLS_AT_A_TIME // self._run.pixels))

    def go_on(self, images: Iterable[int], tolerance: float) -> None:
        """Let these images iterate until they meet another tolerance, whether they rested or not; all others rest."""
        chosen = list(images)
        if self._rested[chosen].any():
            self._run.start_over(self.ordering.numbers_a_sweep)
        self._tolerance = self._run.values["tolerance"] = _rounded_down(tolerance)
        self._rested[:] = True
        self._rested[chosen] = False

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
            measured = self._run.own_measures
            first, last = self._queue(iterations)
            cl.enqueue_copy(self._device.queue, self._changes, self._run.values["changes"])
            rows = self._changes[1:]
            self._row = 0
            done = self._note_rest(rows <= self._tolerance)
            self._run.sweeps_of += 4 * done
            if self._run.own_measures > measured:
                self._run.own_measures_of += done
            self._check_all_done()
            self.kernel_seconds += 1e-9 * (last.profile.end - first.profile.start)
        return rows.astype(np.float64)

    def _queue(self, iterations: int) -> tuple[cl.Event, cl.Event]:
        """The first and the last event of so many iterations."""
        events = []
        if most := self.ordering.iterations_a_launch(self._run):
            for begin in range(0, iterations, most):
                count = min(most, iterations - begin)
                events.append(self.ordering.iterate(self._run, count))
                self._row += count
                self._run.sweeps += 4 * count
                self._run.own_measures += count
                self._run.measured_sweeps = self._run.sweeps
        else:
            for _ in range(iterations):
                events += [self._sweep_in_turn(), self.measure()]
        return events[0], events[-1]

    def _note_rest(self, met: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Iterations that each image has done, of those that `met` says of whether they met the tolerance."""
        done = np.where(self._rested, 0, len(met))
        ended = met.any(axis=0) & ~self._rested
        done[ended] = 1 + met[:, ended].argmax(axis=0)
        self._rested |= ended
        return done

    def sweep_in_turn(self) -> cl.Event:
        """Queue the four sweeps of an iteration, with the renewal of the boundary after each.

        Returns the event of the first.
        """
        self._run.sweeps_of[~self._rested] += 4
        return self._sweep_in_turn()

    def sweep(self, number: int) -> cl.Event:
        """Queue a sweep of all images, for orderings that have single sweeps.

        Parameters
        ----------
        number : int
            0 to 3: the direction, see :data:`persfs_cl._cl.run.DIRECTIONS`; sweeps of colours have none.
        """
        self._run.sweeps_of[~self._rested] += 1
        return self._sweep(number)

    def _sweep_in_turn(self) -> cl.Event:
        if self.ordering.sweeps_together and not self._run.has_boundary:
            return self._sweep(0, count=4)
        events = []
        for number in range(4):
            events.append(self._sweep(number))
            self.renew_boundary()
        return events[0]

    def _sweep(self, number: int, count: int = 1) -> cl.Event:
        if not self._row:
            self._begin(1)
        event = self.ordering.sweep(self._run, number, count)
        self._run.sweeps += count
        return event

    def renew_boundary(self) -> None:
        """Queue the renewal of the boundary cells from inside, eq. (12)."""
        if self._run.has_boundary:
            items = self._renew_items
            self._renew.launch(self._device, (items, self.count), (items, 1), self._run.values)

    def measure(self) -> cl.Event:
        """Queue the search for the largest change since the last one."""
        values = {**self._run.values, "measured_sweeps": self._run.measured_sweeps}
        event = self._measure.launch(self._device, *self._measure_launch, values)
        self._run.measured_sweeps = self._run.sweeps
        self._row += 1
        return event

    def log_depth(self) -> NDArray[np.floating]:
        """A copy of the values of images of one shape as they are now, shape (images, height, width)."""
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
            held = self._run.values["log_depth"]
            stored, _ = cl.enqueue_map_buffer(queue, held, cl.map_flags.READ, 0, shape, self._real)
            try:
                for image, taken in zip(stored, values, strict=True):
                    layout.take(image, taken)
            finally:
                stored.base.release(queue)

    @property
    def _row(self) -> int:
        """Of the record of changes, that of the iteration at hand; 0 between runs."""
        row: int = self._run.values["iteration"]
        return row

    @_row.setter
    def _row(self, row: int) -> None:
        self._run.values["iteration"] = row

    def _begin(self, iterations: int) -> None:
        """Clear the record of changes; its row 0 says which images rest."""
        values, queue = self._run.values, self._device.queue
        changes = np.zeros((iterations + 1, self.count), np.float32)
        changes[0] = np.where(self._rested, -1.0, np.inf)
        if changes.shape != self._changes.shape:
            values["changes"] = allocate(self._device, changes.nbytes)
        cl.enqueue_copy(queue, values["changes"], changes)
        self._changes = changes
        self._row = 1

    def _check_all_done(self) -> None:
        """Wait for the device, and raise an error where groups that share out the work have left some of it."""
        if not self.ordering.is_done(self._run):
            raise DeviceError(
                f"{self._device} left parts of the image undone: its driver is at fault. Use "
                f"{keyword('ordering', 'lexicographic')}."
            )

    @contextmanager
    def _until_idle(self) -> Iterator[None]:
        """Not to leave, whatever happens, before the kernels are done with arrays that may then be freed."""
        try:
            yield
        except BaseException:
            self._device.queue.finish()
            raise


def _has_what_rests(images: Sequence[Image], pixels: int) -> bool:
    """Whether an account of changes pays: it takes up to a sixth of the time where all cells change."""
    if images[0].settles:
        return True
    swept = sum(int(np.count_nonzero(image.flags & SWEPT)) for image in images)
    return swept <= _MOST_SWEPT * len(images) * pixels


def _rounded_down(tolerance: float) -> np.float32:
    """The largest float32 that is no more, so that host and device agree on who has met it."""
    rounded = np.float32(tolerance)
    return np.nextafter(rounded, np.float32(0.0)) if rounded > tolerance else rounded


def _boundary(
    device: Device, images: Sequence[Image], layout: Layout, real: np.dtype[np.floating]
) -> dict[str, cl.Buffer]:
    """The lists of boundary cells; see kernels/shared/boundary.cl."""
    counts = np.array([len(image.cells) for image in images])
    edges = np.array([image.edges for image in images])
    parts = np.stack([np.cumsum(counts) - counts, edges, counts - edges], axis=1).astype(np.int32)

    def listed(name: str) -> NDArray[np.int32]:
        cells = np.concatenate([layout.cells(getattr(image, name), image.flags.shape[1]) for image in images])
        # OpenCL has no empty buffers; that of a list without cells is never read.
        return cells if counts.any() else np.zeros(4, np.int32)

    lists = {name: upload(device, listed(name)) for name in ("cells", "inwards", "beside")}
    renewed = allocate(device, max(1, int(counts.sum())) * real.itemsize)
    return {"counts": upload(device, parts), **lists, "renewed": renewed}
