"""What a batch of very many photographs costs besides the photographs: listing, handing out, and the manifest."""

from __future__ import annotations

import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.blocks import usable_cores
from persfs_cl.pipeline.cluster import RESOURCE, Cluster
from persfs_cl.pipeline.crew import Crew
from persfs_cl.pipeline.job import Job
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.manifest import FOLDER, latest, now
from persfs_cl.pipeline.manifest import Record as Line
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.plan import Plan as BatchPlan
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workforce import crew_settings
from persfs_cl.surface.saving import Saving

if TYPE_CHECKING:
    from distributed import Scheduler

LISTING, MANIFEST, CREW, CLUSTER = "listing", "manifest", "processes here", "workers of Dask"
_IN_A_FOLDER = 1000
_ASKED_EVERY = 1000
"""Outcomes between two looks at what the scheduler holds."""
_FEW = 4
"""Processes at most: it is the one that hands out whose rate is wanted."""
_Result = TypeVar("_Result")


def tasks(plan: Plan) -> Iterator[list[Record]]:
    """A batch whose photographs take no time: they do not exist, which is an outcome like any other.

    Everything else is as it is with real ones: the same listing, processes, scheduler, threads, records and manifest.
    """
    with tempfile.TemporaryDirectory(prefix="persfs-cl-") as place:
        root = Path(place)
        yield listing(plan, root / "photos")
        yield manifest(plan, root / "manifest")
        yield crew(plan)
        yield cluster(plan, root / "cluster")


def listing(plan: Plan, folder: Path) -> list[Record]:
    """Finding files in folders of a thousand, and what the list of them takes."""
    for number in range(plan.tasks):
        within = folder / f"{number // _IN_A_FOLDER:05}"
        if number % _IN_A_FOLDER == 0:
            within.mkdir(parents=True)
        (within / f"photo-{number:08}.jpg").touch()
    seconds, found = _timed(lambda: list_inputs(folder))
    taken, again = _traced(lambda: list_inputs(folder))
    count = len(found.inputs)
    return [
        _record(LISTING, "files", "1/s", len(again.inputs) / seconds, f"{count} files, in folders of {_IN_A_FOLDER}"),
        _record(LISTING, "memory a file", "B", taken / count),
    ]


def manifest(plan: Plan, folder: Path) -> list[Record]:
    """Adding lines as long as those of real photographs, and reading which are done."""
    store = FolderStore(folder)
    lines = [_line(number) for number in range(plan.tasks)]

    def add() -> None:
        with closing(store.journal()) as journal:
            for line in lines:
                journal.add(line)

    def read() -> Any:
        return latest(store.manifests())

    adding, _ = _timed(add)
    size = sum(file.stat().st_size for file in (folder / FOLDER).glob("*.jsonl"))
    reading, known = _timed(read)
    taken, _ = _traced(read)
    return [
        _record(MANIFEST, "lines added", "1/s", len(lines) / adding, f"{len(lines)} lines"),
        _record(MANIFEST, "size of a line", "B", size / len(lines)),
        _record(MANIFEST, "lines read", "1/s", len(known) / reading),
        _record(MANIFEST, "memory a photograph", "B", taken / len(known)),
    ]


def crew(plan: Plan) -> list[Record]:
    """Handing tasks to processes on this machine, which all take the same device, for they do not use it."""
    processes = min(_FEW, usable_cores())
    work = BatchPlan()
    settings = crew_settings(work, None, [plan.device] * processes, None)
    team = Crew([replace(setting, processes=1) for setting in settings])
    rate = _rate(team.outcomes(_tasks(work, plan.tasks), lambda: False))
    return [_record(CREW, "tasks", "1/s", rate, f"{plan.tasks} tasks, {processes} processes")]


def cluster(plan: Plan, folder: Path, *, processes: bool = True) -> list[Record]:
    """Handing tasks to workers of Dask, and what its scheduler holds meanwhile.

    Parameters
    ----------
    plan : Plan
    folder : Path
        For the output.
    processes : bool
        Whether workers have processes of their own.
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        return [skip("tasks", CLUSTER, "tasks", "1/s", 0, plan.precision, f"Dask is not installed ({error}).")]
    workers = min(_FEW, usable_cores()) if processes else 1
    work = BatchPlan(saving=Saving.of("depth"))
    store = FolderStore(folder)
    (folder / FOLDER).mkdir(parents=True)
    held: list[tuple[int, int]] = []
    with (
        LocalCluster(
            n_workers=workers,
            processes=processes,
            protocol="tcp",
            threads_per_worker=1,
            resources={RESOURCE: 1},
            dashboard_address=":0",
            host="127.0.0.1",
        ) as made,
        Client(made, set_as_default=False) as client,
    ):
        (setting,) = crew_settings(work, store, [plan.device], None)
        team = Cluster(made.scheduler_address, replace(setting, device=plan.device.index))

        def watched() -> Iterator[Outcome]:
            for number, outcome in enumerate(team.outcomes(_tasks(work, plan.tasks), lambda: False)):
                if number % _ASKED_EVERY == 0:
                    held.append(client.run_on_scheduler(_held))
                yield outcome

        rate = _rate(watched())
    chunks, size = map(max, zip(*held, strict=True))
    return [
        _record(CLUSTER, "tasks", "1/s", rate, f"{plan.tasks} tasks, {workers} workers"),
        _record(CLUSTER, "chunks with the scheduler at most", "", max(1, chunks)),
        _record(CLUSTER, "size of a chunk at most", "B", max(1, size)),
    ]


def _held(dask_scheduler: Scheduler) -> tuple[int, int]:
    """How many chunks there are, and the size of the largest."""
    from distributed.protocol.pickle import dumps

    there = list(dask_scheduler.tasks.values())
    return len(there), max((len(dumps(task.run_spec)) for task in there if task.run_spec is not None), default=0)


def _tasks(work: BatchPlan, count: int) -> Iterator[Task]:
    camera = CameraChoice()
    for number in range(count):
        name = f"{number // _IN_A_FOLDER:05}/photo-{number:08}.jpg"
        job = Job(Path("/nowhere") / name, camera, work.brightness, light=work.light, reflectance=work.reflectance)
        yield Task(number, name, job, f"{number:032x}")


def _line(number: int) -> Line:
    """As a photograph of a flash leaves it, with the files of a batch's default."""
    name = f"{number // _IN_A_FOLDER:05}/photo-{number:08}.jpg"
    path = f"/data/photographs/{name}"
    return Line(
        name=name,
        path=path,
        status="done",
        input_hash=f"{number:032x}",
        stamps={"path": (3_145_728 + number, 1_700_000_000_000_000_000 + number)},
        parameter_hash=f"{7:032x}",
        version="0.1.0",
        device="pthread-Some Processor (Portable Computing Language, OpenCL 3.0 PoCL 3.0)",
        converged="CONVERGED",
        iterations=7,
        size=(3000, 4000),
        seconds=dict.fromkeys(("read", "prepare", "solve", "write"), 0.123456789 + number),
        finished=now(),
        files=("depth.npy", "depth.tiff", "normals.png", "preview.jpg", "photo.jpg", "relief.js", "report.json"),
        figures={
            "focal_length": [3456.78901234, 3456.78901234],
            "horizontal_view": 60.123456789,
            "camera_source": "EXIF, focal length in 35 mm film",
            "depth_min": 0.87654321098,
            "depth_median": 1.01234567891,
            "depth_max": 1.23456789012,
            "solved": 12_000_000 - number,
            "unreached": 0,
            "clamped": 12,
            "mean_error": 1.2345678901,
            "root_mean_square": 2.3456789012,
        },
    )


def _rate(outcomes: Iterable[Outcome]) -> float:
    """Outcomes a second, from the first on: the start of the processes is no matter of the number of tasks."""
    count, began = -1, 0.0
    for outcome in outcomes:
        if outcome.end != "failed":
            raise outcome.error or AssertionError(outcome)
        began = began or time.perf_counter()
        count += 1
    return count / (time.perf_counter() - began)


def _timed(work: Callable[[], _Result]) -> tuple[float, _Result]:
    began = time.perf_counter()
    result = work()
    return time.perf_counter() - began, result


def _traced(work: Callable[[], _Result]) -> tuple[int, _Result]:
    """Bytes that a result takes, by Python's own account."""
    tracemalloc.start()
    try:
        result = work()
        return tracemalloc.get_traced_memory()[0], result
    finally:
        tracemalloc.stop()


def _record(workload: str, quantity: str, unit: str, value: float, detail: str = "") -> Record:
    return Record.of(
        [value],
        experiment="tasks",
        workload=workload,
        quantity=quantity,
        unit=unit,
        size=0,
        images=1,
        precision=Plan.precision,
        detail=detail,
    )
