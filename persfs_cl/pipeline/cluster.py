"""A batch on many machines: the workers of a scheduler of Dask share its tasks.

Tasks go out in chunks of some seconds of work, of which a few are with the scheduler for each device at any time. So it
holds the same whether there are a thousand photos or ten million. The workers write the results, and send back records.
The module is long because what may happen between a scheduler, workers and tasks is one thing to reason about.
"""

from __future__ import annotations

import queue
import secrets
import time
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from persfs_cl.checks import warn
from persfs_cl.errors import DeviceError, InputError, PersfsError, UnavailableError
from persfs_cl.pipeline.cluster_worker import Answer, Order, release, solve_photos, stop, versions
from persfs_cl.pipeline.crew import dropped, failed
from persfs_cl.pipeline.manifest import now
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workers import Setting

if TYPE_CHECKING:
    from dask.typing import Key
    from distributed import Client, Future

RESOURCE = "device"
"""What a worker has one of for each OpenCL device."""

_AHEAD = 2
"""Chunks with the scheduler for each device: the one at work, and the next."""
_FIRST, _MOST = 8, 256
"""Tasks of the first chunks, and of any chunk."""
_SECONDS = 10.0
"""That a chunk should take: long compared with its beginning and its end, when the device waits."""
_GROWTH = 4
"""A chunk has at most so many times the tasks of the ones before."""
_ATTEMPTS = 2
"""Of a photo that devices cannot do, though they do others."""
_RETRIES = 2
"""Of a chunk that ends with an error that nobody foresaw."""
_ASKED_EVERY = 0.2
"""Seconds between two looks whether an end is asked for."""
_LOOKED_EVERY = 2.0
"""Seconds between two looks at the workers."""
_GRACE = 60.0
"""Seconds for workers to end what they have in hand, when an end is asked for."""


@dataclass(frozen=True)
class Patience:
    """How long a run goes without a device, in seconds.

    Attributes
    ----------
    told : float
        Until a warning says so.
    others : float
        Until it ends, where there are workers, but none with a device.
    none : float
        Until it ends, where there are no workers: a queue of jobs may have others first.
    """

    told: float = 10.0
    others: float = 60.0
    none: float = 1800.0


class Cluster:
    """The workers of a scheduler that have the resource "device".

    Parameters
    ----------
    scheduler : str
        Its address, or the path of the file that it was told to describe itself in.
    setting : Setting
        As for a process here; memory and threads are left to the workers.
    max_memory : int, optional
        Bytes that photos may take together in a worker; half of its memory when not given.
    patience : Patience

    Raises
    ------
    InputError
        When results are to be sent instead of written.
    UnavailableError
        When Dask is not installed.
    """

    def __init__(
        self,
        scheduler: str,
        setting: Setting,
        max_memory: int | None = None,
        patience: Patience = Patience(),
    ) -> None:
        if setting.store is None:
            raise InputError.about(
                "scheduler", scheduler, "has workers that write their results: give a folder or a URL for them."
            )
        if isinstance(setting.store, FolderStore):
            setting = replace(setting, store=FolderStore(setting.store.root.absolute()))
        try:
            import distributed  # noqa: F401 - an extra
        except ImportError as error:
            raise UnavailableError(
                f"Dask's workers cannot be reached ({error}): pip install 'persfs-cl[cluster]'."
            ) from error
        self._scheduler, self._patience = scheduler, patience
        self._order = Order(secrets.token_hex(8), now(), setting, max_memory)

    def outcomes(self, tasks: Iterable[Task], interrupted: Callable[[], bool]) -> Generator[Outcome, None, None]:
        """As :meth:`persfs_cl.pipeline.crew.Crew.outcomes`.

        Raises
        ------
        InputError
            When the scheduler does not answer.
        DeviceError
            When it has no worker with a device, or loses all, or ends.
        """
        client = _connected(self._scheduler)
        try:
            yield from _Run(client, self._scheduler, self._order, self._patience).outcomes(tasks, interrupted)
        finally:
            client.close()


def _connected(scheduler: str) -> Client:
    from distributed import Client

    is_file = Path(scheduler).is_file()
    if not is_file and ":" not in scheduler:
        raise InputError.about(
            "scheduler",
            scheduler,
            "is no file, and no address such as tcp://head:8786: start 'dask scheduler', and give the address that it "
            "prints, or the file of its --scheduler-file.",
        )
    try:
        # The program may have a client of its own, which stays the one that Dask takes by default.
        return Client(
            None if is_file else scheduler, scheduler_file=scheduler if is_file else None, set_as_default=False
        )
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError.about(
            "scheduler",
            scheduler,
            f"does not answer ({' '.join(str(error).split())}): start 'dask scheduler', and give the address that it "
            "prints, or the file of its --scheduler-file.",
        ) from error


@dataclass(eq=False)
class _Chunk:
    """Tasks that are with the scheduler."""

    tasks: list[Task]
    future: Future[Answer]
    places: list[str]
    """Workers that it is for; all when empty."""


@dataclass(eq=False)
class _Run:
    """One run on a cluster."""

    client: Client
    scheduler: str
    order: Order
    patience: Patience
    heard: queue.SimpleQueue[Future[Answer]] = field(default_factory=queue.SimpleQueue)
    sent: dict[Key, _Chunk] = field(default_factory=dict)
    again: deque[list[Task]] = field(default_factory=deque)
    size: int = _FIRST
    exhausted: bool = False
    workers: dict[str, int] = field(default_factory=dict)
    """Addresses of those that are used, with the number of their devices."""
    given_up: dict[str, PersfsError] = field(default_factory=dict)
    tried: defaultdict[int, set[str]] = field(default_factory=lambda: defaultdict(set))
    """Which workers failed at a photo."""
    looked: float = -float("inf")
    seen: float = field(default_factory=time.monotonic)
    """When there was a worker."""
    told: bool = False

    def outcomes(self, tasks: Iterable[Task], interrupted: Callable[[], bool]) -> Iterator[Outcome]:
        """See :meth:`Cluster.outcomes`."""
        source = map(_everywhere, tasks)
        until: float | None = None
        try:
            while True:
                if until is None and interrupted():
                    until = time.monotonic() + _GRACE
                    self._stop()
                    for chunk in self.again:
                        yield from map(dropped, chunk)
                    self.again.clear()
                if until is None:
                    self._look()
                    self._feed(source)
                if not self.sent and (until is not None or self._is_over(source)):
                    return
                if until is not None and time.monotonic() > until:
                    for sent in self.sent.values():
                        yield from map(dropped, sent.tasks)
                    return
                yield from self._hear(stopping=until is not None)
        finally:
            self._end()

    def _look(self) -> None:
        """See which workers there are."""
        if time.monotonic() - self.looked < _LOOKED_EVERY:
            return
        try:
            found = self.client.scheduler_info(n_workers=-1)["workers"]
        except (OSError, TimeoutError) as error:
            raise self._lost() from error
        self.looked = time.monotonic()
        devices = {address: int(about["resources"].get(RESOURCE, 0)) for address, about in found.items()}
        equipped = {address: count for address, count in devices.items() if count > 0}
        self._use({address: count for address, count in equipped.items() if address not in self.given_up})
        if equipped and not self.workers:
            raise self._nobody()
        if self.workers:
            self.seen, self.told = self.looked, False
            return
        waited, patience = self.looked - self.seen, self.patience.others if found else self.patience.none
        if waited > patience:
            raise DeviceError(self._without(len(found)))
        if waited > self.patience.told and not self.told:
            self.told = True
            warn(f"{self._without(len(found))} Until then, nothing is done; it ends after {patience:g} s.")

    def _use(self, workers: dict[str, int]) -> None:
        """Use these workers, and send what was for others alone anew."""
        self.workers = workers
        for key, chunk in list(self.sent.items()):
            if chunk.places and not workers.keys() & set(chunk.places):
                del self.sent[key]
                chunk.future.cancel()
                self.again.append(chunk.tasks)

    def _feed(self, source: Iterator[Task]) -> None:
        most = _AHEAD * sum(self.workers.values())
        while len(self.sent) < most and (chunk := self._next(source)):
            self._send(chunk)

    def _next(self, source: Iterator[Task]) -> list[Task]:
        if self.again:
            return self.again.popleft()
        chunk = list(islice(source, self.size))
        self.exhausted = len(chunk) < self.size
        return chunk

    def _is_over(self, source: Iterator[Task]) -> bool:
        """Whether nothing is left, which has to be asked where there is nobody to do it."""
        if self.again or self.exhausted:
            return not self.again
        if not (chunk := list(islice(source, 1))):
            return True
        self.again.append(chunk)
        return False

    def _send(self, tasks: list[Task]) -> None:
        import cloudpickle

        avoided = set().union(*(self.tried.get(task.number, ()) for task in tasks))
        places = sorted(self.workers.keys() - avoided) or sorted(self.workers)
        pinned = bool(avoided or self.given_up)
        future = self.client.submit(
            solve_photos,
            versions(),
            # What is defined in the user's script goes with it.
            cloudpickle.dumps((self.order, tasks)),
            resources={RESOURCE: 1},
            workers=places if pinned else None,
            retries=_RETRIES,
            pure=False,
        )
        self.sent[future.key] = _Chunk(tasks, future, places if pinned else [])
        future.add_done_callback(self.heard.put)

    def _hear(self, *, stopping: bool) -> Iterator[Outcome]:
        """What the workers say next."""
        try:
            future = self.heard.get(timeout=_ASKED_EVERY)
        except queue.Empty:
            return
        chunk = self.sent.get(future.key)
        if chunk is None:
            return  # it was sent anew
        if future.status == "finished":
            try:
                answer = future.result(timeout=_LOOKED_EVERY)
            except TimeoutError:  # its worker is gone, and the scheduler has it done again
                future.add_done_callback(self.heard.put)
                return
            del self.sent[future.key]
            yield from self._answered(chunk, answer, stopping)
        elif future.status == "error":
            del self.sent[future.key]
            yield from self._failed(chunk, future, stopping)
        elif future.status == "pending":
            future.add_done_callback(self.heard.put)
        else:
            raise self._lost()

    def _answered(self, chunk: _Chunk, answer: Answer, stopping: bool) -> Iterator[Outcome]:
        if answer.refusal is not None:
            self._give_up(answer.worker, answer.refusal)
            if stopping:
                yield from map(dropped, chunk.tasks)
            else:
                self.again.append(chunk.tasks)
            return
        if answer.seconds > 0:
            pace = answer.seconds / len(chunk.tasks)
            self.size = max(1, min(_MOST, int(_SECONDS / pace), _GROWTH * max(self.size, 1)))
        tasks = {task.number: task for task in chunk.tasks}
        for outcome in answer.outcomes:
            task = tasks[outcome.number]
            if outcome.end in ("unfit", "device"):
                yield from self._refused(task, outcome, answer.worker, stopping)
            elif outcome.end == "dropped" and not stopping:
                self.again.append([task])
            else:
                self.tried.pop(task.number, None)
                yield outcome

    def _refused(self, task: Task, outcome: Outcome, worker: str, stopping: bool) -> Iterator[Outcome]:
        """A device failed at a photo, which is to blame where the device works."""
        if outcome.end == "device" and outcome.error is not None:
            self._give_up(worker, outcome.error)
        if stopping:
            yield dropped(task)
        elif outcome.end == "device":
            self.again.append([task])
        elif task.attempts + 1 >= _ATTEMPTS:
            self.tried.pop(task.number, None)
            yield replace(outcome, end="failed")
        else:
            self.tried[task.number].add(worker)
            self.again.append([replace(task, attempts=task.attempts + 1)])

    def _failed(self, chunk: _Chunk, future: Future[Answer], stopping: bool) -> Iterator[Outcome]:
        """The scheduler has given a chunk up."""
        from distributed import KilledWorker

        error = future.exception()
        if stopping:
            yield from map(dropped, chunk.tasks)
        elif not isinstance(error, KilledWorker):
            raise UnavailableError(
                f"A worker could not do what it was asked ({type(error).__name__}: {' '.join(str(error).split())}): "
                "install the same version of persfs-cl for all workers."
            ) from error
        elif len(chunk.tasks) > 1:
            # Which of them is to blame shows when each is by itself.
            self.again.extend([task] for task in chunk.tasks)
        else:
            (task,) = chunk.tasks
            blamed = InputError(
                f"{task.job.title}: {error.allowed_failures + 1} workers ended while they solved it alone. The driver "
                "may have crashed, or the memory not sufficed: see their logs, or try a smaller photo."
            )
            yield Outcome(task.number, "failed", failed(task, blamed), blamed)

    def _give_up(self, worker: str, why: PersfsError) -> None:
        if worker not in self.given_up:
            self.given_up[worker] = why
            warn(f"The worker {worker} is not used any more. {why}")
        self._use({address: count for address, count in self.workers.items() if address != worker})
        # There may be others, or an end.
        self.looked = -float("inf")

    def _stop(self) -> None:
        with suppress(OSError, TimeoutError):
            self.client.run(stop, self.order.run, wait=False, on_error="ignore")

    def _end(self) -> None:
        """Leave nothing with the workers."""
        futures = [chunk.future for chunk in self.sent.values()]
        self.sent.clear()
        with suppress(OSError, TimeoutError):
            if futures:
                self.client.cancel(futures)
            self.client.run(release, self.order.run, on_error="ignore")

    def _without(self, others: int) -> str:
        has = f"{others} workers, but none with" if others else "no worker with"
        return (
            f"The scheduler {self.scheduler} has {has} the resource {RESOURCE!r}: start one for each device by "
            f"""'dask worker {self.scheduler} --nworkers 1 --resources "{RESOURCE}=1"'."""
        )

    def _nobody(self) -> DeviceError:
        why = next(reversed(self.given_up.values()))
        error = DeviceError(
            f"No worker of {self.scheduler} can be used, and photos are not done: the same command goes on from there. "
            f"{next(reversed(self.given_up))}: {why}"
        )
        error.__cause__ = why
        return error

    def _lost(self) -> DeviceError:
        return DeviceError(
            f"The scheduler {self.scheduler} has gone, and photos are not done: start it again, and the same command "
            "goes on from there."
        )


def _everywhere(task: Task) -> Task:
    """The same task with paths that do not depend on where a process is."""
    job = task.job
    return replace(task, job=_absolute(replace(job, brightness=_absolute(job.brightness))))


def _absolute(value: Any) -> Any:
    """A dataclass with its paths made absolute."""
    paths = {one.name: path for one in fields(value) if isinstance(path := getattr(value, one.name), Path)}
    # What all tasks have in common stays one object, and is pickled once.
    return replace(value, **{name: path.absolute() for name, path in paths.items()}) if paths else value
