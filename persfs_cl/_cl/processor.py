"""A processor that is newer than PoCL's compiler, named by what it can do."""

from __future__ import annotations

import ctypes
import logging
import os
import platform
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyopencl as cl

_LOG = logging.getLogger(__name__)
_LEVELS = (
    ("x86-64-v4", 16, "avx512f avx512bw avx512cd avx512dq avx512vl"),
    ("x86-64-v3", 8, "avx avx2 bmi1 bmi2 f16c fma abm movbe"),
    ("x86-64-v2", 4, "cx16 lahf_lm popcnt pni sse4_1 sse4_2 ssse3"),
)
"""Levels of the System V ABI for x86-64, which all compilers know: the width of a vector in floats, and what a level
adds to the one below it, as Linux calls it."""
_BASE = "x86-64"
_UNKNOWN = "generic"
_POINTER = struct.Struct("@P")
_RECORD = 8192
"""Bytes that are searched for the target's name: a record of a device is no larger."""
_BEHIND = 4
"""Texts behind the target's name up to the processor's: the first before PoCL 5, the second in Debian's PoCL 3.1, the
fourth since PoCL 5."""
_LONGEST_NAME = 64
_named: dict[int, str] = {}
"""What devices were told, by the addresses of their records."""


def name_processor(handle: cl.Device) -> str | None:
    """Tell PoCL's compiler what the processor can do, if the compiler is older and does not know the processor.

    LLVM calls what it does not know "generic". PoCL hands the name on, and LLVM's own front end refuses it: nothing
    compiles. Before PoCL 5, which has POCL_LLVM_CPU_NAME, no option or variable gives it another name. But each build
    reads it from the driver's record of the device, where it stands behind the target's name. There it is replaced by
    the x86-64 level that Linux and the driver agree on.

    That is outside of what OpenCL promises, and so is done only where both names are found. If there is nothing to
    replace, or it cannot be looked for, the driver stays as it is, and its own error says what does not compile.

    Parameters
    ----------
    handle : pyopencl.Device
        Of which nothing has been compiled yet.

    Returns
    -------
    str or None
        The level, such as "x86-64-v3", from an earlier call too; None where the compiler knows the processor, or the
        driver is not PoCL on Linux and x86-64.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> from persfs_cl._cl.processor import name_processor
    >>> name_processor(ps.devices()[0].context.devices[0]) in (None, "x86-64-v4", "x86-64-v3", "x86-64-v2", "x86-64")
    True
    """
    if handle.int_ptr in _named:
        return _named[handle.int_ptr]
    # Of other kinds of devices the record says nothing of this processor.
    on_it = sys.platform == "linux" and platform.machine() == "x86_64" and bool(handle.type & cl.device_type.CPU)
    if not on_it or "PoCL" not in handle.platform.version:
        return None
    try:
        # Reading by this file is refused where an address is no memory; reading the address itself ends the process.
        memory = os.open("/proc/self/mem", os.O_RDONLY)
    except OSError as error:
        _LOG.debug("%s: the name of its processor cannot be looked up: %s", handle.name, error)
        return None
    try:
        place = _place_of_unknown(lambda address, size: _read(memory, address, size), handle.int_ptr)
    finally:
        os.close(memory)
    if place is None:
        return None
    level = level_of(set((cpuinfo("flags") or "").split()), handle.native_vector_width_float)
    # PoCL keeps the address, so that the copy is never freed.
    ctypes.c_void_p.from_address(place).value = _copy_in_c(level)
    # Not before: another thread goes by it.
    _named[handle.int_ptr] = level
    _LOG.debug("%s: its compiler does not know the processor, and is told that it is %s", handle.name, level)
    return level


def level_of(flags: set[str], width: int) -> str:
    """The highest level all of whose flags are there, and whose vectors are no wider than the driver says.

    Emulators pass on the flags of the processor beneath them; the driver has asked the processor itself.

    Parameters
    ----------
    flags : set of str
        As in /proc/cpuinfo.
    width : int
        Floats of the widest vector that the driver knows of.

    Examples
    --------
    >>> from persfs_cl._cl.processor import level_of
    >>> level_of({"sse2"}, 4)
    'x86-64'
    """
    reached = _BASE
    for level, floats, added in reversed(_LEVELS):
        if floats > width or not flags.issuperset(added.split()):
            break
        reached = level
    return reached


def cpuinfo(field: str) -> str | None:
    """What Linux says of the first processor, such as its "model name"; None where it says nothing.

    Examples
    --------
    >>> from persfs_cl._cl.processor import cpuinfo
    >>> cpuinfo("no such field") is None
    True
    """
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    said = (line.partition(":") for line in lines)
    return next((value.strip() for name, _, value in said if name.strip() == field), None)


def _place_of_unknown(read: Callable[[int, int], bytes], record: int) -> int | None:
    """Where the record of a device has the address of an unknown processor's name; None where the name is another."""
    left = 0
    for place, address in _pointers(read(record, _RECORD), record):
        text = _text_at(read, address)
        if left and text == _UNKNOWN:
            return place
        if left == 1:
            break  # beyond this the record of another device may begin
        left = left - 1 if left else _BEHIND * text.startswith("x86_64-")
    return None


def _pointers(record: bytes, begin: int) -> Iterator[tuple[int, int]]:
    whole = len(record) - len(record) % _POINTER.size
    for offset, (address,) in enumerate(_POINTER.iter_unpack(record[:whole])):
        yield begin + offset * _POINTER.size, address


def _text_at(read: Callable[[int, int], bytes], address: int) -> str:
    """Text at an address, up to its end; nothing where there is no memory."""
    # Near the end of what can be read, less comes back than was asked for.
    return read(address, _LONGEST_NAME).partition(b"\0")[0].decode("ascii", errors="replace")


def _read(memory: int, address: int, size: int) -> bytes:
    try:
        return os.pread(memory, size, address)
    except (OSError, OverflowError):  # no memory there, or no address of a file
        return b""


def _copy_in_c(text: str) -> Any:
    copied = ctypes.CDLL(None).strdup
    copied.restype = ctypes.c_void_p
    return copied(text.encode())
