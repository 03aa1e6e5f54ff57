"""What is said of many photos, each reason once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from persfs_cl.wording import at_place

_SHOWN = 100
"""Photos that are named, and reasons that are told, at most: the page and the table of the results have all."""
_BEFORE = 3
"""Photos that are named before their reason."""


@dataclass
class _Group:
    """Photos of which the same is said.

    `text` is what is said of the first, and `of_all` whether it names no photo, so that it is true of all. `place` is
    of the first: it stands before the text where there is one photo, unless the text begins with it.
    """

    text: str
    of_all: bool
    place: str
    count: int = 0
    names: list[str] = field(default_factory=list)


class Alike:
    """Photos by what is said of them, in the order in which it was first said.

    Of two photos the same is said when the sentences differ in nothing but the photo's own file and name.

    Parameters
    ----------
    every_name : bool
        Name all photos, up to a hundred, and not the first three of a reason alone.
    """

    def __init__(self, *, every_name: bool) -> None:
        self._every_name = every_name
        self._groups: dict[str, _Group] = {}
        self._named = 0
        self._untold = 0

    def add(self, name: str, path: Path, text: str) -> None:
        """Take what is said of a photo, in a line."""
        # Of a line of a list, the path on it.
        key = text.replace(str(path), "\0").replace(name, "\0").replace(name.rpartition(": ")[2], "\0")
        group = self._groups.get(key)
        if group is None:
            if len(self._groups) == _SHOWN or self._named == _SHOWN:
                self._untold += 1
                return
            named = text.startswith(str(path)) and str(path).endswith(name)
            group = self._groups[key] = _Group(text, key == text, str(path) if named else name)
        group.count += 1
        if len(group.names) < (_SHOWN if self._every_name else _BEFORE) and self._named < _SHOWN:
            group.names.append(name)
            self._named += 1

    def groups(self, of: str = "") -> Iterator[tuple[int, list[str], str]]:
        """How many photos, the names of some, and what is said, after `of`: "of the first" where it names that."""
        for group in self._groups.values():
            whose = "" if group.of_all else "of the first, "
            alone = group.count == 1
            yield group.count, group.names, at_place(group.place, group.text, of) if alone else of + whose + group.text

    def lines(self, of: str = "") -> Iterator[str]:
        """All of it, for standard error; `of` comes before the reason.

        The reason is on the line of the first photos, and the others are on the next.
        """
        for count, names, said in self.groups(of):
            if count == 1:
                yield f"persfs-cl: {said}"
                continue
            others = " and others" if count > len(names[:_BEFORE]) else ""
            yield f"persfs-cl: {count} photos, {', '.join(names[:_BEFORE])}{others}: {said}"
            if names[_BEFORE:]:
                yield f"persfs-cl: the same of {', '.join(names[_BEFORE:])}."

    @property
    def more(self) -> int:
        """Photos whose reason is not told, and those without a name where each should have one."""
        unnamed = sum(group.count - len(group.names) for group in self._groups.values())
        return self._untold + (unnamed if self._every_name else 0)
