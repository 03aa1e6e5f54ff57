"""Folders walked: what lies in them, each folder once, whatever links lead where.

Paths are texts here: there may be a million of them.
"""

from __future__ import annotations

import heapq
import os
from collections.abc import Callable, Collection, Iterator, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

_MAGIC = "*?["
_ANY_DEPTH = "**"


class Folder(NamedTuple):
    """A folder on the way, with its files.

    Attributes
    ----------
    path : str
        As it is opened, with a separator at its end.
    place : str
        Its absolute path without symbolic links, with a separator at its end.
    below : str
        Its path from the top, with "/" after each part; empty for the top.
    files : list of str
        Names, in no order, without those that begin with a dot.
    """

    path: str
    place: str
    below: str
    files: list[str]


def walk(
    top: str,
    *,
    leave_out: Collection[str],
    unreadable: Callable[[str, OSError], None],
    enter: Callable[[str], bool] = lambda _below: True,
) -> Iterator[Folder]:
    """A folder and all below it, through symbolic links too. What begins with a dot is left out, but for the top.

    A folder that several ways lead to is there once, by a way without links if there is one.

    Parameters
    ----------
    top : str
    leave_out : collection of str
        Absolute paths without links of folders below the top.
    unreadable : callable
        Called with the path and the error of each folder that cannot be read.
    enter : callable
        Whether a folder is of interest, by `Folder.below`.

    Yields
    ------
    Folder
        In no order, and once for each: what comes of it must not depend on that.
    """
    ways = [(_ended(top), _ended(os.path.realpath(top)), "")]
    # Those behind links wait until all others are done, and are taken by their names.
    links: list[tuple[str, str, str]] = []
    seen: set[str] = set()
    while ways or links:
        if ways:
            path, place, below = ways.pop()
        else:
            below, path, place = heapq.heappop(links)
        if place in seen:
            continue
        seen.add(place)
        files = []
        try:
            with os.scandir(path) as entries:
                for entry in entries:
                    name = entry.name
                    if name.startswith("."):
                        continue
                    if not entry.is_dir():
                        files.append(name)
                        continue
                    linked = entry.is_symlink()
                    target = os.path.realpath(entry.path) if linked else place + name
                    if target in leave_out or not enter(f"{below}{name}/"):
                        continue
                    way = path + name + os.sep, _ended(target), f"{below}{name}/"
                    if linked:
                        heapq.heappush(links, (way[2], *way[:2]))
                    else:
                        ways.append(way)
        except OSError as error:
            unreadable(path, error)
        yield Folder(path, place, below, files)


def has_pattern(path: str) -> bool:
    """Whether a path that does not exist may be meant as a pattern."""
    return any(sign in path for sign in _MAGIC)


def split_pattern(path: str) -> tuple[str, list[str]]:
    """The fixed part of a pattern, and the parts that follow it.

    The fixed part goes as far as parts have no signs, or folders of their very names exist.
    """
    drive, rest = os.path.splitdrive(path)
    fixed = drive + (os.sep if rest.startswith(("/", os.sep)) else "")
    parts = [part for part in rest.replace(os.sep, "/").split("/") if part not in ("", ".")]
    while len(parts) > 1 and (not has_pattern(parts[0]) or os.path.isdir(os.path.join(fixed, parts[0]))):
        fixed = os.path.join(fixed, parts.pop(0))
    return fixed or ".", parts


def fits(pattern: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether the parts of a path fit those of a pattern, in which ``**`` stands for any number of folders."""
    if not pattern:
        return not parts
    first, *rest = pattern
    if first == _ANY_DEPTH:
        # What it stands for at the end is no folder alone.
        return bool(parts) if not rest else any(fits(rest, parts[start:]) for start in range(len(parts)))
    return bool(parts) and fnmatchcase(parts[0], first) and fits(rest, parts[1:])


def may_lead(pattern: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether something in a folder of these parts may fit a pattern, or lie in a folder that does."""
    for expected, part in zip(pattern, parts, strict=False):
        if expected == _ANY_DEPTH:
            return True
        if not fnmatchcase(part, expected):
            return False
    return True


def _ended(path: str) -> str:
    return path if path.endswith(os.sep) else path + os.sep
