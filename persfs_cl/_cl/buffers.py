"""Arrays on a device."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import out_of_memory
from persfs_cl._cl.layout import ALIGNMENT


def upload(device: Device, values: NDArray[Any]) -> cl.Buffer:
    """The values on the device, which may work on the array itself.

    So the array must not be changed afterwards, and the buffer must be kept until the kernels that use it have run.

    Raises
    ------
    DeviceError
        When the device has no memory for them.
    """
    host = np.ascontiguousarray(values)
    # A processor works on the array itself, which the buffer keeps alive: no second one to allocate and fill.
    in_place = device.kind == "cpu" and host.flags.writeable and host.ctypes.data % ALIGNMENT == 0
    place = cl.mem_flags.USE_HOST_PTR if in_place else cl.mem_flags.COPY_HOST_PTR
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE | place, hostbuf=host)
    except (cl.MemoryError, cl.LogicError) as error:
        raise out_of_memory(device, error, host.nbytes) from error


def allocate(device: Device, size: int) -> cl.Buffer:
    """So many bytes on the device, not set to anything.

    Raises
    ------
    DeviceError
        When the device has no memory for them.
    """
    try:
        return cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size)
    except (cl.MemoryError, cl.LogicError) as error:
        raise out_of_memory(device, error, size) from error
