"""OpenCL devices: what there is, which one to take, and its context, made once and reused."""

from __future__ import annotations

import functools
import os
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyopencl as cl

from persfs_cl._cl.cache import prepare_caches
from persfs_cl._cl.processor import name_processor
from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError
from persfs_cl.wording import keyword

INSTALL_HINT = (
    "Install an OpenCL driver: 'pip install pocl-binary-distribution' (CPU, Linux x86-64), "
    "'apt install pocl-opencl-icd' (CPU, Debian and Ubuntu), or your GPU's driver. "
    "'persfs-cl devices' lists what is found."
)

_KINDS = ("cpu", "gpu", "other")
"""In the order that devices are listed in."""

_finding = threading.Lock()
_owner: int | None = None
"""The process that first asked OpenCL for anything."""


class Device:
    """One OpenCL device, with its context, queue, programs and kernels, which are made at first use and reused.

    Obtained from :func:`devices`; never constructed by users. A device may be pickled: another process finds the same
    one again, by name, driver and, of several equal ones, place. OpenCL does not survive a fork: a forked child can
    hold a device and read what it is called, but its use there raises :class:`DeviceError`.

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
    register_bits : int or None
        See :func:`persfs_cl._cl.registers.register_bits`; None before it is asked for.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> device = ps.devices()[0]
    >>> device.index, device.kind in ("cpu", "gpu", "other")
    (0, True)
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
        self.register_bits: int | None = None
        self._processor: str | None = None
        self.programs: dict[object, cl.Program] = {}
        self.kernels: dict[object, Any] = {}
        self._context: cl.Context | None = None
        self._queue: cl.CommandQueue | None = None

    @property
    def context(self) -> cl.Context:
        """The device's one context."""
        _claim_process()
        if self._context is None:  # asked before the lock too, which another thread may hold for a whole run
            with self._lock, self._refusal("context"):
                if self._context is None:
                    self._processor = name_processor(self._handle)
                    self._context = cl.Context([self._handle])
        return self._context

    @property
    def processor(self) -> str | None:
        """What the device's compiler was told that the processor is; None where it knows by itself.

        See :func:`persfs_cl._cl.processor.name_processor`.
        """
        self.context  # noqa: B018  # which is made after the compiler was told
        return self._processor

    @property
    def queue(self) -> cl.CommandQueue:
        """The device's one in-order queue; events carry times."""
        _claim_process()
        if self._queue is None:
            timed = cl.command_queue_properties.PROFILING_ENABLE
            with self._lock, self._refusal("queue"):
                self._queue = self._queue or cl.CommandQueue(self.context, properties=timed)
        return self._queue

    @property
    def lock(self) -> threading.RLock:
        """Held while a program is built or a run uses the queue: OpenCL kernels are not thread-safe."""
        # In a forked child it would stay locked for ever if a thread held it at the time.
        _claim_process()
        return self._lock

    @contextmanager
    def _refusal(self, what: str) -> Iterator[None]:
        try:
            yield
        except cl.Error as error:
            raise DeviceError(
                f"{self} gives no {what}: {error}. Another program may use all of it: try again later, or give another "
                "device."
            ) from error

    def real(self, precision: str) -> np.dtype[np.floating]:
        """NumPy type for a precision, after checking that the device has it.

        Raises
        ------
        DeviceError
            When float64 is asked of a device without it.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> ps.devices()[0].real("float32")
        dtype('float32')
        """
        if precision == "float64" and not self.has_float64:
            raise DeviceError(
                f"{self} has no double precision: use {keyword('precision', 'float32')} or another device "
                f"({', '.join(str(other) for other in devices() if other.has_float64) or 'none here has it'}).",
                argument="precision",
                value=precision,
            )
        return np.dtype(precision)

    def is_handle(self, handle: cl.Device) -> bool:
        """Whether this is the device behind a handle of pyopencl.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> device = ps.devices()[0]
        >>> device.is_handle(device.context.devices[0])
        True
        """
        return bool(self._handle == handle)

    @property
    def version(self) -> str:
        """The platform's version without what PoCL adds of how it was built, set off by two spaces."""
        return self.platform_version.partition("  ")[0]

    def __str__(self) -> str:
        return f"{self.name} ({self.platform}, {self.version})"

    def __repr__(self) -> str:
        return f"Device({self.index}, {self.kind}, {self})"

    def __reduce__(self) -> tuple[Callable[..., Device], tuple[str, str, int]]:
        """Pickled as what it is called: another process, or machine, looks for a device of that name.

        Several of one name, as in a machine with equal GPUs, are told apart by their order.
        """
        equal = _of_name(self.name, self.platform_version)
        # The list may have been made anew since this one was found in it.
        same = (
            [device is self for device in equal] if self in equal else [each.is_handle(self._handle) for each in equal]
        )
        place = same.index(True) if any(same) else 0
        return _named, (self.name, self.platform_version, place)


def _named(name: str, platform_version: str, place: int) -> Device:
    found = _of_name(name, platform_version)
    if place < len(found):
        return found[place]
    which = f"Number {place + 1} of the devices" if found else "The device"
    raise DeviceError(f"{which} {name} ({platform_version}) of a pickled result is not there. {INSTALL_HINT}")


def _of_name(name: str, platform_version: str) -> list[Device]:
    # A forked child has the list of its parent, and needs no OpenCL to look at it. An error that early, while a pool
    # unpickles a task, would end the worker and be lost, and the parent would wait for ever: it is raised at first use.
    found = _all_devices() if _forked() else devices()
    return [device for device in found if (device.name, device.platform_version) == (name, platform_version)]


def _forked() -> bool:
    return _owner not in (None, os.getpid())


def _claim_process() -> None:
    """Remember that this process uses OpenCL, unless a parent did before the fork: the driver's threads stayed there.

    Raises
    ------
    DeviceError
        In such a child, where the driver would wait for its threads for ever.
    """
    global _owner  # noqa: PLW0603  # a process is what there is one of
    if _forked():
        raise DeviceError(
            f"OpenCL does not survive a fork: process {_owner} used it before it forked process {os.getpid()}. Use "
            'multiprocessing with the start method "spawn", or fork before OpenCL is first used.'
        )
    _owner = os.getpid()


def _kind(handle: cl.Device) -> str:
    if handle.type & cl.device_type.GPU:
        return "gpu"
    if handle.type & cl.device_type.CPU:
        return "cpu"
    return "other"


def _age(device: Device) -> tuple[int, ...]:
    """Negated version of PoCL, so that the newest sorts first: "OpenCL 3.0 PoCL 3.1+debian ..." is 3.1."""
    version = re.search(r"PoCL (\d+)\.(\d+)", device.platform_version)
    return tuple(-int(number) for number in version.groups()) if version else ()


@functools.cache
def _all_devices() -> tuple[Device, ...]:
    _claim_process()
    said = prepare_caches()
    try:
        platforms = cl.get_platforms()
    except cl.Error:
        # The loader reports "no platform" as an error; an empty list says the same to every caller.
        return ()
    for text in said:
        warn(text)
    handles = []
    for number, platform in enumerate(platforms):
        try:
            handles += platform.get_devices()
        except cl.Error as error:
            name = _name_or_number(platform, number)
            warn(f"OpenCL platform {name} lists no devices: {error}")
    found = []
    for handle in handles:
        try:
            found.append(Device(0, handle))
        except cl.Error as error:
            warn(f"An OpenCL device that does not say what it is was left out: {error}")
    found.sort(key=_rank)
    for index, device in enumerate(found):
        device.index = index
    return tuple(found)


def _rank(device: Device) -> tuple[bool, int, bool, tuple[int, ...]]:
    """The order of devices; of equal ones the driver's own is kept."""
    # Versions of two makers say nothing about each other. PoCL comes with the package, and its tests run on it.
    return not device.has_float64, _KINDS.index(device.kind), not device.is_pocl, _age(device)


def _name_or_number(platform: cl.Platform, number: int) -> str:
    try:
        return repr(platform.name)
    except cl.Error:
        return f"number {number}"


def devices() -> list[Device]:
    """All OpenCL devices: CPUs first, then GPUs, and those without double precision last.

    Of several drivers for a processor PoCL comes first, and of several versions of PoCL the newest.

    From the first call on, a child of this process that is made by a fork cannot use OpenCL: use multiprocessing with
    the start method "spawn".

    Returns
    -------
    list of Device
        Empty when no OpenCL driver is installed. The same objects in every call and thread.

    Raises
    ------
    DeviceError
        In a process that was forked after OpenCL was used.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> [device.index for device in ps.devices()] == list(range(len(ps.devices())))
    True
    """
    _claim_process()
    with _finding:  # a cache alone lets two threads make two objects of one device
        return list(_all_devices())
