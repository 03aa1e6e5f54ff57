"""What a person at a terminal sees of a long run."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from persfs_cl.choices import Stopping


def remaining_iterations(
    changes: Sequence[float], tolerance: float, max_iterations: int, stopping: Stopping = "distance"
) -> int:
    """How many iterations are left, if the changes go on to shrink as they did over the latter half of them.

    Parameters
    ----------
    changes : sequence of float
        max |ΔZ| of every iteration so far, at least one.
    tolerance : float
        At which the run ends.
    max_iterations : int
    stopping : {"distance", "change", "gain"}
        Whether it is for the distance from the limit or for the change of an iteration; with "gain" nobody can tell.

    Returns
    -------
    int
        At most `max_iterations` less the iterations done.
    """
    done = len(changes)
    left = max_iterations - done
    middle = (done - 1) // 2
    if stopping == "gain" or done < 2 or tolerance <= 0 or min(changes[middle], changes[-1]) <= 0:
        return left
    decay = math.log(changes[middle] / changes[-1]) / (done - 1 - middle)
    if decay <= 0:
        return left
    measure = changes[-1] / math.expm1(decay) if stopping == "distance" else changes[-1]
    return min(left, max(0, math.ceil(math.log(max(measure / tolerance, 1.0)) / decay)))


@contextmanager
def progress_line(
    tolerance: float, max_iterations: int, stopping: Stopping = "distance"
) -> Iterator[Callable[[int, float], None]]:
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
            rest = remaining_iterations(changes, tolerance, max_iterations, stopping)
            seconds = rest * (time.perf_counter() - began) / (iteration - 1)
            told = stopping != "gain"
            line.update(
                task,
                description=f"iteration {iteration}, change {change:.1e}",
                completed=iteration,
                total=iteration + rest if told else None,
                left=f"about {timedelta(seconds=min(math.ceil(seconds), 10**9))} left" if told else "",
            )

        yield show


@contextmanager
def writing() -> Iterator[None]:
    """A line on standard error while results are written, if that is a terminal."""
    if sys.stderr.isatty():
        with Console(stderr=True).status("writing the results"):
            yield
    else:
        yield
