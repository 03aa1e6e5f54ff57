"""Files made several at a time are those made one by one."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

import pytest
from processes import wait_until

import persfs_cl as ps
from persfs_cl.errors import PersfsWarning
from persfs_cl.surface import plots
from persfs_cl.surface.jobs import Jobs, threads_for
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solution import Solution
from persfs_cl.surface.solved import Derived
from persfs_cl.surface.writing import load_libraries, write_files

FILES = Saving.of("depth,normals.npy,mesh.ply,mesh.obj,normals.png,relief.png,convergence.png,report", mesh_faces=1000)
"""Each kind, and of the pictures three: all have a test of the same in tests/surface/test_plots.py."""


@pytest.fixture(scope="module")
def solution() -> Solution:
    scene = ps.bump((40, 50), light=ps.FlashLight())
    return ps.reconstruct(scene.image, scene.camera, light=scene.light)


def written(solution: Solution, folder: Path, threads: int) -> Mapping[str, bytes]:
    folder.mkdir()
    names = write_files(folder, solution, FILES, Derived(solution), report=lambda: {"a": 1}, threads=threads)
    assert sorted(names) == sorted(path.name for path in folder.iterdir())
    return {name: (folder / name).read_bytes() for name in names}


def test_threads_write_the_same_bytes_and_say_so_in_the_same_order(solution: Solution, tmp_path: Path) -> None:
    one, four = (written(solution, tmp_path / str(threads), threads) for threads in (1, 4))
    assert list(one) == list(FILES.files) == list(four)
    assert one == four


def test_what_several_files_need_is_computed_once(solution: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    computed: list[int] = []
    begun = threading.Barrier(4, timeout=600)
    normals = Solution.normals

    def counted(surface: Solution) -> Any:
        computed.append(1)
        return normals(surface)

    monkeypatch.setattr(Solution, "normals", counted)
    derived = Derived(solution)

    def ask() -> Any:
        begun.wait()
        return derived.normals

    with Jobs(4) as jobs:
        results = [jobs.add(ask) for _ in range(4)]
        found = [result() for result in results]
    assert len(computed) == 1
    assert all(one is found[0] for one in found)
    derived.release()
    assert derived.normals is not found[0]


def test_a_picture_that_fails_is_told_of_by_the_thread_that_asked(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise RuntimeError("no paper")

    monkeypatch.setattr(plots, "relief_picture", fail)
    with pytest.warns(PersfsWarning, match=r"relief\.png could not be drawn \(RuntimeError: no paper\)") as said:
        names = set(written(solution, tmp_path / "some", 3))
    assert names == {*FILES.files} - {"relief.png"}
    assert said[0].filename == __file__


def test_after_an_error_nothing_more_is_begun() -> None:
    begun, ended = threading.Event(), threading.Event()
    later: list[Any] = []

    def wait() -> None:
        begun.set()
        # Until what was to come later is cancelled, however late the other thread comes to that.
        wait_until(lambda: bool(later) and later[0].__self__.cancelled())
        ended.set()

    def fail_while_others_work() -> None:
        with Jobs(2) as jobs:
            jobs.add(wait)
            jobs.add(wait)
            later.append(jobs.add(lambda: None))
            begun.wait()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail_while_others_work()
    assert ended.is_set()
    with pytest.raises(CancelledError):
        later[0]()


def test_one_thread_does_what_is_asked_for_when_it_is_asked_for() -> None:
    done: list[str] = []
    with Jobs(1) as jobs:
        first, second = jobs.add(lambda: done.append("first")), jobs.add(lambda: done.append("second"))
        second()
        first()
    assert done == ["second", "first"]
    assert threads_for(1000) == 1


def test_libraries_are_loaded_for_what_is_wanted_and_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fail() -> None:
        asked.append(1)
        raise OSError("no such library")

    monkeypatch.setattr("persfs_cl.surface.writing.prepare_to_draw", fail)
    load_libraries(Saving.of("depth,mesh,report"))
    assert not asked
    load_libraries(Saving.of("depth,pictures"))
    assert asked
