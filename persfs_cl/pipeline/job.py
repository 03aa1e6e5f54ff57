"""From a photo's file to its surface: read, prepare, solve.

Each step is a function of what the one before returned, and of nothing else. A job can be pickled, and so can what the
steps return: they may run in threads or processes of their own. They are in one module, which is long for that, since
each is read with the one before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import warn
from persfs_cl.colour import encode_srgb
from persfs_cl.errors import CameraError, InputError
from persfs_cl.framing.maps import Maps
from persfs_cl.guide.guide import Points
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import Photo, read_frame, read_photo
from persfs_cl.masks import rim
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.darkness import too_dark
from persfs_cl.pipeline.frames import frames_for
from persfs_cl.pipeline.guides import GuideFile
from persfs_cl.pipeline.optics import CameraChoice, horizontal_view
from persfs_cl.pipeline.results import PhotoSolution
from persfs_cl.preparation.prepare import Preparation, prepare_photo
from persfs_cl.preparation.prepared import PreparedPhoto, framed
from persfs_cl.preparation.silhouette import eroded, silhouette
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.given import check
from persfs_cl.solver.inputs import warn_of_steep_outline
from persfs_cl.solver.options import Callback, Options
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reconstruct import reconstruct
from persfs_cl.surface.outcome import Taken
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
        Files of the photo's size. A mask may be "auto", and an albedo "fit": then they are found.
    mask_erode : int
        Pixels along the outline of the mask that are left out.
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
    size : int or None
        Pixels of the longer side that are solved, at most.
    """

    path: Path
    camera: CameraChoice
    brightness: Brightness
    mask: Path | Literal["auto"] | None = None
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
    size: int | None = None
    mask_erode: int = 0

    @property
    def title(self) -> str:
        """What errors call the photo."""
        return str(self.path) if self.frame is None else f"{self.path}, frame {self.frame}"

    @property
    def outlined(self) -> bool:
        """Whether it is found, or changed, which pixels are the surface."""
        return self.mask == "auto" or self.mask_erode > 0

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
        Of the photo.
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
    camera : Camera
        A pinhole camera, that of the image.
    maps : Maps
        What goes with the image: its mask is what is solved; without known depths it is left to the solver what to
        assume.
    colour : ndarray of uint8, shape (height, width, 3)
        Of the photo, for people to look at.
    report : mapping
        What the report says besides what it says of the solution.
    """

    inputs: JobInputs
    prepared: PreparedPhoto
    image: Array
    unfiltered: Array
    camera: Camera
    maps: Maps
    colour: NDArray[np.uint8]
    report: Mapping[str, Any]


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
    inside = np.ones(shape, bool)
    if isinstance(job.mask, Path):
        inside = read_mask(job.mask, shape, orientation=turned)
    elif job.mask == "auto":
        with _naming(job.title):
            inside = silhouette(photo.image, mask=opaque & np.isfinite(photo.image))
    whole = opaque & inside
    if job.mask_erode and whole.all():
        raise InputError.about(
            "mask_erode", job.mask_erode, f"has no outline to go by: give {keyword('mask')}, or leave it out."
        ).at(job.title)
    wanted = eroded(whole, job.mask_erode)
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
    inputs = JobInputs(job, photo, preparation, camera, source, wanted, walls, depths, shares, within, guide)
    if not inputs.lit.any():
        left_out = {"transparent": ~opaque, f"outside {job.mask}": ~inside}
        if job.mask_erode:
            left_out[f"within {job.mask_erode} pixels of the outline"] = whole & ~wanted
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
    job, photo, walls = inputs.job, inputs.photo, inputs.walls
    camera, colour = inputs.camera, photo.colour
    maps = Maps(inputs.wanted, walls, inputs.known_depth, inputs.albedo, inputs.depth_range, inputs.guide)
    with _naming(job.title):
        _require_shading(photo, inputs.lit)
        prepared = prepare_photo(photo, camera, inputs.preparation, mask=inputs.lit)
        told = prepared.mask
        if walls is not None:
            seen = inputs.wanted & np.isfinite(photo.image)
            # Their light tells which side walls belong to: corrected like all other, but not mixed with it.
            alone = replace(
                inputs.preparation, despeckle=False, highlights="keep", clip_highlights=None, denoise=0.0, mean_filter=1
            )
            of_walls = prepare_photo(photo, camera, alone, mask=seen).light
            prepared = replace(
                prepared,
                light=np.where(walls & seen, of_walls, prepared.light),
                unfiltered=np.where(walls & seen, of_walls, prepared.unfiltered),
            )
            told = told | (walls & seen)
        for frame in frames_for(camera, (told.shape[0], told.shape[1]), job.size):
            prepared, told = framed(prepared, frame, told), frame.mostly(told)
            maps, colour, camera = maps.framed(frame), frame.colour(colour), frame.camera
        wanted = np.ones(told.shape, bool) if maps.mask is None else maps.mask
        if not (prepared.mask & wanted).any():
            raise InputError(
                f"{prepared.mask.shape[1]} × {prepared.mask.shape[0]} pixels leave none to solve: give a larger "
                f"{keyword('size')}, or a mask that leaves more."
            )
        image, unfiltered, done = job.brightness.applied(prepared, job.light, job.reflectance)
        depths, walls = maps.known_depth, maps.walls
        assumed = depths is None and maps.depth_range is None and maps.guide is None and job.light.flat_rim
        known = rim(wanted) if assumed else np.zeros(wanted.shape, bool) if depths is None else np.isfinite(depths)
        solvable = wanted
        if prepared.masked.any():
            solvable = wanted & ~prepared.masked
            if assumed:
                # The edge of a hole is no edge of the object.
                depths = np.where(known, 1.0, np.nan)
                albedo = None if isinstance(maps.albedo, str) else maps.albedo
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
            "size": list(photo.image.shape[::-1]),
            **{name: str(file) if isinstance(file, Path) else file for name, file in job.files.items()},
            "mask_erode": job.mask_erode,
            "mask_pixels": int(np.count_nonzero(inputs.wanted)),
            **({} if job.frame is None else {"frame": job.frame}),
        },
        "known": {
            "pixels": int(np.count_nonzero(known)),
            "assumed": "z = 1 on the edge of the image or mask" if assumed else None,
        },
        "camera": {"source": inputs.source, "horizontal_view": horizontal_view(camera, image.shape)},
        "requested": {**job.camera.said, "size": job.size, "device": job.keywords.get("device")},
    }
    maps = replace(maps, mask=solvable, known_depth=depths)
    return PreparedJob(inputs, prepared, image, unfiltered, camera, maps, colour, report)


def pose(ready: PreparedJob, options: Options) -> Problem:
    """What is to be solved of a photo that is ready.

    Parameters
    ----------
    ready : PreparedJob
    options : Options
        Complete, see :func:`persfs_cl.solver.complete.complete`.

    Raises
    ------
    PersfsError
        Naming the photo.
    """
    inputs = ready.inputs
    with _naming(inputs.job.title):
        return Problem.of(check(ready.image, ready.camera, **vars(ready.maps), options=options, whole=False))


def finished(ready: PreparedJob, solution: Solution) -> PhotoSolution:
    """A photo with its surface.

    Warns
    -----
    UserWarning
        When many of its pixels are too dark for the light.
    """
    inputs = ready.inputs
    height, width = inputs.photo.image.shape
    taken = Taken(inputs.camera, (height, width), inputs.job.outlined)
    solution = replace(solution, taken_by=taken)
    clamped, solved = int(np.count_nonzero(solution.clamped)), int(np.count_nonzero(solution.solved))
    levelled = ready.report["photo"]["normalise"] == "level"
    if (remark := too_dark(clamped, solved, solution.light, levelled=levelled)) is not None:
        warn(remark)
    return PhotoSolution(solution, inputs.photo.path, ready.colour, ready.prepared, ready.unfiltered, ready.report)


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
            ready.camera,
            **vars(ready.maps),
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
    values = photo.image if mask.all() else photo.image[mask]
    if bad := int(np.count_nonzero(np.isnan(values))):
        are = "1 NaN pixel is" if bad == 1 else f"{bad} NaN pixels are"
        raise InputError(f"{are} among those to solve: leave them out with {keyword('mask')}.")
    darkest, brightest = float(values.min()), float(values.max())
    if brightest <= 0:
        raise InputError("every pixel to solve is black: there is no shading to reconstruct from.")
    if darkest == brightest and values.size > 1:
        coded = f" ({255 * float(encode_srgb(darkest)):.4g} of 255 in sRGB)" if photo.encoding == "srgb" else ""
        raise InputError(
            f"the photo is constant, {darkest:.4g} in linear light{coded} at each of {values.size} pixels to solve: "
            "there is no shading to reconstruct from."
        )
