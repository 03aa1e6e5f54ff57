"""One device at work: threads that read, that solve, and that make results and write them, all at once.

Where the device has one process, two threads solve, so that one gets its photos onto the device while that works on
those of the other. What is held at any time is bounded: a photo is read only when there is room for all that will come
of it, by its number of pixels, and gives the room back when its results are written. A photo that is larger than all
the room is taken when there is nothing else.
"""

from __future__ import annotations

import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from persfs_cl._cl.device import Device
from persfs_cl.errors import DeviceError, InputError, KernelBuildError, PersfsError, Worded, spelled
from persfs_cl.pipeline.headers import pixels
from persfs_cl.pipeline.health import trouble
from persfs_cl.pipeline.job import Job, PreparedJob, finished, pose, prepare, read_job
from persfs_cl.pipeline.manifest import Record, as_entry, now, package_version
from persfs_cl.pipeline.plan import input_hash, stamps
from persfs_cl.pipeline.results import PhotoSolution, write
from persfs_cl.pipeline.room import Memory, bytes_for
from persfs_cl.pipeline.store import Shelf
from persfs_cl.solver.attempt import Attempt
from persfs_cl.solver.iterate import Watch
from persfs_cl.solver.options import Options
from persfs_cl.solver.pieces import busy_pixels, pieces
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.solver.solve import attempt, finish, told
from persfs_cl.surface.outcome import Status
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solution import Solution
from persfs_cl.told import Heard, hearing
from persfs_cl.wording import Spelling, marked

_ROOM_OF_READERS = 4
"""Photos that wait to be written for each writer: more would only hold memory."""

End = Literal["done", "failed", "dropped", "unfit", "device"]


@dataclass(frozen=True)
class Task:
    """One photo to be done.

    Attributes
    ----------
    number : int
        By which its outcome is told apart.
    name : str
        Of its folder below the output.
    job : Job
    parameter_hash : str
    attempts : int
        How often it was tried before, on devices that failed.
    """

    number: int
    name: str
    job: Job
    parameter_hash: str
    attempts: int = 0


@dataclass(frozen=True)
class Outcome:
    """What came of a task.

    Attributes
    ----------
    number : int
    end : {"done", "failed", "dropped", "unfit", "device"}
        "dropped": it was not finished, because an end was asked for. "unfit": this device cannot do it, though it can
        do others. "device": it can do nothing any more.
    record : Record
    error : PersfsError or None
    solution : Solution or None
        Where it is wanted.
    said : tuple of str
        The warnings of the record, with marks where they mention keywords, see :mod:`persfs_cl.wording`.
    """

    number: int
    end: End
    record: Record
    error: PersfsError | None = None
    solution: Solution | None = None
    said: tuple[str, ...] = ()


@dataclass(eq=False)
class _Work:
    """A task on its way."""

    task: Task
    said: list[Heard] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    known: dict[str, Any] = field(default_factory=dict)
    ready: PreparedJob | None = None
    problem: Problem | None = None
    attempted: Attempt | None = None
    solved: PhotoSolution | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        assert self.problem is not None  # noqa: S101 - for the type checker
        return self.problem.image.shape


class Station:
    """A device with its threads, in a process that hears the warnings of each, see :func:`persfs_cl.told.listen`.

    Parameters
    ----------
    device : Device
    shelf : Shelf or None
        Where results are put.
    saving : Saving
        Which files.
    options : Options
        Complete, see :func:`persfs_cl.solver.complete.complete`; the light and the material are the tasks' too.
    memory : Memory
        Gives photos the memory that they take.
    put : callable
        Called with each outcome, by any thread.
    solutions : bool
        Whether outcomes carry the solution.
    spelling : callable
        Of the keywords that records, reports and pages mention.
    readers, solvers, writers : int
        Numbers of threads.
    """

    def __init__(
        self,
        device: Device,
        *,
        shelf: Shelf | None,
        saving: Saving,
        options: Options,
        memory: Memory,
        put: Callable[[Outcome], None],
        solutions: bool = False,
        spelling: Spelling = str,
        readers: int = 2,
        solvers: int = 2,
        writers: int = 2,
    ) -> None:
        self._device, self._shelf, self._saving, self._options = device, shelf, saving, options
        self._put, self._solutions, self._spelling = put, solutions, spelling
        scheme = SCHEMES[options["scheme"]]
        self._in_rounds = scheme.model(options["light"], options["reflectance"]).in_rounds
        self._by_energy = scheme.by_energy
        self._memory = memory
        self._inbox: queue.SimpleQueue[Task | None] = queue.SimpleQueue()
        self._ready: deque[_Work] = deque()
        self._changed = threading.Condition()
        self._reading = readers
        self._most_waiting = solvers * busy_pixels(device)
        self._to_write: queue.Queue[_Work | None] = queue.Queue(_ROOM_OF_READERS * writers)
        self._stopped = threading.Event()
        self._readers = [threading.Thread(target=self._read_all, daemon=True) for _ in range(readers)]
        self._solvers = [threading.Thread(target=self._solve_all, daemon=True) for _ in range(solvers)]
        self._writers = [threading.Thread(target=self._write_all, daemon=True) for _ in range(writers)]
        for thread in (*self._readers, *self._solvers, *self._writers):
            thread.start()

    def add(self, task: Task) -> None:
        """Have a task done, when its turn comes."""
        self._inbox.put(task)

    def stop(self) -> None:
        """Drop what is not being written yet."""
        self._stopped.set()

    def finish(self) -> None:
        """Wait until everything that was added has an outcome. Nothing can be added any more."""
        for _ in self._readers:
            self._inbox.put(None)
        for thread in (*self._readers, *self._solvers):
            thread.join()
        for _ in self._writers:
            self._to_write.put(None)
        for thread in self._writers:
            thread.join()

    def _read_all(self) -> None:
        while (task := self._inbox.get()) is not None:
            work = _Work(task)
            with self._ending(work):
                with self._changed:
                    self._changed.wait_for(lambda: self._waiting < self._most_waiting)
                self._read(work)
                with self._changed:
                    self._ready.append(work)
                    self._changed.notify_all()
        with self._changed:
            self._reading -= 1
            self._changed.notify_all()

    def _read(self, work: _Work) -> None:
        job = work.task.job
        in_rounds = self._in_rounds or job.guide is not None
        wanted = bytes_for(pixels(job), self._saving, in_rounds=in_rounds, by_energy=self._by_energy)
        self._require_going()
        granted = threading.Event()
        self._memory.ask(work.task.number, wanted, granted.set)
        granted.wait()
        with self._step(work, "read"):
            with suppress(OSError):  # what the system refuses is said by those who read the files: they have the words
                work.known["stamps"] = stamps(job)
                work.known["input_hash"] = input_hash(job, work.known["stamps"])
            inputs = read_job(job)
            work.known["size"] = inputs.photo.image.shape[:2]
        with self._step(work, "prepare"):
            work.ready = prepare(inputs)
            work.problem = pose(work.ready, self._options)

    @property
    def _waiting(self) -> int:
        """Pixels that have been read and that no solver has taken."""
        return sum(math.prod(work.shape) for work in self._ready)

    def _solve_all(self) -> None:
        while group := self._next_group():
            self._solve(group)

    def _next_group(self) -> list[_Work]:
        """The photo that has waited longest, with others that can share its launches; none when all are done."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready or not self._reading)
            if not self._ready:
                return []
            waiting = list(self._ready)
            members, *_ = pieces([work.shape for work in waiting], self._device, self._options["precision"])
            group = [waiting[number] for number in members]
            for work in group:
                self._ready.remove(work)
            self._changed.notify_all()
            return group

    def _solve(self, group: Sequence[_Work]) -> None:
        began = time.perf_counter()
        problems = [work.problem for work in group if work.problem is not None]
        watch = Watch(lambda _iteration, _change: self._stopped.is_set())
        said: list[Heard] = []
        with self._ending(*group):
            self._require_going()
            try:
                with hearing() as said:
                    attempts = attempt(self._device, problems, self._options, watch, range(len(problems)))
            except Exception:
                if len(group) == 1:
                    raise
                # Which of them is to blame shows when each has launches of its own.
                for work in group:
                    self._solve([work])
                return
            if any(each.status is Status.STOPPED for each in attempts):
                self._require_going()
        if group[0].problem is None:
            return  # they have ended
        share = (time.perf_counter() - began) / len(group)
        for place, (work, attempted) in enumerate(zip(group, attempts, strict=True)):
            work.seconds["solve"] = share
            work.said += [one for one in said if one.place in (None, place)]
            work.attempted, work.problem = attempted, None
            self._to_write.put(work)

    def _finish(self, work: _Work) -> None:
        """Make a solution of what the device made of a photo, which is no more for it to do."""
        assert work.ready is not None  # noqa: S101 - for the type checker
        assert work.attempted is not None  # noqa: S101 - for the type checker
        began = time.perf_counter()
        with hearing() as said:
            [solution] = told([finish(self._device, work.attempted, self._options)], [0])
            work.seconds["solve"] += time.perf_counter() - began
            total = solution.elapsed.total + work.seconds["prepare"]
            solved = finished(work.ready, replace(solution, elapsed=replace(solution.elapsed, total=total)))
        work.said += said
        work.solved = replace(solved, warnings=self._warnings(work))
        work.ready = work.attempted = None

    def _write_all(self) -> None:
        while (work := self._to_write.get()) is not None:
            with self._ending(work):
                self._finish(work)
                if self._shelf is None:
                    record = self._record(work, ())
                else:
                    record = self._shelf.put(work.task.name, partial(self._fill, work))
                solution = work.solved.solution if self._solutions and work.solved else None
                told_of = tuple(map(_marked, work.said))
                self._end(work, Outcome(work.task.number, "done", record, solution=solution, said=told_of))

    def _fill(self, work: _Work, folder: Path) -> Record:
        assert work.solved is not None  # noqa: S101 - for the type checker
        with self._step(work, "write"):
            files = write(work.solved, folder, self._saving, name=work.task.name)
        return self._record(work, tuple(file.name for file in files))

    def _record(self, work: _Work, files: tuple[str, ...]) -> Record:
        assert work.solved is not None  # noqa: S101 - for the type checker
        return Record(**{**self._about(work), **work.solved.summary(files)}, status="done")

    def _warnings(self, work: _Work) -> tuple[str, ...]:
        return tuple(spelled(one.warning, self._spelling) for one in work.said)

    def _about(self, work: _Work) -> dict[str, Any]:
        """What is recorded of every photo, however it ended."""
        return {
            "name": work.task.name,
            "path": str(work.task.job.path),
            "warnings": self._warnings(work),
            "parameter_hash": work.task.parameter_hash,
            "version": package_version(),
            "device": str(self._device),
            "seconds": work.seconds,
            "finished": now(),
            **work.known,
        }

    def _end(self, work: _Work, outcome: Outcome) -> None:
        work.ready = work.problem = work.attempted = work.solved = None
        try:
            self._put(outcome)
        finally:
            self._memory.give_back(work.task.number)

    @contextmanager
    def _step(self, work: _Work, name: str) -> Iterator[None]:
        """A part of the work: what it says and how long it takes is noted, and it is not begun after a stop."""
        if name != "write":
            self._require_going()
        began = time.perf_counter()
        with hearing() as said:
            try:
                yield
            finally:
                work.said += said
                work.seconds[name] = time.perf_counter() - began

    def _require_going(self) -> None:
        if self._stopped.is_set():
            raise _Dropped

    @contextmanager
    def _ending(self, *works: _Work) -> Iterator[None]:
        """Whatever is raised becomes the outcome of the photos: one must not end the others."""
        try:
            yield
        except _Dropped:
            self._fail(works, "dropped", lambda work: InputError(f"{work.task.job.title} was not finished."))
        except (DeviceError, KernelBuildError) as error:
            blamed = error
            end: End = "unfit" if trouble(self._device, self._options) is None else "device"
            self._fail(works, end, lambda _: blamed)
        except PersfsError as error:
            refused = error
            self._fail(works, "failed", lambda _: refused)
        except MemoryError:
            why = "does not fit into memory: reduce its size, or let fewer be in work at a time."
            self._fail(works, "failed", lambda work: InputError(f"{work.task.job.title} {why}"))
        except Exception as error:  # noqa: BLE001 - one photo must not end the others
            said = f"{type(error).__name__}, which should not happen: {' '.join(str(error).split())}"
            self._fail(works, "failed", lambda work: InputError(f"{work.task.job.title}: {said}"))

    def _fail(
        self,
        works: Sequence[_Work],
        end: End,
        why: Callable[[_Work], PersfsError],
    ) -> None:
        for work in works:
            error = why(work)
            record = Record(**self._about(work), status="failed", error=as_entry(error, self._spelling))
            self._end(work, Outcome(work.task.number, end, record, error))


def _marked(heard: Heard) -> str:
    """A warning as text that can be sent anywhere, and worded there."""
    warning = heard.warning
    return marked(warning.parts) if isinstance(warning, Worded) else heard.message


class _Dropped(Exception):  # noqa: N818 - no error: an end was asked for
    pass
