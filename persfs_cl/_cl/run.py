"""Images on a device during their iterations, as the orderings see them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.kernel import Kernel
from persfs_cl._cl.layout import Layout

DIRECTIONS = ((0, 0), (1, 0), (0, 1), (1, 1))
"""The four sweeps as (leftwards, upwards), in the paper's order."""


@dataclass
class Run:
    """What an ordering needs to know of the images, and its way to launch its kernel on them.

    Attributes
    ----------
    device : Device
    kernel : Kernel
        Of the ordering.
    layout : Layout
    images : int
        How many share the launches.
    has_boundary : bool
        Whether there are boundary cells, to be renewed after each sweep.
    values : dict
        What kernels may declare as arguments, by name: the arrays, the sizes of the layout, `iteration`, which is the
        one at hand, and so on.
    launches : int
        Of the ordering's kernel, since the images were uploaded.
    sweeps, own_measures : int
        Of each image that does not rest, since then: its sweeps, and its iterations in which the ordering's own kernel
        looked for the largest change.
    measured_sweeps : int
        Those sweeps that the last search for the largest change followed.
    sweeps_of, own_measures_of : ndarray of int, shape (images,)
        The same of each image, which may have come to rest.
    """

    device: Device
    kernel: Kernel
    layout: Layout
    images: int
    has_boundary: bool
    values: dict[str, Any]
    launches: int = 0
    sweeps: int = 0
    own_measures: int = 0
    measured_sweeps: int = 0
    sweeps_of: NDArray[np.int64] = field(init=False)
    own_measures_of: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        self._clear()

    def start_over(self, numbers_a_sweep: int) -> None:
        """Count everything from 0 again: the counters of an image that has rested lag behind those of the others.

        What an image's account of changes has by its sweeps so far, some numbers a sweep, is put back by as many.
        """
        account = self._read("changed").reshape(self.images, -1)
        kept = np.maximum(account - numbers_a_sweep * self.sweeps_of[:, None], 0).astype(np.int32)
        cl.enqueue_copy(self.device.queue, self.values["changed"], kept)
        self._clear()
        if (buffer := self.values.get("sync")) is not None:
            cl.enqueue_fill_buffer(self.device.queue, buffer, np.zeros(1, np.int32), 0, buffer.size)

    def _clear(self) -> None:
        self.launches = self.sweeps = self.own_measures = self.measured_sweeps = 0
        self.sweeps_of, self.own_measures_of = np.zeros((2, self.images), np.int64)

    @property
    def pixels(self) -> int:
        """Of all images."""
        return self.images * self.layout.height * self.layout.width

    def launch(self, size: tuple[int, ...], group: tuple[int, ...] | None = None, **own: Any) -> cl.Event:
        """Queue a launch of the ordering's kernel.

        Parameters
        ----------
        size, group : tuple of int
            As of :meth:`persfs_cl._cl.kernel.Kernel.launch`.
        own
            Arguments that only this launch has, or in place of what `values` says.
        """
        values: Mapping[str, Any] = {**self.values, **own}
        event = self.kernel.launch(self.device, size, group, values)
        self.launches += 1
        return event

    def counters(self) -> NDArray[np.int32]:
        """The ordering's counters `sync` as they are when the device has done what is queued."""
        return self._read("sync")

    def _read(self, name: str) -> NDArray[np.int32]:
        """Integers of a buffer."""
        buffer = self.values[name]
        integers = np.empty(buffer.size // 4, np.int32)
        cl.enqueue_copy(self.device.queue, integers, buffer)
        return integers
