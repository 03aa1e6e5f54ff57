"""Which files of a surface are written."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from persfs_cl.errors import InputError
from persfs_cl.surface.simplify import as_mesh_faces
from persfs_cl.wording import keyword

DEFAULT_MESH_FACES = 500_000
"""A mesh of more is simplified unless told otherwise: viewers turn so many with ease."""

SHADED, PHOTO, RELIEF = "preview.jpg", "photo.jpg", "relief.js"
PREVIEW = (SHADED, PHOTO, RELIEF)
"""What a page with many results shows of one: the surface shaded, the photograph, and the surface to be turned."""
PAGE = "index.html"
"""A page about this result alone, on which it can be turned."""

_MESHES = tuple(f"mesh.{suffix}" for suffix in ("ply", "obj", "stl", "glb"))
GROUPS = {
    "depth": ("depth.npy", "depth.tiff"),
    "normals": ("normals.png",),
    "mesh": _MESHES[:1],
    "pictures": (
        "depth.png",
        "normals.png",
        "relief.png",
        "rendered.png",
        "comparison.png",
        "confidence.png",
        "convergence.png",
        "guide.png",
    ),
    "preview": PREVIEW,
    "page": (*PREVIEW, PAGE),
    "report": ("report.json",),
}
"""The files of each item that is no file itself."""

FILES = (
    "depth.npy",
    "depth.tiff",
    "depth.tif",
    "normals.npy",
    "report.json",
    *GROUPS["pictures"],
    *PREVIEW,
    PAGE,
    *_MESHES,
)
"""All there are, in the order in which they are told of."""


@dataclass(frozen=True)
class Saving:
    """Which files of a surface are written, and how fine its mesh is.

    Attributes
    ----------
    files : tuple of str
        Their names, in the order in which they are told of.
    mesh_faces : int or None
        A mesh of more triangles is simplified to so many; None keeps all.

    Examples
    --------
    >>> from persfs_cl.surface.saving import Saving
    >>> Saving.of("report, depth, mesh.glb").files
    ('depth.npy', 'depth.tiff', 'report.json', 'mesh.glb')
    """

    files: tuple[str, ...]
    mesh_faces: int | None = DEFAULT_MESH_FACES

    @classmethod
    def of(cls, items: str | Iterable[str], mesh_faces: int | None = DEFAULT_MESH_FACES) -> Saving:
        """What a list of items stands for.

        Parameters
        ----------
        items : str or iterable of str
            Groups ("depth", "normals", "mesh", "pictures", "preview", "page", "report") and names of single files,
            such as "mesh.glb"; a text has commas between them.
        mesh_faces : int or None
            As the attribute; 0 stands for None.

        Raises
        ------
        InputError
            When an item is unknown, there is none, or `mesh_faces` is no number of triangles, or below 100.

        Examples
        --------
        >>> from persfs_cl.surface.saving import Saving
        >>> Saving.of(["normals.npy", "mesh"], mesh_faces=10_000)
        Saving(files=('normals.npy', 'mesh.ply'), mesh_faces=10000)
        """
        wanted: set[str] = set()
        for item in _items(items):
            name = item.strip().lower()
            if name not in GROUPS and name not in FILES:
                raise InputError(
                    f"{keyword('save')} has the item {item.strip()!r}, which is none: give groups of files, "
                    f"{', '.join(GROUPS)}, or single ones, {', '.join(FILES)}.",
                    argument="save",
                    value=items,
                )
            wanted.update(GROUPS.get(name, (name,)))
        if not wanted:
            raise InputError.about("save", items, f"names nothing to write: give items, such as {', '.join(GROUPS)}.")
        return cls(tuple(file for file in FILES if file in wanted), as_mesh_faces(mesh_faces))

    @property
    def meshes(self) -> list[str]:
        """Those of the files that hold a mesh."""
        return [file for file in self.files if file in _MESHES]

    def without(self, *items: str) -> Saving:
        """The same without the files of some items; there may be none left.

        Examples
        --------
        >>> from persfs_cl.surface.saving import Saving
        >>> Saving.of("depth,pictures").without("pictures").files
        ('depth.npy', 'depth.tiff')
        """
        left_out = {file for item in items for file in GROUPS.get(item, (item,))}
        return Saving(tuple(file for file in self.files if file not in left_out), self.mesh_faces)


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
