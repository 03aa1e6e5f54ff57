"""Each thread hears its own warnings, and of which image they are."""

from __future__ import annotations

import functools
import subprocess
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyopencl as cl
import pytest
import tifffile
from samples import random_samples

import persfs_cl as ps
from persfs_cl import told
from persfs_cl._cl.program import program
from persfs_cl.checks import warn
from persfs_cl.errors import PersfsWarning
from persfs_cl.io.photos import read_photo
from persfs_cl.io.remarks import decoding
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import prepare
from persfs_cl.solver.solve import solve
from persfs_cl.told import concerning, hearing, listen, overhearing
from persfs_cl.wording import keyword

THREADS = 8


@pytest.fixture(params=["as usual", "listening"])
def either(request: pytest.FixtureRequest) -> None:
    """In a process of either kind."""
    if request.param == "listening":
        request.getfixturevalue("listening")


def tiff(path: Path, *, odd: bool) -> Path:
    """A photo that is read; an odd one not without a remark, which tifffile logs."""
    tifffile.imwrite(path, random_samples(1, 8), photometric="minisblack")
    if odd:
        with tifffile.TiffFile(path) as file:
            place = file.pages.first.tags["ResolutionUnit"].offset
        data = bytearray(path.read_bytes())
        data[place + 8] = 77
        path.write_bytes(data)
    return path


@pytest.mark.filterwarnings("always:")
def test_what_is_overheard_is_shown_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr(warnings, "showwarning", lambda message, *_place, **_where: shown.append(str(message)))
    with overhearing() as heard:
        warn(f"{keyword('scheme', 'upwind')} is odd")
        warnings.warn("for those who write code", DeprecationWarning, stacklevel=1)
    warn("later")
    assert list(map(str, heard)) == ["scheme='upwind' is odd"]
    assert isinstance(heard[0], PersfsWarning)
    assert shown == ["scheme='upwind' is odd", "for those who write code", "later"]


@pytest.mark.usefixtures("either")
def test_a_block_hears_the_package_and_others_as_plain_text(capfd: pytest.CaptureFixture[str]) -> None:
    with hearing() as heard:
        warn(f"{keyword('scheme', 'upwind')} is odd")
        warnings.warn("another", RuntimeWarning, stacklevel=1)
        warnings.warn("another", RuntimeWarning, stacklevel=1)
        with hearing() as inner:
            assert np.array([1.0]) / 0.0 == np.inf
    assert [each.message for each in heard] == ["scheme='upwind' is odd", "another", "another"]
    assert [each.category for each in heard] == [PersfsWarning, RuntimeWarning, RuntimeWarning]
    assert [each.message for each in inner] == ["divide by zero encountered in divide"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("either")
def test_a_block_leaves_the_warnings_as_they_were() -> None:
    before = warnings.showwarning, list(warnings.filters)
    with pytest.raises(ZeroDivisionError), hearing():
        raise ZeroDivisionError
    assert (warnings.showwarning, warnings.filters) == before


def test_what_nobody_listens_to_is_shown_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr(told._Process, "listens", False)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_: shown.append(str(message))
        listen()
        listen()
        with hearing() as heard:
            other = threading.Thread(target=warn, args=("of another thread",))
            other.start()
            other.join()
        warn("after the block")
        warnings.warn("of developers", DeprecationWarning, stacklevel=1)
    assert heard == []
    assert shown == ["of another thread", "after the block"]


@pytest.mark.usefixtures("listening")
def test_a_thread_that_changes_the_warnings_for_a_while_leaves_others_deaf_for_no_longer() -> None:
    usual = told._Process.show
    warnings.showwarning = usual
    warnings.simplefilter("ignore")
    with hearing() as heard:
        warn("something")
    assert [each.message for each in heard] == ["something"]


@pytest.mark.usefixtures("either")
def test_warnings_concern_the_innermost_image() -> None:
    with hearing() as heard:
        warn("a")
        with concerning(3):
            warn("b")
            with concerning(0):
                warn("c")
            warn("d")
    assert [(each.message, each.place) for each in heard] == [("a", None), ("b", 3), ("c", 0), ("d", 3)]


def both_at_once(first: threading.Barrier) -> bool:
    """Whether another thread is in such a block too, or comes in while this one waits."""
    with decoding("a.png"):
        try:
            first.wait()
        except threading.BrokenBarrierError:
            return False
        return True


def test_decoders_wait_for_each_other_but_where_each_thread_listens(request: pytest.FixtureRequest) -> None:
    with ThreadPoolExecutor(2) as pool:
        assert not any(pool.map(both_at_once, [threading.Barrier(2, timeout=0.3)] * 2))
    request.getfixturevalue("listening")
    with ThreadPoolExecutor(2) as pool:
        assert all(pool.map(both_at_once, [threading.Barrier(2, timeout=600)] * 2))


@pytest.mark.usefixtures("either")
def test_threads_at_once_hear_of_their_own_files_alone(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    request.addfinalizer(functools.partial(sys.setswitchinterval, sys.getswitchinterval()))
    sys.setswitchinterval(1e-6)
    files = [tiff(tmp_path / f"{number}.tif", odd=number % 2 == 0) for number in range(THREADS)]
    begin = threading.Barrier(THREADS)

    def read(file: Path) -> list[list[str]]:
        begin.wait()
        said = []
        for _ in range(20):
            with hearing() as heard:
                read_photo(file)
            said.append([each.message for each in heard])
        return said

    with ThreadPoolExecutor(THREADS) as pool:
        for number, said in enumerate(pool.map(read, files)):
            if number % 2:
                assert said == [[]] * 20
            else:
                assert all(
                    len(messages) == 1 and messages[0].startswith(f"{files[number]} was read, but is damaged or odd (")
                    for messages in said
                )
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("either")
def test_a_compiler_is_not_heard_twice(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """What pyopencl warns of is in the log of the build, which is read."""
    usual = cl.Program.build

    def build(program: cl.Program, *given: Any) -> cl.Program:
        warnings.warn("Non-empty compiler output encountered.", cl.CompilerWarning, stacklevel=1)
        warnings.warn("no space left for the cache", UserWarning, stacklevel=1)
        return usual(program, *given)  # type: ignore[no-any-return]

    monkeypatch.setattr(cl.Program, "build", build)
    with hearing() as heard:
        program(device, ["boundary", "renew"], "float32", {"ONLY_IN_THE_TEST_OF_HEARING": len(device.programs)})
    assert [each.message for each in heard] == ["no space left for the cache"]


@pytest.mark.usefixtures("either")
def test_warnings_of_images_that_share_launches_say_which() -> None:
    """The lamp is too far from the camera for the first surface, and not for the second, which is farther away."""
    options = complete({"light": ps.FlashLight(offset=(0.8, 0.0, 0.0)), "scheme": "lax-friedrichs"})
    device, *_ = ps.devices()
    scene = ps.bump((24, 30), light=ps.FlashLight())
    images = (scene.image, scene.image / 100.0)
    problems = [prepare(image, scene.camera, None, None, None, options=options) for image in images]
    with hearing() as heard:
        solve(device, problems, options, None)
        solve(device, problems, options, None, [5, 7])
    assert [each.place for each in heard if "is too far from the camera" in each.message] == [0, 5]


@pytest.mark.usefixtures("either")
def test_warnings_of_a_batch_say_which_image() -> None:
    """Under a flash a dark background becomes far away, and the images before and after it have none."""
    image = ps.bump((20, 20), light=ps.FlashLight()).image
    dark = image.copy()
    dark[:5] *= 1e-4
    wide = np.vstack([dark, dark])
    camera = ps.bump((20, 20)).camera
    with hearing() as heard:
        ps.reconstruct_batch([image, dark, image, wide], camera, light=ps.FlashLight())
    assert [each.place for each in heard if "darker than" in each.message] == [1, 3]


def test_a_process_of_its_own_prints_nothing(tmp_path: Path) -> None:
    script = """
import sys
from concurrent.futures import ThreadPoolExecutor
from persfs_cl.errors import PersfsWarning
from persfs_cl.io.photos import read_photo
from persfs_cl.told import hearing, listen

def read(file):
    with hearing() as heard:
        read_photo(file)
    return len(heard)

listen()
with ThreadPoolExecutor(4) as pool:
    print(*pool.map(read, sys.argv[1:]))
"""
    files = [tiff(tmp_path / f"{number}.tif", odd=number % 3 == 0) for number in range(6)]
    done = subprocess.run(
        [sys.executable, "-c", script, *files], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert (done.stdout, done.stderr) == ("1 0 0 1 0 0\n", "")
