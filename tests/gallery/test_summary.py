from __future__ import annotations

import csv
import os
import random
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
from made import HOSTILE, failure, record

from persfs_cl.errors import InputError
from persfs_cl.gallery.summary import write_summary


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", errors="surrogateescape", newline="") as file:
        return list(csv.DictReader(file))


def test_a_row_an_image_with_all_that_is_known(tmp_path: Path) -> None:
    path = write_summary(tmp_path, iter([record("a.png", warnings=["one", "two"])]))
    assert path == tmp_path / "summary.csv"
    (row,) = rows_of(path)
    assert row == {
        "name": "a.png",
        "path": "/data/a.png",
        "status": "done",
        "error_kind": "",
        "error": "",
        "warnings": "one\ntwo",
        "height": "48",
        "width": "64",
        "converged": "CONVERGED",
        "iterations": "7",
        "solved": "3000",
        "unreached": "72",
        "clamped": "0",
        "at_bound": "0",
        "depth_min": "0.9",
        "depth_median": "1.0",
        "depth_max": "1.25",
        "mean_error": "1.5",
        "root_mean_square": "2.25",
        "horizontal_view": "50.0",
        "focal_length_x": "60.0",
        "focal_length_y": "61.0",
        "seconds_read": "0.02",
        "seconds_prepare": "0.05",
        "seconds_solve": "0.7",
        "seconds_write": "0.1",
        "device": "cpu: a processor",
        "finished": "2026-11-29T14:00:00+00:00",
        "input_hash": "0123456789abcdef",
        "parameter_hash": "fedcba9876543210",
        "version": "0.1.0",
    }


def test_failures_have_their_reason_and_else_nothing(tmp_path: Path) -> None:
    (row,) = rows_of(write_summary(tmp_path, [failure("a.png", "it is black.")]))
    assert (row["status"], row["error_kind"], row["error"]) == ("failed", "InputError", "it is black.")
    assert {
        row[name] for name in ("height", "iterations", "solved", "depth_min", "focal_length_x", "seconds_solve")
    } == {""}


def test_text_is_quoted_and_numbers_are_not(tmp_path: Path) -> None:
    path = write_summary(tmp_path, [record("=1+1.png")])
    header, line = path.read_text("utf-8").splitlines()
    assert header.startswith('"name","path",')
    assert line.startswith('"=1+1.png","/data/=1+1.png","done","","",')
    assert ",48,64," in line


def test_names_are_as_they_are_byte_for_byte(tmp_path: Path) -> None:
    path = write_summary(tmp_path, map(record, HOSTILE))
    assert [row["name"] for row in rows_of(path)] == sorted(HOSTILE, key=os.fsencode)
    assert b"not text \xff\x80.png" in path.read_bytes()


def test_rows_are_sorted_by_name_whatever_their_order(tmp_path: Path) -> None:
    names = [f"{number:05}.png" for number in range(3000)]
    shuffled = random.Random(5).sample(names, len(names))
    assert [row["name"] for row in rows_of(write_summary(tmp_path, map(record, shuffled)))] == names


def test_memory_does_not_grow_with_the_images(tmp_path: Path) -> None:
    def peak(count: int) -> int:
        tracemalloc.start()
        write_summary(tmp_path, (record(f"{number}.png") for number in range(count)))
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(10)
    assert peak(4000) < 2 * peak(400) + 200_000


def test_no_images_are_a_header(tmp_path: Path) -> None:
    path = write_summary(tmp_path, [])
    assert rows_of(path) == []
    assert path.read_text("utf-8").startswith('"name",')


def test_folder_that_is_missing_is_named(tmp_path: Path) -> None:
    records: list[dict[str, Any]] = []
    with pytest.raises(InputError, match=r"summary\.csv cannot be written"):
        write_summary(tmp_path / "gone", records)
