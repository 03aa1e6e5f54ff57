"""How many pixels a file may have: asked of its header, before a decoder makes room for them."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath

VARIABLE = "PERSFS_CL_MAX_PIXELS"
"""The environment variable that sets the limit."""

# What reading a colour photo takes at its peak, and about half of what solving it takes.
_BYTES_PER_PIXEL = 64
# A machine that does not tell its memory is taken for one of 8 GiB.
_USUAL_MEMORY = 2**33
_CONTROL_GROUPS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))


def memory() -> int:
    """Bytes of memory that this machine, or the container on it, has."""
    sizes = []
    with suppress(AttributeError, ValueError, OSError):  # not on Windows
        sizes.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    for file in _CONTROL_GROUPS:
        with suppress(OSError, ValueError):  # "max", or no such file
            sizes.append(int(file.read_text(encoding="ascii")))
    return min((size for size in sizes if size > 0), default=_USUAL_MEMORY)


# Asked once: it takes longer than to look at the header of a file.
_memory = functools.cache(memory)


def max_pixels(environment: Mapping[str, str] = os.environ) -> int:
    """The largest number of pixels that is read: a share of the machine's memory, or what PERSFS_CL_MAX_PIXELS says.

    Raises
    ------
    InputError
        When the variable holds no number of at least 1.
    """
    text = environment.get(VARIABLE, "").strip()
    if not text:
        return _memory() // _BYTES_PER_PIXEL
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (number >= 1 and math.isfinite(number)):
        raise InputError(f"The environment variable {VARIABLE} is {text!r}: give a number of pixels, such as 4e8.")
    return int(number)


def require_pixels(path: FilePath, shape: tuple[int, ...], *, weight: int = 1) -> None:
    """Refuse a file of more pixels than are read.

    Parameters
    ----------
    path : path
        Named in the error.
    shape : tuple of int
        As the header says, (height, width) or longer; nothing may be decoded yet.
    weight : int
        How many pixels of ordinary integers take the room of one of these, which may be floats or of many channels.

    Raises
    ------
    InputError
        Naming both numbers and PERSFS_CL_MAX_PIXELS.
    """
    limit = max_pixels()
    # As whole numbers of any size: headers lie.
    pixels = math.prod(shape) * weight
    if pixels > limit:
        room = f"take the room of {_counted(pixels)}" if weight > 1 else f"are {_counted(pixels)}"
        raise InputError(
            f"{path} is too large: {' × '.join(map(str, shape))} pixels {room}, and the limit here is "
            f"{_counted(limit)}. Reduce it first, or set the environment variable {VARIABLE} to more."
        )


def _counted(pixels: int) -> str:
    return f"{pixels:,}" if pixels < 10**6 else f"{float(min(pixels, 10**300)) / 1e6:,.4g} million"
