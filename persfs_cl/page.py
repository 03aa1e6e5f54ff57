"""Markdown pages that hold the tables of a command between markers: ``<!-- name -->`` and ``<!-- end -->``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, atomic_path, read_bytes

ENVIRONMENT = "environment"
"""The marker under which every page says on what machine its figures were found."""

_END = "<!-- end -->"
_MARKED = re.compile(r"<!-- (?P<name>[\w-]+) -->\n(?P<content>(?:(?!<!-- ).)*?)\n?<!-- end -->", re.DOTALL)


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, words: int, remarks: bool = False) -> str:
    """Cells as a table, in which so many of the first columns hold words, with `remarks` the last one too."""
    rule = ["---"] * words + ["--:"] * (len(header) - words)
    if remarks:
        rule[-1] = "---"
    # What a compiler or the system says may hold either.
    lines = ([cell.replace("|", r"\|").replace("\n", " ") for cell in cells] for cells in (header, rule, *rows))
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def marked(page: str) -> dict[str, str]:
    """What a page holds between its markers, by their names."""
    return {found["name"]: found["content"] for found in _MARKED.finditer(page)}


def between_markers(name: str, content: str) -> str:
    """The content with the markers around it, as a page has them."""
    return f"<!-- {name} -->\n{content}\n{_END}"


def filled(page: str, contents: Mapping[str, str]) -> str:
    """The page with other contents between those of its markers that are named.

    Raises
    ------
    InputError
        When the page lacks a marker.
    """
    if missing := [name for name in contents if name not in marked(page)]:
        raise InputError(f"the page has no place for {missing[0]!r}: add <!-- {missing[0]} --> and {_END} to it.")
    return _MARKED.sub(
        lambda found: between_markers(found["name"], contents.get(found["name"], found["content"])), page
    )


def read_page(path: FilePath) -> str:
    """The text of a page.

    Raises
    ------
    InputError
        When the file cannot be read, or is no text in UTF-8.
    """
    try:
        return read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8 ({error.reason}): name a Markdown page.") from error


def fill_page(path: FilePath, contents: Mapping[str, str]) -> None:
    """:func:`filled` for a file.

    Raises
    ------
    InputError
        When the page cannot be read or written, or lacks a marker.
    """
    text = filled(read_page(path), contents)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
