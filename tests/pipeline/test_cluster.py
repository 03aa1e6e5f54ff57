"""Batches on the workers of Dask: the same results as here, whatever becomes of the workers."""

from __future__ import annotations

import importlib
import importlib.util
import os
import pickle
import shutil
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest
from command import run
from processes import wait_until

import persfs_cl as ps
from persfs_cl.errors import DeviceError, InputError, PersfsWarning, UnavailableError
from persfs_cl.pipeline import cluster, cluster_worker, station, store
from persfs_cl.pipeline.batch import batch
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.cluster import Cluster, Patience
from persfs_cl.pipeline.cluster_worker import Answer, versions
from persfs_cl.pipeline.job import Job, read_job
from persfs_cl.pipeline.manifest import FOLDER, Record, records_of
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.remote_store import store_for
from persfs_cl.pipeline.run import BatchResult
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workers import Setting
from persfs_cl.solver.complete import complete
from persfs_cl.surface.saving import Saving

if importlib.util.find_spec("distributed") is None:
    pytest.skip("Dask is missing", allow_module_level=True)

SCENE = ps.bump((20, 24), light=ps.FlashLight())
COUNT = 30
SAVE = "depth.npy,normals.npy,report"
OF_THE_RUN = {"report.json", "record.json"}
"""They say how long it took, and when."""


def dask(module: str = "distributed") -> Any:
    """A module of Dask, which takes a second to import: not where tests are collected, but where they are run."""
    return importlib.import_module(module)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    levels = np.round(255 * SCENE.image / SCENE.image.max())
    for number in range(COUNT):
        imageio.v3.imwrite(folder / f"{number:02}.png", np.roll(levels, number, axis=1).astype(np.uint8))
    (folder / "broken.png").write_bytes(b"no picture")
    return folder


@pytest.fixture(scope="module")
def workers() -> Iterator[str]:
    """The address of a scheduler with two workers in processes of their own."""
    with (
        dask("dask.config").set({"distributed.worker.profile.enabled": False}),
        dask().LocalCluster(
            n_workers=2, threads_per_worker=1, resources={"device": 1}, dashboard_address=":0", host="127.0.0.1"
        ) as made,
    ):
        yield made.scheduler_address


@pytest.fixture(scope="module")
def local(photos: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("local")
    assert len(reconstructed(photos, folder)) == COUNT + 1
    return contents(folder)


def reconstructed(photos: Path, output: Path, **keywords: Any) -> list[BatchResult]:
    return list(batch(photos, output, camera=SCENE.camera, light=ps.FlashLight(), save=SAVE, **keywords))


def contents(folder: Path) -> dict[str, bytes]:
    """The files of all results, but for what a run says of itself."""
    files = (file for file in folder.rglob("*") if file.is_file() and file.name not in OF_THE_RUN)
    named = {file.relative_to(folder).as_posix(): file.read_bytes() for file in files}
    return {name: data for name, data in named.items() if "/" in name and not name.startswith(FOLDER)}


def manifest(output: Path | str) -> dict[str, Record]:
    records = [record for lines in store_for(output).manifests() for record in records_of(lines)]
    found = {record.name: record for record in records}
    assert len(found) == len(records), "each photo was done once"
    return found


def die_after(count: int, witness: str) -> None:
    """Let this worker end as by a crash when it has written so many results, whose records it copies."""
    put, written, one_by_one = store._FolderShelf.put, [], threading.Lock()

    def counted(self: Any, name: str, fill: Callable[[Path], Record]) -> Record:
        record = put(self, name, fill)
        # Several threads write: those that end while the last is counted wait here for the end of the process.
        with one_by_one:
            written.append(name)
            if len(written) == count:
                for one in written:
                    shutil.copy(self._root / one / store.RECORD, Path(witness) / one)
                os.kill(os.getpid(), signal.SIGKILL)
        return record

    store._FolderShelf.put = counted  # type: ignore[method-assign]


@pytest.mark.thorough
def test_a_worker_that_is_killed_costs_nothing(
    photos: Path, workers: str, local: dict[str, bytes], tmp_path: Path
) -> None:
    witness, output = tmp_path / "witness", tmp_path / "output"
    witness.mkdir()
    with dask().Client(workers, set_as_default=False) as client:
        (first, process), _ = client.run(os.getpid).items()
        client.run(die_after, 3, str(witness), workers=[first])
    results = reconstructed(photos, output, scheduler=workers)
    ended = {result.name: result for result in results}
    assert len(results) == len(ended) == COUNT + 1
    assert isinstance(ended.pop("broken.png").error, InputError)
    assert all(result.error is None for result in ended.values())
    assert contents(output) == local
    assert manifest(output).keys() == {*ended, "broken.png"}
    # What it had done is not done again, though it could not say that it had.
    before = list(witness.iterdir())
    assert len(before) == 3
    assert all((output / file.name / store.RECORD).read_bytes() == file.read_bytes() for file in before)
    with dask().Client(workers, set_as_default=False) as client:
        assert process not in client.run(os.getpid).values()
    assert not list(output.glob(".*")), "nothing half-made is left"
    again = reconstructed(photos, output, scheduler=workers)
    assert [result.name for result in again] == ["broken.png"]


def test_results_go_to_a_url(photos: Path, workers: str, local: dict[str, bytes], tmp_path: Path) -> None:
    url = (tmp_path / "output").as_uri()
    camera = ("--focal-length", str(SCENE.camera.fx))
    options = ("--light", "flash", "--save", SAVE, "--scheduler", workers)
    ended = run("batch", photos, "-o", url, *camera, *options)
    assert (ended.status, f"{COUNT} done" in ended.stderr) == (1, True), ended.stderr
    assert "broken.png" in ended.stderr
    made = contents(tmp_path / "output")
    assert made == local
    assert len(manifest(url)) == COUNT + 1


def test_an_end_that_is_asked_for_drops_the_rest(photos: Path, workers: str, tmp_path: Path) -> None:
    """And the next run goes on from there."""
    output = tmp_path / "output"
    inputs = {file.name for file in photos.iterdir()}

    def outcomes(interrupted: Callable[[], bool]) -> Iterator[Outcome]:
        team = Cluster(workers, setting(FolderStore(output)))
        return team.outcomes(tasks(photos, sorted(inputs)), interrupted)

    (output / FOLDER).mkdir(parents=True)
    going = outcomes(lambda: began)
    began = False
    ended = [next(going)]
    began = True
    results = {outcome.record.name for outcome in [*ended, *going] if outcome.end != "dropped"}
    assert not list(output.glob(".*"))
    there = {file.parent.name for file in output.rglob(store.RECORD)}
    assert there == results - {"broken.png"}
    assert {outcome.record.name for outcome in outcomes(lambda: False)} == inputs
    assert [outcome.end for outcome in outcomes(lambda: True)] == []


def wait_until_unwanted(file: str) -> None:
    worker = dask().get_worker()
    key = worker.get_current_task()
    assert cluster_worker._is_wanted(worker, key)
    Path(file, "begun").touch()
    while cluster_worker._is_wanted(worker, key):
        time.sleep(0.02)
    Path(file, "ended").touch()


@pytest.mark.usefixtures("listening")
def test_a_chunk_ends_when_who_asked_is_gone(photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with dask().LocalCluster(
        n_workers=1, processes=False, protocol="tcp", dashboard_address=":0", host="127.0.0.1"
    ) as made:
        with dask().Client(made.scheduler_address, set_as_default=False) as client:
            future = client.submit(wait_until_unwanted, str(tmp_path), pure=False)
            wait_until((tmp_path / "begun").exists)
            assert not future.done()
        wait_until((tmp_path / "ended").exists)
    # And then the station drops what it has, of which some is not read before.
    stop, stopped = station.Station.stop, threading.Event()

    def noted(self: station.Station) -> None:
        stop(self)
        stopped.set()

    def held(job: Job) -> Any:
        if job.path.name >= "20.png":
            stopped.wait()
        return read_job(job)

    monkeypatch.setattr(station.Station, "stop", noted)
    monkeypatch.setattr(station, "read_job", held)
    (tmp_path / "output" / FOLDER).mkdir(parents=True)
    order = cluster_worker.Order("run", "", setting(FolderStore(tmp_path / "output")), None)
    desk = cluster_worker._Desk(order, 2**30, 2)
    names = sorted(file.name for file in photos.glob("[0-9]*.png"))
    ends = Counter(outcome.end for outcome in desk.outcomes(list(tasks(photos, names)), lambda: False))
    desk.close()
    assert ends["dropped"] >= COUNT - 20
    assert ends["dropped"] + ends["done"] == COUNT
    assert len(list((tmp_path / "output").rglob(store.RECORD))) == ends["done"]


def setting(place: store.Store | None) -> Setting:
    options = complete({"light": ps.FlashLight()})
    options["device"] = options["callback"] = None
    options["throw"] = False
    return Setting(None, place, Saving.of(SAVE), options, 2**30, place is None, 2)


def tasks(folder: Path, names: Sequence[str]) -> Iterator[Task]:
    for number, name in enumerate(names):
        camera = CameraChoice.like(SCENE.camera)
        yield Task(number, name, Job(folder / name, camera, Brightness(), light=ps.FlashLight()), "parameters")


@pytest.mark.usefixtures("listening")
@pytest.mark.parametrize(("resources", "says"), [(None, "1 workers, but none with"), ({"device": 1}, "numpy 0.0")])
def test_workers_that_cannot_be_used_are_named(
    resources: dict[str, float] | None, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # In one process, where only who asks looks here.
    monkeypatch.setattr(cluster, "versions", lambda: {**versions(), "numpy": "0.0"})
    with dask().LocalCluster(
        n_workers=1, processes=False, protocol="tcp", resources=resources, dashboard_address=":0", host="127.0.0.1"
    ) as made:
        team = Cluster(made.scheduler_address, setting(FolderStore(tmp_path)), patience=Patience(others=0.0))
        if resources is None:
            with pytest.raises(DeviceError, match=f"{says} the resource 'device': start one.*--resources"):
                list(team.outcomes(tasks(tmp_path, ["a"]), lambda: False))
        else:
            with pytest.warns(PersfsWarning, match="is not used any more"), pytest.raises(DeviceError, match="same"):
                list(team.outcomes(tasks(tmp_path, ["a"]), lambda: False))


@pytest.mark.parametrize(
    ("address", "why"), [("tcp://127.0.0.1:1", "does not answer"), ("nonsense", "is no file, and no address such as")]
)
def test_a_scheduler_that_does_not_answer_is_named(address: str, why: str, tmp_path: Path) -> None:
    with (
        dask("dask.config").set({"distributed.comm.timeouts.connect": "200ms"}),
        pytest.raises(InputError, match=f"scheduler='{address}' {why}"),
    ):
        list(Cluster(address, setting(FolderStore(tmp_path))).outcomes(tasks(tmp_path, ["a"]), lambda: False))


def test_what_a_cluster_needs_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="scheduler='here' has workers that write"):
        batch(tmp_path, scheduler="here")
    with pytest.raises(InputError, match="device='all' means several"):
        batch(tmp_path, tmp_path / "output", device="all", scheduler="here")
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UnavailableError, match=r"pip install 'persfs-cl\[cluster\]'"):
        batch(tmp_path, tmp_path / "output", scheduler="here")


@dataclass
class FakeFuture:
    key: str
    outcome: Any
    status: str = "finished"

    def add_done_callback(self, tell: Callable[[FakeFuture], None]) -> None:
        self.status = "error" if isinstance(self.outcome, Exception) else "finished"
        tell(self)

    def result(self, timeout: float) -> Any:
        assert timeout > 0
        return self.outcome

    def exception(self) -> Any:
        return self.outcome

    def cancel(self) -> None:
        pass


@dataclass
class FakeClient:
    """Workers that answer as a function says, which is given the address and the tasks."""

    answer: Callable[[str, list[Task]], Any]
    workers: tuple[str, ...] = ("one", "two")
    sent: list[tuple[str, list[int]]] = field(default_factory=list)

    def scheduler_info(self, n_workers: int) -> Any:
        assert n_workers == -1
        return {"workers": {address: {"resources": {"device": 1}} for address in self.workers}}

    def submit(self, _function: Any, _versions: Any, payload: bytes, **options: Any) -> FakeFuture:
        assert options["resources"] == {"device": 1}
        _, tasks = pickle.loads(payload)
        place = (options["workers"] or self.workers)[len(self.sent) % len(options["workers"] or self.workers)]
        self.sent.append((place, [task.number for task in tasks]))
        return FakeFuture(str(len(self.sent)), self.answer(place, tasks))

    def cancel(self, _futures: Any) -> None:
        pass

    def run(self, *_arguments: Any, **_options: Any) -> None:
        pass


def done(task: Task) -> Outcome:
    return Outcome(task.number, "done", Record(name=task.name, path="", status="done"))


def outcomes(client: FakeClient, count: int) -> list[Outcome]:
    order = cluster_worker.Order("run", "", setting(FolderStore(Path("output"))), None)
    made = cluster._Run(client, "address", order, Patience())  # type: ignore[arg-type] # it does as a client does
    return list(made.outcomes(tasks(Path(), [str(number) for number in range(count)]), lambda: False))


def test_chunks_grow_with_the_pace_and_little_is_sent_ahead() -> None:
    taken: list[int] = []

    def source() -> Iterator[Task]:
        for task in tasks(Path(), [str(number) for number in range(3000)]):
            taken.append(task.number)
            yield task

    client = FakeClient(lambda place, given: Answer(place, 0.01 * len(given), [done(task) for task in given]))
    made = cluster._Run(client, "address", cluster_worker.Order("run", "", setting(None), None), Patience())  # type: ignore[arg-type]
    for number, outcome in enumerate(made.outcomes(source(), lambda: False)):
        assert outcome.end == "done"
        assert len(taken) - number <= 4 * 256
    assert sorted(number for _, numbers in client.sent for number in numbers) == list(range(3000))
    sizes = [len(numbers) for _, numbers in client.sent]
    assert sizes[:4] == [8, 8, 8, 8]
    assert max(sizes) == 256


@pytest.mark.parametrize(("bad", "end"), [(("one",), "done"), (("one", "two"), "failed")])
def test_a_photo_that_a_device_fails_at_is_tried_on_another_worker(bad: Sequence[str], end: str) -> None:
    def answer(place: str, given: list[Task]) -> Answer:
        failing = Outcome(3, "unfit", Record(name="3", path="", status="failed"), InputError("It did not fit."))
        return Answer(place, 1.0, [failing if task.number == 3 and place in bad else done(task) for task in given])

    client = FakeClient(answer)
    ends = {outcome.number: outcome.end for outcome in outcomes(client, 8)}
    assert client.sent == [("one", list(range(8))), ("two", [3])]
    assert ends == {**dict.fromkeys(range(8), "done"), 3: end}


def test_a_worker_whose_device_fails_hands_its_photos_to_the_others() -> None:
    def answer(place: str, given: list[Task]) -> Answer:
        broken = DeviceError("It broke.")
        failed = [Outcome(task.number, "device", Record(name="", path="", status="failed"), broken) for task in given]
        return Answer(place, 1.0, failed if place == "one" else [done(task) for task in given])

    client = FakeClient(answer)
    with pytest.warns(PersfsWarning, match="one is not used any more"):
        ended = outcomes(client, 100)
    assert {outcome.number for outcome in ended} == set(range(100))
    assert {outcome.end for outcome in ended} == {"done"}
    places = [place for place, _ in client.sent]
    assert "one" not in places[places.index("two", 8) :]
    with pytest.warns(PersfsWarning), pytest.raises(DeviceError, match=r"No worker of address can be used.*It broke"):
        outcomes(FakeClient(answer, ("one",)), 100)


def test_the_photo_that_ends_workers_is_found() -> None:
    def answer(place: str, given: list[Task]) -> Any:
        if any(task.number == 5 for task in given):
            return dask().KilledWorker("key", None, 3)
        return Answer(place, 1.0, [done(task) for task in given])

    client = FakeClient(answer)
    ended = {outcome.number: outcome for outcome in outcomes(client, 16)}
    assert [number for number, outcome in ended.items() if outcome.end == "failed"] == [5]
    assert "4 workers ended while they solved it alone" in str(ended[5].error)
    assert Counter(number for _, numbers in client.sent for number in numbers)[5] == 2


def test_a_worker_without_the_package_is_named() -> None:
    with pytest.raises(UnavailableError, match=r"ModuleNotFoundError: No module.*install the same version"):
        outcomes(FakeClient(lambda *_: ModuleNotFoundError("No module named 'persfs_cl'")), 8)
