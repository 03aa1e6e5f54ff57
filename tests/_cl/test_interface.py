"""kernels/README.md says what each kind of kernel file must define, and for which others: it holds, for every file."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

KERNELS = Path(__file__).resolve().parents[2] / "kernels"
SOURCES = {path.name: path for path in sorted(KERNELS.glob("*/*.cl"))}
DEFINITIONS = [
    r"^\s*#define (\w+)",
    r"^typedef \w+ (\w+)[; ]",
    r"^typedef \w+\([^)]*\) (\w+);",
    r"^} (\w+);",
    r"^(?:static inline|__kernel)[^;{}=]*?\b(\w+)\((?!\()[^{}]*\)\s*{",
    r"^(\w+)\([^;{}]*\)\s*{",  # where what stands before the name has a line of its own
]


KINDS = ("Materials", "Models", "Schemes", "Orderings")
OF_EVERY_PROGRAM = {"LANES", "CLK_GLOBAL_MEM_FENCE", "INT_MAX", "INFINITY"}
"""Constants that a program has anyway, and those of OpenCL C."""


class Row(NamedTuple):
    """A row of a table: the cells by their headings."""

    section: str
    cells: dict[str, str]

    def names(self, heading: str) -> list[str]:
        """Names in backticks that are no files."""
        return re.findall(r"`(\w+)`", self.cells.get(heading, ""))

    def files(self, heading: str) -> set[str]:
        return set(re.findall(r"`(\w+\.cl)`", self.cells.get(heading, "")))


def rows() -> list[Row]:
    """Those of all tables of the page."""
    found: list[Row] = []
    section = ""
    headings: list[str] = []
    for line in (KERNELS / "README.md").read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            section = line.removeprefix("## ")
        if not line.startswith("|"):
            headings = []
            continue
        cells = [cell.strip() for cell in line[1:-1].split("|")]
        if not headings:
            headings = cells
        elif not line.startswith("|---"):
            found.append(Row(section, dict(zip(headings, cells, strict=True))))
    return found


ROWS = rows()
PARTS = {file: row for row in ROWS if row.section == "Parts" for file in row.files("file")}


def interface(section: str) -> list[Row]:
    """Rows of the names that a kind of file defines."""
    return [row for row in ROWS if row.section == section and "name" in row.cells]


def listed(section: str) -> dict[str, Row]:
    """Rows of the files of a kind that the page lists."""
    return {file: row for row in ROWS if row.section == section for file in row.files("file")}


def members(folder: str) -> list[str]:
    """Files of a folder that are of its kind."""
    return [name for name, path in SOURCES.items() if path.parent.name == folder and name not in PARTS]


@cache
def code(file: str) -> str:
    """Its text without comments."""
    return re.sub(r"/\*.*?\*/", "", SOURCES[file].read_text(encoding="utf-8"), flags=re.DOTALL)


@cache
def defined(file: str) -> set[str]:
    return {name for pattern in DEFINITIONS for name in re.findall(pattern, code(file), re.MULTILINE)}


@cache
def users(name: str) -> set[str]:
    """Files that use a name and do not define it."""
    return {file for file in SOURCES if name not in defined(file) and re.search(rf"(?<![.>\w]){name}\b", code(file))}


def own_parts(file: str) -> set[str]:
    """Parts that a file uses, by the page."""
    return {part for part, row in PARTS.items() if file in row.files("used by")}


def parts_of(file: str) -> set[str]:
    """The same, and the parts that these use."""
    return own_parts(file).union(*map(parts_of, own_parts(file)))


def demanded(row: Row, file: str) -> bool:
    """Whether a file of the kind must define the name of a row."""
    name = row.cells["name"]
    if file in row.files("name"):
        return False
    condition = re.search(r"where `(\w+)` is (\d)", name)
    return not condition or bool(re.search(rf"#define {condition[1]} {condition[2]}\b", code(file)))


def name_of(row: Row) -> str:
    return row.names("name")[0]


def test_every_file_is_of_a_kind() -> None:
    assert {path.parent.name for path in SOURCES.values()} == {"shared", "energy", "multigrid", *map(str.lower, KINDS)}
    assert len(SOURCES) == len(list(KERNELS.glob("*/*.cl"))), "each name must be there once"
    assert PARTS.keys() <= SOURCES.keys()
    assert not members("shared") + members("energy") + members("multigrid"), "all are parts"
    for section in ("Models", "Orderings"):
        assert sorted(listed(section)) == members(section.lower())
    mentioned = {file for row in ROWS for heading in row.cells for file in row.files(heading)}
    assert mentioned <= SOURCES.keys()


@pytest.mark.parametrize("file", PARTS)
def test_a_part_defines_what_the_page_says_for_those_that_use_it(file: str) -> None:
    names = PARTS[file].names("defines")
    assert names
    assert set(names) <= defined(file)
    if expected := PARTS[file].files("used by"):
        assert set().union(*map(users, names)) == expected
        of_kinds = {name_of(row) for kind in KINDS for row in interface(kind)}
        assert {name for name in defined(file) - of_kinds if users(name) & expected} == set(names)


@pytest.mark.parametrize(
    ("file", "section"),
    [(file, section) for section in ("Materials", "Schemes") for file in members(section.lower())],
)
def test_each_file_of_a_kind_defines_its_names(file: str, section: str) -> None:
    assert {name_of(row) for row in interface(section) if demanded(row, file)} <= defined(file)


@pytest.mark.parametrize("file", members("models"))
def test_each_model_defines_the_names_for_what_it_serves(file: str) -> None:
    row = listed("Models")[file]
    served = row.files("serves")
    served |= set().union(*map(parts_of, served))
    names = {name_of(each) for each in interface("Models") if each.files("used by") & served}
    assert names
    assert names <= defined(file).union(*map(defined, row.files("stands after")))
    assert row.files("stands after") == own_parts(file)


@pytest.mark.parametrize("file", members("orderings"))
def test_each_ordering_has_its_kernel_parts_and_constants(file: str) -> None:
    row = listed("Orderings")[file]
    kernels = re.findall(r"^__kernel[^{}]*?\b(\w+)\(__global", code(file), re.MULTILINE)
    assert kernels == row.names("kernel")
    assert row.files("stands after") == own_parts(file)
    program = "".join(map(code, {file} | parts_of(file)))
    constants = set(re.findall(r"\b[A-Z][A-Z_]+\b", program)).difference(OF_EVERY_PROGRAM, *map(defined, SOURCES))
    assert set(row.names("constants")) == constants


@pytest.mark.parametrize("row", [row for kind in KINDS for row in interface(kind)], ids=name_of)
def test_the_page_says_who_uses_a_name(row: Row) -> None:
    folder = row.section.lower()
    outside = {file for file in users(name_of(row)) if SOURCES[file].parent.name != folder or file in PARTS}
    assert outside == row.files("used by")
