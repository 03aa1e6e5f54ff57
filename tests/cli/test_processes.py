"""Forks, signals and streams, each in a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

RENDER = ("render", "depth.npy", "-o", "image.png", "--focal-length=9", "--light=flash", "--white=1")


def python(script: str, *arguments: str) -> str:
    """What a script prints. One that hangs fails."""
    # The warning is of Python 3.12, and says what the test is about.
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", script, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


FORK = """
import os, pickle, sys
import persfs_cl as ps
from persfs_cl._cl.kernel import kernel
from persfs_cl._cl.program import program
from persfs_cl._cl.selection import select_device

scene = ps.bump((9, 9))
solve = lambda **keywords: ps.reconstruct(scene.image, scene.camera, max_iterations=1, **keywords)
device = ps.devices()[0]
pickled = pickle.dumps(device)
if sys.argv[1] == "run":
    solve()
ways = {
    "devices": ps.devices,
    "select": select_device,
    "context": lambda: device.context,
    "queue": lambda: device.queue,
    "lock": lambda: device.lock,
    "program": lambda: program(device, ["boundary", "renew"], "float32"),
    "kernel": lambda: kernel(device, ["boundary", "renew"], "float32", {}, "renew_boundary"),
    "reconstruct": solve,
    "reconstruct on a device": lambda: solve(device=device),
    "reconstruct on a pickled device": lambda: solve(device=pickle.loads(pickled)),
    "render": lambda: ps.render(scene.depth, scene.camera),
}
sys.stdout.flush()
child = os.fork()
if child == 0:
    for name, way in ways.items():
        try:
            way()
        except ps.DeviceError as error:
            if "does not survive a fork" in str(error) and 'start method "spawn"' in str(error):
                print(name)
    assert str(pickle.loads(pickled)) == str(device)
    sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
print(device is ps.devices()[0] and solve().iterations)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.parametrize("before", ["list", "run"])
def test_opencl_is_refused_to_a_forked_child(before: str) -> None:
    ways = ["devices", "select", "context", "queue", "lock", "program", "kernel"]
    ways += ["reconstruct", "reconstruct on a device", "reconstruct on a pickled device", "render"]
    assert python(FORK, before).splitlines() == [*ways, "1"]


POOL = """
import multiprocessing
import persfs_cl as ps

def solve(device):
    scene = ps.bump((9, 9))
    return ps.reconstruct(scene.image, scene.camera, device=device, max_iterations=1, tolerance=0, throw=True)

if __name__ == "__main__":
    early = multiprocessing.get_context("fork").Pool(1)  # before OpenCL is used here
    device = ps.devices()[0]
    late = multiprocessing.get_context("fork").Pool(1)
    for pool in (early, late):
        with pool:
            try:
                pool.apply(solve, [device])
            except ps.PersfsError as error:
                print(type(error).__name__, hasattr(error, "solution"))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_errors_of_a_pool_reach_its_parent() -> None:
    assert python(POOL).splitlines() == ["ConvergenceError True", "DeviceError False"]


@pytest.fixture
def depth(tmp_path: Path) -> Path:
    """A folder with what RENDER needs."""
    np.save(tmp_path / "depth.npy", np.ones((9, 9)))
    return tmp_path


INTERRUPTED_AT_AN_IMPORT = """
import os, signal, sys

at, seen = int(sys.argv.pop(1)), 0

class Interrupt:
    def find_spec(name, *_arguments):
        global seen
        seen += seen > 0 or name.startswith("persfs_cl.cli.")
        if seen == at:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt)
signal.signal(signal.SIGINT, signal.default_int_handler)
from persfs_cl.cli import main
try:
    main()
finally:
    if at < 0:
        print(seen)
"""


def interrupted(at: int, folder: Path) -> subprocess.CompletedProcess[str]:
    """The command, with Ctrl-C at the import of this number."""
    command = [sys.executable, "-c", INTERRUPTED_AT_AN_IMPORT, str(at), *RENDER, "--overwrite"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=600)


@pytest.mark.parametrize(
    ("first", "parts"), [((1,), (2, 4)), pytest.param((2, 3), (1, 3, 5, 6), marks=pytest.mark.thorough)]
)
def test_ctrl_c_at_any_import_is_quiet(first: tuple[int, ...], parts: tuple[int, ...], depth: Path) -> None:
    whole = interrupted(-1, depth)
    assert whole.returncode == 0, whole.stderr
    image = (depth / "image.png").read_bytes()
    imports = int(whole.stdout.split()[-1])
    assert imports > 100
    moments = [*first, *(imports * part // 6 for part in parts)]
    with ThreadPoolExecutor(2) as pool:
        for moment, done in zip(moments, pool.map(interrupted, moments, [depth] * len(moments)), strict=True):
            assert (done.returncode, done.stdout) == (130, ""), (moment, done.stderr)
            assert done.stderr.splitlines()[-1] == "persfs-cl: interrupted.", moment
            assert "Traceback" not in done.stderr
            assert "ignored" not in done.stderr
    assert {path.name: path.read_bytes() for path in depth.glob("*.png")} == {"image.png": image}
    assert not list(depth.glob(".*"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize(
    ("streams", "status", "said"),
    [
        (">&-", 1, "standard output cannot be written: Bad file descriptor"),
        ("> /dev/full", 1, "standard output cannot be written: No space left on device"),
        pytest.param("2>&-", 0, "", marks=pytest.mark.thorough),
        pytest.param("2> /dev/full", 0, "", marks=pytest.mark.thorough),
        pytest.param("<&- >&- 2>&-", 1, "", marks=pytest.mark.thorough),
    ],
)
def test_results_are_written_whatever_the_streams_are(streams: str, status: int, said: str, depth: Path) -> None:
    command = ["sh", "-c", f'"$@" {streams}', "sh", sys.executable, "-m", "persfs_cl", *RENDER]
    done = subprocess.run(command, cwd=depth, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == status
    assert done.stdout.strip() == ("image.png" if status == 0 else "")
    lines = done.stderr.splitlines()
    assert len(lines) == (2 if said else 0), "the brightness of white, and what is wrong"
    assert not said or lines[1].startswith(f"persfs-cl: {said}")
    assert (depth / "image.png").stat().st_size > 0
    assert {path.name for path in depth.iterdir()} == {"depth.npy", "image.png"}


def test_a_reader_that_left_is_no_reason_to_complain(depth: Path) -> None:
    theirs, ours = os.pipe()
    os.close(theirs)
    command = [sys.executable, "-m", "persfs_cl", *RENDER]
    done = subprocess.run(command, cwd=depth, stdout=ours, stderr=subprocess.PIPE, text=True, check=False, timeout=600)
    os.close(ours)
    assert done.returncode == 1
    assert done.stderr == "White is a brightness of 1. To reconstruct from this file, give --gain 1.\n"
    assert (depth / "image.png").exists()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="this system has no terminals that hang up")
@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_what_is_ignored_from_the_start_stays_so(number: str) -> None:
    script = f"""
import os, signal
# A test run in the background of a shell would hand on that some are ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
for usual in (signal.SIGTERM, signal.SIGHUP):
    signal.signal(usual, signal.SIG_DFL)
signal.signal(signal.{number}, signal.SIG_IGN)
from persfs_cl.cli.interrupts import raising
from persfs_cl.cli.signals import answer, leave_at_once
answer(leave_at_once)
signal.raise_signal(signal.{number})
with raising():
    signal.raise_signal(signal.{number})
print("alive", flush=True)
for other in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    if other != signal.{number}:
        try:
            with raising():
                signal.raise_signal(other)
        except KeyboardInterrupt:
            print("interrupted")
"""
    assert python(script).split() == ["alive", "interrupted", "interrupted"]
