"""What a run wrote to a folder, told to the next one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from persfs_cl.io.account import ACCOUNT, give_account, superseded, written_before


def test_only_unchanged_files_of_the_account_are_a_runs(tmp_path: Path) -> None:
    for name in ("a", "b", "c", "link", "same size"):
        (tmp_path / name).write_text(name)
    give_account(tmp_path)
    (tmp_path / "foreign").write_text("x")
    (tmp_path / "b").write_text("changed")
    # The clock of a file system may be coarse, so the time is set.
    os.utime(tmp_path / "same size", ns=(0, 1))
    (tmp_path / "link").unlink()
    (tmp_path / "link").symlink_to("foreign")
    assert written_before(tmp_path) == {"a", "c"}
    assert superseded(tmp_path, ["c"]) == {"a"}
    assert superseded(tmp_path, [], [tmp_path / "." / "a"]) == {"c"}


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "{}", '{"files": 3}', "[" * 100_000),
        '{"files": {"../mine": [4, 1], "..": [4, 1], "": [4, 1], "mine": 4}}',
        '{"files": {"mine": [4]}}',
    ],
)
def test_an_account_that_is_none_names_no_file(text: str, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    os.utime(tmp_path / "mine", ns=(1, 1))
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine").write_text("mine")
    os.utime(folder / "mine", ns=(1, 1))
    (folder / ACCOUNT).write_text(text)
    assert written_before(folder) == set()
