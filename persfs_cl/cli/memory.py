"""Memory that arrays of large photographs give back, kept for the next ones."""

from __future__ import annotations

import ctypes
import os

_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""What glibc's malloc.h calls M_TRIM_THRESHOLD and so on."""
_LARGEST_ARRAY = 2**30
_MOST_KEPT = 2**31 - 1


def keep_freed_memory() -> None:
    """Have the C library take memory for new arrays from what earlier ones gave back, where it is glibc.

    By itself it hands each large array back to the system at once, which must clear the memory for the next one: that
    takes longer than what is computed there, and half of all time in the system. For a process that ends with one
    photograph; up to 2 GiB stay with it.
    """
    try:
        glibc = os.confstr("CS_GNU_LIBC_VERSION")
    except (AttributeError, ValueError, OSError):
        return
    if not glibc:
        return
    mallopt = ctypes.CDLL(None).mallopt
    # What threads allocate goes to the same place as all else: heaps of their own are handed back early.
    for option, value in ((_MMAP_THRESHOLD, _LARGEST_ARRAY), (_TRIM_THRESHOLD, _MOST_KEPT), (_ARENA_MAX, 1)):
        mallopt(option, value)
