"""Files of points: what is read from them, and what is said of those that hold none."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import persfs_cl as ps
from persfs_cl.cli.app import app
from persfs_cl.io.points import at_points, compare_points, read_points

CSV = b"column,row,depth\n1,2,3.5\n4,5,0.25\n"
JSON = b'{"points": [{"column": 1, "row": 2, "depth": 3.5}, {"column": 4, "row": 5, "depth": 0.25}]}'
POINTS = [[1.0, 2.0, 3.5], [4.0, 5.0, 0.25]]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.csv", CSV),
        ("a.csv", b"\xef\xbb\xbf" + CSV.replace(b"\n", b"\r\n")),
        ("a.csv", b"1,2,3.5\n\n 4, 5 ,.25"),
        ("a.csv", b'depth,"any, name",row,column\n3.5,x,2,1\n0.25,,5,4\n'),
        ("a.json", JSON),
        ("a.JSON", JSON[11:-1]),
    ],
)
def test_points_of_a_file(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    assert read_points(tmp_path / name).tolist() == POINTS


@pytest.mark.parametrize(
    ("data", "place", "words"),
    [
        (CSV + b"7,8\n", "line 4", "has 2 fields, not 3"),
        (b"1,2,3\n1,2,3,4\n", "line 2", "has 4 fields, not 3"),
        (b'1,2,3\n"1\n2",2,3\n', "line 3", "column '1"),
        (CSV + b"7,,1\n", "line 4", "row ''"),
        (CSV + b"7,1,nan\n", "line 4", "depth 'nan'"),
        (CSV + b"7,1,inf\n", "line 4", "depth 'inf'"),
        (CSV + b"7,1,1e400\n", "line 4", "depth '1e400'"),
        (CSV + b"7,1,-2\n", "line 4", "depth -2"),
        (CSV + b"7,1,5e-324\n", "line 4", "from 1e-30 to 1e+30"),
        (CSV + b"1e18,1,2\n", "line 4", "up to 1e+09"),
        (CSV + b"7,1,2\x00\n", "line 4", ""),
        (CSV + b"7,1,\xff\n", "line 4", "UTF-8"),
        (CSV.decode().encode("utf-16"), "line 1", "UTF-8"),
        (CSV + b"7,1," + b"9" * 140_000 + b"\n", "line 4", "field larger"),
        (CSV + b"7,1," + b"9" * 6000 + b"\n", "line 4", "depth '999"),
        (b"a,b,c\n1,2,3\n", "", "headings 'a, b, c'"),
        (b"1;2;3\n", "", "with commas between"),
        (b"column,row,depth\n", "", "no point"),
        (b"\n", "", "no point"),
    ],
)
def test_what_is_wrong_with_csv(tmp_path: Path, data: bytes, place: str, words: str) -> None:
    check(tmp_path / "points.csv", data, place, words)


@pytest.mark.parametrize(
    ("data", "place", "words"),
    [
        (b"[" * 100_000, "", "nested too deep"),
        (b'[{"column": 1, "row": 2, "depth": ' + b"[" * 500 + b"]" * 500 + b"}]", "point 1", "depth [[["),
        (b'[\n{"column": 1,\n"row" 2}]', "line 3", "at column 7"),
        (b'[{"column": 1, "row": 2, "depth": ' + b"9" * 5000 + b"}]", "", "too many digits"),
        (b'[{"column": 1, "row": 2, "depth": ' + b"9" * 400 + b"}]", "point 1", "depth 999"),
        (b'[{"column": 1, "row": 2, "depth": NaN}]', "point 1", "depth nan"),
        (b'[{"column": 1, "row": 2, "depth": null}]', "point 1", "depth None"),
        (b'[{"column": true, "row": 2, "depth": 1}]', "point 1", "column True"),
        (b'[{"column": "\\ud800", "row": 2, "depth": 1}]', "point 1", r"column '\ud800'"),
        (JSON.replace(b'"row": 5, ', b""), "point 2", "lacks row"),
        (b"[[1, 2, 3]]", "point 1", "no object"),
        (b'"points"', "", "no list"),
        (b'{"points": 3}', "", "holds 3, no list"),
        (b"{}", "", 'without "points"'),
        (b"[]", "", "no point"),
        (b"\xef\xbb\xbf", "line 1", "no JSON"),
    ],
)
def test_what_is_wrong_with_json(tmp_path: Path, data: bytes, place: str, words: str) -> None:
    check(tmp_path / "points.json", data, place, words)


def check(path: Path, data: bytes, place: str, words: str) -> None:
    path.write_bytes(data)
    with pytest.raises(ps.InputError) as caught:
        read_points(path)
    message = str(caught.value)
    assert message.startswith(f"{path}, {place}" if place else str(path))
    assert words in message
    assert re.search(r": (give|mend|rename|save)", message), "there is a remedy"
    assert len(message) < len(str(path)) + 300


@pytest.mark.parametrize(("name", "data"), [("points.csv", CSV), ("points.json", JSON)])
def test_random_edits_give_points_or_an_error_that_names_the_file(tmp_path: Path, name: str, data: bytes) -> None:
    random = np.random.default_rng(5)
    path = tmp_path / name
    alphabet = b"0123456789.,;:-+eEnaNif\"'[]{}\\ \t\n\r\x00\xff\xc3\xe2"
    refused = 0
    for _ in range(400):
        edited = bytearray(data)
        for _ in range(random.integers(1, 4)):
            place, piece = random.integers(len(edited)), bytes(random.choice(list(alphabet), random.integers(0, 3)))
            edited[place : place + random.integers(0, 12)] = piece
            edited = edited or bytearray(b" ")
        path.write_bytes(edited)
        try:
            points = read_points(path)
        except ps.InputError as error:
            assert str(error).startswith(str(path))  # noqa: PT017  # not every edit is refused
            refused += 1
            continue
        assert points.ndim == 2
        assert points.shape[1] == 3
        assert np.isfinite(points).all()
        assert (points[:, 2] > 0).all()
    assert 0 < refused < 400


def test_points_beside_a_map_have_no_value() -> None:
    grid = np.arange(6.0).reshape(2, 3)
    points = np.array([[2.4, 0.6, 1], [-1, 0, 1], [3, 1, 1], [1e9, -1e9, 1]])
    assert at_points(grid, points).tolist()[0] == 5.0
    assert np.isnan(at_points(grid, points)[1:]).all()


def test_depths_of_points_are_distances() -> None:
    for wrong in (0.0, -1.0, 1e308, np.inf):
        with pytest.raises(ps.InputError, match="from 1e-30 to 1e\\+30"):
            compare_points([1.0, wrong], [1.0, 1.0])
    with pytest.raises(ps.InputError, match=r"none of 1 points.*Give points by the columns"):
        compare_points([np.nan], [1.0])
    assert compare_points([1e-30, 1e30], [1e30, 1e-30]).scale == pytest.approx(5e59)


def test_a_report_beside_the_depth_that_is_no_report_is_no_error(tmp_path: Path) -> None:
    np.save(tmp_path / "depth.npy", np.full((6, 5), 2.0))
    (tmp_path / "points.json").write_text(json.dumps([{"column": 1, "row": 1, "depth": 2}]))
    (tmp_path / "report.json").write_text("[" * 100_000)
    outcome = CliRunner().invoke(app, ["compare", str(tmp_path / "depth.npy"), str(tmp_path / "points.json")])
    assert outcome.exit_code == 0
