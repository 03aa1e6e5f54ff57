"""OpenCL devices: what there is, which one to take, and its context, made once and reused."""

from __future__ import annotations

import functools
import os
import re
import threading
import warnings
from collections.abc import Callable

import numpy as np
import pyopencl as cl

from persfs_cl.checks import brief
from persfs_cl.errors import DeviceError

INSTALL_HINT = (
    "Install an OpenCL driver: 'pip install pocl-binary-distribution' (CPU, Linux x86-64), "
    "'apt install pocl-opencl-icd' (CPU, Debian and Ubuntu), or your GPU's driver. "
    "'persfs-cl devices' lists what is found."
)
_SELECT = "Give one of these numbers, part of a name, 'cpu' or 'gpu', or leave it out."


class Device:
    """One OpenCL device, with its context, queue, programs and kernels, which are made at first use and reused.

    Obtained from :func:`devices`; never constructed by users.

    Attributes
    ----------
    index : int
        Position in :func:`devices`, usable as ``device=index``.
    name, platform, platform_version, driver_version : str
    kind : str
        "cpu", "gpu" or "other".
    is_pocl : bool
        Whether the driver is PoCL.
    rounds_correctly : bool
        Whether programs ask for correctly rounded division and square root in single precision.
    has_float64 : bool
        Whether ``precision="float64"`` works.
    memory : int
        Global memory in bytes.
    compute_units : int
    largest_group : int
        Work-items of a work-group at most.
    """

    def __init__(self, index: int, handle: cl.Device) -> None:
        self.index = index
        self._handle = handle
        self._lock = threading.RLock()
        self.name: str = handle.name.strip()
        self.platform: str = handle.platform.name.strip()
        self.platform_version: str = handle.platform.version.strip()
        self.driver_version: str = handle.driver_version.strip()
        self.kind = _kind(handle)
        self.is_pocl = "PoCL" in self.platform_version
        # Vectors and scalars must not round differently; a GPU, which has no vectors, is spared the cost.
        correct = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        self.rounds_correctly = self.kind == "cpu" and bool(handle.single_fp_config & correct)
        self.has_float64 = bool(handle.double_fp_config)
        self.memory: int = handle.global_mem_size
        self.compute_units: int = handle.max_compute_units
        self.largest_group: int = handle.max_work_group_size
        self.programs: dict[object, cl.Program] = {}
        self.kernels: dict[object, cl.Kernel] = {}

    @functools.cached_property
    def context(self) -> cl.Context:
        """The device's one context."""
        with self._lock:
            return cl.Context([self._handle])

    @functools.cached_property
    def queue(self) -> cl.CommandQueue:
        """The device's one in-order queue; events carry times."""
        with self._lock:
            return cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)

    @property
    def lock(self) -> threading.RLock:
        """Held while a program is built or a run uses the queue: OpenCL kernels are not thread-safe."""
        return self._lock

    def real(self, precision: str) -> np.dtype[np.floating]:
        """NumPy type for a precision, after checking that the device has it.

        Raises
        ------
        DeviceError
            When float64 is asked of a device without it.
        """
        if precision == "float64" and not self.has_float64:
            raise DeviceError(
                f"{self} has no double precision: use precision='float32' or another device "
                f"({', '.join(str(other) for other in devices() if other.has_float64) or 'none here has it'})."
            )
        return np.dtype(precision)

    def is_handle(self, handle: cl.Device) -> bool:
        """Whether this is the device behind a handle of pyopencl."""
        return bool(self._handle == handle)

    def __str__(self) -> str:
        return f"{self.name} ({self.platform}, {self.platform_version})"

    def __repr__(self) -> str:
        return f"Device({self.index}, {self.kind}, {self})"

    def __reduce__(self) -> tuple[Callable[..., Device], tuple[str, str]]:
        """Pickled as what it is called: another process, or machine, looks for a device of that name."""
        return _named, (self.name, self.platform_version)


def _named(name: str, platform_version: str) -> Device:
    for device in devices():
        if (device.name, device.platform_version) == (name, platform_version):
            return device
    raise DeviceError(f"The device {name} ({platform_version}) of a pickled result is not there. {INSTALL_HINT}")


def _kind(handle: cl.Device) -> str:
    if handle.type & cl.device_type.GPU:
        return "gpu"
    if handle.type & cl.device_type.CPU:
        return "cpu"
    return "other"


def _platform_age(handle: cl.Device) -> tuple[int, ...]:
    """Negated version numbers, so that of several drivers for one processor the newest sorts first.

    PoCL says "OpenCL 3.0 PoCL 3.1+debian ...": the driver's own version follows the name where there is one.
    """
    version = handle.platform.version
    own = re.search(r"PoCL (\d+)\.(\d+)", version) or re.search(r"(\d+)\.(\d+)", version)
    return tuple(-int(number) for number in own.groups()) if own else ()


@functools.cache
def _all_devices() -> tuple[Device, ...]:
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        # The loader reports "no platform" as an error; an empty list says the same to every caller.
        return ()
    handles = []
    for platform in platforms:
        try:
            handles += platform.get_devices()
        except cl.Error as error:
            warnings.warn(f"OpenCL platform {platform.name!r} lists no devices: {error}", stacklevel=2)
    order = {"cpu": 0, "gpu": 1, "other": 2}
    handles.sort(key=lambda handle: (order[_kind(handle)], _platform_age(handle)))
    return tuple(Device(index, handle) for index, handle in enumerate(handles))


def devices() -> list[Device]:
    """All OpenCL devices: CPUs first, then GPUs; of several drivers for a processor the newest first.

    Returns
    -------
    list of Device
        Empty when no OpenCL driver is installed.
    """
    return list(_all_devices())


def select_device(selector: int | str | Device | None = None) -> Device:
    """The device that a user means. Never asks.

    Parameters
    ----------
    selector : None, "cpu", "gpu", int, str or Device
        None honours the environment variable PYOPENCL_CTX and else takes the first of :func:`devices`;
        a number is an index into that list; any other text is part of a device's or platform's name.

    Raises
    ------
    DeviceError
        When there is no device, or none that fits.
    """
    found = devices()
    if isinstance(selector, Device):
        return selector
    if not found:
        raise DeviceError(f"No OpenCL device found. {INSTALL_HINT}")
    if selector is None:
        return _from_environment(found) if os.environ.get("PYOPENCL_CTX") else found[0]
    listing = "; ".join(f"{device.index}: {device}" for device in found)
    if isinstance(selector, (int, np.integer)) and not isinstance(selector, bool):
        if 0 <= selector < len(found):
            return found[selector]
        raise DeviceError(f"device={selector} does not exist. There are: {listing}. {_SELECT}")
    if isinstance(selector, str) and selector.strip():
        if selector.strip().isdecimal() and len(selector.strip()) < 10:
            return select_device(int(selector))
        wanted = selector.strip().lower()
        for device in found:
            by_name = wanted in f"{device.name} {device.platform} {device.platform_version}".lower()
            if device.kind == wanted or (wanted not in ("cpu", "gpu") and by_name):
                return device
        raise DeviceError(f"No OpenCL device fits device={brief(selector)}. There are: {listing}. {_SELECT}")
    raise DeviceError(
        f"device={brief(selector)} is not a choice: give None, 'cpu', 'gpu', an index, part of a name, or a Device."
    )


def _from_environment(found: list[Device]) -> Device:
    wanted = os.environ["PYOPENCL_CTX"]
    try:
        handle = cl.create_some_context(interactive=False).devices[0]
    except (cl.Error, RuntimeError, ValueError, IndexError) as error:
        raise DeviceError(
            f"PYOPENCL_CTX={wanted!r} names no device ({error}): unset it, or see 'persfs-cl devices'."
        ) from error
    return next(device for device in found if device.is_handle(handle))
