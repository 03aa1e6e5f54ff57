"""Forks, signals and streams, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


def python(script: str, *arguments: str) -> str:
    """What a script prints. One that hangs fails."""
    # The warning is of Python 3.12, and says what the test is about.
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", script, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


FORK = """
import os, pickle, sys
import persfs_cl as ps
from persfs_cl._cl.device import select_device
from persfs_cl._cl.program import kernel, program

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
    "kernel": lambda: kernel(device, ["boundary", "renew"], "float32", {}, "renew", []),
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
                print(type(error).__name__, error.__dict__.keys() == {"solution"})
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
def test_errors_of_a_pool_reach_its_parent() -> None:
    assert python(POOL).splitlines() == ["ConvergenceError True", "DeviceError False"]
