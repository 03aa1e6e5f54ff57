"""What a reconstruction returns: the surface, how the run went, and files of all of it."""

from __future__ import annotations

import enum
import math
import platform
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.guide.fit import GuideFit
from persfs_cl.io.export import write_depth
from persfs_cl.io.files import FilePath, as_path, filling
from persfs_cl.surface import plots
from persfs_cl.surface.export import draw_all, drawings, unit_of, write_array, write_json, write_mesh
from persfs_cl.surface.jobs import Jobs, threads_for
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, PAGE, PREVIEW, Saving
from persfs_cl.surface.solved import Derived, SolvedSurface, Unreliable


class Status(enum.Enum):
    """How an iteration ended; the value says what that means and what to try.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.status is ps.Status.CONVERGED
    True
    """

    CONVERGED = "The tolerance is met, or nothing changes any more."
    MAX_ITERATIONS = (
        "The iterations ran out before the tolerance was met: allow more of them, or accept a larger tolerance; "
        "where an off-axis lamp takes rounds, have it nearer to the camera."
    )
    STOPPED = "It was ended before the tolerance was met, by Ctrl-C or a callback: the surface is unfinished."


@dataclass(frozen=True)
class Elapsed:
    """Seconds a reconstruction took.

    Attributes
    ----------
    total : float
        From call to return.
    kernels : float
        Of these, on the device.
    build : float
        Of these, compiling kernels; next to nothing when they were compiled before.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.elapsed.total > solution.elapsed.kernels > 0
    True
    """

    total: float
    kernels: float
    build: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution(SolvedSurface):
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
        Iterations done, of four sweeps each; for "regularised" of steps on all grids, without the sweeps before.
    changes : ndarray of float64, shape (iterations,)
        max |ΔZ| over each iteration.
    status : Status
    distance : float
        Estimate of max |Z - limit|, the limit being where the iteration leads: from the rate at which the changes
        shrink, within a factor of 2 where they do so steadily, and above what rounding leaves. NaN where the changes do
        not shrink, and after the rounds of an off-axis lamp. For "regularised" it may be above the tolerance though
        the run has converged, see `stopping` of :func:`persfs_cl.reconstruct`; it tells nothing of other minima.
    elapsed : Elapsed
    parameters : mapping
        The remaining keywords, with "auto" resolved.
    guide : GuideFit or None
        What became of the guide, see :class:`GuideFit <persfs_cl.guide.fit.GuideFit>`; None without one, and where the
        run was ended before it was used. Then `iterations` and `changes` are of all runs, `distance` of the last.

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

    iterations: int
    changes: Array
    status: Status
    distance: float
    elapsed: Elapsed
    parameters: Mapping[str, Any]
    guide: GuideFit | None = None

    def __repr__(self) -> str:
        height, width = self.depth.shape
        rounds = "1 iteration" if self.iterations == 1 else f"{self.iterations} iterations"
        solved = np.count_nonzero(self.solved)
        depths = f", depth {np.nanmin(self.depth):.4g} to {np.nanmax(self.depth):.4g}" if solved else ""
        return f"<Solution {self.status.name}, {rounds}, {solved} of {width} x {height} pixels{depths}>"

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
        save: str | Iterable[str] = "depth,mesh,pictures,report",
        mesh_faces: int | None = DEFAULT_MESH_FACES,
        colour: NDArray[np.uint8] | None = None,
        report: Mapping[str, Any] | None = None,
        unreliable: Unreliable | None = None,
        folder: bool = False,
    ) -> list[Path]:
        """Write the surface to one file, or several files to a folder.

        Parameters
        ----------
        path : path
            A file whose suffix says what is wanted: ``.npy``, ``.tif``, ``.tiff`` (depth, float32 in TIFF), ``.png``
            (picture of the depth), ``.ply``, ``.obj``, ``.stl``, ``.glb`` (mesh), ``.json`` (report). A name
            without a suffix, or of a folder that exists, is a folder, made if needed.
        save : str or iterable of str
            What a folder receives: groups of files and names of single files; a text has commas between them. The
            groups are "depth" (depth.npy, depth.tiff), "normals" (normals.png), "mesh" (mesh.ply), "pictures"
            (depth.png, normals.png, relief.png, rendered.png, comparison.png, confidence.png, convergence.png, and with
            a guide guide.png) and "report" (report.json). Single files may be others too: depth.tif, normals.npy
            (float32), mesh.obj, mesh.stl, mesh.glb. A picture that cannot be drawn is left out, with a warning.
        mesh_faces : int or None
            As for :meth:`mesh`.
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
        ['bump.ply', 'depth.npy', 'depth.tiff', 'normals.npy']
        """
        target = as_path(path)
        saving = Saving.of(save, mesh_faces)
        if not {*PREVIEW, PAGE}.isdisjoint(saving.files):
            raise InputError.about("save", save, "has previews, which 'persfs-cl' alone draws: leave them out.")
        derived = Derived(self, unreliable)
        if target.suffix and not folder and not target.is_dir():
            self._write(target, derived, saving.mesh_faces, colour, report)
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

    def _write(
        self,
        target: Path,
        derived: Derived,
        mesh_faces: int | None,
        colour: NDArray[np.uint8] | None,
        report: Mapping[str, Any] | None,
    ) -> None:
        suffix = target.suffix.lower()
        if suffix in (".npy", ".tif", ".tiff"):
            write_depth(target, self.depth)
        elif suffix == ".png":
            plots.depth_picture(target, self.depth, unit=unit_of(self))
        elif suffix in (".ply", ".obj", ".stl", ".glb"):
            write_mesh(target, self.mesh(colour, mesh_faces=mesh_faces))
        elif suffix == ".json":
            write_json(target, report_of(self, derived), report)
        else:
            raise InputError(
                f"{target.name!r} has no known suffix: use .npy, .tiff, .png, .ply, .obj, .stl, .glb or .json, "
                "or a folder name without suffix for everything."
            )


def write_files(
    folder: Path,
    solution: Solution,
    saving: Saving,
    derived: Derived,
    *,
    colour: NDArray[np.uint8] | None = None,
    report: Callable[[], Mapping[str, Any]] = dict,
    threads: int = 1,
) -> list[str]:
    """Write files of a surface, all but previews.

    Parameters
    ----------
    folder : Path
        Exists, and is not looked at by others before everything is in it.
    solution : Solution
    saving : Saving
    derived : Derived
        Of the solution. It is released as soon as nothing needs it: a mesh takes much memory too.
    colour
        As for :meth:`Solution.save`.
    report : callable
        Returns further entries for the report, where there is one.
    threads : int
        How many files are made at a time. With one, the memory for a mesh is taken when that for all else is free.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    InputError
        When a file cannot be written.
    """
    made: dict[str, Callable[[], None]] = {
        file: partial(write_depth, folder / file, solution.depth) for file in ("depth.npy", "depth.tiff", "depth.tif")
    }
    made["normals.npy"] = lambda: write_array(folder / "normals.npy", derived.normals.astype(np.float32))
    made["report.json"] = lambda: write_json(folder / "report.json", report_of(solution, derived), report())
    possible = drawings(
        solution, derived, solution.changes, solution.parameters["tolerance"], solution.distance, solution.guide
    )
    drawn = {file: possible[file] for file in saving.files if file in possible}

    def write_meshes() -> None:
        mesh = solution.mesh(colour, mesh_faces=saving.mesh_faces)
        for file in saving.meshes:
            write_mesh(folder / file, mesh)

    with Jobs(threads) as jobs:
        # It takes longest, so that it is begun first.
        meshes = jobs.add(write_meshes) if saving.meshes else None
        written = [file for file in saving.files if file in made]
        results = [jobs.add(made[file]) for file in written]
        pictures = draw_all(folder, drawn, jobs)
        for result in results:
            result()
        derived.release()
        if meshes is not None:
            meshes()
    return [*written, *pictures, *saving.meshes]


def report_of(solution: Solution, derived: Derived) -> dict[str, Any]:
    """The report of :meth:`Solution.report` from what is at hand of the surface."""
    grey, confidence = derived.prepared_residual, derived.confidence
    height, width = solution.depth.shape
    return {
        "status": solution.status.name,
        "meaning": solution.status.value,
        "iterations": solution.iterations,
        "changes": solution.changes.tolist(),
        "distance": None if math.isnan(solution.distance) else solution.distance,
        "pixels": {
            "all": solution.depth.size,
            "solved": int(np.count_nonzero(solution.solved)),
            "unreached": int(np.count_nonzero(solution.unreached)),
            "clamped": int(np.count_nonzero(solution.clamped)),
            "at_bound": int(np.count_nonzero(solution.at_bound)),
            "walls": 0 if solution.walls is None else int(np.count_nonzero(solution.walls)),
            "walls_solved": 0 if solution.walls is None else int(np.count_nonzero(solution.walls & solution.solved)),
        },
        "guide": None if solution.guide is None else solution.guide.report(),
        "depth": derived.depths,
        "grey_levels": {
            "compared_with": "the prepared image",
            "mean_error": grey.mean,
            "root_mean_square": grey.root_mean_square,
        },
        "confidence": confidence.report(),
        "seconds": {
            "total": solution.elapsed.total,
            "kernels": solution.elapsed.kernels,
            "build": solution.elapsed.build,
        },
        "parameters": {
            "focal_length": [solution.camera.fx, solution.camera.fy],
            "principal_point": list(solution.camera.centre((height, width))),
            "light": {"kind": type(solution.light).__name__, **asdict(solution.light)},
            "reflectance": {"kind": type(solution.reflectance).__name__, **asdict(solution.reflectance)},
            **solution.parameters,
        },
        "device": {
            "name": solution.device.name,
            "platform": solution.device.platform,
            "platform_version": solution.device.platform_version,
            "driver_version": solution.device.driver_version,
        },
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("persfs-cl", "pyopencl", "numpy")},
        },
    }
