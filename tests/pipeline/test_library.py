"""``ps.batch`` from scripts, threads and loops that end early, and the numbers that it gives."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from batches import FOCAL, photos, require_whole, times_done
from processes import finished, running, wait_until

import persfs_cl as ps
from persfs_cl.io.photos import read_photo
from persfs_cl.pipeline.run import BatchResult

LIGHT = ps.FlashLight()
CAMERA = ps.Camera(FOCAL)
LINUX = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="finds processes as Linux shows them")


def test_numbers_are_those_of_one_by_one_to_the_bit(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    shapes = ((24, 30), (17, 40), (33, 9))
    for number, shape in enumerate(shapes):
        photos(folder / str(number), 3, shape)
    keywords: dict[str, Any] = {"light": LIGHT, "max_iterations": 60}
    (folder / "bad.png").write_bytes(b"")
    found: list[BatchResult] = []
    # In a thread, for once: processes are not the main thread's alone.
    thread = threading.Thread(target=lambda: found.extend(ps.batch(folder, camera=CAMERA, **keywords)))
    thread.start()
    thread.join()
    results = {result.name: result for result in found}
    assert "is empty" in str(results.pop("bad.png").error)
    assert len(results) == 9
    images = {name: read_photo(folder / name).image for name in results}
    alone = {name: ps.reconstruct(image, CAMERA, **keywords) for name, image in images.items()}
    together = dict(zip(images, ps.reconstruct_batch(list(images.values()), CAMERA, **keywords), strict=True))
    for name, result in results.items():
        assert result.solution is not None
        for other in (alone[name], together[name]):
            for array in ("depth", "log_depth", "changes"):
                np.testing.assert_array_equal(getattr(result.solution, array), getattr(other, array))
            assert (result.solution.status, result.solution.iterations) == (other.status, other.iterations)


@pytest.mark.usefixtures("in_this_process")
def test_bounds_of_the_depth_are_for_all_photographs(tmp_path: Path) -> None:
    names = photos(tmp_path / "in", 2, (24, 30))
    images = {name: read_photo(tmp_path / "in" / name).image for name in names}
    near = float(np.median(ps.reconstruct(images[names[0]], CAMERA, light=LIGHT).depth))
    far = np.full((24, 30), np.nan)
    far[:5] = 1.1 * near
    np.save(tmp_path / "far.npy", far)
    # By the order whose kernels are compiled most quickly.
    bounds: dict[str, Any] = {"near": near, "far": tmp_path / "far.npy", "ordering": "lexicographic"}
    for result in ps.batch(tmp_path / "in", tmp_path / "out", camera=CAMERA, light=LIGHT, save="depth.npy", **bounds):
        expected = ps.reconstruct(
            images[result.name], CAMERA, light=LIGHT, depth_range=(near, far), ordering="lexicographic"
        )
        np.testing.assert_array_equal(np.load(tmp_path / "out" / result.name / "depth.npy"), expected.depth)
        assert expected.at_bound.any()
    assert not list(ps.batch(tmp_path / "in", tmp_path / "out", camera=CAMERA, light=LIGHT, save="depth.npy", **bounds))
    # Another bound is another result.
    bounds["near"] = 1.01 * near
    again = list(ps.batch(tmp_path / "in", tmp_path / "out", camera=CAMERA, light=LIGHT, save="depth.npy", **bounds))
    assert len(again) == 2
    with pytest.raises(ps.InputError, match=r"near=-1\.0 is not a depth"):
        ps.batch(tmp_path / "in", camera=CAMERA, light=LIGHT, near=-1.0)


SCRIPT = """
import sys
import persfs_cl as ps
from lamps import Lamp
print("begun")
for result in ps.batch(sys.argv[1], camera=ps.Camera(30.0), light=Lamp()):
    print(result.name, result.solution.status.name, result.path.name)
"""


def test_a_plain_script_needs_no_guard_and_may_have_lights_in_modules_of_its_own(tmp_path: Path) -> None:
    names = photos(tmp_path / "in", 3)
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    (tmp_path / "lamps.py").write_text("import persfs_cl as ps\nclass Lamp(ps.FlashLight): pass\n")
    # Names of modules of Python, as lie about where people work.
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "queue.py").write_text("raise SystemExit('the wrong module')")
    command = [sys.executable, str(script), str(tmp_path / "in")]
    done = subprocess.run(command, cwd=elsewhere, capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    first, *rest = done.stdout.splitlines()
    assert (first, sorted(rest)) == ("begun", [f"{name} CONVERGED {name}" for name in names])


MINE = """
import sys
import persfs_cl as ps

class Lamp(ps.FlashLight):
    pass

try:
    print(list(ps.batch(sys.argv[1], camera=ps.Camera(30.0), light=Lamp())))
except ps.InputError as error:
    print(error)
"""


@LINUX
def test_a_light_of_the_script_itself_is_a_clear_error(tmp_path: Path) -> None:
    photos(tmp_path / "in", 1)
    status, printed, said = finished(MINE, tmp_path / "in")
    assert (status, said) == (0, "")
    assert "does not know a light or a material" in printed
    assert "define its class in a module that can be imported" in printed


def test_what_cannot_be_sent_is_a_clear_error(tmp_path: Path) -> None:
    photos(tmp_path / "in", 1)

    class Lamp(ps.FlashLight):
        pass

    with pytest.raises(ps.InputError, match=r"cannot be sent to the process of a device .*top of a module"):
        list(ps.batch(tmp_path / "in", camera=CAMERA, light=Lamp()))
    with pytest.raises(ps.InputError, match=r"callback.* is for one photograph"):
        ps.batch(tmp_path / "in", camera=CAMERA, callback=lambda *_: None)
    with pytest.raises(ps.InputError, match="throw"):
        ps.batch(tmp_path / "in", camera=CAMERA, throw=True)


def test_what_a_camera_says_is_no_keyword_of_a_batch(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"argument 'fov': give camera=Camera\(\.\.\.\), or one by Camera\.from_fov"):
        ps.batch(tmp_path, fov=50.0)


EARLY = """
import sys
import persfs_cl as ps
results = ps.batch(sys.argv[1], sys.argv[2], camera=ps.Camera(30.0), light=ps.FlashLight(), save="depth.npy")
print(next(results).name, flush=True)
results.close()
print("closed", flush=True)
sys.stdin.read()
"""


@LINUX
@pytest.mark.usefixtures("in_this_process")
def test_a_loop_that_ends_early_leaves_no_process_and_nothing_unfinished(tmp_path: Path) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    names = photos(folder, 60)
    with running(EARLY, folder, out) as process:
        assert process.popen.stdout is not None
        first = process.popen.stdout.readline().strip()
        assert process.popen.stdout.readline() == "closed\n"
        wait_until(lambda: not process.workers())
        assert process.popen.poll() is None
        assert [path.name for path in out.glob(".*")] == []
        assert first in times_done(out)
    # Also of what was complete, but not told any more, nothing is done again.
    there = {path.parent.name: path.stat().st_mtime_ns for path in out.glob("*/record.json")}
    results = list(ps.batch(folder, out, camera=CAMERA, light=LIGHT, save="depth.npy"))
    assert not {result.name for result in results} & set(there)
    assert times_done(out) == dict.fromkeys(names, 1)
    require_whole(out, names)


def test_an_output_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    photos(tmp_path / "in", 1)
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ps.InputError, match="cannot be written"):
        list(ps.batch(tmp_path / "in", tmp_path / "file" / "out", camera=CAMERA, light=LIGHT))
