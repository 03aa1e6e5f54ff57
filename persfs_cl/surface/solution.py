"""What a reconstruction returns: the surface, how the run went, and files of all of it."""

from __future__ import annotations

import enum
import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_depth, write_grey
from persfs_cl.io.files import FilePath, as_path, filling
from persfs_cl.surface import plots as pictures
from persfs_cl.surface.confidence import Confidence
from persfs_cl.surface.export import draw_all, write_json, write_mesh
from persfs_cl.surface.solved import SolvedSurface, Unreliable


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

    CONVERGED = "The largest change over an iteration is at most the tolerance."
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
    depth, log_depth, solved, unreached, clamped
        z and Z = ln z of each pixel, and which pixels have a depth, have none, or have one that the equation leaves
        open; arrays of shape (height, width), see :class:`SolvedSurface <persfs_cl.surface.solved.SolvedSurface>`.
    image, camera, light, reflectance, albedo, device
        What it was found from, and where.
    walls, discontinuities
        Where the surface may jump, and where it is interrupted; None where no walls were given.
    iterations : int
        Iterations done, of four sweeps each.
    changes : ndarray of float64, shape (iterations,)
        max |ΔZ| over each iteration.
    status : Status
    elapsed : Elapsed
    parameters : mapping
        The remaining keywords, with "auto" resolved.

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
    elapsed: Elapsed
    parameters: Mapping[str, Any]

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
        return self._report(self.render(), self.confidence(unreliable))

    def _report(self, rendered: Array, confidence: Confidence) -> dict[str, Any]:
        grey = self._residual(rendered, self.image)
        height, width = self.depth.shape
        return {
            "status": self.status.name,
            "meaning": self.status.value,
            "iterations": self.iterations,
            "changes": self.changes.tolist(),
            "pixels": {
                "all": self.depth.size,
                "solved": int(self.solved.sum()),
                "unreached": int(self.unreached.sum()),
                "clamped": int(self.clamped.sum()),
                "walls": 0 if self.walls is None else int(self.walls.sum()),
                "walls_solved": 0 if self.walls is None else int((self.walls & self.solved).sum()),
            },
            "depth": _extremes(self.depth[self.solved]),
            "grey_levels": {
                "compared_with": "the prepared image",
                "mean_error": grey.mean,
                "root_mean_square": grey.root_mean_square,
            },
            "confidence": confidence.report(),
            "seconds": {
                "total": self.elapsed.total,
                "kernels": self.elapsed.kernels,
                "build": self.elapsed.build,
            },
            "parameters": {
                "focal_length": [self.camera.fx, self.camera.fy],
                "principal_point": list(self.camera.centre((height, width))),
                "light": {"kind": type(self.light).__name__, **asdict(self.light)},
                "reflectance": {"kind": type(self.reflectance).__name__, **asdict(self.reflectance)},
                **self.parameters,
            },
            "device": {
                "name": self.device.name,
                "platform": self.device.platform,
                "platform_version": self.device.platform_version,
                "driver_version": self.device.driver_version,
            },
            "versions": {
                "python": platform.python_version(),
                **{name: version(name) for name in ("persfs-cl", "pyopencl", "numpy")},
            },
        }

    def save(
        self,
        path: FilePath,
        *,
        colour: NDArray[np.uint8] | None = None,
        report: Mapping[str, Any] | None = None,
        unreliable: Unreliable | None = None,
        folder: bool = False,
    ) -> list[Path]:
        """Write the surface to one file, or everything to a folder.

        Parameters
        ----------
        path : path
            A file whose suffix says what is wanted: ``.npy``, ``.tif``, ``.tiff`` (depth, float32 in TIFF), ``.png``
            (picture of the depth), ``.ply``, ``.obj``, ``.stl``, ``.glb`` (mesh), ``.json`` (report). A name
            without a suffix, or of a folder that exists, is a folder, made if needed, that receives depth.npy,
            depth.tiff, depth.png, normals.png, relief.png, mesh.ply, rendered.png, comparison.png, confidence.png,
            convergence.png and report.json. A picture that cannot be drawn is left out, with a warning.
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
            When the suffix is unknown or the file cannot be written.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import persfs_cl as ps
        >>> scene = ps.bump((20, 20), light=ps.FlashLight())
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
        >>> with TemporaryDirectory() as folder:
        ...     solution.save(Path(folder) / "bump.ply")[0].name
        'bump.ply'
        """
        target = as_path(path)
        if target.suffix and not folder and not target.is_dir():
            self._write(target, colour, report, unreliable)
            return [target]
        names = ("depth.npy", "depth.tiff", "mesh.ply", "report.json")
        with filling(target) as temporary:
            for name in names[:2]:
                self._write(temporary / name, colour, report, unreliable)
            # Once for the report and all pictures: in a large photograph these take more memory than all the rest.
            normals, rendered = self.normals(), self.render()
            confidence = self._confidence(normals, unreliable)
            write_json(temporary / "report.json", self._report(rendered, confidence), report)
            drawn = self._draw(temporary, normals, rendered, confidence)
            del normals, rendered, confidence
            self._write(temporary / "mesh.ply", colour, report, unreliable)
        return [target / name for name in (*names, *drawn)]

    @property
    def _unit(self) -> str:
        return "units of the light's gain" if self.light.determines_depth else pictures.UNIT

    def _write(
        self,
        target: Path,
        colour: NDArray[np.uint8] | None,
        report: Mapping[str, Any] | None,
        unreliable: Unreliable | None,
    ) -> None:
        suffix = target.suffix.lower()
        if suffix in (".npy", ".tif", ".tiff"):
            write_depth(target, self.depth)
        elif suffix == ".png":
            pictures.depth_picture(target, self.depth, unit=self._unit)
        elif suffix in (".ply", ".obj", ".stl", ".glb"):
            write_mesh(target, self.mesh(colour))
        elif suffix == ".json":
            write_json(target, self.report(unreliable), report)
        else:
            raise InputError(
                f"{target.name!r} has no known suffix: use .npy, .tiff, .png, .ply, .obj, .stl, .glb or .json, "
                "or a folder name without suffix for everything."
            )

    def _draw(self, folder: Path, normals: Array, rendered: Array, confidence: Confidence) -> list[str]:
        """Names of the pictures drawn; one that cannot be is left out, with a warning, for nothing depends on it."""
        white = self.white
        drawings: dict[str, Callable[[Path], None]] = {
            "depth": lambda path: pictures.depth_picture(path, self.depth, unit=self._unit),
            "normals": lambda path: pictures.normals_picture(path, normals),
            "relief": lambda path: pictures.relief_picture(
                path,
                self.depth,
                self.camera,
                self.image,
                unit=self._unit,
                white=white,
                discontinuities=self.discontinuities,
                normals=normals,
            ),
            "rendered": lambda path: write_grey(path, rendered / white),
            "comparison": lambda path: pictures.comparison_picture(
                path, self.image, rendered, white=white, photo_title="Prepared photograph"
            ),
            "confidence": lambda path: pictures.confidence_picture(path, confidence.slope_error, confidence.unreliable),
            "convergence": lambda path: pictures.convergence_picture(path, self.changes, self.parameters["tolerance"]),
        }
        return draw_all(folder, drawings)


def _extremes(values: Array) -> dict[str, float | None]:
    if values.size == 0:
        return dict.fromkeys(("min", "median", "max"))
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
