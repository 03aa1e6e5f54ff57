"""Batches that are killed, interrupted, or whose devices fail: in processes of their own."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import pytest
from batches import FOCAL, lines, photos, require_whole, times_done
from processes import COMMAND, finished, running, wait_until

import persfs_cl as ps

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="finds processes as Linux shows them")

BATCH = """
import sys
import persfs_cl as ps
for result in ps.batch(sys.argv[1], sys.argv[2], camera=ps.Camera(30.0), light=ps.FlashLight(), save=sys.argv[3]):
    print(result.name, flush=True)
"""
DEFAULT = {
    *("depth.npy", "depth.tiff", "camera.json", "normals.png", "report.json"),
    *("preview.jpg", "photo.jpg", "relief.js"),
}


def finish(folder: Path, out: Path, save: str = "depth.npy") -> list[str]:
    """Run to the end in this process; names of what was left to do."""
    light = ps.FlashLight()
    return [one.name for one in ps.batch(folder, out, camera=ps.Camera(FOCAL), light=light, save=save) if not one.error]


def kill_at_random(out: Path, kills: int, script: str, *arguments: str) -> None:
    chance = random.Random(kills)
    for number in range(kills):
        wanted = len(lines(out)) + chance.choice([0, 1, 2, 3])
        with running(script, *arguments) as process:
            process.until(lambda: len(process.workers()) > 0)
            if wanted > len(lines(out)):
                process.until(lambda: len(lines(out)) >= wanted)  # noqa: B023
                time.sleep(chance.uniform(0.0, 0.1))
            else:
                time.sleep(chance.uniform(0.0, 3.0))
            if number % 2:
                process.kill_all()
            else:
                process.popen.kill()
            # Processes for devices end with their parent.
            wait_until(lambda: not process.processes())
        assert set(times_done(out).values()) <= {1}
    assert sum(times_done(out).values()) > 0


@pytest.mark.thorough
@pytest.mark.usefixtures("in_this_process")
def test_killed_at_random_moments_and_run_to_the_end(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 30)
    kill_at_random(out, 2, BATCH, str(folder), str(out), "depth.npy")
    finish(folder, out)
    assert times_done(out) == dict.fromkeys(names, 1)
    require_whole(out, names)
    assert finish(folder, out) == []


@pytest.mark.thorough
def test_command_killed_ten_times_and_run_to_the_end(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 120)
    arguments = ("batch", str(folder), "-o", str(out), "--light=flash", f"--focal-length={FOCAL}")
    kill_at_random(out, 10, COMMAND, *arguments)
    with running(COMMAND, *arguments) as process:
        assert process.ended()[0] == 0
    assert times_done(out) == dict.fromkeys(names, 1)
    require_whole(out, names, DEFAULT)
    assert {path.name for path in out.iterdir()} == {*names, "manifest", "index.html", "contact.jpg", "summary.csv"}


SABOTAGE = """
import os, signal, sys, time
from pathlib import Path

place, way = Path(os.environ["SABOTAGE"]), os.environ["SABOTAGE_WAY"]
if any("pipeline.workers" in argument for argument in sys.orig_argv):
    start = 0
    while True:
        try:
            os.close(os.open(place / f"start-{start}", os.O_CREAT | os.O_EXCL))
            break
        except FileExistsError:
            start += 1
    from persfs_cl.errors import DeviceError
    from persfs_cl.solver import solve as module
    from persfs_cl.pipeline import job as jobs

    usual, read = module.attempt, jobs.read_job
    # The first that started, and all that were started anew.
    def attempt(device, problems, *rest):
        check = problems[0].image.shape == (8, 8)
        if way in ("kill", "break", "all") and (start != 1 or way == "all"):
            if (place / "failing").exists() or len(list(Path(os.environ["SABOTAGE_OUT"]).glob("*/record.json"))) >= 3:
                (place / "failing").touch()
                if way != "kill":
                    raise DeviceError("It was taken out.")
                if not check:
                    os.kill(os.getpid(), signal.SIGKILL)
        elif way in ("kill", "break"):
            while not check and not (place / f"start-{ {'kill': 4, 'break': 2}[way] }").exists():
                time.sleep(0.01)
        return usual(device, problems, *rest)

    def read_job(job):
        if way == "poison" and job.path.name == "00007.png":
            os.kill(os.getpid(), signal.SIGKILL)
        if way == "hold" and job.path.name >= "00020.png":
            stopped.wait()
        return read(job)

    module.attempt, jobs.read_job = attempt, read_job
    if way == "hold":
        import threading
        from persfs_cl.pipeline.station import Station

        stopped, stop = threading.Event(), Station.stop

        def noted(station):
            stop(station)
            stopped.set()

        Station.stop = noted
"""
TWO = """
import sys
import warnings
import persfs_cl as ps
from persfs_cl.pipeline import crew
warnings.simplefilter("always")
# Few in hand: there must be some for each process that is started anew.
crew._MOST = 8
device = {0: "all", 1: [0, 0]}[len(ps.devices()) < 2]
for result in ps.batch(
    sys.argv[1], sys.argv[2], camera=ps.Camera(30.0), light=ps.FlashLight(), save="depth.npy", device=device
):
    print(result.name, result.error or "", flush=True)
"""


@pytest.fixture
def sabotage(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of what processes for devices are to do, without a hook for it in the package."""
    place = tmp_path / "sabotage"
    place.mkdir()
    (place / "sitecustomize.py").write_text(SABOTAGE)
    monkeypatch.setenv("SABOTAGE", str(place))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(place), os.environ.get("PYTHONPATH", "")])))
    # All drivers of the machine, which compile everything for themselves.
    if request.node.get_closest_marker("thorough"):
        monkeypatch.delenv("OCL_ICD_VENDORS", raising=False)
    return place


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.thorough)])
def test_command_interrupted_keeps_what_is_complete(number: signal.Signals, tmp_path: Path, sabotage: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 40)
    arguments = ("batch", folder, "-o", out, "--light=flash", f"--focal-length={FOCAL}", "--save=depth.npy")
    # Half of the photos are not read before the end is asked for, however late that is.
    with running(COMMAND, *arguments, SABOTAGE_WAY="hold") as process:
        process.until(lambda: len(lines(out)) >= 3)
        if number == signal.SIGTERM:
            for one in process.processes():  # as schedulers end a job
                os.kill(one, number)
        else:
            process.popen.send_signal(number)
        status, printed, said = process.ended()
    assert status == 130, said
    assert (sabotage / "start-0").exists()
    assert "stopping; what is in hand is dropped." in said
    assert f"Interrupted: {len(printed.splitlines())} of {len(names)} are done. The same command goes on from" in said
    done = times_done(out)
    assert 3 <= len(done) <= len(names) / 2
    assert [record.name for record in lines(out) if record.status == "failed"] == []
    assert {Path(line).name for line in printed.splitlines()} == set(done)
    require_whole(out, done)
    assert (out / "index.html").exists()
    left = finish(folder, out)
    assert sorted([*left, *done]) == names
    require_whole(out, names)


@pytest.mark.parametrize("way", ["break", pytest.param("kill", marks=pytest.mark.thorough)])
def test_a_device_that_fails_midway_leaves_its_photos_to_the_other(way: str, tmp_path: Path, sabotage: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    # The other one waits until the process that was killed has been started anew often enough.
    names = photos(folder, {"break": 24, "kill": 60}[way])
    status, printed, said = finished(TWO, folder, out, SABOTAGE_WAY=way, SABOTAGE_OUT=str(out))
    assert status == 0, said
    assert sorted(line.rstrip() for line in printed.splitlines()) == names
    assert "is not used any more. It" in said
    assert (sabotage / "failing").exists()
    assert times_done(out) == dict.fromkeys(names, 1)
    assert len(lines(out)) == len(names), "no photo is blamed"
    require_whole(out, names)


@pytest.mark.thorough
def test_a_photo_that_kills_every_process_fails_by_name(
    tmp_path: Path, sabotage: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 20)
    monkeypatch.setenv("SABOTAGE_WAY", "poison")
    light = ps.FlashLight()
    results = list(ps.batch(folder, out, camera=ps.Camera(FOCAL), light=light, save="depth.npy", device=0))
    [failed] = [result for result in results if result.error]
    assert failed.name == "00007.png"
    assert "the process that solved it ended twice (signal 9), the second time with nothing else to do" in str(
        failed.error
    )
    assert 2 <= len(list(sabotage.glob("start-*"))) <= 3
    good = [name for name in names if name != failed.name]
    assert times_done(out) == dict.fromkeys(good, 1)
    require_whole(out, good)
    monkeypatch.setenv("SABOTAGE_WAY", "none")
    assert finish(folder, out) == ["00007.png"]


@pytest.mark.thorough
@pytest.mark.usefixtures("sabotage")
def test_command_without_a_device_that_works_says_so_and_goes_on_later(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 40)
    arguments = ("batch", folder, "-o", out, "--light=flash", f"--focal-length={FOCAL}", "--save=depth.npy")
    for _ in range(2):
        status, _printed, said = finished(COMMAND, *arguments, SABOTAGE_WAY="all", SABOTAGE_OUT=str(out))
        assert status == 3
        assert "No device is left" in said
        assert "It was taken out." in said
        assert {record.status for record in lines(out)} == {"done"}
    before = len(lines(out))
    assert 0 < before < len(names)
    assert finished(COMMAND, *arguments, SABOTAGE_WAY="none")[0] == 0
    assert times_done(out) == dict.fromkeys(names, 1)
    require_whole(out, names)
