"""What a kind of file is, and what all kinds are made from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.surface import triangulation
from persfs_cl.surface.outcome import Outcome
from persfs_cl.surface.simplify import simplified_triangles
from persfs_cl.surface.solid import Block
from persfs_cl.surface.solved import Derived
from persfs_cl.surface.triangles import Triangles
from persfs_cl.wording import keyword

if TYPE_CHECKING:
    import trimesh

Kind = Literal["data", "picture", "mesh", "solid", "preview"]


class Source:
    """What files of a surface are made from.

    Parameters
    ----------
    solution : Outcome
    derived : Derived
        Of the solution.
    colour : ndarray of uint8, shape (height, width) or (height, width, 3), optional
        What the surface wears; the image itself when not given.
    report : callable
        Returns further entries for the report.
    mesh_faces : int, optional
        A mesh of more triangles is simplified to so many.
    block : Block
        Size of what is printed.
    """

    def __init__(
        self,
        solution: Outcome,
        derived: Derived,
        *,
        colour: NDArray[np.uint8] | None = None,
        report: Callable[[], Mapping[str, Any]] = dict,
        mesh_faces: int | None = None,
        block: Block = Block(),
    ) -> None:
        self.solution, self.derived, self.report = solution, derived, report
        self.mesh_faces, self.block = mesh_faces, block
        self._colour = colour

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width)."""
        height, width = self.solution.depth.shape
        return height, width

    @property
    def outlined(self) -> bool:
        """Whether it was found, or changed, which pixels of a photograph are the surface."""
        taken = self.solution.taken_by
        return taken is not None and taken.outlined

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """What the surface wears, shape (height, width, 3)."""
        return triangulation.rgb(self.solution.shown if self._colour is None else self._colour, self.shape)

    # One thread makes everything that needs them.
    @cached_property
    def triangles(self) -> Triangles:
        """The surface, simplified if need be, with colours."""
        surface = self.solution
        colour = surface.shown if self._colour is None else self._colour
        return simplified_triangles(surface.depth, surface.camera, self.mesh_faces, colour, surface.discontinuities)

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The same as a mesh."""
        return self.triangles.mesh()

    @cached_property
    def solid(self) -> trimesh.Trimesh:
        """The surface as a block."""
        return self.solution.solid(self.block.width, self.block.base, mesh_faces=self.mesh_faces)


@dataclass(frozen=True)
class Format:
    """A kind of file.

    Attributes
    ----------
    file : str
        Its name in a folder of results.
    write : callable or None
        Writes it to a path. None for what only a photograph's pipeline can write.
    groups : tuple of str
        Words that stand for it and others.
    kind : {"data", "picture", "mesh", "solid", "preview"}
        A picture that cannot be drawn is left out, with a warning. Meshes and solids are made last, by one thread.
    alone : bool
        Whether it is what a single file of its suffix becomes.
    applies : callable
        Whether there is such a file of a surface.
    about : callable or None
        What a report says of it: what is needed to read it.
    memory : int
        Bytes that it takes for each pixel, where that is more than solving takes.
    packages : tuple of str
        What it takes to write it, besides what always is there.
    extra : str
        The extra that brings them.
    """

    file: str
    write: Callable[[Path, Source], None] | None
    groups: tuple[str, ...] = ()
    kind: Kind = "data"
    alone: bool = False
    applies: Callable[[Source], bool] = lambda _: True
    about: Callable[[Source], Mapping[str, Any]] | None = None
    memory: int = 0
    packages: tuple[str, ...] = ()
    extra: str = ""

    @property
    def is_solid(self) -> bool:
        """Whether it is a solid to be printed."""
        return self.kind == "solid"

    @property
    def is_mesh(self) -> bool:
        """Whether it is made of triangles, which may be too many."""
        return self.kind in ("mesh", "solid")

    @property
    def suffix(self) -> str:
        """Of its name."""
        return Path(self.file).suffix

    def require(self) -> None:
        """Refuse it where it cannot be written, before the work.

        Raises
        ------
        InputError
            Naming the extra.
        """
        if missing := [package for package in self.packages if find_spec(package) is None]:
            absent = "is" if len(missing) == 1 else "are"
            raise InputError(
                f"{keyword('save', self.file)} needs {' and '.join(missing)}, which {absent} not installed: pip "
                f"install 'persfs-cl[{self.extra}]'.",
                argument="save",
                value=self.file,
            )
