"""The most memory that processes have had, as the system tells it."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

_PROCESSES = Path("/proc")
_PEAK = re.compile(r"^VmHWM:\s+(\d+) kB", re.MULTILINE)
_PARENT = re.compile(r"^PPid:\s+(\d+)", re.MULTILINE)
_WORKER = b"persfs_cl.pipeline.workers"


def peak_memory() -> int:
    """Largest memory that this process has had so far, in bytes."""
    # Linux hands its getrusage figure down from the process that started this one.
    if (peak := _told(_PROCESSES / "self")) is not None:
        return peak
    import resource  # noqa: PLC0415 - not at the top, for Windows has none

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


def tells_of_others() -> bool:
    """Whether the system tells of other processes too, as Linux does."""
    return _told(_PROCESSES / "self") is not None


def peaks_of_workers() -> dict[int, int]:
    """Largest memory so far of each process for a device that this one has started, in bytes, by their numbers."""
    found = {}
    for place in _PROCESSES.glob("[0-9]*"):
        if (peak := _told(place, parent=os.getpid())) is not None:
            found[int(place.name)] = peak
    return found


def _told(place: Path, parent: int | None = None) -> int | None:
    """What is told of a process, or only of a worker of one; None where nothing is."""
    try:
        status = (place / "status").read_text(encoding="utf-8", errors="replace")
        if parent is not None:
            above = _PARENT.search(status)
            if above is None or int(above[1]) != parent or _WORKER not in (place / "cmdline").read_bytes():
                return None
    except OSError:  # it has ended, or this is no Linux
        return None
    peak = _PEAK.search(status)
    return None if peak is None else 1024 * int(peak[1])
