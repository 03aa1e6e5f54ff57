"""Which device a user means."""

from __future__ import annotations

import os

import numpy as np
import pyopencl as cl

from persfs_cl._cl.device import INSTALL_HINT, Device, devices
from persfs_cl._cl.registers import register_bits
from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError, KernelBuildError, PersfsError
from persfs_cl.wording import keyword

_SELECT = "Give one of these numbers, part of a name, 'cpu' or 'gpu', or leave it out."


def select_device(selector: int | str | Device | None = None) -> Device:
    """The device that a user means. Never asks.

    Parameters
    ----------
    selector : None, "cpu", "gpu", int, str or Device
        None honours the environment variable PYOPENCL_CTX and else takes the first of :func:`devices` that compiles;
        a number is an index into that list; any other text is part of a device's or platform's name.

    Raises
    ------
    DeviceError
        When there is no device, or none that fits, or in a process that was forked after OpenCL was used.
    KernelBuildError
        When a device is to be chosen and none compiles.

    Warns
    -----
    UserWarning
        When a device that comes first does not compile, and another is taken.
    """
    found = devices()
    if isinstance(selector, Device):
        return selector
    if not found:
        raise DeviceError(f"No OpenCL device found. {INSTALL_HINT}")
    if selector is None:
        return _from_environment(found) if os.environ.get("PYOPENCL_CTX") else _first_that_compiles(found)
    listing = "; ".join(f"{device.index}: {device}" for device in found)
    if isinstance(selector, (int, np.integer)) and not isinstance(selector, bool):
        if 0 <= selector < len(found):
            return found[selector]
        raise DeviceError.about(
            "device", selector, f"does not exist. The devices here are {listing}. {_SELECT}", written=str(selector)
        )
    if isinstance(selector, str) and selector.strip():
        if selector.strip().isdecimal() and len(selector.strip()) < 10:
            return select_device(int(selector))
        wanted = selector.strip().lower()
        for device in found:
            by_name = wanted in f"{device.name} {device.platform} {device.platform_version}".lower()
            if device.kind == wanted or (wanted not in ("cpu", "gpu") and by_name):
                return device
        raise DeviceError(
            f"No OpenCL device fits {keyword('device', selector)}. The devices here are {listing}. {_SELECT}",
            argument="device",
            value=selector,
        )
    raise DeviceError.about(
        "device", selector, "is not a choice: give None, 'cpu', 'gpu', an index, part of a name, or a Device."
    )


def _first_that_compiles(found: list[Device]) -> Device:
    failures: list[PersfsError] = []
    for device in found:
        try:
            register_bits(device)
        except (DeviceError, KernelBuildError) as error:
            failures.append(error)
            continue
        if failures:
            reasons = " ".join(str(failure) for failure in failures)
            warn(f"{device} is used, as what comes before it does not compile. {reasons}")
        return device
    raise failures[0]


def _from_environment(found: list[Device]) -> Device:
    wanted = os.environ["PYOPENCL_CTX"]
    try:
        handle = cl.create_some_context(interactive=False).devices[0]
    except (cl.Error, RuntimeError, ValueError, IndexError) as error:
        raise DeviceError.about(
            "PYOPENCL_CTX", wanted, f"names no device ({error}): unset it, or see 'persfs-cl devices'."
        ) from error
    for device in found:
        if device.is_handle(handle):
            return device
    raise DeviceError.about("PYOPENCL_CTX", wanted, "names a device that cannot be used: see 'persfs-cl devices'.")
