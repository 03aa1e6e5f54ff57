"""A page that shows all images of a run, from a disk and without a network: index.html."""

from __future__ import annotations

import html
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

from persfs_cl.gallery.summary import SUMMARY
from persfs_cl.io.files import atomic_path
from persfs_cl.surface.formats.pictures import PAGE
from persfs_cl.surface.views.pages import drawing_script, json_in_page, page_file, parts

MOST_ROWS = 50_000
"""Images that a page lists; a browser takes seconds to open one of more."""
_MOST_FAILURES = 10_000
"""Images listed beyond those because they failed."""

_SCRIPTS = "records.js", "table.js", "panel.js", "main.js"
_LEFT_OUT = {"input_hash", "parameter_hash", "version"}


def write_index(
    output: Path,
    records: Iterable[Mapping[str, Any]],
    *,
    title: str,
    parameters: Mapping[str, Any] | None = None,
    elsewhere: str | None = SUMMARY,
) -> Path:
    """Write index.html: a table of all images, and the relief of each, which can be turned.

    A browser opens it as it lies in the folder. Photographs, previews and reliefs are loaded from the images' folders
    when they are looked at. All else is in the page. Of a single image, it is a page of that image alone.

    Parameters
    ----------
    output : Path
        Folder with the results, in which the images' folders lie by their names; the files of an image whose name is
        "" lie in `output` itself.
    records : iterable of mapping
        Of the manifest, in the order in which they come when nothing else is asked for. The first 50,000 are listed,
        and up to 10,000 further ones that failed.
    title : str
    parameters : mapping, optional
        What all images have in common, by name; mappings among them are written as "light.kind".
    elsewhere : str or None
        The file beside it that has the figures, for those whose browser runs no scripts, if there is one.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    target = output / PAGE
    counts = _Counts()
    texts = {
        "title": html.escape(title),
        "style": _file("page.css"),
        "script": _script(),
        "without": "This page needs JavaScript." + (f" {elsewhere} has the same figures." if elsewhere else ""),
    }
    with (
        atomic_path(target) as temporary,
        # A title may have letters that no file can hold.
        temporary.open("w", encoding="utf-8", errors="replace", newline="\n") as file,
    ):
        for named, part in parts(_file("index.html")):
            if not named:
                file.write(part)
            elif part == "records":
                _write_records(file, counts.listed(records))
            elif part == "about":
                # After the records, which are counted as they are written.
                about = {"title": title, "total": counts.total, "failed": counts.failed}
                file.write(json_in_page({**about, "parameters": dict(_flat(parameters or {}))}))
            else:
                file.write(texts[part])
    return target


class _Counts:
    """How many records there are, and which of them are listed."""

    def __init__(self) -> None:
        self.total = 0
        self.failed = 0

    def listed(self, records: Iterable[Mapping[str, Any]]) -> Iterator[Mapping[str, Any]]:
        beyond = 0
        for record in records:
            failed = record["status"] == "failed"
            self.total += 1
            self.failed += failed
            if self.total <= MOST_ROWS:
                yield record
            elif failed and beyond < _MOST_FAILURES:
                beyond += 1
                yield record


def _write_records(file: IO[str], records: Iterable[Mapping[str, Any]]) -> None:
    separator = "["
    for record in records:
        file.write(separator + json_in_page({key: value for key, value in record.items() if key not in _LEFT_OUT}))
        separator = ",\n"
    file.write("]" if separator != "[" else "[]")


def _flat(parameters: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", _shown(value)


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_shown, value))
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _script() -> str:
    return "\n".join([drawing_script(), *map(_file, _SCRIPTS)])


def _file(name: str) -> str:
    return page_file(__package__ or "", name)
