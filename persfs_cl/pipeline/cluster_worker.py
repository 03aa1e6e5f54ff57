"""What a worker of Dask does for a batch: chunks of tasks go through the same station as those of a process here.

The station stays from chunk to chunk of a run. It ends with the run, or when a chunk of another run comes.
"""

from __future__ import annotations

import asyncio
import pickle
import queue
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from persfs_cl._cl.selection import select_device
from persfs_cl.errors import InputError, PersfsError, UnavailableError
from persfs_cl.io.limits import memory
from persfs_cl.pipeline.crew import dropped
from persfs_cl.pipeline.manifest import FOLDER, Known, Record
from persfs_cl.pipeline.plan import is_the_same
from persfs_cl.pipeline.room import Room
from persfs_cl.pipeline.station import Outcome, Station, Task
from persfs_cl.pipeline.store import FolderStore, Store
from persfs_cl.pipeline.workers import Setting
from persfs_cl.told import listen

if TYPE_CHECKING:
    from dask.typing import Key
    from distributed import Worker

_SHARE_OF_MEMORY = 0.5
_LEAST_THREADS = 2
_ASKED_EVERY = 0.5
"""Seconds between two looks whether a chunk is wanted still."""
_PATIENCE = 15.0
"""Seconds until a folder must be seen that another machine has made: what was not there is remembered for a while."""


@dataclass(frozen=True)
class Order:
    """What all chunks of a run have in common.

    Attributes
    ----------
    run : str
        By which runs are told apart.
    began : str
        When, as :func:`persfs_cl.pipeline.manifest.now` writes it.
    setting : Setting
        Its memory and its threads are the worker's to say.
    max_memory : int or None
        Bytes that photos may take together; None takes half of what the worker has.
    """

    run: str
    began: str
    setting: Setting
    max_memory: int | None


@dataclass(frozen=True)
class Answer:
    """What has become of a chunk.

    Attributes
    ----------
    worker : str
        Its address.
    seconds : float
    outcomes : sequence of Outcome
        One for each task.
    refusal : PersfsError or None
        Why this worker can do nothing at all. There are no outcomes then.
    """

    worker: str
    seconds: float = 0.0
    outcomes: Sequence[Outcome] = ()
    refusal: PersfsError | None = None


class _Desk:
    """The station of a run, in this process."""

    def __init__(self, order: Order, room: int, threads: int) -> None:
        self._order, self._open = order, ExitStack()
        self._waiting: dict[int, queue.SimpleQueue[Outcome]] = {}
        setting, store = order.setting, _store(order)
        device = select_device(setting.device)
        device.real(setting.options["precision"])
        _require_sight(store)
        self._store = store
        self._station = Station(
            device,
            shelf=self._open.enter_context(store.opened()),
            saving=setting.saving,
            options=setting.options,
            memory=Room(room),
            put=self._put,
            spelling=setting.spelling,
            readers=threads,
            writers=threads,
        )

    @property
    def idle(self) -> bool:
        """Whether it has nothing to do."""
        return not self._waiting

    def outcomes(self, tasks: Sequence[Task], is_wanted: Callable[[], bool]) -> list[Outcome]:
        """Do a chunk, but for what is complete: the worker that had it before may have ended too soon to say so."""
        found = self._store.records([task.name for task in tasks])
        ended = [
            Outcome(task.number, "done", found[task.name])
            for task in tasks
            if task.name in found and _was_done(self._order, task, found[task.name])
        ]
        here: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        left = {task.number: task for task in tasks}
        for outcome in ended:
            del left[outcome.number]
        self._waiting.update(dict.fromkeys(left, here))
        for task in left.values():
            self._station.add(task)
        looked = -float("inf")
        while len(ended) < len(tasks):
            if time.monotonic() - looked > _ASKED_EVERY:
                looked = time.monotonic()
                if not is_wanted():
                    self.stop()
            with suppress(queue.Empty):
                ended.append(here.get(timeout=_ASKED_EVERY))
        return ended

    def stop(self) -> None:
        """Drop what is not being written yet."""
        self._station.stop()

    def close(self) -> None:
        """End, without what is not being written yet."""
        self._station.stop()
        self._station.finish()
        self._open.close()

    def _put(self, outcome: Outcome) -> None:
        self._waiting.pop(outcome.number).put(outcome)


class _Process:
    """What this process has of all runs."""

    lock = threading.Lock()
    desks: dict[str, _Desk] = {}  # noqa: RUF012 - one a process is meant
    ended: set[str] = set()  # noqa: RUF012


@cache
def versions() -> Mapping[str, str]:
    """Of all on which the bits of results depend, or whether processes understand each other."""
    found = {"Python": "{}.{}".format(*sys.version_info)}
    for name in ("persfs-cl", "numpy", "pyopencl", "distributed"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


def solve_photos(expected: Mapping[str, str], payload: bytes) -> Answer:
    """Do a chunk of tasks, in a thread of a worker.

    Parameters
    ----------
    expected : mapping
        The versions of who asks, see :func:`versions`.
    payload : bytes
        Order and tasks, pickled: what another version would not understand.
    """
    from distributed import get_worker

    worker = get_worker()
    began = time.perf_counter()
    own = versions()
    if other := [f"{name} {own[name]}, not {wanted}" for name, wanted in expected.items() if own.get(name) != wanted]:
        refusal = UnavailableError(f"It has {'; '.join(other)}: install the same versions everywhere.")
        return Answer(worker.address, refusal=refusal)
    order: Order
    order, tasks = pickle.loads(payload)
    try:
        desk = _desk(order, worker)
    except PersfsError as error:
        return Answer(worker.address, refusal=error)
    if desk is None:
        return Answer(worker.address, outcomes=[dropped(task) for task in tasks])
    is_wanted = partial(_is_wanted, worker, worker.get_current_task())
    outcomes = desk.outcomes(tasks, is_wanted)
    if not is_wanted():
        _close(order.run)  # whoever asked may have gone
    return Answer(worker.address, time.perf_counter() - began, outcomes)


async def stop(run: str) -> None:
    """Drop what a run has in hand here, but for what is being written."""
    _Process.ended.add(run)
    if (desk := _Process.desks.get(run)) is not None:
        desk.stop()


async def release(run: str) -> None:
    """End what a run has here."""
    await asyncio.to_thread(_close, run)


def _desk(order: Order, worker: Worker) -> _Desk | None:
    """That of a run, made if need be; None when the run has ended."""
    with _Process.lock:
        if order.run in _Process.ended:
            return None
        for run, other in list(_Process.desks.items()):
            # Its run may have been killed; if not, it gets a new one.
            if run != order.run and other.idle:
                _Process.desks.pop(run).close()
        if order.run not in _Process.desks:
            listen()
            limit = worker.memory_manager.memory_limit or memory()
            room = int(_SHARE_OF_MEMORY * limit) if order.max_memory is None else order.max_memory
            threads = max(_LEAST_THREADS, worker.state.nthreads // 2)
            _Process.desks[order.run] = _Desk(order, room, threads)
        return _Process.desks[order.run]


def _close(run: str) -> None:
    _Process.ended.add(run)
    with _Process.lock:
        if (desk := _Process.desks.pop(run, None)) is not None:
            desk.close()


def _is_wanted(worker: Worker, key: Key) -> bool:
    """Whether a chunk is not cancelled: by its client, or because that is gone."""
    task = worker.state.tasks.get(key)
    return task is not None and task.state != "cancelled"


def _was_done(order: Order, task: Task, record: Record) -> bool:
    """Whether a result is of this run: an earlier one may be wanted anew, though nothing has changed."""
    is_new = record.finished >= order.began and record.version == versions()["persfs-cl"]
    return is_new and record.status == "done" and is_the_same(task.job, task.parameter_hash, Known.of(record))


def _store(order: Order) -> Store:
    store = order.setting.store
    assert store is not None  # noqa: S101 - for the type checker: a cluster is not made without
    return store


def _require_sight(store: Store) -> None:
    """Refuse to make a folder of one's own where that of the run is meant."""
    if not isinstance(store, FolderStore):
        return
    until = time.monotonic() + _PATIENCE
    while not (store.root / FOLDER).is_dir():
        if time.monotonic() > until:
            raise InputError(
                f"It does not see {store.root / FOLDER}, which the run has made: let all machines have the folder "
                "under the same path, or write to a URL."
            )
        time.sleep(0.2)
