"""What a reconstruction returns: the surface, how the run went, and files of all of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, as_path, filling
from persfs_cl.surface.formats import FORMATS
from persfs_cl.surface.formats.format import Format, Source
from persfs_cl.surface.formats.pictures import PAGE, PREVIEW
from persfs_cl.surface.formats.records import report_of
from persfs_cl.surface.jobs import threads_for
from persfs_cl.surface.outcome import Outcome
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, Saving
from persfs_cl.surface.solid import Block
from persfs_cl.surface.solved import Derived, Unreliable
from persfs_cl.surface.views.notebook import surface_html, surface_png
from persfs_cl.surface.writing import write_file, write_files


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(Outcome):
    """A reconstructed surface.

    Attributes
    ----------
    depth, log_depth, solved, unreached, clamped, at_bound
        z and Z = ln z of each pixel, and which pixels have a depth, have none, have one that the equation leaves open,
        or have one that is a bound of ``depth_range`` or guide; arrays of shape (height, width), see
        :class:`SolvedSurface <persfs_cl.surface.solved.SolvedSurface>`.
    image, camera, light, reflectance, albedo, device
        What it was found from, and where.
    walls, discontinuities
        Where the surface may jump, and where it is interrupted; None where no walls were given.
    iterations : int
        Iterations done, of four sweeps each, by multigrid those of the finest grid; for "regularised" of steps on all
        grids, without the sweeps before.
    changes : ndarray of float64, shape (iterations,)
        max |ΔZ| over each iteration; what coarser grids add between two of them is in neither.
    status : Status
    distance : float
        Estimate of max |Z - limit|, the limit being where the iteration leads: from the rate at which the changes
        shrink, without `acceleration` within a factor of 2 where they do so steadily, and above what rounding leaves;
        with it mostly too large. NaN where the changes do not shrink, and after the rounds of an off-axis lamp. For
        "regularised" it is mostly too large, up to a hundred times, since patches come to rest one after the other; and
        it does not foresee a patch that leaves for another minimum.
    elapsed : Elapsed
    parameters : mapping
        The remaining keywords, with "auto" resolved.
    guide : GuideFit or None
        What became of the guide, see :class:`GuideFit <persfs_cl.guide.fit.GuideFit>`; None without one, and where the
        run was ended before it was used. Then `iterations` and `changes` are of all runs, `distance` of the last.
    taken_by : Taken or None
        Camera and (height, width) of the photo that the command or :func:`persfs_cl.batch` has read, see
        :class:`Taken <persfs_cl.surface.outcome.Taken>`; by :func:`persfs_cl.reconstruct` those of the image that was
        given, where its lens bends lines, else None.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.status.name, solution.depth.shape, bool(solution.solved.all())
    ('CONVERGED', (20, 20), True)
    >>> ps.compare(solution.depth, scene.depth).mean < 0.01
    True
    """

    def __repr__(self) -> str:
        height, width = self.depth.shape
        rounds = "1 iteration" if self.iterations == 1 else f"{self.iterations} iterations"
        solved = np.count_nonzero(self.solved)
        depths = f", depth {np.nanmin(self.depth):.4g} to {np.nanmax(self.depth):.4g}" if self._has_depth else ""
        return f"<Solution {self.status.name}, {rounds}, {solved} of {width} x {height} pixels{depths}>"

    def _repr_html_(self) -> str | None:
        """Depth, shaded relief and a relief that turns, for notebooks.

        None where nothing has a depth, so that they show the line above.
        """
        return surface_html(self) if self._has_depth else None

    def _repr_png_(self) -> bytes | None:
        """Depth and shaded relief, where a notebook shows no pages."""
        return surface_png(self) if self._has_depth else None

    @property
    def _has_depth(self) -> bool:
        """Whether there is anything to show, whatever `solved` says of an array that somebody has put in."""
        return bool(np.isfinite(self.depth).any())

    def report(self, unreliable: Unreliable | None = None) -> dict[str, Any]:
        """Everything about the run that a later reader needs, ready for JSON.

        Parameters
        ----------
        unreliable : mapping, optional
            As for :meth:`confidence`.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> report = solution.report()
        >>> report["status"], report["pixels"]["solved"], report["parameters"]["scheme"]
        ('CONVERGED', 400, 'upwind')
        """
        return report_of(self, Derived(self, unreliable))

    def save(
        self,
        path: FilePath,
        *,
        save: str | Iterable[str] = "depth,mesh,pictures,report,solution",
        mesh_faces: int | None = DEFAULT_MESH_FACES,
        width: float = Block.width,
        base: float = Block.base,
        colour: NDArray[np.uint8] | None = None,
        report: Mapping[str, Any] | None = None,
        unreliable: Unreliable | None = None,
        folder: bool = False,
    ) -> list[Path]:
        """Write the surface to one file, or several files to a folder.

        Parameters
        ----------
        path : path
            A file whose suffix says what is wanted: ``.npy``, ``.tif``, ``.tiff``, ``.exr`` (depth, float32 but for
            NumPy), ``.png`` (picture of the depth), ``.ply``, ``.obj``, ``.stl``, ``.glb`` (mesh), ``.3mf`` (solid),
            ``.json`` (report). A name without a suffix, or of a folder that exists, is a folder, made if needed.
        save : str or iterable of str
            What a folder receives: groups of files and names of single files; a text has commas between them. The
            groups are "depth" (depth.npy, depth.tiff), "normals" (normals.png), "points" (points.ply), "colmap" and
            "open3d" (depth with its camera), "solution" (what :func:`persfs_cl.load` reads: depth.npy, solution.npz,
            report.json), "report" (report.json), "pictures" (depth.png, normals.png, relief.png, rendered.png,
            comparison.png, confidence.png, convergence.png, and with a guide guide.png), "mesh" (mesh.ply) and "solid"
            (solid.stl). `FORMATS <persfs_cl.surface.formats.FORMATS>` has all single files. A picture that cannot be
            drawn is left out, with a warning.
        mesh_faces : int or None
            As for :meth:`mesh`.
        width, base : float
            Of solids, as for :meth:`solid`.
        colour : ndarray of uint8, optional
            Vertex colours of the mesh, as for :meth:`mesh`.
        report : mapping, optional
            Further entries for the report.
        unreliable : mapping, optional
            As for :meth:`confidence`, for the picture of it and the report.
        folder : bool
            True makes a folder of `path` whatever its suffix.

        Returns
        -------
        list of Path
            The files written: all of them or, after an error, none.

        Raises
        ------
        InputError
            When the suffix or an item is unknown or a file cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> with TemporaryDirectory() as folder:
        ...     one = solution.save(Path(folder) / "bump.ply")
        ...     some = solution.save(Path(folder) / "bump", save="depth,normals.npy", report={"photo": "bump.png"})
        >>> [file.name for file in (*one, *some)]
        ['bump.ply', 'depth.npy', 'depth.tiff', 'normals.npy', 'camera.json']
        """
        target = as_path(path)
        saving = Saving.of(save, mesh_faces, width=width, base=base)
        if not {*PREVIEW, PAGE}.isdisjoint(saving.files):
            raise InputError.about("save", save, "has previews, which 'persfs-cl' alone draws: leave them out.")
        derived = Derived(self, unreliable)
        if target.suffix and not folder and not target.is_dir():
            source = Source(
                self,
                derived,
                colour=colour,
                report=lambda: report or {},
                mesh_faces=saving.mesh_faces,
                block=saving.block,
            )
            write_file(target, _format_of(target), source)
            return [target]
        with filling(target) as temporary:
            written = write_files(
                temporary,
                self,
                saving,
                derived,
                colour=colour,
                report=lambda: report or {},
                threads=threads_for(self.depth.size),
            )
        return [target / name for name in written]


def _format_of(target: Path) -> Format:
    """What a single file is to be, by its suffix."""
    kinds = {one.suffix: one for one in FORMATS.values() if one.alone}
    if target.suffix.lower() not in kinds:
        raise InputError(
            f"{target.name!r} has no known suffix: use one of {', '.join(kinds)}, or a folder name without suffix for "
            "everything."
        )
    return kinds[target.suffix.lower()]
