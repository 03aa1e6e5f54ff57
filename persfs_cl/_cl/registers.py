"""How wide the vectors may be that a device's compiler is given."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import kernel

LANES = (1, 2, 4, 8, 16)
"""Cells that a work-item may update at once: see kernels/shared/prelude.cl."""
WIDEST = max(LANES)
"""Of all vectors."""
SUFFICIENT = 8
"""Where a vector waits for the one before, or for memory: wider ones are no faster."""


def register_bits(device: Device) -> int:
    """Bits of the vector registers that the device's compiler uses; 0 where it does not say, as on GPUs.

    The compiler itself is asked, see kernels/shared/registers.cl: a driver may claim wider registers than its compiler
    uses.

    Raises
    ------
    KernelBuildError
        When the device compiles nothing.
    """
    with device.lock:
        if device.register_bits is None:
            device.register_bits = _asked(device)
        return device.register_bits


def lanes(device: Device, precision: str, most: int = WIDEST) -> int:
    """Cells that a work-item may update at once: as many as a vector register holds, up to `most`, or 1.

    Wide vectors are only for compilers that say what registers they have. Others get the kernels of GPUs, with one cell
    a work-item, which every compiler takes.

    Raises
    ------
    DeviceError
        When the device lacks the precision.
    KernelBuildError
        When it compiles nothing.
    """
    return max(1, min(most, register_bits(device) // (8 * device.real(precision).itemsize)))


def _asked(device: Device) -> int:
    bits = np.zeros(1, np.int32)
    with in_words(device):
        answer = cl.Buffer(device.context, cl.mem_flags.WRITE_ONLY, bits.nbytes)
        kernel(device, ["registers"], "float32", None, "registers").launch(device, (1,), (1,), {"bits": answer})
        cl.enqueue_copy(device.queue, bits, answer)
    return int(bits[0])
