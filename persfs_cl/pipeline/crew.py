"""The devices of this machine, and how they share the tasks."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from multiprocessing.connection import wait

from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError, InputError, PersfsError
from persfs_cl.pipeline.manifest import Record, now
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.workers import Setting, Worker

_AHEAD = 256
"""Tasks that a device has at most: enough for small photos to share launches."""
_FAILURES = 3
"""A device that fails so often, with nothing done in between, is given up."""
_ATTEMPTS = 2
"""A photo that a device failed at so often is given up."""
_ASKED_EVERY = 0.2
"""Seconds between two looks whether an end is asked for."""


@dataclass(eq=False)
class _Member:
    """A device, and what it has to do."""

    setting: Setting
    worker: Worker | None = None
    name: str = ""
    tasks: dict[int, Task] = field(default_factory=dict)
    failures: int = 0

    @property
    def alone(self) -> bool:
        """Whether it has a task that was tried before, which nothing else shall be near."""
        return any(task.attempts for task in self.tasks.values())


class Crew:
    """Processes that share tasks, one for each device.

    A device whose process ends, or that refuses its work, is started anew; what it had to do goes back to all. After
    some failures in a row it is given up, and the others go on. What was in the process when it ended is tried again by
    itself, so that the one photo that ends processes is known by the second time.

    Parameters
    ----------
    settings : sequence of Setting
        One for each device.
    inherited : sequence of int
        File descriptors that the processes are to hold too.
    """

    def __init__(self, settings: Sequence[Setting], inherited: Sequence[int] = ()) -> None:
        self._members = [_Member(setting) for setting in settings]
        self._inherited = inherited
        self._refusal: PersfsError | None = None
        self._again: deque[Task] = deque()
        self._tried: defaultdict[int, set[_Member]] = defaultdict(set)
        """Which devices failed at a photo."""

    def outcomes(self, tasks: Iterable[Task], interrupted: Callable[[], bool]) -> Generator[Outcome, None, None]:
        """Have tasks done, and say what comes of them, as they end.

        Parameters
        ----------
        tasks : iterable of Task
            Taken from as the devices need them.
        interrupted : callable
            Whether an end is asked for. What is in hand is then finished or dropped, which may take a moment.

        Yields
        ------
        Outcome
            One for each task that was taken.

        Raises
        ------
        DeviceError
            When no device is left, and tasks are.
        """
        source = iter(tasks)
        stopping = False
        try:
            for member in self._members:
                self._start(member)
            while True:
                if not stopping and interrupted():
                    stopping = True
                    source = iter(())
                    for task in self._again:
                        yield dropped(task)
                    self._again.clear()
                    for member in self._living():
                        member.worker.stop()  # type: ignore[union-attr] # it lives
                for member in self._living():
                    self._feed(member, source)
                busy = [member for member in self._living() if member.tasks]
                if not busy:
                    left = [*self._again, *([] if self._living() else _first(source))]
                    if not left:
                        return
                    raise self._nobody(len(self._again))
                yield from self._heard(stopping)
        finally:
            self._end()

    def _living(self) -> list[_Member]:
        return [member for member in self._members if member.worker is not None]

    def _start(self, member: _Member) -> None:
        try:
            member.worker = Worker(member.setting, self._inherited)
        except PersfsError as error:
            self._refusal = error
            warn(f"{error}")

    def _feed(self, member: _Member, source: Iterator[Task]) -> None:
        worker = member.worker
        while worker is not None and len(member.tasks) < _AHEAD and not member.alone:
            task = self._untried(member)
            if task is not None:
                if member.tasks:
                    self._again.appendleft(task)
                    return  # first what it has, then this by itself
            else:
                found = _first(source)
                if not found:
                    return
                task = found[0]
            member.tasks[task.number] = task
            with suppress(OSError):  # it has ended, which will be heard
                worker.add(task)

    def _untried(self, member: _Member) -> Task | None:
        """A task to be tried again, if this device is one for it: not if it failed at it, and another has not."""
        for task in self._again:
            tried = self._tried[task.number]
            if member not in tried or tried.issuperset(self._living()):
                self._again.remove(task)
                return task
        return None

    def _is_to_blame(self, task: Task) -> bool:
        """Whether a task has failed often enough, and everywhere."""
        return task.attempts + 1 >= _ATTEMPTS and self._tried[task.number].issuperset(self._living())

    def _heard(self, stopping: bool) -> Iterator[Outcome]:
        """What the processes say next."""
        speakers = {member.worker.connection: member for member in self._living() if member.worker}
        for connection in wait(list(speakers), _ASKED_EVERY):
            member = speakers[connection]  # type: ignore[index] # these are what was waited for
            try:
                kind, about = member.worker.connection.recv()  # type: ignore[union-attr] # it lives
            except (EOFError, OSError):
                yield from self._lost(member, stopping)
                continue
            if kind == "ready":
                member.name = about
            elif kind == "refused":
                self._refusal = about
                member.failures = _FAILURES
                yield from self._lost(member, stopping)
            else:
                yield from self._ended(member, about, stopping)

    def _ended(self, member: _Member, outcome: Outcome, stopping: bool) -> Iterator[Outcome]:
        task = member.tasks.pop(outcome.number)
        if outcome.end != "device":
            member.failures = 0
            yield outcome
            return
        member.failures += 1
        self._refusal = outcome.error
        self._tried[task.number].add(member)
        if stopping or self._is_to_blame(task):
            yield replace(outcome, end="dropped" if stopping else "failed")
        else:
            self._again.append(replace(task, attempts=task.attempts + 1))
        if member.failures >= _FAILURES:
            yield from self._lost(member, stopping)

    def _lost(self, member: _Member, stopping: bool) -> Iterator[Outcome]:
        """Take back what a device had to do, and start it anew or give it up."""
        worker, member.worker = member.worker, None
        if worker is None:
            return
        worker.kill()
        status = worker.close()
        member.failures += 1
        for task in member.tasks.values():
            self._tried[task.number].add(member)
            if stopping:
                yield dropped(task)
            elif self._is_to_blame(task):
                yield _killed(task, status)
            else:
                self._again.append(replace(task, attempts=task.attempts + 1))
        member.tasks.clear()
        if stopping:
            return
        if member.failures < _FAILURES:
            self._start(member)
        else:
            why = self._refusal or f"Its process ended with status {status}."
            warn(f"{member.name or member.setting.device or 'A device'} is not used any more. {why}")

    def _nobody(self, left: int) -> DeviceError:
        why = self._refusal or "Their processes ended."
        more = f"at least {left} photos are" if left else "photos are"
        error = DeviceError(f"No device is left, and {more} not done: the same command goes on from there. {why}")
        error.__cause__ = self._refusal
        return error

    def _end(self) -> None:
        for member in self._living():
            if member.tasks:
                member.worker.kill()  # type: ignore[union-attr] # it lives
            else:
                member.worker.finish()  # type: ignore[union-attr] # it lives
        for member in self._living():
            member.worker.close()  # type: ignore[union-attr] # it lives
            member.worker = None


def _first(source: Iterator[Task]) -> list[Task]:
    return list(islice(source, 1))


def failed(task: Task, error: PersfsError) -> Record:
    """The record of a task that nobody came to solve, or that ended who did."""
    return Record(
        name=task.name,
        path=str(task.job.path),
        status="failed",
        error={"kind": type(error).__name__, "message": str(error)},
        parameter_hash=task.parameter_hash,
        finished=now(),
    )


def _killed(task: Task, status: int) -> Outcome:
    how = f"signal {-status}" if status < 0 else f"status {status}"
    error = InputError(
        f"{task.job.title}: the process that solved it ended twice ({how}), the second time with nothing else to do. "
        "The driver may have crashed, or the memory not sufficed: try another device, or a smaller photo."
    )
    return Outcome(task.number, "failed", failed(task, error), error)


def dropped(task: Task) -> Outcome:
    """The outcome of a task that was not finished."""
    error = InputError(f"{task.job.title} was not finished, because an end was asked for.")
    return Outcome(task.number, "dropped", failed(task, error), error)
