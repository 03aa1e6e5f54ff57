"""Ctrl-C and other signals, and what a person at a terminal sees meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from command import FOCAL, WIDTH, names, run, strict

import persfs_cl as ps
from persfs_cl.cli.interrupts import raising, stop_on_interrupt
from persfs_cl.cli.progress import remaining_iterations
from persfs_cl.io.account import give_account
from persfs_cl.io.export import write_depth, write_grey
from persfs_cl.io.photos import read_photo
from persfs_cl.preparation import normalise as grey
from persfs_cl.surface.jobs import Jobs
from persfs_cl.surface.writing import draw_all


def test_second_interrupt_writes_nothing(photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_arguments: object, **_keywords: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("persfs_cl.pipeline.job.reconstruct", interrupted)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert (outcome.status, outcome.stdout) == (130, "")
    assert "interrupted" in outcome.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupt_of_the_preparation_writes_nothing(
    number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def prepare(*_arguments: object, **_keywords: object) -> None:
        signal.raise_signal(number)
        pytest.fail("the preparation goes on")

    monkeypatch.setattr("persfs_cl.pipeline.job.prepare_photo", prepare)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert outcome == (130, "", "persfs-cl: interrupted.")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("ctrl_c", "quick")
def test_an_interrupt_before_the_guide_was_used_says_so(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def progress(*_arguments: object) -> Iterator[Callable[[int, float], None]]:
        def show(iteration: int, _change: float) -> None:
            if iteration == 2:
                signal.raise_signal(signal.SIGINT)

        yield show

    (tmp_path / "points.csv").write_text("3,4,1.0\n20,12,1.1\n", encoding="utf-8")
    monkeypatch.setattr("persfs_cl.cli.reconstruct.progress_line", progress)
    guided = ("--guide", tmp_path / "points.csv", "--scheme=lax-friedrichs", "--tolerance=0", "--save=depth.npy")
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, *guided)
    assert outcome.status == 130
    assert "The guide was not used yet when the run was ended." in outcome.stderr


@pytest.mark.usefixtures("ctrl_c", "quick")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_twice_at_once_keeps_what_there_is(
    number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def progress(*_arguments: object) -> Iterator[Callable[[int, float], None]]:
        def show(iteration: int, _change: float) -> None:
            for _ in range(2 * (iteration == 2)):  # as timeout sends it
                signal.raise_signal(number)

        yield show

    monkeypatch.setattr("persfs_cl.cli.reconstruct.progress_line", progress)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--scheme=lax-friedrichs", "--tolerance=0")
    assert outcome.status == 130
    assert strict(tmp_path / "out" / "report.json")["status"] == "STOPPED"
    assert strict(tmp_path / "out" / "report.json")["iterations"] == 2
    assert names(tmp_path / "out") == {
        "camera.json",
        "depth.npy",
        "depth.tiff",
        "mesh.ply",
        "report.json",
        "solution.npz",
        "index.html",
    }


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    ("existing", "number"), [(False, signal.SIGINT), (True, signal.SIGINT), (True, signal.SIGTERM)]
)
def test_interrupt_of_the_pictures_keeps_the_rest(
    existing: bool, number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "photo.png").write_bytes(photo.read_bytes())
    if existing:
        (out / "normals.png").write_text("of an earlier run, and goes with it")
        give_account(out)
        (out / "relief.png").write_text("old")

    def interrupted(drawings: Mapping[str, Callable[[], None]], jobs: Jobs) -> list[str]:
        if drawings:
            signal.raise_signal(number)
        return draw_all(drawings, jobs)

    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", interrupted)
    outcome = run("reconstruct", out / "photo.png", "-o", out, *FOCAL, "--overwrite")
    kept = {"camera.json", "depth.npy", "depth.tiff", "mesh.ply", "report.json", "solution.npz"}
    assert outcome.status == 130
    assert {Path(line) for line in outcome.stdout.splitlines()} == {out / name for name in kept}
    assert names(out) == kept | {"photo.png"} | ({"relief.png"} if existing else set())
    assert "depth, mesh, report and solution are still written, the pictures are not" in outcome.stderr
    assert ("PNG files in the folder are not of this run." in outcome.stderr) == existing
    assert strict(out / "report.json")["status"] == "CONVERGED"
    image = grey.normalise_linear(read_photo(photo).image)
    np.testing.assert_array_equal(np.load(out / "depth.npy"), ps.reconstruct(image, ps.Camera(WIDTH)).depth)


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    ("items", "kept", "said"),
    [("depth.npy,relief.png", {"depth.npy"}, "depth is still written"), ("relief.png", set(), "interrupted.")],
)
def test_interrupt_of_the_pictures_keeps_what_else_was_wanted(
    items: str, kept: set[str], said: str, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "persfs_cl.surface.plots.relief_picture", lambda *_arguments, **_keywords: signal.raise_signal(signal.SIGINT)
    )
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--save", items)
    assert outcome.status == 130
    assert said in outcome.stderr
    assert (names(tmp_path / "out") if kept else set()) == kept
    assert (tmp_path / "out").exists() == bool(kept)


@pytest.mark.usefixtures("ctrl_c", "quick")
def test_second_interrupt_of_the_writing_leaves_nothing(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("persfs_cl.io.clouds._put", lambda *_arguments: signal.raise_signal(signal.SIGINT))
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert (outcome.status, outcome.stdout) == (130, "")
    assert outcome.stderr.endswith("persfs-cl: interrupted.")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("module", ["typer", "persfs_cl.cli.reconstruct"])
def test_interrupt_of_the_start_is_quiet(module: str) -> None:
    script = f"""
import sys
class Interrupt:
    def find_spec(name, *_arguments):
        if name == {module!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt)
from persfs_cl.cli import main
main()
"""
    command = [sys.executable, "-c", script, "reconstruct", "photo.png", "-o", "out"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "persfs-cl: interrupted.\n")


@pytest.mark.usefixtures("ctrl_c")
def test_stop_on_interrupt_asks_first_and_raises_then() -> None:
    with stop_on_interrupt() as asked:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert not asked(), "from here on there is something to keep"
        signal.raise_signal(signal.SIGINT)
        assert asked()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.usefixtures("ctrl_c")
def test_stop_on_interrupt_leaves_an_ignored_interrupt_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with stop_on_interrupt() as asked:
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
            assert not asked()


@pytest.mark.usefixtures("ctrl_c")
def test_interrupt_in_a_weak_reference_ends_the_command() -> None:
    things = [{"some", "thing"}]
    reference = weakref.ref(things[0], lambda _reference: signal.raise_signal(signal.SIGINT))

    def draw() -> None:
        things.clear()  # Python drops what this raises
        assert reference() is None
        for _ in range(6000):
            time.sleep(0.1)

    with pytest.raises(KeyboardInterrupt), raising():
        draw()


@pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")
def test_progress_on_a_terminal_and_interrupt_of_a_real_run(tmp_path: Path) -> None:
    # From its one known peak a bump of this size takes thousands of iterations of the paper's scheme to come to rest,
    # and half a minute of the processor's: the interrupt may come late.
    scene = ps.bump((240, 240)).seeded()
    write_grey(tmp_path / "photo.png", scene.image, 16)
    write_depth(tmp_path / "known.npy", scene.known_depth)
    # A test run in the background of a shell would hand on that Ctrl-C is ignored.
    script = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    command = [sys.executable, "-c", f"{script}from persfs_cl.cli import main; main()"]
    command += ["reconstruct", "photo.png", "-o", "out", "--focal-length=240"]
    command += ["--known-depth=known.npy", "--surface", scene.surface, "--scheme=lax-friedrichs"]
    # A picture, and other files.
    files = {"depth.npy", "convergence.png", "depth.tiff", "report.json"}
    command += ["--ordering=lexicographic", "--tolerance=0", "--max-iterations=1000000", "--save", ",".join(files)]
    ours, theirs = os.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        seen, pressed = b"", False
        while chunk := read_or_end(ours):
            seen += chunk
            if b"iteration " in seen and b" left" in seen and not pressed:
                process.send_signal(signal.SIGINT)
                pressed = True
        stdout, _ = process.communicate()
    os.close(ours)
    assert process.returncode == 130, seen
    assert {Path(line).name for line in stdout.decode().splitlines()} == files
    assert names(tmp_path / "out") == files
    report = strict(tmp_path / "out" / "report.json")
    assert report["status"] == "STOPPED"
    assert 1 <= report["iterations"] < 1000000
    assert b"STOPPED after" in seen


def read_or_end(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux says that nobody writes to a pseudo-terminal any more
        return b""


def test_remaining_iterations() -> None:
    halves = [2.0**-k for k in range(11)]
    assert remaining_iterations(halves, 2.0**-30, 1000) == 20
    assert remaining_iterations(halves, 2.0**-30, 15) == 4
    assert remaining_iterations(halves, 2.0**-9, 1000) == 0
    slow = [0.9**k for k in range(11)]
    assert remaining_iterations(slow, 0.9**30, 1000, "change") == 20
    assert remaining_iterations(slow, 9.1 * 0.9**30, 1000, "distance") == 20
    for changes, tolerance in (([1.0], 0.1), (halves, 0.0), ([1.0, 2.0], 0.1), ([1.0, 0.0], 0.1)):
        assert remaining_iterations(changes, tolerance, 100) == 100 - len(changes)
