"""Folders of small photographs, and what has become of them in a batch."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import persfs_cl as ps
from persfs_cl._cl.selection import select_device
from persfs_cl.pipeline.job import Job
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.manifest import FOLDER, Record, now
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.plan import Plan, input_hash, stamps
from persfs_cl.pipeline.room import Room
from persfs_cl.pipeline.run import Again, Batch, BatchResult
from persfs_cl.pipeline.shards import Shard
from persfs_cl.pipeline.station import Outcome, Station, Task
from persfs_cl.pipeline.store import RECORD, Store
from persfs_cl.pipeline.workers import Setting
from persfs_cl.surface.saving import Saving

SHAPE = (24, 30)
FOCAL = 30.0
LIGHT = ps.FlashLight()
PLAN = Plan(camera=CameraChoice(FOCAL), light=LIGHT, saving=Saving.of("depth.npy"))


def photos(folder: Path, count: int, shape: tuple[int, int] = SHAPE, *, first: int = 0) -> list[str]:
    """Write photos of bumps, each of another brightness, and return their names."""
    folder.mkdir(parents=True, exist_ok=True)
    image = ps.bump(shape, light=LIGHT).image
    image /= image.max()
    names = [f"{number:05}.png" for number in range(first, first + count)]
    for number, name in enumerate(names, first):
        Image.fromarray((255 * image * (0.5 + 0.5 * (number * 0.618 % 1.0))).astype(np.uint8)).save(folder / name)
    return names


def lines(out: Path) -> list[Record]:
    """All records of the manifest, the oldest run's first."""
    return [
        record
        for file in sorted((out / FOLDER).glob("*.jsonl"))
        for line in file.read_bytes().splitlines()
        if (record := Record.read(line)) is not None
    ]


def times_done(out: Path) -> Counter[str]:
    """How often the manifest says of each photo that it was done."""
    return Counter(record.name for record in lines(out) if record.status == "done")


def require_whole(out: Path, names: Iterable[str], files: Iterable[str] = ("depth.npy",)) -> None:
    """Each photo has its result, each result all its files, and there is nothing that is not finished."""
    expected = {*files, RECORD}
    assert [path.name for path in out.rglob(".*")] == []
    there = {path.parent.relative_to(out).as_posix() for path in out.rglob(RECORD)}
    assert there == set(names)
    for name in there:
        assert {path.name for path in (out / name).iterdir()} == expected
        assert np.isfinite(np.load(out / name / "depth.npy")).any()
        assert json.loads((out / name / RECORD).read_text())["name"] == name


class Here:
    """In place of a crew: one device, in this process, which must be one that is listening.

    Parameters
    ----------
    settings : sequence of Setting
        Of the device.
    _inherited : sequence of int
    """

    def __init__(self, settings: Sequence[Setting], _inherited: Sequence[int] = ()) -> None:
        [self._setting] = settings

    def outcomes(self, tasks: Iterable[Task], _interrupted: Callable[[], bool]) -> Generator[Outcome, None, None]:
        setting, found = self._setting, list[Outcome]()
        assert setting.store is not None
        with setting.store.opened() as shelf:
            station = Station(
                select_device(setting.device),
                shelf=shelf,
                saving=setting.saving,
                options=setting.options,
                memory=Room(setting.memory),
                put=found.append,
            )
            for task in tasks:
                station.add(task)
            station.finish()
        yield from found


class Pretender:
    """Does tasks without solving anything, and remembers which; some it may fail at, or be ended before.

    Parameters
    ----------
    store : Store or None
    bad : collection of str
        Names of photos that fail.
    notices : int or None
        So many outcomes are told; of the next one, the result is there, but nobody hears of it.
    """

    def __init__(self, store: Store | None, bad: Sequence[str] = (), notices: int | None = None) -> None:
        self._store, self._bad, self._notices = store, bad, notices
        self.did: list[str] = []

    def __call__(self, _held: Sequence[int]) -> Pretender:
        return self

    def outcomes(self, tasks: Iterable[Task], interrupted: Callable[[], bool]) -> Generator[Outcome, None, None]:
        assert self._store is not None
        with self._store.opened() as shelf:
            for task in tasks:
                if interrupted():
                    return
                self.did.append(task.name)
                if task.name in self._bad:
                    error = ps.InputError(f"{task.name} is bad.")
                    said = {"kind": "InputError", "message": str(error)}
                    record = Record(**about(task.job, task), status="failed", error=said)
                    yield Outcome(task.number, "failed", record, error)
                    continue

                def fill(folder: Path, task: Task = task) -> Record:
                    np.save(folder / "depth.npy", np.ones(3))
                    return Record(**about(task.job, task), status="done", files=("depth.npy",))

                record = shelf.put(task.name, fill)
                if self._notices is not None and len(self.did) > self._notices:
                    raise KeyboardInterrupt
                yield Outcome(task.number, "done", record)


def about(job: Job, task: Task) -> dict[str, Any]:
    stamped = stamps(job)
    return {
        "name": task.name,
        "path": str(job.path),
        "input_hash": input_hash(job, stamped),
        "stamps": stamped,
        "parameter_hash": task.parameter_hash,
        "finished": now(),
    }


def pretend(
    folder: Path,
    store: Store,
    *,
    plan: Plan = PLAN,
    again: Again = "changed",
    shard: Shard | None = None,
    bad: Sequence[str] = (),
    notices: int | None = None,
) -> tuple[list[str], list[BatchResult], int]:
    """Run a batch that solves nothing: names of photos that were done or tried, results, and how many were skipped."""
    worker = Pretender(store, bad, notices)
    batch = Batch(list_inputs(folder), plan, store, again=again, shard=shard)
    results = list(batch.results(worker))
    return worker.did, results, batch.skipped
