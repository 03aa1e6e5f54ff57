"""How long something takes: warmed up, repeated, taken in turns, by the clock on the wall and by the device's own."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

Work = Callable[[int], float | None]
"""Does so many units, waits for their end, and returns the device's own seconds where there are any."""

Clock = Callable[[], float]

LARGEST_COUNT = 1 << 20


@dataclass(frozen=True)
class Spread:
    """Some measurements of one quantity.

    Attributes
    ----------
    median, lowest, highest : float
    repeats : int
    """

    median: float
    lowest: float
    highest: float
    repeats: int

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """Summary of at least one value."""
        return cls(statistics.median(values), min(values), max(values), len(values))


@dataclass(frozen=True)
class Timing:
    """Seconds of each repeat, for one unit of work.

    Attributes
    ----------
    wall : tuple of float
        From the call to the return.
    device : tuple of float
        By the device's own clock; empty when it was not asked.
    """

    wall: tuple[float, ...]
    device: tuple[float, ...] = ()

    def rates(self, units: float) -> list[float]:
        """How many `units` a second, in each repeat, when one unit of work holds so many of them."""
        return [units / seconds for seconds in self.wall]

    def over(self, other: Timing) -> list[float]:
        """How many times as long this takes as another one of the same rounds, in each of them."""
        return [own / others for own, others in zip(self.wall, other.wall, strict=True)]

    def device_rates(self, units: float) -> list[float]:
        """The same by the device's own clock."""
        return [units / seconds for seconds in self.device]


def take_turns(
    works: Mapping[str, Work],
    *,
    repeats: int,
    least_seconds: float,
    step: int = 1,
    steps: Mapping[str, int] | None = None,
    clock: Clock = time.perf_counter,
) -> dict[str, Timing]:
    """Measure several works in turns, so that a disturbance of the machine hits them alike.

    Parameters
    ----------
    works : mapping of str to Work
    repeats : int
        Rounds, in each of which every work is run once.
    least_seconds : float
        How long one run takes at least: the number of units is chosen so, which warms up and compiles too.
    step : int
        The number of units is a multiple of this.
    steps : mapping of str to int, optional
        Instead of `step` for some of the works.
    clock : callable
        Seconds since some moment.

    Returns
    -------
    dict of str to Timing
        The repeats of all works are in the order of the rounds.
    """
    own = steps or {}
    counts = {
        name: warm_up(work, least_seconds=least_seconds, step=own.get(name, step), clock=clock)
        for name, work in works.items()
    }
    wall: dict[str, list[float]] = {name: [] for name in works}
    device: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            count = counts[name]
            seconds, own_seconds = _run(work, count, clock)
            wall[name].append(seconds / count)
            if own_seconds is not None:
                device[name].append(own_seconds / count)
    return {name: Timing(tuple(wall[name]), tuple(device[name])) for name in works}


def warm_up(work: Work, *, least_seconds: float, step: int, clock: Clock = time.perf_counter) -> int:
    """Run some work until it is warm, and find out how many units take long enough to be measured.

    Returns
    -------
    int
        A multiple of `step`, at most about :data:`LARGEST_COUNT`.
    """
    work(step)  # the first run compiles and allocates: its time says nothing
    count = step
    while count < LARGEST_COUNT:
        seconds, _ = _run(work, count, clock)
        if seconds >= least_seconds:
            break
        # Not more than eightfold at once: the first short runs are slower than the long ones.
        growth = min(8.0, 1.2 * least_seconds / max(seconds, 1e-9))
        count = max(count + step, round(count * growth / step) * step)
    return count


def _run(work: Work, count: int, clock: Clock) -> tuple[float, float | None]:
    began = clock()
    own_seconds = work(count)
    return clock() - began, own_seconds
