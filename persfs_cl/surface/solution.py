"""What a reconstruction returns."""

from __future__ import annotations

import enum
import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl import metrics
from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.checks import as_floats, as_mask, warn
from persfs_cl.errors import InputError
from persfs_cl.io import photos as images
from persfs_cl.io.files import FilePath, as_path, atomic_path, filling, json_text
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface import geometry as surface
from persfs_cl.surface import plots as pictures
from persfs_cl.surface import render as forward
from persfs_cl.surface.confidence import Confidence, slope_error

if TYPE_CHECKING:
    import trimesh

Doubts = Mapping[str, Mask]

_BRIGHTEST = 1e100
"""More than any brightness; what is multiplied by it still has a double-precision number."""


class Status(enum.Enum):
    """How an iteration ended; the value says what that means and what to try."""

    CONVERGED = "The largest change over an iteration is at most the tolerance."
    MAX_ITERATIONS = (
        "The iterations ran out before the tolerance was met: raise max_iterations, or accept a larger tolerance; "
        "where a lamp beside the camera is found in rounds, have it nearer to the camera."
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
    """

    total: float
    kernels: float
    build: float


@dataclass(frozen=True, repr=False)
class Solution:
    """A reconstructed surface.

    Attributes
    ----------
    depth : ndarray of float64, shape (height, width)
        z along the optical axis, in the units of the known values; NaN where not solved.
    log_depth : ndarray of float64, shape (height, width)
        Z = ln z.
    solved : ndarray of bool, shape (height, width)
        Pixels that have a depth, known ones included.
    unreached : ndarray of bool, shape (height, width)
        Pixels that were to be solved but have no depth: no known value can reach them, or none had reached them when
        the run was ended early.
    clamped : ndarray of bool, shape (height, width)
        Solved pixels where the equation degenerates (too dark for their place in the image): their slope is bounded
        by ``max_slope`` alone.
    iterations : int
        Iterations done, of four sweeps each.
    changes : ndarray of float64, shape (iterations,)
        max |ΔZ| over each iteration.
    status : Status
    elapsed : Elapsed
    device : Device
    image : ndarray of float64, shape (height, width)
        The brightness that was reconstructed: E, or that under the flash.
    camera, light, reflectance
        As given.
    parameters : mapping
        The remaining keywords, with "auto" resolved.
    albedo : ndarray of float64, shape (height, width), or None
        As given; 1 where there is no surface.
    walls : ndarray of bool, shape (height, width), or None
        Pixels on walls that the surface may have: inside the mask, or of known depth. They are solved where a side had
        a depth within `REACH <persfs_cl.surface.discontinuities.REACH>` pixels, from which it is continued. None where
        none were given.
    cuts : Cuts or None
        Where the walls interrupt the surface: between each of their pixels and the neighbours on other sides. Normals,
        mesh and the surface photographed again do not look across. None where no walls were given.
    """

    depth: Array
    log_depth: Array
    solved: NDArray[np.bool_]
    unreached: NDArray[np.bool_]
    clamped: NDArray[np.bool_]
    iterations: int
    changes: Array
    status: Status
    elapsed: Elapsed
    device: Device
    image: Array
    camera: Camera
    light: Light
    reflectance: Reflectance
    parameters: Mapping[str, Any]
    albedo: Array | None = None
    walls: Mask | None = None
    cuts: surface.Cuts | None = None

    def __repr__(self) -> str:
        height, width = self.depth.shape
        rounds = "1 iteration" if self.iterations == 1 else f"{self.iterations} iterations"
        solved = np.count_nonzero(self.solved)
        depths = f", depth {np.nanmin(self.depth):.4g} to {np.nanmax(self.depth):.4g}" if solved else ""
        return f"<Solution {self.status.name}, {rounds}, {solved} of {width} x {height} pixels{depths}>"

    def normals(self) -> Array:
        """Unit normals towards the camera, shape (height, width, 3), in camera axes; NaN where not solved."""
        return surface.normals(self.depth, self.camera, self.cuts)

    def points(self) -> Array:
        """Points z (x, y, 1) in camera axes, shape (height, width, 3); NaN where not solved."""
        return surface.points(self.depth, self.camera)

    def mesh(self, colour: NDArray[np.uint8] | None = None) -> trimesh.Trimesh:
        """Triangle mesh, with no faces across unsolved pixels or cuts.

        Parameters
        ----------
        colour : ndarray of uint8, shape (height, width) or (height, width, 3), optional
            Vertex colours; the image itself, encoded for display, when not given.
        """
        if colour is None:
            colour = images.to_display(np.nan_to_num(self.image / self.white))
        return surface.mesh(self.depth, self.camera, colour, self.cuts)

    @property
    def white(self) -> float:
        """Brightness that is drawn white and counts 255 grey levels: 1, or under a flash the image's brightest."""
        if self.light.normalised:
            return 1.0
        used = self.solved if self.walls is None else self.solved & ~self.walls
        # Of known pixels the brightness may be anything, or black where a run was ended early.
        brightest = float(np.fmax.reduce(self.image[used], initial=0.0))
        return brightest if brightest * _BRIGHTEST >= 1.0 else 1.0

    def render(self) -> Array:
        """The surface photographed again under its own light, eq. (6); NaN where not solved."""
        return forward.render(
            self.depth,
            self.camera,
            light=self.light,
            reflectance=self.reflectance,
            albedo=self.albedo,
            cuts=self.cuts,
            device=self.device,
        )

    def grey_errors(self, photo: Array | None = None) -> metrics.Errors:
        """Difference between the re-rendered and the given image in grey levels, 0 to 255 (the paper's Table 2).

        Parameters
        ----------
        photo : ndarray of float, shape (height, width), optional
            Compare with this image, on the same scale, such as the photograph before smoothing, instead of with the
            prepared :attr:`image`.

        Raises
        ------
        InputError
            When it holds no numbers, or is not of the image's shape.
        """
        given = self.image if photo is None else as_floats("photo", photo)
        if given.shape != self.image.shape:
            raise InputError(f"photo has shape {given.shape}: give one of the image's shape {self.image.shape}.")
        if (largest := float(np.fmax.reduce(np.abs(given), axis=None))) > _BRIGHTEST:
            raise InputError(f"photo goes up to {largest:g}: give one on the scale of the image, NaN where unknown.")
        return self._grey_errors(self.render(), given)

    def _grey_errors(self, rendered: Array, given: Array) -> metrics.Errors:
        grey = 255.0 / self.white
        seen = np.clip(rendered, 0.0, self.white)
        seen *= grey
        return metrics.compare(seen, grey * given)

    def confidence(self, doubts: Doubts | None = None) -> Confidence:
        """How far each pixel can be believed, as far as it can be told without knowing the surface.

        Parameters
        ----------
        doubts : mapping of str to ndarray of bool, shape (height, width), optional
            Further pixels whose brightness does not tell of the slope, by the reason: shadows, highlights and the like.
            In :attr:`Confidence.doubts <persfs_cl.surface.confidence.Confidence.doubts>` they come after those that the
            solver knows of: "unreached", "clamped" and, where walls were given, "on a wall".

        Returns
        -------
        Confidence

        Raises
        ------
        InputError
            When `doubts` is no mapping, or a map is not of bool, or not of the image's shape.
        """
        return self._confidence(self.normals(), doubts)

    def _confidence(self, normals: Array, doubts: Doubts | None) -> Confidence:
        if doubts is not None and not isinstance(doubts, Mapping):
            raise InputError.about("doubts", doubts, "is no mapping: give maps of bool by the reason for doubt.")
        shape = self.depth.shape
        given = {reason: as_mask(f"doubts[{reason!r}]", pixels, shape) for reason, pixels in (doubts or {}).items()}
        grid = self.camera.grid((self.depth.shape[0], self.depth.shape[1]))
        cosine = np.empty(self.depth.shape)
        for rows in row_blocks(self.depth.shape):
            z = self.depth[rows]
            to_light = self.light.toward(z, grid.x, grid.y[rows])
            along = (normals[rows] * to_light).sum(axis=-1)
            np.divide(along, np.linalg.norm(to_light, axis=-1), out=cosine[rows])
        own = {"unreached": self.unreached, "clamped": self.clamped}
        if self.walls is not None:
            own["on a wall"] = self.walls
        return Confidence(slope_error(cosine, self.reflectance), {**own, **given})

    def report(self, doubts: Doubts | None = None) -> dict[str, Any]:
        """Everything about the run that a later reader needs, ready for JSON.

        Parameters
        ----------
        doubts : mapping, optional
            As for :meth:`confidence`.
        """
        return self._report(self.render(), self.confidence(doubts))

    def _report(self, rendered: Array, confidence: Confidence) -> dict[str, Any]:
        grey = self._grey_errors(rendered, self.image)
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
        doubts: Doubts | None = None,
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
        doubts : mapping, optional
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
        """
        target = as_path(path)
        if target.suffix and not folder and not target.is_dir():
            self._write(target, colour, report, doubts)
            return [target]
        names = ("depth.npy", "depth.tiff", "mesh.ply", "report.json")
        with filling(target) as temporary:
            for name in names[:2]:
                self._write(temporary / name, colour, report, doubts)
            # Once for the report and all pictures: in a large photograph these take more memory than all the rest.
            normals, rendered = self.normals(), self.render()
            confidence = self._confidence(normals, doubts)
            _write_json(temporary / "report.json", self._report(rendered, confidence), report)
            drawn = self._draw(temporary, normals, rendered, confidence)
            del normals, rendered, confidence
            self._write(temporary / "mesh.ply", colour, report, doubts)
        return [target / name for name in (*names, *drawn)]

    @property
    def _unit(self) -> str:
        return "units of the light's gain" if self.light.determines_depth else pictures.UNIT

    def _write(
        self,
        target: Path,
        colour: NDArray[np.uint8] | None,
        report: Mapping[str, Any] | None,
        doubts: Doubts | None,
    ) -> None:
        suffix = target.suffix.lower()
        if suffix in (".npy", ".tif", ".tiff"):
            images.write_depth(target, self.depth)
        elif suffix == ".png":
            pictures.depth_picture(target, self.depth, unit=self._unit)
        elif suffix in (".ply", ".obj", ".stl", ".glb"):
            mesh = self.mesh(colour)
            with atomic_path(target) as temporary:
                mesh.export(temporary)
        elif suffix == ".json":
            _write_json(target, self.report(doubts), report)
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
                cuts=self.cuts,
                normals=normals,
            ),
            "rendered": lambda path: images.write_grey(path, rendered / white),
            "comparison": lambda path: pictures.comparison_picture(
                path, self.image, rendered, white=white, photo_title="Prepared photograph"
            ),
            "confidence": lambda path: pictures.confidence_picture(path, confidence.slope_error, confidence.doubts),
            "convergence": lambda path: pictures.convergence_picture(path, self.changes, self.parameters["tolerance"]),
        }
        drawn = []
        for name, draw in drawings.items():
            file = f"{name}.png"
            try:
                draw(folder / file)
            except Exception as error:  # whatever a library that draws raises
                # A full disk has room for no other file either: the user chooses another.
                if isinstance(error, InputError) and isinstance(error.__cause__, OSError):
                    raise
                warn(
                    f"{file} could not be drawn ({type(error).__name__}: {' '.join(str(error).split())}): depth, mesh, "
                    "report and other pictures are complete without it."
                )
            else:
                drawn.append(file)
        return drawn


def _extremes(values: Array) -> dict[str, float | None]:
    if values.size == 0:
        return dict.fromkeys(("min", "median", "max"))
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}


def _write_json(target: Path, *entries: Mapping[str, Any] | None) -> None:
    merged = {name: value for some in entries for name, value in (some or {}).items()}
    with atomic_path(target) as temporary:
        temporary.write_text(json_text(merged) + "\n", encoding="utf-8")
