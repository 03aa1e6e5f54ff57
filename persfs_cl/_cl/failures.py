"""What OpenCL reports, as an error of this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pyopencl as cl

from persfs_cl._cl.device import Device
from persfs_cl.errors import DeviceError
from persfs_cl.wording import keyword


@contextmanager
def in_words(device: Device) -> Iterator[None]:
    """Errors of OpenCL in a block as errors of this package.

    Raises
    ------
    DeviceError
        Naming the device, what it said, and what to do.
    """
    try:
        yield
    except cl.MemoryError as error:
        raise DeviceError(
            f"{device} has no memory left for this image (it has {device.memory / 2**30:.1f} GiB): use a smaller "
            f"image, {keyword('precision', 'float32')}, or another device. It says: {error}"
        ) from error
    except cl.Error as error:
        raise DeviceError(
            f"{device} failed: {error}. Use another device, or another version of its driver; "
            "'persfs-cl devices --check' tells which devices work."
        ) from error
