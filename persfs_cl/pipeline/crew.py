"""The devices of this machine, and how they share the tasks."""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from multiprocessing.connection import wait

from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError, InputError, KernelBuildError, PersfsError
from persfs_cl.pipeline.manifest import Record, as_entry, now
from persfs_cl.pipeline.members import Member, Team
from persfs_cl.pipeline.room import Room
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.workers import LAST_WORDS, Setting, Worker

_FEWEST, _FEWEST_ALONE, _FEWEST_SHARED, _MOST = 8, 24, 2, 256
"""Tasks that a process has in hand: at the least, where its device is one of several, the only one, or shared with
other processes; and at most. Enough to read and to write while it solves, and for small photos to share launches."""
_DEATHS = 4
"""A device whose processes end so often, with nothing done in between, is given up."""
_KILLED = 9
"""The signal by which a system that lacks memory ends processes."""
_ASKED_EVERY = 0.2
"""Seconds between two looks whether an end is asked for."""


class Crew:
    """Processes that share tasks, one for each device, or one for each core where the device is the processor itself.

    A process that ends is started anew, and so is a device that works no more; what it had to do goes back to all, and
    is done when nothing else is left, each by itself. A photo whose process ends then too, on every device, is to
    blame, unless the devices do nothing else either. After some ends in a row a device is given up, and the others go
    on. A photo that a device refuses, but that does others, is for the others.

    Parameters
    ----------
    settings : sequence of Setting
        One for each device.
    inherited : sequence of int
        File descriptors that the processes are to hold too.
    """

    def __init__(self, settings: Sequence[Setting], inherited: Sequence[int] = ()) -> None:
        self._teams = [Team(setting) for setting in settings]
        self._inherited = inherited
        self._room = Room(max(setting.memory for setting in settings))
        self._fresh: deque[Task] = deque()
        """Taken back from a device that was to blame."""
        self._again: deque[Task] = deque()
        """To be done once more, by themselves."""
        self._tried: defaultdict[int, set[Team]] = defaultdict(set)
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
            for team in self._teams:
                if self._start(team) is None:
                    self._give_up(team)
            while True:
                if not stopping and interrupted():
                    stopping = True
                    source = iter(())
                    yield from map(dropped, self._taken_back())
                    for member in self._members():
                        member.worker.stop()
                for team in self._living():
                    self._feed(team, source)
                if not any(team.is_busy for team in self._living()):
                    if not self._living() and (left := [*self._fresh, *self._again, *_first(source)]):
                        raise self._nobody(len(left))
                    for team in self._living():
                        yield from self._blamed(team)
                    return
                yield from self._heard(stopping)
        finally:
            self._end()

    def _living(self) -> list[Team]:
        return [team for team in self._teams if team.members]

    def _members(self) -> list[Member]:
        return [member for team in self._teams for member in team.members]

    def _taken_back(self) -> list[Task]:
        suspects = [task for team in self._teams for task, _ in team.suspects]
        left = [*self._fresh, *self._again, *suspects]
        self._fresh.clear()
        self._again.clear()
        for team in self._teams:
            team.suspects.clear()
        return left

    def _start(self, team: Team) -> Member | None:
        """A further process for a device; None where the system starts none."""
        try:
            member = Member(Worker(team.setting, self._inherited))
        except DeviceError as error:
            if not team.members:
                team.refusal = error
            return None
        team.members.append(member)
        return member

    def _feed(self, team: Team, source: Iterator[Task]) -> None:
        """Give the processes of a device what they lack, and others a start where there is something left to do."""
        if team.is_shared or (team.most > 1 and not any(member.ready for member in team.members)):
            fewest = _FEWEST_SHARED
        else:
            fewest = _FEWEST if len(self._living()) > 1 else _FEWEST_ALONE
        if team.is_careful:
            return
        for member in team.members:
            while len(member.tasks) < min(_MOST, max(fewest, member.window)):
                if (task := self._next(team, source)) is None:
                    break
                self._give(member, task)
                if task.attempts:
                    team.share_cores()
                    return
        while team.is_shared and len(team.members) < team.most:
            if (task := self._next(team, source)) is None:
                break
            if (further := self._start(team)) is None:
                self._fresh.appendleft(task)
                team.most = len(team.members)
                break
            self._give(further, task)
        team.share_cores()

    def _give(self, member: Member, task: Task) -> None:
        member.tasks[task.number] = task
        with suppress(OSError):  # it has ended, which will be heard
            member.worker.add(task)

    def _next(self, team: Team, source: Iterator[Task]) -> Task | None:
        """What a device is to do next, if there is anything for it now."""
        if self._fresh:
            return self._fresh.popleft()
        for task in _first(source):
            return task
        if team.is_busy:
            return None  # first what it has, then each of the others by itself
        for task in self._again:
            tried = self._tried[task.number]
            if team not in tried or tried.issuperset(self._living()):
                self._again.remove(task)
                return task
        return None

    def _heard(self, stopping: bool) -> Iterator[Outcome]:
        """What the processes say next."""
        speakers = {member.worker.connection: (team, member) for team in self._teams for member in team.members}
        for connection in wait(list(speakers), _ASKED_EVERY):
            team, member = speakers[connection]  # type: ignore[index] # these are what was waited for
            if member not in team.members:
                continue  # it was given up with its device meanwhile
            try:
                kind, about = member.worker.connection.recv()
            except (EOFError, OSError):
                yield from self._lost(team, member, stopping)
                continue
            if kind == "ready":
                member.ready = True
                team.name, team.is_shared = about.name, about.is_shared
            elif kind == "asks":
                number, wanted = about
                self._room.ask(number, wanted, partial(member.worker.grant, number))
            elif kind == "outcome":
                yield from self._ended(team, member, about, stopping)
            elif isinstance(about, (DeviceError, KernelBuildError)):
                if not any(other.ready for other in team.members):
                    team.refusal = about
                    team.deaths = _DEATHS
                yield from self._lost(team, member, stopping)
            else:
                raise about

    def _ended(self, team: Team, member: Member, outcome: Outcome, stopping: bool) -> Iterator[Outcome]:
        self._room.give_back(outcome.number)
        task = member.tasks.pop(outcome.number)
        member.pace()
        if outcome.end == "done":
            team.deaths = 0
            yield from self._blamed(team)
        if outcome.end not in ("unfit", "device"):
            yield outcome
        elif stopping:
            yield replace(outcome, end="dropped")
        elif outcome.end == "device":
            team.refusal = outcome.error
            member.tasks[task.number] = task
            yield from self._lost(team, member, stopping)
        else:
            tried = self._tried[task.number]
            tried.add(team)
            if tried.issuperset(self._living()):
                yield replace(outcome, end="failed")
            else:
                self._again.append(task)

    def _blamed(self, team: Team) -> Iterator[Outcome]:
        """The photos that ended its processes, for the device itself is well."""
        suspects, team.suspects = team.suspects, []
        for task, status in suspects:
            yield _killed(task, status)

    def _lost(self, team: Team, member: Member, stopping: bool) -> Iterator[Outcome]:
        """Take back what a process had to do, and start it anew, or give up its device."""
        status = self._dismiss(team, member)
        tasks = list(member.tasks.values())
        if others := any(other.ready for other in team.members):
            # The device works. Who never came to anything, or was ended from outside, may have been one too many.
            if not member.ready or status == -_KILLED:
                team.most = len(team.members)
        else:
            team.deaths += 1
        if stopping:
            yield from map(dropped, tasks)
            return
        if not member.ready:
            self._fresh.extend(tasks)  # it never looked at them
        for task in tasks if member.ready else ():
            tried = self._tried[task.number]
            tried.add(team)
            if task.attempts and tried.issuperset({team, *self._living()}):
                team.suspects.append((task, status))
            else:
                self._again.append(replace(task, attempts=task.attempts + 1))
        # Those that are left go on, and others are started when there is something for them.
        if others or (team.deaths < _DEATHS and (team.members or self._start(team))):
            return
        self._give_up(team, _ending(status))

    def _dismiss(self, team: Team, member: Member) -> int:
        """Have a process end at once, and say how it ended."""
        team.members.remove(member)
        member.worker.kill()
        status = member.worker.close()
        for number in member.tasks:
            self._room.give_back(number)
        return status

    def _give_up(self, team: Team, ending: str = "") -> None:
        """Leave what a device had to do to the others."""
        for member in list(team.members):
            self._dismiss(team, member)
            self._fresh.extend(member.tasks.values())  # it is not known to be to blame for anything
        why = team.refusal or f"Its processes ended, the last with {ending}."
        self._again.extend(task for task, _ in team.suspects)
        team.suspects.clear()
        again = list(self._again)
        self._again.clear()
        for task in again:
            # Where nobody else failed, it was to blame, and the others need not be careful.
            own = self._tried[task.number] == {team}
            (self._fresh if own else self._again).append(replace(task, attempts=0) if own else task)
        team.deaths = _DEATHS
        if any(other.deaths < _DEATHS for other in self._teams):  # or else an error says so
            warn(f"{team.title} is not used any more. {why}")

    def _nobody(self, left: int) -> DeviceError:
        refusal = next((team.refusal for team in self._teams if team.refusal), None)
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
        for member in self._members():
            if member.tasks or not member.ready:
                member.worker.kill()
            else:
                member.worker.finish()
        # A driver may hang in that: not for each of them.
        until = time.monotonic() + LAST_WORDS
        for team in self._teams:
            for member in team.members:
                member.worker.close(max(0.0, until - time.monotonic()))
            team.members.clear()


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
