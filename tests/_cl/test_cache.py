"""Caches of compiled kernels that are unwritable, full of rubbish or cut short."""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import pyopencl as cl
import pytest

import persfs_cl as ps
from persfs_cl._cl import cache
from persfs_cl._cl import program as program_module
from persfs_cl._cl.kernel import kernel
from persfs_cl._cl.program import program
from persfs_cl._cl.selection import select_device

# The smallest kernel there is.
KERNEL = (
    "from persfs_cl._cl.registers import register_bits; from persfs_cl._cl.selection import select_device; "
    "print(register_bits(select_device()))"
)


def run(**environment: str) -> subprocess.CompletedProcess[str]:
    """A process that compiles a kernel, or finds it in the cache."""
    inherited = {name: value for name, value in os.environ.items() if name != "POCL_CACHE_DIR"}
    return subprocess.run(
        [sys.executable, "-c", KERNEL],
        env={**inherited, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Caches of a process that has compiled a kernel, and what it printed."""
    folder = tmp_path_factory.mktemp("caches")
    first = run(XDG_CACHE_HOME=str(folder))
    assert (first.returncode, first.stderr) == (0, "")
    assert first.stdout.strip() != ""
    return folder, first.stdout


@pytest.mark.parametrize(
    ("pattern", "size"),
    [
        pytest.param("program.bc", 1000, marks=pytest.mark.thorough),
        pytest.param("program.bc", 0, marks=pytest.mark.thorough),
        ("*.so", 3000),
        pytest.param("*.so", 0, marks=pytest.mark.thorough),
        ("*.sqlite", 3000),
        ("*.sqlite", None),
        pytest.param("*.so", None, marks=pytest.mark.thorough),
        pytest.param("program.bc", None, marks=pytest.mark.thorough),
    ],
)
def test_a_damaged_cache_is_made_whole_without_a_word(
    filled: tuple[Path, str], tmp_path: Path, pattern: str, size: int | None
) -> None:
    folder, printed = filled
    damaged = tmp_path / "caches"
    shutil.copytree(folder, damaged)
    files = list(damaged.rglob(pattern))
    if not files and select_device().is_pocl:
        pytest.fail(f"no {pattern} in {sorted(damaged.rglob('*'))}")
    for file in files:
        if size is None:
            file.write_bytes(b"rubbish")
        else:
            os.truncate(file, size)
    second = run(XDG_CACHE_HOME=str(damaged))
    assert (second.returncode, second.stdout, second.stderr) == (0, printed, "")


@pytest.mark.parametrize("change", ["DROP TABLE dict", "UPDATE dict SET key_value = x'00ff'", "a folder"])
def test_a_database_of_another_form_does_no_harm(filled: tuple[Path, str], tmp_path: Path, change: str) -> None:
    folder, printed = filled
    damaged = tmp_path / "caches"
    shutil.copytree(folder, damaged)
    (file,) = damaged.rglob("*invoker*.sqlite")
    if change == "a folder":
        file.unlink()
        file.mkdir()
    else:
        with contextlib.closing(sqlite3.connect(file)) as database:
            database.execute(change)
            database.execute("CREATE TABLE IF NOT EXISTS dict (other TEXT)")
            database.commit()
    second = run(XDG_CACHE_HOME=str(damaged))
    assert (second.returncode, second.stdout, second.stderr) == (0, printed, "")


def test_a_kernel_that_cannot_be_prepared_is_an_error_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError("no room")

    device, constants = select_device(), {"ONLY_IN_THE_TEST_OF_KERNELS": 1}
    monkeypatch.setattr(cl, "_PYOPENCL_NO_CACHE", False)
    monkeypatch.setattr(cl, "Kernel", refuse)
    with pytest.raises(ps.KernelBuildError, match=r"renew_boundary cannot be prepared \(OSError: no room\)"):
        kernel(device, ["boundary", "renew"], "float32", constants, "renew_boundary")


@pytest.mark.parametrize("variable", ["POCL_CACHE_DIR", pytest.param("XDG_CACHE_HOME", marks=pytest.mark.thorough)])
def test_an_unusable_cache_is_replaced_and_named(filled: tuple[Path, str], tmp_path: Path, variable: str) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.touch()
    environment = {"XDG_CACHE_HOME": str(filled[0]), variable: str(in_the_way), "TMPDIR": str(tmp_path)}
    done = run(**environment)
    assert (done.returncode, done.stdout) == (0, filled[1])
    warned = [line for line in done.stderr.splitlines() if "PersfsWarning" in line]
    assert any(str(in_the_way) in line and variable in line for line in warned)
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == [in_the_way], "private caches go with their process"


def test_a_cache_of_binaries_in_the_way_is_named(filled: tuple[Path, str], tmp_path: Path) -> None:
    """Drivers other than PoCL need it."""
    caches = tmp_path / "caches"
    shutil.copytree(filled[0], caches, ignore=shutil.ignore_patterns("pyopencl"))
    (caches / "pyopencl").touch()
    done = run(XDG_CACHE_HOME=str(caches))
    assert (done.returncode, done.stdout) == (0, filled[1])
    assert f"The kernel cache {caches / 'pyopencl'} cannot be used" in done.stderr
    assert "XDG_CACHE_HOME" in done.stderr


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_found_before_kernels_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert cache._problem(tmp_path / "new", 2**16) is None
    full = Path("/dev/full").open("wb")  # noqa: SIM115 # closed by whoever is given it
    monkeypatch.setattr("tempfile.TemporaryFile", lambda **_: full)
    assert cache._problem(tmp_path, 2**16) == "No space left on device"
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]


@pytest.mark.parametrize("reason", ["no folder", "no more files"])
def test_where_no_cache_can_be_the_reason_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, reason: str) -> None:
    usual = os.statvfs(tmp_path)
    in_the_way = tmp_path / "a {} in its name"
    in_the_way.touch()
    monkeypatch.setenv("POCL_CACHE_DIR", str(in_the_way) if reason != "no more files" else str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing" if reason == "no folder" else tmp_path))
    said = {
        "no folder": "No such file or directory",
        "no more files": "the disk has room for no more files",
    }

    if reason == "no more files":
        monkeypatch.setattr(os, "statvfs", lambda _: os.statvfs_result((*usual[:5], 1000, 3, 3, *usual[8:])))
    with pytest.raises(ps.DeviceError, match=f"{said[reason]}.*POCL_CACHE_DIR, or TMPDIR"):
        cache.prepare_caches()


def test_a_forked_child_leaves_the_cache_of_its_parent(tmp_path: Path) -> None:
    cache._remove(str(tmp_path), os.getpid() + 1)
    assert tmp_path.is_dir()
    cache._remove(str(tmp_path), os.getpid())
    assert not tmp_path.exists()


def test_files_that_are_cut_short_are_told_from_whole_ones(filled: tuple[Path, str], tmp_path: Path) -> None:
    files = [file for pattern in ("program.bc", "*.so") for file in filled[0].rglob(pattern)]
    if not files:
        pytest.skip("no device here has a cache of PoCL's form")
    for file in files:
        assert cache._is_whole(file)
        content = file.read_bytes()
        for share in range(10):
            part = tmp_path / f"part{file.suffix}"
            part.write_bytes(content[: len(content) * share // 10])
            assert not cache._is_whole(part)
            part.write_bytes(content[: len(content) * share // 10].ljust(len(content), b"\0"))
            assert not cache._is_whole(part)


def test_only_empty_files_that_pocl_has_forgotten_are_removed(tmp_path: Path) -> None:
    old, new, used = (tmp_path / f"tempfile_{name}" for name in ("old", "new", "used"))
    for file in (old, new, used):
        file.touch()
    used.write_text("kernel")
    long_ago = time.time() - 7200
    for file in (old, used):
        os.utime(file, (long_ago, long_ago))
    cache._clean_pocl(tmp_path)
    assert sorted(tmp_path.iterdir()) == [new, used]


def test_a_cache_is_left_alone_whose_damage_cannot_be_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As that of another user."""
    program_folder = tmp_path / "AB" / "PROGRAM"
    program_folder.mkdir(parents=True)
    (program_folder / "program.bc").write_bytes(b"BC")
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with monkeypatch.context() as changed:
        changed.setattr(shutil, "rmtree", lambda *_arguments, **_keywords: None)
        (said,) = cache.prepare_caches()
    assert said.startswith(f"The kernel cache {tmp_path} cannot be used ({program_folder} in it is damaged, and cannot")
    assert os.environ["POCL_CACHE_DIR"] != str(tmp_path)
    assert cache.prepare_caches() == []
    monkeypatch.setenv("POCL_CACHE_DIR", str(tmp_path))
    assert cache.prepare_caches() == []
    assert not program_folder.exists()


def test_what_the_cache_cannot_load_is_built_again(monkeypatch: pytest.MonkeyPatch) -> None:
    # Chosen first: that too may compile something.
    chosen = select_device()
    tried = []
    usual = cl.Program.build

    def build(self: cl.Program, options: list[str]) -> Any:
        tried.append(options)
        if len(tried) == 1:
            raise KeyError("PYOPENCL_CACHE_FAILURE_FATAL")
        return usual(self, options)

    monkeypatch.setattr(cl.Program, "build", build)
    program(chosen, ["boundary", "renew"], "float32", {"ONLY_IN_THE_TEST_OF_THE_CACHE": 1})
    assert len(tried) == 2
    assert set(tried[1]) - set(tried[0]) == {"-DATTEMPT=1"}


def test_what_never_builds_is_an_error_of_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = select_device()

    def build(*_: object) -> None:
        raise cl.LogicError("clBuildProgram failed: INVALID_OPERATION")

    monkeypatch.setattr(cl.Program, "build", build)
    with pytest.raises(ps.KernelBuildError, match=r"INVALID_OPERATION(?s:.)*Delete the kernel cache"):
        program(chosen, ["boundary", "renew"], "float32", {"ONLY_IN_THE_TEST_OF_FAILURE": 1})


def test_the_compiler_is_heard_only_about_our_source(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same words without the name of a kernel file are the driver's chatter."""
    source = "__kernel void mended(__global float *a) { a[0] = 1; }\n"
    texts = {"prelude": "typedef float real;\n", "renew": source}
    monkeypatch.setattr(program_module, "kernel_source", lambda name: texts.get(name, "\n"))
    for number, said in enumerate(("Compilation started\nCompilation done", "renew.cl:1:7: warning: odd")):
        monkeypatch.setattr(cl.Program, "get_build_info", lambda *_, text=said: text)
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            program(device, ["boundary", "renew"], "float32", {"ONLY_IN_THE_TEST_OF_WORDS": number})
        assert [said in str(warning.message) for warning in heard] == [True] * number
