"""Names of result folders: one for each input, and no result inside another's."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterable, Sequence

from persfs_cl.gallery.contact import CONTACT
from persfs_cl.gallery.summary import SUMMARY
from persfs_cl.io.files import PREFIX
from persfs_cl.pipeline.manifest import FOLDER
from persfs_cl.surface.formats.pictures import PAGE

OF_THE_BATCH = frozenset({PAGE, CONTACT, SUMMARY, FOLDER})
"""What a batch itself writes at the top of its output, in small letters."""
_UNPRINTED = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\udc80-\udcff]")
"""Ends of lines, other signs that control a terminal, and bytes that are no UTF-8 as Python has them."""


def result_names(wanted: Sequence[str], places: Sequence[str]) -> list[str]:
    """Names of result folders, below the output.

    Where inputs would have one name, or one name would be a folder of another, parent folders are put in front of all
    of these until they differ.

    Parameters
    ----------
    wanted : sequence of str
        The name that each input should have, with "/" between its parts.
    places : sequence of str
        The absolute path of each input, with the system's separator, and no two the same.

    Returns
    -------
    list of str
        As safe as :func:`safe` makes them. Two are the same only where the names of the parent folders do not tell
        inputs apart.
    """
    names = list(map(safe, wanted))
    length: dict[int, int] = {}
    while clashing := _clashing(names):
        longer = False
        for index in clashing:
            parts = [part for part in os.path.splitdrive(places[index])[1].split(os.sep) if part]
            length[index] = length.get(index, names[index].count("/") + 1) + 1
            longer |= length[index] <= len(parts)
            names[index] = safe("/".join(parts[-length[index] :]))
        if not longer:
            break
    return names


def safe(name: str) -> str:
    """A name, changed where it would be taken for something else than a result.

    An underscore stands before a first part that the batch itself writes, and before a part that looks like a temporary
    file. Bytes that are no UTF-8, ends of lines and other control characters are written as two digits after a percent
    sign, each byte: names are printed, one a line, and stand in tables and pages.
    """
    if not name.isprintable():
        name = _UNPRINTED.sub(_digits, name)
    first, slash, rest = name.partition("/")
    # Underscores that are there already count, so that no two names become one.
    if first.lstrip("_").casefold() in OF_THE_BATCH:
        name = f"_{first}{slash}{rest}"
    if PREFIX in name:
        parts = name.split("/")
        name = "/".join(f"_{part}" if part.lstrip("_").startswith(PREFIX) else part for part in parts)
    return name


def ancestors(names: Iterable[str]) -> set[str]:
    """Every folder that a name, with "/" between its parts, lies in."""
    found: set[str] = set()
    for name in names:
        folder = name.rpartition("/")[0]
        while folder and folder not in found:
            found.add(folder)
            folder = folder.rpartition("/")[0]
    return found


def _clashing(names: Sequence[str]) -> list[int]:
    """Places of the names that are there twice, are a folder of others, or lie in such a folder."""
    counts = Counter(names)
    heads = {name for name in ancestors(counts) if name in counts}
    heads |= {name for name, count in counts.items() if count > 1} if len(counts) < len(names) else set()
    if not heads:
        return []
    return [index for index, name in enumerate(names) if name in heads or not heads.isdisjoint(ancestors([name]))]


def _digits(sign: re.Match[str]) -> str:
    return "".join(f"%{byte:02x}" for byte in os.fsencode(sign[0]))
