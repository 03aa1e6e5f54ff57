"""What a device can do at best, and the time that it says it took: the measures behind the bench."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyopencl as cl

from persfs_cl._cl.buffers import allocate
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import kernel
from persfs_cl._cl.registers import lanes

KERNEL_FILE = "roofline"
_COPY_BLOCK = 16
"""Bytes, as in kernels/shared/roofline.cl."""
_CHAINS = 12


def device_seconds(device: Device, work: Callable[[], object]) -> float:
    """Run what `work` queues, wait for its end, and give the seconds that it took by the device's own clock."""
    with device.lock, in_words(device):
        begin = cl.enqueue_marker(device.queue)
        work()
        end = cl.enqueue_marker(device.queue)
        device.queue.finish()
        return float(1e-9 * (end.profile.end - begin.profile.end))


def copier(device: Device, size: int) -> Callable[[int], None]:
    """Function that queues so many copies of an array.

    Parameters
    ----------
    device : Device
    size : int
        Bytes, a multiple of 64. A copy reads and writes them once each.

    Raises
    ------
    DeviceError
        When the device cannot hold two such arrays.
    """
    copying = kernel(device, [KERNEL_FILE], "float32", None, "copy")
    with in_words(device):
        arrays = [allocate(device, size) for _ in range(2)]
        for array in arrays:
            # Memory that was never written to may be one and the same page of zeros.
            cl.enqueue_fill_buffer(device.queue, array, np.ones(1, np.float32), 0, size)
    blocks = size // _COPY_BLOCK

    values = dict(zip(("from", "to"), arrays, strict=True))

    def copy(count: int) -> None:
        for _ in range(count):
            copying.launch(device, (blocks,), None, values)

    return copy


def multiplier(device: Device, precision: str) -> tuple[Callable[[int], None], int]:
    """Function that queues so many launches of nothing but multiply-adds, and the operations of one launch.

    A multiply-add counts as two operations.

    Raises
    ------
    DeviceError
        When the device lacks the precision.
    """
    real = device.real(precision)
    wide = lanes(device, precision)
    multiplying = kernel(device, [KERNEL_FILE], precision, {"LANES": wide}, "multiply_adds")
    items = device.compute_units * (4 if wide > 1 else 2048)
    rounds = 4096
    results = allocate(device, items * real.itemsize)
    values = {"results": results, "rounds": rounds, "factor": 0.5, "summand": 0.5}

    def multiply(count: int) -> None:
        for _ in range(count):
            multiplying.launch(device, (items,), (1,) if wide > 1 else None, values)

    return multiply, 2 * _CHAINS * wide * items * rounds
