"""From a photo's file to its surface: read, prepare, solve.

Each step is a function of what the one before returned, and of nothing else. A job can be pickled, and so can what the
steps return: they may run in threads or processes of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.colour import encode_srgb
from persfs_cl.errors import CameraError, InputError
from persfs_cl.guide.guide import Points
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import Photo, read_frame, read_photo
from persfs_cl.masks import rim
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.guides import GuideFile
from persfs_cl.pipeline.optics import CameraChoice, horizontal_view
from persfs_cl.pipeline.results import PhotoSolution
from persfs_cl.preparation.prepare import Preparation, prepare_photo
from persfs_cl.preparation.prepared import PreparedPhoto
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.given import check
from persfs_cl.solver.inputs import warn_of_steep_outline
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reconstruct import reconstruct
from persfs_cl.surface.solution import Solution
from persfs_cl.wording import keyword


@dataclass(frozen=True)
class Job:
    """What is to be done with one photo, as names of files and plain values.

    Attributes
    ----------
    path : Path
        The photo. Its transparent pixels are not solved.
    camera : CameraChoice
    brightness : Brightness
    mask, walls, known_depth, albedo : Path or None
        Files of the photo's size. An albedo may be "fit": it is found.
    near, far : float, Path or None
        Depths between which the surface lies, as numbers or files.
    guide : GuideFile or None
        What is coarsely known of the depth.
    light : Light
    reflectance : Reflectance
    keywords : Options
        Further keywords of :func:`persfs_cl.reconstruct`.
    frame : int or None
        Of a video, which frame is the photo.
    """

    path: Path
    camera: CameraChoice
    brightness: Brightness
    mask: Path | None = None
    walls: Path | None = None
    known_depth: Path | None = None
    albedo: Path | Literal["fit"] | None = None
    near: float | Path | None = None
    far: float | Path | None = None
    guide: GuideFile | None = None
    light: Light = ParallelLight()
    reflectance: Reflectance = Lambertian()
    keywords: Options = field(default_factory=Options)
    frame: int | None = None

    @property
    def title(self) -> str:
        """What errors call the photo."""
        return str(self.path) if self.frame is None else f"{self.path}, frame {self.frame}"

    @property
    def files(self) -> dict[str, float | str | Path | None]:
        """The photo, and what comes with it; bounds of the depth may be numbers."""
        names = ("path", "mask", "walls", "known_depth", "albedo", "near", "far")
        guide = None if self.guide is None else self.guide.path
        return {**{name: getattr(self, name) for name in names}, "guide": guide}


@dataclass(frozen=True, eq=False)
class JobInputs:
    """What the files of a job hold.

    Attributes
    ----------
    job : Job
    photo : Photo
    preparation : Preparation
    camera : Camera
    source : str
        What told the focal length.
    wanted : ndarray of bool, shape (height, width)
        Pixels of the surface: opaque, and inside the mask.
    walls : ndarray of bool, shape (height, width), or None
    known_depth : ndarray of float64, shape (height, width), or None
        NaN where unknown.
    albedo : ndarray of float64, shape (height, width), or None
    depth_range : (near, far) or None
        Numbers, arrays of that shape, or None where there is no bound.
    guide : ndarray of float64, shape (any, any), Points, or None
    """

    job: Job
    photo: Photo
    preparation: Preparation
    camera: Camera
    source: str
    wanted: Mask
    walls: Mask | None
    known_depth: Array | None
    albedo: Array | Literal["fit"] | None
    depth_range: tuple[float | Array | None, float | Array | None] | None
    guide: Array | Points | None

    @property
    def lit(self) -> Mask:
        """Pixels whose shading counts: those of walls belong to whatever is next to them."""
        return self.wanted if self.walls is None else self.wanted & ~self.walls


@dataclass(frozen=True, eq=False)
class PreparedJob:
    """An image that is ready to be solved.

    Attributes
    ----------
    inputs : JobInputs
    prepared : PreparedPhoto
        With the maps of saturated pixels, highlights and others.
    image, unfiltered : ndarray of float64, shape (height, width)
        What is solved, and the photo itself on the same scale.
    mask : ndarray of bool, shape (height, width)
        Pixels to solve.
    known_depth : ndarray of float64, shape (height, width), or None
        NaN where unknown; None leaves it to the solver what to assume.
    report : mapping
        What the report says besides what it says of the solution.
    """

    inputs: JobInputs
    prepared: PreparedPhoto
    image: Array
    unfiltered: Array
    mask: Mask
    known_depth: Array | None
    report: Mapping[str, Any]

    @property
    def maps(self) -> dict[str, Any]:
        """What goes with the image, by the keywords of :func:`persfs_cl.reconstruct`."""
        return {
            "mask": self.mask,
            "walls": self.inputs.walls,
            "known_depth": self.known_depth,
            "albedo": self.inputs.albedo,
            "depth_range": self.inputs.depth_range,
            "guide": self.inputs.guide,
        }


def read_job(job: Job) -> JobInputs:
    """Read the files of a job.

    Raises
    ------
    PersfsError
        Naming the file that cannot be used.
    """
    channel, encoding, halved = job.brightness.channel, job.brightness.encoding, job.brightness.half_size
    if job.frame is None:
        photo = read_photo(
            job.path,
            channel=channel,
            encoding=encoding,
            keep_nan=True,
            page=job.brightness.page,
            half_size=halved,
        )
    else:
        for name in ("page", "half_size"):
            if value := getattr(job.brightness, name):
                raise InputError.about(name, value, f"is not for a video such as {job.path}: leave it out.")
        photo = read_frame(job.path, job.frame, channel=channel, encoding=encoding)
    shape = (photo.image.shape[0], photo.image.shape[1])
    opaque = np.ones(shape, bool) if photo.mask is None else photo.mask
    turned = photo.orientation
    inside = np.ones(shape, bool) if job.mask is None else read_mask(job.mask, shape, orientation=turned)
    walls = None if job.walls is None else read_mask(job.walls, shape, orientation=turned)
    depths = None if job.known_depth is None else read_depth(job.known_depth, shape, orientation=turned)
    shares: Array | Literal["fit"] | None = None
    if job.albedo == "fit":
        shares = "fit"
    elif job.albedo is not None:
        shares = read_light(
            job.albedo, shape, channel=photo.channel, encoding=encoding, orientation=turned, half_size=halved
        )
    bounds = [
        read_depth(one, shape, orientation=turned) if isinstance(one, Path) else one for one in (job.near, job.far)
    ]
    within = None if job.near is None and job.far is None else (bounds[0], bounds[1])
    preparation = job.brightness.preparation(shape, orientation=turned)
    camera, source = job.camera.of(job.path, shape)
    guide = None if job.guide is None else job.guide.read(job.path, camera, shape, orientation=turned)
    inputs = JobInputs(job, photo, preparation, camera, source, opaque & inside, walls, depths, shares, within, guide)
    if not inputs.lit.any():
        left_out = {"transparent": ~opaque, f"outside {job.mask}": ~inside}
        if walls is not None:
            left_out[f"in {job.walls}"] = walls
        raise InputError(_why_empty(left_out)).at(job.title)
    return inputs


def prepare(inputs: JobInputs) -> PreparedJob:
    """Make the photo of a job ready to be solved.

    Raises
    ------
    PersfsError
        Naming the photo.
    """
    job, photo, wanted, walls = inputs.job, inputs.photo, inputs.wanted, inputs.walls
    depths = inputs.known_depth
    assumed = depths is None and inputs.depth_range is None and inputs.guide is None and job.light.flat_rim
    known = rim(wanted) if assumed else np.zeros(wanted.shape, bool) if depths is None else np.isfinite(depths)
    solvable = wanted
    with _naming(job.title):
        _require_shading(photo, inputs.lit)
        prepared = prepare_photo(photo, inputs.camera, inputs.preparation, mask=inputs.lit)
        if walls is not None:
            seen = wanted & np.isfinite(photo.image)
            # Their light tells which side walls belong to: corrected like all other, but not mixed with it.
            alone = replace(inputs.preparation, highlights="keep", clip_highlights=None, mean_filter=1)
            of_walls = prepare_photo(photo, inputs.camera, alone, mask=seen).light
            prepared = replace(
                prepared,
                light=np.where(walls & seen, of_walls, prepared.light),
                unfiltered=np.where(walls & seen, of_walls, prepared.unfiltered),
            )
        image, unfiltered, done = job.brightness.applied(prepared, job.light)
        if prepared.masked.any():
            solvable = wanted & ~prepared.masked
            if assumed:
                # The edge of a hole is no edge of the object.
                depths = np.where(known, 1.0, np.nan)
                albedo = None if isinstance(inputs.albedo, str) else inputs.albedo
                looked_at = solvable if walls is None else solvable & ~walls
                brightness = image if albedo is None else image / albedo
                warn_of_steep_outline(brightness, looked_at, wanted, job.light, job.reflectance)
    report = {
        "photo": {
            **done,
            "encoding": photo.encoding,
            "bits": photo.bits,
            **({"profile": photo.profile} if photo.profile else {}),
            **({"page": job.brightness.page} if job.brightness.page is not None else {}),
            **({"half_size": True} if job.brightness.half_size else {}),
            **{name: str(file) if isinstance(file, Path) else file for name, file in job.files.items()},
            **({} if job.frame is None else {"frame": job.frame}),
        },
        "known": {
            "pixels": int(np.count_nonzero(known)),
            "assumed": "z = 1 on the edge of the image or mask" if assumed else None,
        },
        "camera": {"source": inputs.source, "horizontal_view": horizontal_view(inputs.camera, wanted.shape)},
        "requested": {**job.camera.said, "device": job.keywords.get("device")},
    }
    return PreparedJob(inputs, prepared, image, unfiltered, solvable, depths, report)


def pose(ready: PreparedJob, options: Options) -> Problem:
    """What is to be solved of a photo that is ready.

    Parameters
    ----------
    ready : PreparedJob
    options : Options
        Complete, see :func:`persfs_cl.solver.options.complete`.

    Raises
    ------
    PersfsError
        Naming the photo.
    """
    inputs = ready.inputs
    with _naming(inputs.job.title):
        return Problem.of(check(ready.image, inputs.camera, **ready.maps, options=options, whole=False))


def finished(ready: PreparedJob, solution: Solution) -> PhotoSolution:
    """A photo with its surface."""
    return PhotoSolution(solution, ready.inputs.photo, ready.prepared, ready.unfiltered, ready.report)


def solve(ready: PreparedJob, callback: Callback | None = None) -> PhotoSolution:
    """Reconstruct the surface of a photo that is ready.

    Parameters
    ----------
    ready : PreparedJob
    callback : callable, optional
        As for :func:`persfs_cl.reconstruct`.

    Raises
    ------
    PersfsError
        Naming the photo, where it is to blame.
    """
    inputs = ready.inputs
    job = inputs.job
    keywords: Options = {**job.keywords, "light": job.light, "reflectance": job.reflectance, "callback": callback}
    with _naming(job.title):
        solution = reconstruct(
            ready.image,
            inputs.camera,
            **ready.maps,
            **keywords,
        )
    return finished(ready, solution)


def solve_photo(job: Job, callback: Callback | None = None) -> PhotoSolution:
    """Read one photo and reconstruct it: all steps, one after the other.

    Parameters
    ----------
    job : Job
    callback : callable, optional
        As for :func:`persfs_cl.reconstruct`.

    Raises
    ------
    PersfsError
        Naming the file that cannot be used.
    """
    return solve(prepare(read_job(job)), callback)


@contextmanager
def _naming(title: str) -> Iterator[None]:
    """Put the photo's name before the message of an error."""
    try:
        yield
    except (InputError, CameraError) as error:
        raise error.at(title) from error


def _why_empty(left_out: Mapping[str, Mask]) -> str:
    counts = [f"{np.count_nonzero(pixels)} are {why}" for why, pixels in left_out.items() if pixels.any()]
    size = next(iter(left_out.values())).size
    return f"no pixel is left to solve: of {size}, {', '.join(counts)}. Leave out fewer."


def _require_shading(photo: Photo, mask: Mask) -> None:
    """Refuse a photo by its own values, before they are normalised."""
    values = photo.image[mask]
    if bad := int(np.count_nonzero(np.isnan(values))):
        raise InputError(f"{bad} NaN pixels are among those to solve: leave them out with {keyword('mask')}.")
    darkest, brightest = float(values.min()), float(values.max())
    if brightest <= 0:
        raise InputError("every pixel to solve is black: there is no shading to reconstruct from.")
    if darkest == brightest and values.size > 1:
        coded = f" ({255 * float(encode_srgb(darkest)):.4g} of 255 in sRGB)" if photo.encoding == "srgb" else ""
        raise InputError(
            f"the photo is constant, {darkest:.4g} in linear light{coded} at each of {values.size} pixels to solve: "
            "there is no shading to reconstruct from."
        )
