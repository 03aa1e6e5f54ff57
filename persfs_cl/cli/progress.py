"""What a person at a terminal sees of a long run, and how Ctrl-C ends it."""

from __future__ import annotations

import _thread
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from types import FrameType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it: 128 + SIGINT."""


def remaining_iterations(changes: Sequence[float], tolerance: float, max_iterations: int) -> int:
    """How many iterations are left, if the changes go on to shrink as they did over the latter half of them.

    Parameters
    ----------
    changes : sequence of float
        max |ΔZ| of every iteration so far, at least one.
    tolerance : float
        The change at which the run ends.
    max_iterations : int

    Returns
    -------
    int
        At most `max_iterations` less the iterations done.
    """
    done = len(changes)
    left = max_iterations - done
    middle = (done - 1) // 2
    if done < 2 or tolerance <= 0 or min(changes[middle], changes[-1]) <= 0:
        return left
    decay = math.log(changes[middle] / changes[-1]) / (done - 1 - middle)
    if decay <= 0:
        return left
    return min(left, max(0, math.ceil(math.log(changes[-1] / tolerance) / decay)))


@contextmanager
def progress_line(tolerance: float, max_iterations: int) -> Iterator[Callable[[int, float], None]]:
    """A line on standard error with iteration, change and time left; nothing when that is not a terminal.

    Yields
    ------
    callable
        To be called with iteration and change after each iteration.
    """
    if not sys.stderr.isatty():
        yield lambda _iteration, _change: None
        return
    changes: list[float] = []
    began = time.perf_counter()
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[left]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as line:
        task = line.add_task("preparing", total=None, left="")

        def show(iteration: int, change: float) -> None:
            nonlocal began
            changes.append(change)
            if iteration == 1:  # which took longer: kernels may have been compiled
                began = time.perf_counter()
                return
            rest = remaining_iterations(changes, tolerance, max_iterations)
            seconds = rest * (time.perf_counter() - began) / (iteration - 1)
            line.update(
                task,
                description=f"iteration {iteration}, change {change:.1e}",
                completed=iteration,
                total=iteration + rest,
                left=f"about {timedelta(seconds=min(math.ceil(seconds), 10**9))} left",
            )

        yield show


@contextmanager
def writing() -> Iterator[None]:
    """A line on standard error while results are written, if that is a terminal; Ctrl-C is sure to end the block.

    Python drops exceptions in the callbacks of weak references, which drawing runs by the thousand. A dropped
    KeyboardInterrupt is raised again a moment later.
    """
    usual = sys.unraisablehook

    def again(dropped: sys.UnraisableHookArgs) -> None:
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            threading.Timer(0.01, _thread.interrupt_main).start()
        else:
            usual(dropped)

    sys.unraisablehook = again
    try:
        if sys.stderr.isatty():
            with Console(stderr=True).status("writing the results"):
                yield
        else:
            yield
    finally:
        sys.unraisablehook = usual


@contextmanager
def stop_on_interrupt() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C ask for an end once there is something to keep; before that, and the second time, it raises as usual.

    Yields
    ------
    callable
        Whether an end was asked for. Its first call says that from now on there is something to keep.
    """
    pressed = threading.Event()
    asking = False

    def ask(_number: int, _frame: FrameType | None) -> None:
        pressed.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        # Not by print: the signal may have come in the middle of one.
        os.write(2, b"persfs-cl: stopping; the surface as it is will be written. Ctrl-C again to leave without.\n")

    previous = signal.getsignal(signal.SIGINT)

    def asked() -> bool:
        nonlocal asking
        # A shell starts background jobs with Ctrl-C ignored: that must stay so.
        if not asking and previous != signal.SIG_IGN:
            signal.signal(signal.SIGINT, ask)
        asking = True
        return pressed.is_set()

    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, previous)
