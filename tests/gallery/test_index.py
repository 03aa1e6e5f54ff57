from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from made import HOSTILE, failure, record

from persfs_cl.errors import InputError
from persfs_cl.gallery import index
from persfs_cl.gallery.index import write_index


class Page(HTMLParser):
    """Text of the elements that have a name, and what the page refers to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: dict[str, str] = {}
        self.open: list[str] = []
        self.tags: list[str] = []
        self.references: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        named = dict(attrs)
        self.tags.append(tag)
        self.references += [str(named[name]) for name in ("src", "href") if name in named]
        if tag not in ("meta", "link", "input", "br", "img", "col"):
            self.open.append(named.get("id") or tag)

    def handle_endtag(self, tag: str) -> None:  # noqa: ARG002
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts[self.open[-1]] = self.texts.get(self.open[-1], "") + data

    @property
    def records(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = json.loads(self.texts["records"])
        return found

    @property
    def about(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self.texts["about"])
        return found


def page_of(output: Path) -> Page:
    return Page((output / "index.html").read_text("utf-8"))


def test_page_holds_the_records(tmp_path: Path) -> None:
    records = [record("a/b.png", warnings=["dark"]), failure("c.png"), record("d.png", status="done")]
    assert write_index(tmp_path, iter(records), title="Some images") == tmp_path / "index.html"
    page = page_of(tmp_path)
    left_out = {"input_hash", "parameter_hash", "version"}
    assert page.records == [{key: one[key] for key in one.keys() - left_out} for one in records]
    assert page.about == {"title": "Some images", "total": 3, "failed": 1, "parameters": {}}
    assert page.texts["title"] == page.texts["h1"] == "Some images"
    assert not page.open
    assert "<noscript><p>This page needs JavaScript. summary.csv has the same figures." in (
        tmp_path / "index.html"
    ).read_text("utf-8")


def test_page_asks_for_nothing_from_elsewhere(tmp_path: Path) -> None:
    write_index(tmp_path, [record("a.png")], title="One")
    page = page_of(tmp_path)
    assert page.references == ["data:,"]
    assert not re.search(r"(https?:)?//[a-z]", page.texts["script"] + page.texts["style"])
    assert not re.search(r"@import|url\(", page.texts["style"])


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_come_back_as_they_are(name: str, tmp_path: Path) -> None:
    plain = [record("a.png"), failure("b.png")]
    write_index(tmp_path, plain, title="a", parameters={"x": 1})
    expected = page_of(tmp_path)
    records = [record(name, warnings=[name]), failure(name, message=name)]
    write_index(tmp_path, records, title=name, parameters={name: name})
    page = page_of(tmp_path)
    assert page.tags == expected.tags
    assert [one["name"] for one in page.records] == [name, name]
    assert page.records[0]["warnings"] == [name]
    assert page.records[1]["error"]["message"] == name
    assert page.about["parameters"] == {name: name}
    assert page.about["title"] == name
    assert page.texts["script"] == expected.texts["script"]


def test_parameters_are_text_by_name(tmp_path: Path) -> None:
    parameters = {
        "light": {"kind": "FlashLight", "offset": (0.1, 0.0, float("nan"))},
        "mask": Path("a/mask.png"),
        "smooth": None,
        "overwrite": False,
        "tolerance": 1e-5,
        "iterations": 100,
    }
    write_index(tmp_path, [], title="", parameters=parameters)
    assert page_of(tmp_path).about["parameters"] == {
        "light.kind": "FlashLight",
        "light.offset": "0.1, 0, nan",
        "mask": str(Path("a/mask.png")),
        "smooth": "none",
        "overwrite": "no",
        "tolerance": "1e-05",
        "iterations": "100",
    }


def test_no_images_are_a_page_too(tmp_path: Path) -> None:
    write_index(tmp_path, [], title="Nothing")
    assert page_of(tmp_path).records == []


def test_numbers_that_json_has_not_are_missing(tmp_path: Path) -> None:
    strange = record("a.png", figures={"mean_error": float("nan"), "depth_max": float("inf"), "solved": 0})
    write_index(tmp_path, [strange], title="")
    assert page_of(tmp_path).records[0]["figures"] == {"mean_error": None, "depth_max": None, "solved": 0}


def test_ten_thousand_rows_take_a_second_or_two(tmp_path: Path) -> None:
    start = time.process_time()
    write_index(tmp_path, (record(f"{number:05}.png") for number in range(10_000)), title="Many")
    assert time.process_time() - start < 30  # 0.5 on a processor of 2021
    assert len(page_of(tmp_path).records) == 10_000


def test_of_too_many_the_failed_ones_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index, "MOST_ROWS", 10)
    monkeypatch.setattr(index, "_MOST_FAILURES", 3)

    def many() -> Iterator[dict[str, Any]]:
        for number in range(100):
            yield failure(f"{number}") if number % 10 == 9 else record(f"{number}")

    write_index(tmp_path, many(), title="Many")
    page = page_of(tmp_path)
    assert [one["name"] for one in page.records] == [*map(str, range(10)), "19", "29", "39"]
    assert page.about["total"] == 100
    assert page.about["failed"] == 10


def test_page_that_cannot_be_finished_leaves_the_one_before(tmp_path: Path) -> None:
    write_index(tmp_path, [record("a.png")], title="Before")
    before = (tmp_path / "index.html").read_bytes()

    def broken() -> Iterator[dict[str, Any]]:
        yield record("b.png")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_index(tmp_path, broken(), title="After")
    assert (tmp_path / "index.html").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_folder_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"index\.html cannot be written"):
        write_index(tmp_path / "gone", [], title="")
