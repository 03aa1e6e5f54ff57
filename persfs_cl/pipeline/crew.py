"""The devices of this machine, and how they share the tasks."""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from multiprocessing.connection import wait

from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError, InputError, KernelBuildError, PersfsError
from persfs_cl.pipeline.manifest import Record, as_entry, now
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.workers import Setting, Worker

_FEWEST, _FEWEST_ALONE, _MOST = 8, 24, 256
"""Tasks that a device has in hand, at the least, at the least where it is the only one, and at most: enough to read and
to write while it solves, and for small photos to share launches."""
_SECONDS_AHEAD = 3.0
"""In between, as many as it does in this time: more would leave other devices with nothing at the end."""
_MEASURED_EVERY = 0.5
"""Seconds over which a rate is taken."""
_DEATHS = 4
"""A device whose process ends so often, with nothing done in between, is given up."""
_ASKED_EVERY = 0.2
"""Seconds between two looks whether an end is asked for."""


@dataclass(eq=False)
class _Member:
    """A device, and what it has to do.

    Attributes
    ----------
    setting : Setting
    worker : Worker or None
        None once it is given up.
    ready : bool
        Whether the process has solved something, if only to show that it can.
    name : str
    tasks : dict
        By their numbers.
    deaths : int
        Processes that ended in a row, with nothing done in between.
    window : int
        How many it is to have.
    ended, since : int, float
        Tasks that have ended since a time.
    refusal : PersfsError or None
        What it said last of why it does not work.
    suspects : list
        Tasks that were by themselves when the process ended, and how it ended. They are to blame if the device goes on.
    """

    setting: Setting
    worker: Worker | None = None
    ready: bool = False
    name: str = ""
    tasks: dict[int, Task] = field(default_factory=dict)
    deaths: int = 0
    window: int = 0
    ended: int = 0
    since: float = field(default_factory=time.monotonic)
    refusal: PersfsError | None = None
    suspects: list[tuple[Task, int]] = field(default_factory=list)

    @property
    def title(self) -> str:
        """What warnings call it."""
        return self.name or ("A device" if self.setting.device is None else f"Device {self.setting.device}")

    def pace(self) -> None:
        """Note that a task has ended, and from time to time how many it is to have at a time."""
        self.ended += 1
        seconds = time.monotonic() - self.since
        if seconds > _MEASURED_EVERY:
            self.window = int(self.ended * _SECONDS_AHEAD / seconds)
            self.ended, self.since = 0, time.monotonic()

    @property
    def alone(self) -> bool:
        """Whether it has a task that was tried before, which nothing else shall be near."""
        return any(task.attempts for task in self.tasks.values())


class Crew:
    """Processes that share tasks, one for each device.

    A device whose process ends, or that works no more, is started anew; what it had to do goes back to all, and is done
    when nothing else is left, each by itself. A photo whose process ends then too, on every device, is to blame, unless
    the devices do nothing else either. After some ends in a row a device is given up, and the others go on. A photo
    that a device refuses, but that does others, is for the others.

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
        self._fresh: deque[Task] = deque()
        """Taken back from a device that was to blame."""
        self._again: deque[Task] = deque()
        """To be done once more, by themselves."""
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
        PersfsError
            When what is asked for is impossible on any device.
        """
        source = iter(tasks)
        stopping = False
        try:
            for member in self._members:
                self._start(member)
                if member.worker is None:
                    self._give_up(member)
            while True:
                if not stopping and interrupted():
                    stopping = True
                    source = iter(())
                    yield from map(dropped, self._taken_back())
                    for member in self._living():
                        member.worker.stop()  # type: ignore[union-attr] # it lives
                for member in self._living():
                    self._feed(member, source)
                if not any(member.tasks for member in self._living()):
                    if not self._living() and (left := [*self._fresh, *self._again, *_first(source)]):
                        raise self._nobody(len(left))
                    for member in self._living():
                        yield from self._blamed(member)
                    return
                yield from self._heard(stopping)
        finally:
            self._end()

    def _living(self) -> list[_Member]:
        return [member for member in self._members if member.worker is not None]

    def _taken_back(self) -> list[Task]:
        suspects = [task for member in self._members for task, _ in member.suspects]
        left = [*self._fresh, *self._again, *suspects]
        self._fresh.clear()
        self._again.clear()
        for member in self._members:
            member.suspects.clear()
        return left

    def _start(self, member: _Member) -> None:
        member.ready = False
        try:
            member.worker = Worker(member.setting, self._inherited)
        except DeviceError as error:
            member.refusal = error

    def _feed(self, member: _Member, source: Iterator[Task]) -> None:
        worker = member.worker
        fewest = _FEWEST if len(self._living()) > 1 else _FEWEST_ALONE
        while worker is not None and len(member.tasks) < min(_MOST, max(fewest, member.window)) and not member.alone:
            task = self._next(member, source)
            if task is None:
                return
            member.tasks[task.number] = task
            with suppress(OSError):  # it has ended, which will be heard
                worker.add(task)

    def _next(self, member: _Member, source: Iterator[Task]) -> Task | None:
        """What a device is to do next, if there is anything for it now."""
        if self._fresh:
            return self._fresh.popleft()
        for task in _first(source):
            return task
        if member.tasks:
            return None  # first what it has, then each of the others by itself
        for task in self._again:
            tried = self._tried[task.number]
            if member not in tried or tried.issuperset(self._living()):
                self._again.remove(task)
                return task
        return None

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
                member.name, member.ready = about, True
            elif kind == "outcome":
                yield from self._ended(member, about, stopping)
            elif isinstance(about, (DeviceError, KernelBuildError)):
                member.refusal = about
                member.deaths = _DEATHS
                yield from self._lost(member, stopping)
            else:
                raise about

    def _ended(self, member: _Member, outcome: Outcome, stopping: bool) -> Iterator[Outcome]:
        task = member.tasks.pop(outcome.number)
        member.pace()
        if outcome.end == "done":
            member.deaths = 0
            yield from self._blamed(member)
        if outcome.end not in ("unfit", "device"):
            yield outcome
        elif stopping:
            yield replace(outcome, end="dropped")
        elif outcome.end == "device":
            member.refusal = outcome.error
            member.tasks[task.number] = task
            yield from self._lost(member, stopping)
        else:
            tried = self._tried[task.number]
            tried.add(member)
            if tried.issuperset(self._living()):
                yield replace(outcome, end="failed")
            else:
                self._again.append(task)

    def _blamed(self, member: _Member) -> Iterator[Outcome]:
        """The photos that ended its processes, for the device itself is well."""
        suspects, member.suspects = member.suspects, []
        for task, status in suspects:
            yield _killed(task, status)

    def _lost(self, member: _Member, stopping: bool) -> Iterator[Outcome]:
        """Take back what a device had to do, and start it anew or give it up."""
        worker, member.worker = member.worker, None
        if worker is None:
            return
        worker.kill()
        status = worker.close()
        member.deaths += 1
        tasks = list(member.tasks.values())
        member.tasks.clear()
        if stopping:
            yield from map(dropped, tasks)
            return
        if not member.ready:
            self._fresh.extend(tasks)  # it never looked at them
        for task in tasks if member.ready else ():
            tried = self._tried[task.number]
            tried.add(member)
            if task.attempts and tried.issuperset(self._living()):
                member.suspects.append((task, status))
            else:
                self._again.append(replace(task, attempts=task.attempts + 1))
        if member.deaths < _DEATHS:
            self._start(member)
        if member.worker is None:
            self._give_up(member, _ending(status))

    def _give_up(self, member: _Member, ending: str = "") -> None:
        """Leave what a device had to do to the others."""
        why = member.refusal or f"Its processes ended, the last with {ending}."
        self._again.extend(task for task, _ in member.suspects)
        member.suspects.clear()
        again = list(self._again)
        self._again.clear()
        for task in again:
            # Where nobody else failed, it was to blame, and the others need not be careful.
            own = self._tried[task.number] == {member}
            (self._fresh if own else self._again).append(replace(task, attempts=0) if own else task)
        member.deaths = _DEATHS
        if any(other.deaths < _DEATHS for other in self._members):  # or else an error says so
            warn(f"{member.title} is not used any more. {why}")

    def _nobody(self, left: int) -> DeviceError:
        refusal = next((member.refusal for member in self._members if member.refusal), None)
        if isinstance(refusal, DeviceError) and refusal.argument == "device":
            return refusal  # there is none such: going on later would not help
        photos = "1 photo is" if left == 1 else f"{left} photos are"
        error = DeviceError(f"No device is left, and at least {photos} not done: the same command goes on from there.")
        if refusal is None:
            return error.adding("Their processes ended.")
        error = error.adding(str(refusal))
        error.__cause__ = refusal
        return error

    def _end(self) -> None:
        for member in self._living():
            if member.tasks or not member.ready:
                member.worker.kill()  # type: ignore[union-attr] # it lives
            else:
                member.worker.finish()  # type: ignore[union-attr] # it lives
        for member in self._living():
            member.worker.close()  # type: ignore[union-attr] # it lives
            member.worker = None


def _ending(status: int) -> str:
    return f"signal {-status}" if status < 0 else f"status {status}"


def _first(source: Iterator[Task]) -> list[Task]:
    return list(islice(source, 1))


def failed(task: Task, error: PersfsError) -> Record:
    """The record of a task that nobody came to solve, or that ended who did."""
    return Record(
        name=task.name,
        path=str(task.job.path),
        status="failed",
        error=as_entry(error),
        parameter_hash=task.parameter_hash,
        finished=now(),
    )


def _killed(task: Task, status: int) -> Outcome:
    error = InputError(
        f"{task.job.title}: the process that solved it ended twice ({_ending(status)}), the second time with nothing "
        "else to do. The driver may have crashed, or the memory not sufficed: try another device, or a smaller photo."
    )
    return Outcome(task.number, "failed", failed(task, error), error)


def dropped(task: Task) -> Outcome:
    """The outcome of a task that was not finished."""
    error = InputError(f"{task.job.title} was not finished, because an end was asked for.")
    return Outcome(task.number, "dropped", failed(task, error), error)
