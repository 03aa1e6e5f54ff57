"""Images worked on by blocks of rows that stay in a processor's cache.

Over whole images the intermediate arrays of an expression would cost more than its arithmetic: memory that the system
hands out afresh, and several ways to it and back.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

_PIXELS = 2**16

_LEAST_BLOCKS = 4
"""Of a thread: for less it is not worth its start."""


def row_blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Rows of an image of shape (height, width), some at a time."""
    height, width = shape
    step = max(1, _PIXELS // width)
    for begin in range(0, height, step):
        yield slice(begin, min(begin + step, height))


def in_row_blocks(work: Callable[[slice], None], shape: tuple[int, ...]) -> None:
    """Do some work for all rows of an image, some at a time, by as many threads as are worth it.

    For work that is NumPy's for the most part, which lets other threads go on. What `numpy.errstate` says around the
    call holds for some of the blocks only.
    """
    left = list(row_blocks(shape))
    helpers = min(usable_cores(), len(left) // _LEAST_BLOCKS) - 1

    def take_turns() -> None:
        while left:
            try:
                rows = left.pop()
            except IndexError:  # another was faster
                return
            try:
                work(rows)
            except BaseException:
                left.clear()
                raise

    if helpers < 1:
        take_turns()
        return
    # None is kept: threads do not outlive a fork.
    with ThreadPoolExecutor(helpers) as pool:
        helping = [pool.submit(take_turns) for _ in range(helpers)]
        take_turns()
    for each in helping:
        each.result()


def usable_cores() -> int:
    """Cores of the processor that this process may run on, or its share of them."""
    affinity = getattr(os, "sched_getaffinity", None)  # Linux only
    found = len(affinity(0)) if affinity else os.cpu_count() or 1
    return found if _Share.cores is None else min(found, _Share.cores)


def share_cores(cores: int) -> None:
    """Have no more threads than that for rows, nor groups for sweeps, from now on: other processes have the others."""
    _Share.cores = cores


class _Share:
    """What this process was told to use."""

    cores: int | None = None
