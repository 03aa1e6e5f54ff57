"""Batches that are killed, interrupted, or whose devices fail: in processes of their own."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import pytest
from batches import FOCAL, lines, photos, require_whole, times_done
from processes import COMMAND, running, wait_until

import persfs_cl as ps

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="finds processes as Linux shows them")

BATCH = """
import sys
import persfs_cl as ps
for result in ps.batch(sys.argv[1], sys.argv[2], camera=ps.Camera(30.0), light=ps.FlashLight(), save=sys.argv[3]):
    print(result.name, flush=True)
"""
DEFAULT = {"depth.npy", "depth.tiff", "normals.png", "report.json", "preview.jpg", "photo.jpg", "relief.js"}


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


def test_killed_at_random_moments_and_run_to_the_end(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 40)
    kill_at_random(out, 3, BATCH, str(folder), str(out), "depth.npy")
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


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.thorough)])
def test_command_interrupted_keeps_what_is_complete(number: signal.Signals, tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 150)
    arguments = ("batch", folder, "-o", out, "--light=flash", f"--focal-length={FOCAL}", "--save=depth.npy")
    with running(COMMAND, *arguments) as process:
        process.until(lambda: len(lines(out)) >= 3)
        if number == signal.SIGTERM:
            for one in process.processes():  # as schedulers end a job
                os.kill(one, number)
        else:
            process.popen.send_signal(number)
        status, printed, said = process.ended()
    assert status == 130, said
    assert "stopping; what is in hand is dropped; the same command goes on from there." in said
    done = times_done(out)
    assert 3 <= len(done) < len(names)
    assert [record.name for record in lines(out) if record.status == "failed"] == []
    assert {Path(line).name for line in printed.splitlines()} == set(done)
    require_whole(out, done)
    assert (out / "index.html").exists()
    left = finish(folder, out)
    assert sorted([*left, *done]) == names
    require_whole(out, names)
