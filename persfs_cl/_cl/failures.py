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
        raise out_of_memory(device, error) from error
    except cl.Error as error:
        raise DeviceError(
            f"{device} failed: {error}. Use another device, or another version of its driver; "
            "'persfs-cl devices --check' tells which devices work."
        ) from error


def out_of_memory(device: Device, error: cl.Error, size: int | None = None) -> DeviceError:
    """The error of a device that cannot hold an array of so many bytes; None where the driver does not say which."""
    what = "this image" if size is None else f"an array of {size / 2**20:.0f} MiB"
    return DeviceError(
        f"{device} has no memory left for {what} (it has {device.memory / 2**30:.1f} GiB): use a smaller image, "
        f"{keyword('precision', 'float32')}, or another device. It says: {error}"
    )
