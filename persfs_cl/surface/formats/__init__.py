"""The files that a surface is written to: one module a kind, and one table.

A new kind is a :class:`Format`, in a module of its own or beside its like, and its line in the table. Messages, the
command's choices, batches and reports read it from there.
"""

from __future__ import annotations

from persfs_cl.surface.formats.depths import DEPTHS
from persfs_cl.surface.formats.exchange import EXCHANGE
from persfs_cl.surface.formats.format import Format
from persfs_cl.surface.formats.meshes import CLOUDS, MESHES
from persfs_cl.surface.formats.normals import NORMALS
from persfs_cl.surface.formats.pictures import PICTURES, PREVIEWS
from persfs_cl.surface.formats.records import RECORDS

_ALL = (
    *DEPTHS,
    *NORMALS,
    *CLOUDS,
    *EXCHANGE,
    *RECORDS,
    *PICTURES,
    *PREVIEWS,
    *MESHES,
)
FORMATS: dict[str, Format] = {one.file: one for one in _ALL}
"""All there are, by the names of their files, in the order in which they are told of."""

GROUPS: dict[str, tuple[str, ...]] = {
    group: tuple(one.file for one in _ALL if group in one.groups)
    for group in dict.fromkeys(group for one in _ALL for group in one.groups)
}
"""The files of each item that is no file itself."""
