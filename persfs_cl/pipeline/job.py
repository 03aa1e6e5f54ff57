"""From a photo's file to its surface, and to a folder of results, as the command line asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.cli.options import CameraOptions, horizontal_view
from persfs_cl.colour import encode_srgb
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.files import filling
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import Channel, Encoding, Photo, read_photo
from persfs_cl.masks import rim
from persfs_cl.metrics import Errors
from persfs_cl.preparation.prepare import Highlights, Normalise, Preparation, PreparedPhoto, prepare_photo
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.solver.inputs import warn_of_steep_outline
from persfs_cl.solver.reconstruct import reconstruct
from persfs_cl.surface.solution import Solution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_WITHOUT_PICTURES = ("depth.npy", "depth.tiff", "mesh.ply", "report.json")


@dataclass(frozen=True)
class Brightness:
    """How a photo becomes linear light and, for a parallel light, E.

    Attributes
    ----------
    channel, encoding
        As for :func:`persfs_cl.io.photos.read_photo`.
    ambient, vignetting, highlights, saturation, clip_highlights, mean_filter
        As for :class:`persfs_cl.preparation.prepare.Preparation`, with files instead of arrays.
    normalise : {"linear", "grey", "none"} or None
        Divide by the brightest value, stretch by eq. (2), or leave as it is. None is "linear" for a parallel light;
        for others nothing is normalised.
    white_percentile : float or None
        As for :meth:`persfs_cl.preparation.prepare.PreparedPhoto.normalised`.
    """

    channel: Channel = "luminance"
    encoding: Encoding = "auto"
    ambient: float | Path = 0.0
    vignetting: Literal["none", "cos4"] | Path = "none"
    highlights: Highlights = "keep"
    saturation: float | None = None
    clip_highlights: float | None = None
    mean_filter: int = 1
    normalise: Normalise | None = None
    white_percentile: float | None = None

    def preparation(self, shape: tuple[int, int], *, orientation: int = 1) -> Preparation:
        """The same with arrays of the photo's shape, read from the files; `orientation` is the photo's.

        Raises
        ------
        InputError
            When a file cannot be used, or a number is impossible.
        """
        files = {
            name: read_light(file, shape, channel=self.channel, encoding=self.encoding, orientation=orientation)
            for name, file in (("ambient", self.ambient), ("vignetting", self.vignetting))
            if isinstance(file, Path)
        }
        numbers = {name: getattr(self, name) for name in Preparation.__dataclass_fields__}
        return Preparation(**(numbers | files))

    def of(self, prepared: PreparedPhoto, light: Light) -> tuple[Array, Array, dict[str, Any]]:
        """The image to solve, the photo itself on the same scale, and what was done, for the report.

        The second is less ambient light and without vignetting, but neither clipped nor filled nor filtered; where E is
        1, what is brighter is 1.

        Raises
        ------
        InputError
            When there is no shading, or the light is no parallel one and a normalisation is asked for.
        """
        image, mask = prepared.light, prepared.mask
        if mask.sum() > 1 and np.ptp(image[mask]) == 0:
            raise InputError(
                "the brightness is the same everywhere after --clip-highlights and --mean-filter (and --ambient and "
                "--highlights): there is no shading left to reconstruct from. Clip or smooth less."
            )
        done = {"channel": self.channel, **prepared.report}
        done |= {name: str(file) for name, file in vars(self).items() if isinstance(file, Path)}
        if light.normalised:
            normalised = prepared.normalised(self.normalise or "linear", percentile=self.white_percentile)
            return normalised.image, normalised.unfiltered, {**done, **normalised.report}
        if self.normalise not in (None, "none") or self.white_percentile is not None:
            raise InputError(
                "only a parallel light takes an image between 0 and 1: leave out --normalise and --white-percentile."
            )
        return image, prepared.unfiltered, {**done, "normalise": "none"}


@dataclass(frozen=True)
class PhotoSolution:
    """A reconstructed photo.

    Attributes
    ----------
    solution : Solution
    photo : Photo
    prepared : PreparedPhoto
        With the maps of saturated pixels, highlights and others.
    unfiltered : ndarray of float64, shape (height, width)
        The photo itself, on the scale of the prepared image.
    report : mapping
        What the report says beside what it says of the solution.
    """

    solution: Solution
    photo: Photo
    prepared: PreparedPhoto
    unfiltered: Array
    report: Mapping[str, Any]

    @cached_property
    def prepared_errors(self) -> Errors:
        """Difference between the re-rendered image and the one that was solved, in grey levels, 0 to 255."""
        return self.solution.grey_errors()

    @cached_property
    def photo_errors(self) -> Errors:
        """Difference between the re-rendered image and the photo itself, in grey levels, 0 to 255."""
        # What a camera's white is for E: a highlight may be far brighter than anything that is matt.
        return self.solution.grey_errors(np.minimum(self.unfiltered, self.solution.white))

    def save(self, folder: Path, *, pictures: bool = True) -> list[Path]:
        """Write all results to a folder, or none.

        Parameters
        ----------
        folder : Path
        pictures : bool
            False leaves them out; depth, mesh and report remain.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        InputError
            When a file cannot be written.
        """
        grey = self.photo_errors
        untouched = {"ambient": 0.0, "vignetting": "none"}.items() <= self.report["photo"].items()
        itself = "the photo itself" if untouched else "the photo itself, less ambient light and vignetting"
        levels = {
            "compared_with": f"{itself}, neither clipped nor filtered, with the white of the prepared image",
            "mean_error": grey.mean,
            "root_mean_square": grey.root_mean_square,
        }
        report = {**self.report, "grey_levels_photo": levels}
        doubts = {
            "darker than the ambient light": self.prepared.below_ambient,
            "highlight, left out": self.prepared.masked,
            "highlight, filled": self.prepared.filled,
            "saturated": self.prepared.saturated,
            "clipped": self.prepared.clipped,
        }
        keywords: dict[str, Any] = {"colour": self.photo.colour, "report": report, "doubts": doubts}
        if pictures:
            return self.solution.save(folder, **keywords, folder=True)
        with filling(folder) as temporary:
            for name in _WITHOUT_PICTURES:
                self.solution.save(temporary / name, **keywords)
        return [folder / name for name in _WITHOUT_PICTURES]


def solve_photo(
    path: Path,
    camera: CameraOptions,
    brightness: Brightness,
    *,
    mask: Path | None = None,
    walls: Path | None = None,
    known_depth: Path | None = None,
    albedo: Path | None = None,
    **keywords: Any,
) -> PhotoSolution:
    """Read one photo and reconstruct it.

    Parameters
    ----------
    path : Path
        The photo. Its transparent pixels are not solved.
    camera : CameraOptions
    brightness : Brightness
    mask, walls, known_depth, albedo : Path, optional
        Files of the photo's size.
    **keywords
        As for :func:`persfs_cl.reconstruct`.

    Raises
    ------
    PersfsError
        Naming the file that cannot be used.
    """
    photo = read_photo(path, channel=brightness.channel, encoding=brightness.encoding, keep_nan=True)
    shape = (photo.image.shape[0], photo.image.shape[1])
    opaque = np.ones(shape, bool) if photo.mask is None else photo.mask
    turned = photo.orientation
    inside = np.ones(shape, bool) if mask is None else read_mask(mask, shape, orientation=turned)
    barriers = np.zeros(shape, bool) if walls is None else read_mask(walls, shape, orientation=turned)
    depths = None if known_depth is None else read_depth(known_depth, shape, orientation=turned)
    shares = None
    if albedo is not None:
        shares = read_light(albedo, shape, channel=photo.channel, encoding=brightness.encoding, orientation=turned)
    preparation = brightness.preparation(shape, orientation=turned)
    pinhole, source = camera.camera_and_source(path, shape)
    wanted = opaque & inside
    light = keywords.get("light", ParallelLight())
    assumed = depths is None and light.flat_rim
    known = rim(wanted) if assumed else np.zeros(shape, bool) if depths is None else np.isfinite(depths)
    if not (wanted & ~barriers).any():
        why = _why_empty({"transparent": ~opaque, f"outside {mask}": ~inside, f"in {walls}": barriers})
        raise InputError(f"{path}: {why}")
    solvable = wanted
    try:
        _require_shading(photo, wanted & ~barriers)
        prepared = prepare_photo(photo, pinhole, preparation, mask=wanted & ~barriers)
        if walls is not None:
            lit = wanted & np.isfinite(photo.image)
            # Their light tells which side walls belong to: corrected like all other, but not mixed with it.
            alone = replace(preparation, highlights="keep", clip_highlights=None, mean_filter=1)
            of_walls = prepare_photo(photo, pinhole, alone, mask=lit).light
            prepared = replace(
                prepared,
                light=np.where(barriers & lit, of_walls, prepared.light),
                unfiltered=np.where(barriers & lit, of_walls, prepared.unfiltered),
            )
        image, unfiltered, done = brightness.of(prepared, light)
        if prepared.masked.any():
            solvable = wanted & ~prepared.masked
            if assumed:
                # The edge of a hole is no edge of the object.
                depths = np.where(known, 1.0, np.nan)
                material = keywords.get("reflectance", Lambertian())
                seen = image if shares is None else image / shares
                warn_of_steep_outline(seen, solvable & ~barriers, wanted, light, material)
        solution = reconstruct(
            image,
            pinhole,
            mask=solvable,
            walls=None if walls is None else barriers,
            known_depth=depths,
            albedo=shares,
            **keywords,
        )
    except (InputError, CameraError) as error:
        raise type(error)(f"{path}: {error}") from error
    files = {"path": path, "mask": mask, "walls": walls, "known_depth": known_depth, "albedo": albedo}
    report = {
        "photo": {
            **done,
            "encoding": photo.encoding,
            "bits": photo.bits,
            **{name: None if file is None else str(file) for name, file in files.items()},
        },
        "known": {
            "pixels": int(np.count_nonzero(known)),
            "assumed": "z = 1 on the edge of the image or mask" if assumed else None,
        },
        "camera": {"source": source, "horizontal_view": horizontal_view(pinhole, shape)},
        "requested": {**asdict(camera), "device": keywords.get("device")},
    }
    return PhotoSolution(solution, photo, prepared, unfiltered, report)


def _why_empty(left_out: Mapping[str, Mask]) -> str:
    counts = [f"{np.count_nonzero(pixels)} are {why}" for why, pixels in left_out.items() if pixels.any()]
    size = next(iter(left_out.values())).size
    return f"no pixel is left to solve: of {size}, {', '.join(counts)}. Leave out fewer."


def _require_shading(photo: Photo, mask: Mask) -> None:
    """Refuse a photo by its own values, before they are normalised."""
    values = photo.image[mask]
    if bad := int(np.count_nonzero(np.isnan(values))):
        raise InputError(f"{bad} NaN pixels are among those to solve: leave them out with --mask.")
    darkest, brightest = float(values.min()), float(values.max())
    if brightest <= 0:
        raise InputError("every pixel to solve is black: there is no shading to reconstruct from.")
    if darkest == brightest and values.size > 1:
        coded = f" ({255 * float(encode_srgb(darkest)):.4g} of 255 in sRGB)" if photo.encoding == "srgb" else ""
        raise InputError(
            f"the photo is constant, {darkest:.4g} in linear light{coded} at each of {values.size} pixels to solve: "
            "there is no shading to reconstruct from."
        )
