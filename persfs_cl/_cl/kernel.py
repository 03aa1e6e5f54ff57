"""Kernels: functions of a program, launched with arguments by their names."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pyopencl as cl

from persfs_cl._cl.arguments import Argument, arguments_of
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.parameters import COMMON
from persfs_cl._cl.program import kernel_source, program, program_key
from persfs_cl.errors import KernelBuildError

_LOG = logging.getLogger(__name__)

ROW_GROUP = 64
"""Neighbouring cells of a row that a work-group takes, where each work-item takes its own, if a device allows it."""


def row_group(device: Device) -> int:
    """As many of them as a device allows."""
    return min(ROW_GROUP, device.largest_group)


def in_row_groups(group: int, items: int, *others: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Size of a launch of at least so many items along rows, and of its work-groups of so many.

    That is one for images of all sizes: drivers for processors compile a kernel anew for each size of a group.
    """
    return (-(-items // group) * group, *others), (group, *(1 for _ in others))


class Kernel:
    """A kernel that is given its arguments by name.

    Parameters
    ----------
    made : pyopencl.Kernel
        It knows the types of its arguments.
    arguments : sequence of Argument
        In its order.
    where : str
        The kernel and its files, for messages.
    """

    def __init__(self, made: cl.Kernel, arguments: Sequence[Argument], where: str) -> None:
        self._made = made
        self._names = tuple(argument.name for argument in arguments)
        self._where = where

    def launch(
        self, device: Device, size: tuple[int, ...], group: tuple[int, ...] | None, values: Mapping[str, Any]
    ) -> cl.Event:
        """Queue a launch, by the thread that holds the device's lock.

        Parameters
        ----------
        device : Device
            The kernel's own.
        size : tuple of int
            Work-items.
        group : tuple of int or None
            Work-items of a group, the same for images of all sizes: see :func:`in_row_groups`. None leaves them to the
            driver, for launches that are always of one size.
        values : mapping
            Buffers and numbers by name. The kernel takes those that it declares, whatever else there is.

        Raises
        ------
        KernelBuildError
            When one that it declares is missing.
        """
        return self.prepared(device, size, group, values)()

    def prepared(
        self, device: Device, size: tuple[int, ...], group: tuple[int, ...] | None, values: Mapping[str, Any]
    ) -> Callable[[], cl.Event]:
        """:meth:`launch` as a function without arguments, for one that is done again and again with the same ones."""
        try:
            given = [values[name] for name in self._names]
        except KeyError as error:
            raise KernelBuildError(
                f"{self._where} declares the argument {error.args[0]!r}, for which the launch gives no value: name it "
                f"as one of {', '.join(sorted(values))}, or have the launch give it."
            ) from error
        return partial(self._made, device.queue, size, group, *given)

    def largest_group(self, device: Device) -> int:
        """Largest power of two of work-items that one group may have."""
        info = cl.kernel_work_group_info.WORK_GROUP_SIZE
        limit: Any = self._made.get_work_group_info(info, device.context.devices[0])
        return 1 << (int(limit).bit_length() - 1)


def kernel(
    device: Device,
    names: Sequence[str],
    precision: str,
    definitions: Mapping[str, int] | None,
    name: str,
    parameters: Iterable[str] = COMMON,
) -> Kernel:
    """A kernel of a program, made once: what pyopencl prepares for its arguments takes longer than a small image.

    Parameters
    ----------
    device, names, precision, definitions, parameters
        As for :func:`persfs_cl._cl.program.program`.
    name : str
        Of the kernel's function.

    Raises
    ------
    KernelBuildError
        When the program does not compile, or its files define no such kernel.
    DeviceError
        When the program has no such kernel all the same, as one that a driver has left half-made.
    """
    key = (*program_key(device, names, precision, definitions, parameters), name)
    with device.lock:
        if key not in device.kernels:
            with in_words(device):
                built = program(device, names, precision, definitions, parameters)
                device.kernels[key] = _made(built, names, name, np.dtype(precision).type)
        made: Kernel = device.kernels[key]
        return made


def _made(built: cl.Program, names: Sequence[str], name: str, real: type[np.generic]) -> Kernel:
    arguments = arguments_of("\n".join(map(kernel_source, names)), name, real)
    made = _prepared(built, name, [argument.scalar for argument in arguments])
    return Kernel(made, arguments, f"The kernel {name} of {' + '.join(names)}")


def _prepared(built: cl.Program, name: str, scalars: Sequence[type[np.generic] | None]) -> cl.Kernel:
    try:
        made = cl.Kernel(built, name)
        made.set_scalar_arg_dtypes(scalars)
    except cl.Error:
        raise
    except Exception as error:
        # pyopencl keeps what it prepares in a database, and raises whatever one leads to that is damaged or another's.
        # The environment variable of this name is only read when pyopencl is imported.
        if cl._PYOPENCL_NO_CACHE:  # noqa: SLF001
            raise KernelBuildError(
                f"The kernel {name} cannot be prepared ({type(error).__name__}: {error}). Install another version of "
                "pyopencl."
            ) from error
        _LOG.debug("pyopencl's cache is left alone after: %s", error)
        cl._PYOPENCL_NO_CACHE = True  # noqa: SLF001
        return _prepared(built, name, scalars)
    return made
