"""Tables as Markdown and CSV, from the same cells."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from persfs_cl.io.files import FilePath, atomic_path
from persfs_cl.page import ENVIRONMENT, between_markers, markdown_table


@dataclass(frozen=True)
class Table:
    """Cells as they are printed.

    Attributes
    ----------
    name : str
        Of the CSV file, without its suffix, and of the marker.
    title : str
    header : tuple of str
    rows : tuple of tuple of str
    words : int
        So many of the first columns hold words.
    """

    name: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int = 0

    @property
    def markdown(self) -> str:
        """The table, without its title."""
        return markdown_table(self.header, self.rows, words=self.words)

    def write_csv(self, path: FilePath) -> None:
        """Write the header and the rows.

        Raises
        ------
        InputError
            When the file cannot be written.
        """
        with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows((self.header, *self.rows))


@dataclass(frozen=True)
class Findings:
    """What an experiment came to.

    Attributes
    ----------
    tables : sequence of Table
    pictures : mapping of str to callable
        File names, and what draws them when called with a path.
    """

    tables: Sequence[Table]
    pictures: Mapping[str, Callable[[FilePath], None]] = field(default_factory=dict)


def fragments(tables: Sequence[Table], environment: str) -> dict[str, str]:
    """What stands between the markers of a page, by their names."""
    return {ENVIRONMENT: environment, **{table.name: table.markdown for table in tables}}


def write_fragments(path: FilePath, tables: Sequence[Table], environment: str) -> None:
    """Write all tables to one Markdown file, between the markers that a page has.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    titles = {table.name: f"## {table.title}\n\n" for table in tables}
    parts = [
        f"{titles.get(name, '')}{between_markers(name, content)}\n"
        for name, content in fragments(tables, environment).items()
    ]
    with atomic_path(path) as temporary:
        temporary.write_text("\n".join(parts), encoding="utf-8")
