"""Pages with tables between markers."""

from __future__ import annotations

from pathlib import Path

import pytest

from persfs_cl import InputError
from persfs_cl.page import fill_page, filled, markdown_table, marked

PAGE = "# Title\n\n<!-- a -->\n<!-- end -->\n\n<!-- b-2 -->\nold\nlines\n<!-- end -->\n\nEnd.\n"


def test_a_table_is_what_markdown_wants() -> None:
    table = markdown_table(("what", "ms"), [("a | b\nc", "1"), ("d", "")], words=1)
    assert table == "| what | ms |\n| --- | --: |\n| a \\| b c | 1 |\n| d |  |"


def test_only_what_is_named_changes() -> None:
    assert marked(PAGE) == {"a": "", "b-2": "old\nlines"}
    assert filled(PAGE, marked(PAGE)).replace("<!-- a -->\n\n", "<!-- a -->\n") == PAGE
    text = filled(PAGE, {"a": "new"})
    assert text == PAGE.replace("<!-- a -->\n", "<!-- a -->\nnew\n")
    assert filled(text, {"a": "new"}) == text


def test_the_same_marker_may_stand_twice() -> None:
    assert filled(PAGE + PAGE, {"b-2": "new"}) == 2 * filled(PAGE, {"b-2": "new"})


def test_a_comment_without_an_end_is_no_marker() -> None:
    text = f"<!-- note -->\nwords\n{PAGE}"
    assert marked(text) == marked(PAGE)
    assert filled(text, {"a": "new"}).startswith("<!-- note -->\nwords\n# Title")


def test_a_page_without_the_marker_stays_as_it_is(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    with pytest.raises(InputError, match="no place for 'c': add <!-- c -->"):
        fill_page(page, {"a": "new", "c": ""})
    assert page.read_text(encoding="utf-8") == PAGE


def test_a_page_that_is_no_text_is_told(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match=r"page\.md is no text in UTF-8"):
        fill_page(page, {})
