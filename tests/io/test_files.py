"""Files are read whole and written whole, and a refusal says why and what to do."""

from __future__ import annotations

import os
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from persfs_cl.errors import InputError
from persfs_cl.io import files
from persfs_cl.io.files import as_path, atomic_path, filling, is_temporary, read_bytes, read_lines, remove_leftovers


def test_the_target_appears_only_when_the_block_ends(tmp_path: Path) -> None:
    target = tmp_path / "depth.tiff"
    with atomic_path(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".tiff"
        temporary.write_text("new")
        assert not target.exists()
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), ValueError("no"), OSError("no")])
def test_a_failure_keeps_the_old_file_and_leaves_nothing_behind(tmp_path: Path, failure: BaseException) -> None:
    target = tmp_path / "depth.npy"
    target.write_text("old")

    def write() -> None:
        with atomic_path(target) as temporary:
            temporary.write_text("half")
            raise failure

    with pytest.raises(InputError if isinstance(failure, OSError) else type(failure)):
        write()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_error_before_anything_was_written_is_reported_as_it_is(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), atomic_path(tmp_path / "a.png"):
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_permissions_follow_the_umask(tmp_path: Path, mask: int) -> None:
    target = tmp_path / "depth.npy"
    before = os.umask(mask)
    try:
        with atomic_path(target) as temporary:
            temporary.write_text("x")
    finally:
        os.umask(before)
    assert stat.S_IMODE(target.stat().st_mode) == 0o666 & ~mask


def test_a_symbolic_link_stays_a_link(tmp_path: Path) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (tmp_path / "link.npy").symlink_to(folder / "real.npy")
    with atomic_path(tmp_path / "link.npy") as temporary:
        temporary.write_text("x")
    assert (tmp_path / "link.npy").is_symlink()
    assert (folder / "real.npy").read_text() == "x"


def test_a_relative_name_is_taken_from_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with atomic_path("a.txt") as temporary:
        temporary.write_text("x")
    assert (tmp_path / "a.txt").read_text() == "x"


def write_to(target: Path) -> None:
    with atomic_path(target) as temporary:
        temporary.write_text("x")


def test_a_missing_folder_is_named_with_the_remedy(tmp_path: Path) -> None:
    target = tmp_path / "missing" / "a.npy"
    with pytest.raises(InputError, match=r"a\.npy cannot be written: No such file.*Create the folder first"):
        write_to(target)


@pytest.mark.parametrize("inside", ["a.npy", "deeper/a.npy"])
def test_a_folder_that_is_a_file_is_named_with_the_remedy(tmp_path: Path, inside: str) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"a\.npy cannot be written: Not a directory.*is a file, not a folder"):
        write_to(tmp_path / "file" / inside)


def test_a_name_that_is_too_long_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"File name too long.*shorter name"):
        write_to(tmp_path / ("a" * 300 + ".npy"))


def test_a_folder_is_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "folder.npy"
    target.mkdir()
    with pytest.raises(InputError, match=r"folder\.npy is not a regular file"):
        write_to(target)
    assert target.is_dir()


def test_a_device_is_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="pipe is not a regular file"):
        write_to(pipe)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_named_with_the_remedy(tmp_path: Path) -> None:
    def write() -> None:
        with atomic_path(tmp_path / "a.npy") as temporary:
            temporary.symlink_to("/dev/full")
            temporary.write_text("x")

    with pytest.raises(InputError, match=r"a\.npy cannot be written: No space left on device\. Free some space"):
        write()
    assert not list(tmp_path.iterdir())
    assert Path("/dev/full").is_char_device()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_write_permission_is_named_with_the_remedy(tmp_path: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    with pytest.raises(InputError, match=r"Permission denied.*may write to"):
        write_to(folder / "a.npy")


def test_read_bytes_gives_the_whole_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\0\1\2")
    assert read_bytes(tmp_path / "a") == b"\0\1\2"


def test_read_bytes_says_why_it_cannot(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    with pytest.raises(InputError, match=r"missing\.png does not exist: check the spelling"):
        read_bytes(tmp_path / "missing.png")
    with pytest.raises(InputError, match=r"https://example\.org/a\.jpg is an address, not a file: download it"):
        read_bytes(Path("https://example.org/a.jpg"))
    with pytest.raises(InputError, match="is a folder: name a file in it"):
        read_bytes(tmp_path)
    (tmp_path / "depth.npy").touch()
    with pytest.raises(InputError, match=r"is a folder: give .*/depth\.npy\."):
        read_bytes(tmp_path)
    with pytest.raises(InputError, match=r"empty\.png is empty \(0 bytes\)"):
        read_bytes(tmp_path / "empty.png")
    with pytest.raises(InputError, match=r"cannot be read: Not a directory"):
        read_bytes(tmp_path / "empty.png" / "a.png")


def test_lines_have_numbers_and_are_utf_8(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbf\xc3\xa9 \r\n\n z")
    assert list(read_lines(tmp_path / "a.txt")) == [(1, "é"), (2, ""), (3, "z")]
    (tmp_path / "a.txt").write_bytes(b"a\n\xff\xfe")
    with pytest.raises(InputError, match=r"a\.txt, line 2, is no UTF-8 \(invalid start byte\): save it as UTF-8"):
        list(read_lines(tmp_path / "a.txt"))


def test_files_without_a_size_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As /proc/kmsg, which waits for more."""
    (tmp_path / "empty").touch()
    monkeypatch.setattr(Path, "open", lambda *_: pytest.fail("was read"))
    with pytest.raises(InputError, match=r"is empty \(0 bytes\)"):
        read_bytes(tmp_path / "empty")


def test_what_is_no_regular_file_is_refused_without_being_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")  # opening it would wait for a writer, for ever
    with pytest.raises(InputError, match=r"pipe is a pipe, not a regular file: save its content as a file"):
        read_bytes(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    with pytest.raises(InputError, match="link is a pipe, not a regular file"):
        read_bytes(tmp_path / "link")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "s"))
        with pytest.raises(InputError, match="s is a socket, not a regular file"):
            read_bytes(tmp_path / "s")
    with pytest.raises(InputError, match="/dev/zero is a device, not a regular file"):
        read_bytes("/dev/zero")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    with pytest.raises(InputError, match="loop cannot be read: Too many levels of symbolic links"):
        read_bytes(tmp_path / "loop")
    with pytest.raises(InputError, match=r"is no path \(embedded null"):
        read_bytes("a\0b")


def test_a_file_larger_than_the_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object) -> bytes:
        raise MemoryError

    (tmp_path / "a").write_bytes(b"x")
    monkeypatch.setattr(Path, "open", fail)
    with pytest.raises(InputError, match="a is larger than the memory: give a smaller file"):
        read_bytes(tmp_path / "a")


def test_a_write_that_stops_short_without_a_reason_is_taken_for_a_full_disk(tmp_path: Path) -> None:
    def write() -> None:
        with atomic_path(tmp_path / "a.npy"):
            raise OSError("10000 requested and 5064 written")  # NumPy's words

    with pytest.raises(InputError, match=r"a\.npy cannot be written: 10000 .* The disk is probably full: free some"):
        write()


def fill(folder: Path, failure: BaseException | None = None) -> None:
    with filling(folder) as temporary:
        for name in ("a", "b"):
            (temporary / name).write_text("new")
        if failure:
            raise failure


@pytest.mark.parametrize("use", [as_path, write_to, fill, read_bytes])
def test_what_is_no_path_is_refused(use: Callable[[Any], object]) -> None:
    with pytest.raises(InputError, match=r"3 is no path: give a text or a pathlib\.Path"):
        use(3)
    with pytest.raises(InputError, match=r"'' is no path: it is empty\. Give a name"):
        use("")


def test_a_folder_is_filled_with_all_files_at_once(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    fill(folder)
    assert sorted(path.name for path in folder.iterdir()) == ["a", "b"]
    (folder / "a").write_text("old")
    (folder / "mine").write_text("mine")
    fill(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a": "new", "b": "new", "mine": "mine"}


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), ValueError("no"), OSError("no"), InputError("no")])
def test_a_failure_leaves_the_folder_and_those_above_it_as_they_were(tmp_path: Path, failure: BaseException) -> None:
    expected = InputError if isinstance(failure, OSError) else type(failure)
    with pytest.raises(expected):
        fill(tmp_path / "x" / "y" / "z", failure)
    assert not list(tmp_path.iterdir())
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "a").write_text("old")
    for folder in ("x", "x/y/z"):
        with pytest.raises(expected):
            fill(tmp_path / folder, failure)
    assert [path.name for path in (tmp_path / "x").iterdir()] == ["a"]
    assert (tmp_path / "x" / "a").read_text() == "old"


def test_nothing_is_replaced_when_one_file_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("old")
    (tmp_path / "b").mkdir()
    with pytest.raises(InputError, match="b is a folder and cannot be replaced"):
        fill(tmp_path)
    assert (tmp_path / "a").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_an_interruption_while_files_are_moved_comes_too_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "old").write_text("old")
    (tmp_path / "a").write_text("old")
    usual, moved = Path.replace, []

    def replace(path: Path, target: Path) -> Path:
        moved.append(target.name)
        if len(moved) == 2:
            raise KeyboardInterrupt
        return usual(path, target)

    def interrupted() -> None:
        with filling(tmp_path, lambda names: {"old"} - {*names}) as temporary:
            for name in ("a", "b", "c"):
                (temporary / name).write_text("new")

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "new", "b": "new", "c": "new"}


UNTIL_KILLED = """
import sys, time
from pathlib import Path
from persfs_cl.io.files import atomic_path, filling

with filling(sys.argv[1]) as folder, atomic_path(Path(sys.argv[1]) / "a.npy") as file:
    for place in (folder / "depth.npy", file):
        place.write_text("half")
    print("ready", flush=True)
    time.sleep(600)
"""


@pytest.fixture
def unfinished(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that is writing to tmp_path / "out"."""
    command = [sys.executable, "-c", UNTIL_KILLED, str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield process
        process.kill()


def write_and_list(folder: Path, write: Callable[[Path], None]) -> tuple[list[str], list[str]]:
    """Names that are there after a writing, results and temporary ones."""
    write(folder)
    found = sorted(folder.iterdir())
    return [path.name for path in found if not is_temporary(path)], [path.name for path in found if is_temporary(path)]


@pytest.mark.skipif(os.name != "posix", reason="needs locks that a killed process gives back")
@pytest.mark.parametrize("write", [fill, lambda folder: write_to(folder / "a")])
def test_what_a_killed_process_left_is_removed_and_a_living_one_is_let_be(
    unfinished: subprocess.Popen[str], write: Callable[[Path], None], tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    _, of_living = write_and_list(folder, write)
    assert len(of_living) == 4, "a lock each for a folder and a file"
    unfinished.kill()
    unfinished.wait()
    results, left = write_and_list(folder, write)
    assert "a" in results
    assert left == []


DAY = 24 * 3600.0


@pytest.mark.parametrize("machine", ["this", "other"])
@pytest.mark.parametrize("locks", ["free", "missing", "held", "unsupported"])
def test_leftovers_of_another_machine_must_be_old(
    machine: str, locks: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = files._machine() if machine == "this" else "0" * 8
    stem = f".persfs-cl-{name}-{'1' * 32}"
    lock, file, folder = (tmp_path / f"{stem}{end}" for end in ("", "-file.npy", "-abc"))
    folder.mkdir()
    places = [folder, folder / "depth.npy", file] + [lock] * (locks != "missing")
    for place in places[1:]:
        place.write_text("half")
    with lock.open() if locks == "held" else nullcontext() as held:
        if held is not None:
            assert files._taken(held.fileno())
        if locks == "unsupported":
            monkeypatch.setattr(files, "_taken", lambda _handle: None)
        remove_leftovers(tmp_path)
        sure = machine == "this" and locks in ("free", "missing")
        assert bool(list(tmp_path.iterdir())) != sure
        for place in places if not sure else ():
            os.utime(place, (time.time() - 1.1 * DAY,) * 2)
        remove_leftovers(tmp_path)
        assert bool(list(tmp_path.iterdir())) == (locks == "held")


def test_only_our_own_names_are_taken_for_leftovers(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine").write_text("mine")
    for name in (".persfs", "persfs-cl-mine", ".persfs-cl-young"):
        (tmp_path / name).write_text("mine")
    (tmp_path / ".persfs-cl-folder").mkdir()
    (tmp_path / ".persfs-cl-link").symlink_to(tmp_path / "elsewhere")
    for path in [*tmp_path.iterdir()]:
        if path.name != ".persfs-cl-young":
            os.utime(path, (time.time() - 1.1 * DAY,) * 2, follow_symlinks=False)
    remove_leftovers(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {".persfs", "persfs-cl-mine", ".persfs-cl-young", "elsewhere"}
    assert (tmp_path / "elsewhere" / "mine").read_text() == "mine"
    remove_leftovers(tmp_path / "missing")


def test_a_lock_that_was_removed_before_it_was_held_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = files._taken
    made: list[Path] = []

    def too_late(handle: int) -> bool | None:
        (lock,) = (path for path in tmp_path.iterdir() if is_temporary(path))
        made.append(lock)
        if len(made) == 1:
            lock.unlink()
        return usual(handle)

    monkeypatch.setattr(files, "_taken", too_late)
    write_to(tmp_path / "a")
    assert len(set(made)) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
