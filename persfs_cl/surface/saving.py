"""Which files of a surface are written."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from persfs_cl.errors import InputError
from persfs_cl.surface.formats import FORMATS, GROUPS
from persfs_cl.surface.simplify import as_mesh_faces
from persfs_cl.surface.solid import Block
from persfs_cl.wording import keyword, nearest

DEFAULT_MESH_FACES = 500_000
"""A mesh of more is simplified unless told otherwise: viewers turn so many with ease."""


@dataclass(frozen=True)
class Saving:
    """Which files of a surface are written, how fine its mesh is, and how large what is printed.

    Attributes
    ----------
    files : tuple of str
        Their names, in the order in which they are told of.
    mesh_faces : int or None
        A mesh of more triangles is simplified to so many; None keeps all.
    block : Block
        Size of solids.
    named : frozenset of str
        Those of the files that were asked for by their own names, and not by that of a group.

    Examples
    --------
    >>> from persfs_cl.surface.saving import Saving
    >>> Saving.of("report, depth, mesh.glb").files
    ('depth.npy', 'depth.tiff', 'camera.json', 'report.json', 'mesh.glb')
    """

    files: tuple[str, ...]
    mesh_faces: int | None = DEFAULT_MESH_FACES
    block: Block = Block()
    named: frozenset[str] = field(default=frozenset(), repr=False, compare=False)

    @classmethod
    def of(
        cls,
        items: str | Iterable[str],
        mesh_faces: int | None = DEFAULT_MESH_FACES,
        *,
        width: float = Block.width,
        base: float = Block.base,
    ) -> Saving:
        """What a list of items stands for.

        Parameters
        ----------
        items : str or iterable of str
            Groups of `GROUPS <persfs_cl.surface.formats.GROUPS>`, such as "depth" or "pictures", and names of single
            files, such as "mesh.glb"; a text has commas between them.
        mesh_faces : int or None
            As the attribute; 0 stands for None.
        width, base : float
            Of solids, see :class:`persfs_cl.surface.solid.Block`.

        Raises
        ------
        InputError
            When an item is unknown or cannot be written without an extra that is not installed, there is none,
            `mesh_faces` is no number of triangles, or below 100, or a size is no length.

        Examples
        --------
        >>> from persfs_cl.surface.saving import Saving
        >>> Saving.of(["normals.npy", "mesh"], mesh_faces=10_000)
        Saving(files=('normals.npy', 'mesh.ply'), mesh_faces=10000, block=Block(width=100.0, base=3.0))
        """
        wanted: set[str] = set()
        named: set[str] = set()
        for item in _items(items):
            name = item.strip().lower()
            if name not in GROUPS and name not in FORMATS:
                near = nearest(name, (*GROUPS, *FORMATS))
                groups, single = ", ".join(GROUPS), ", ".join(FORMATS)
                remedy = (
                    f"give groups of files, {groups}, or single ones, {single}."
                    if near is None
                    else f"is it {near}? Groups are {groups}."
                )
                raise InputError(
                    f"{keyword('save')} has the item {item.strip()!r}, which is none: {remedy}",
                    argument="save",
                    value=items,
                )
            wanted.update(GROUPS.get(name, (name,)))
            named.update(() if name in GROUPS else (name,))
        if not wanted:
            raise InputError.about("save", items, f"names nothing to write: give items, such as {', '.join(GROUPS)}.")
        files = tuple(file for file in FORMATS if file in wanted)
        for file in files:
            FORMATS[file].require()
        return cls(files, as_mesh_faces(mesh_faces), Block(width, base), frozenset(named))

    @property
    def said(self) -> dict[str, Any]:
        """What makes files of the same names other files, for reports and to tell whether they are still good."""
        triangles = {"mesh_faces": self.mesh_faces} if any(FORMATS[file].is_mesh for file in self.files) else {}
        return {**triangles, **(asdict(self.block) if self.has_solid else {})}

    @property
    def has_solid(self) -> bool:
        """Whether something is to be printed."""
        return any(FORMATS[file].is_solid for file in self.files)

    def without(self, *items: str) -> Saving:
        """The same without the files of some items; there may be none left.

        Examples
        --------
        >>> from persfs_cl.surface.saving import Saving
        >>> Saving.of("depth,pictures").without("pictures").files
        ('depth.npy', 'depth.tiff', 'camera.json')
        """
        left_out = {file for item in items for file in GROUPS.get(item, (item,))}
        return replace(
            self, files=tuple(file for file in self.files if file not in left_out), named=self.named - left_out
        )

    def lacking(self, written: Iterable[str]) -> tuple[str, ...]:
        """Files that were asked for and are not among those written.

        A group may have pictures that there are not of every surface, and nothing depends on a picture: of these only
        the ones count that were asked for by their names.

        Examples
        --------
        >>> from persfs_cl.surface.saving import Saving
        >>> Saving.of("depth,mesh,pictures,guide.png").lacking(["depth.npy", "depth.tiff", "camera.json"])
        ('mesh.ply', 'guide.png')
        """
        there = set(written)
        return tuple(
            file
            for file in self.files
            if file not in there and (file in self.named or FORMATS[file].kind not in ("picture", "preview"))
        )


def _items(items: str | Iterable[str]) -> list[str]:
    given = items.split(",") if isinstance(items, str) else items
    try:
        listed = list(given)
    except TypeError:
        listed = [given]  # type: ignore[list-item]
    for item in listed:
        if not isinstance(item, str):
            raise InputError.about("save", items, "is no list of items: give a text such as 'depth,report'.")
    return [item for item in listed if item.strip()]
