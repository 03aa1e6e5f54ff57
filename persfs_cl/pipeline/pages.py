"""What a batch has to show for itself: a page, a contact sheet, a table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from persfs_cl.gallery.contact import write_contact_sheet
from persfs_cl.gallery.index import write_index
from persfs_cl.gallery.summary import write_summary
from persfs_cl.pipeline.listing import Input
from persfs_cl.pipeline.manifest import Record, latest, latest_records
from persfs_cl.pipeline.store import FolderStore, Store

_SORTED = 200_000
"""Records that are held in memory to be sorted by name; more are shown in the order in which they ended."""


def title_of(inputs: Sequence[str]) -> str:
    """What a page about some inputs is called."""
    return ", ".join(inputs[:3]) + (f" and {len(inputs) - 3} more" if len(inputs) > 3 else "")


def publish(store: Store, given: Sequence[Input], *, title: str, parameters: Mapping[str, Any]) -> list[str]:
    """Write index.html, contact.jpg and summary.csv, of what the manifest tells of.

    What is not given any more, and has no results, is left out.

    Parameters
    ----------
    store : Store
    given : sequence of Input
        All photos, those of other shares too.
    title : str
    parameters : mapping
        What all photos have in common.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        When one cannot be written.
    """
    known = latest(store.manifests())
    # Mostly it is all of them, and nothing need be looked for.
    if sum(one.name in known for one in given) < len(known):
        names, there = {one.name for one in given}, store.results()
        known = {name: about for name, about in known.items() if name in names or name in there}

    def records() -> Iterator[Record]:
        return latest_records(store.manifests(), known)

    held = sorted(records(), key=lambda record: record.name) if len(known) <= _SORTED else None

    def told() -> Iterable[dict[str, Any]]:
        return map(asdict, records() if held is None else held)

    written: list[str] = []

    def write(folder: Path) -> list[str]:
        files = [write_index(folder, told(), title=title, parameters=parameters), write_summary(folder, told())]
        # The pictures that a sheet is made of are only at hand in a folder.
        if isinstance(store, FolderStore) and (sheet := write_contact_sheet(folder, told(), title=title)) is not None:
            files.append(sheet)
        written.extend(file.name for file in files)
        return written

    store.publish(write)
    return written
