"""The forward model on a device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.buffers import allocate, upload
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import in_row_groups, kernel, row_group
from persfs_cl._cl.parameters import records

KERNEL_FILE = "render"
"""After those of the model."""


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
        rendering = kernel(device, [*model, KERNEL_FILE], precision, None, "render", list(parameters))
        # Kept here, so that the buffers live until the kernel has run.
        values = {
            "log_depth": upload(device, log_depth.astype(real)),
            "flags": upload(device, flags),
            "parameters": upload(device, records([parameters], real)),
            "columns": upload(device, x.astype(real)),
            "lines": upload(device, y.astype(real)),
            "brightness": allocate(device, result.nbytes),
            "width": width,
            "height": height,
        }
        size, group = in_row_groups(row_group(device), width, height)
        rendering.launch(device, size, group, values)
        cl.enqueue_copy(device.queue, result, values["brightness"])
    return result
