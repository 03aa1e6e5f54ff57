"""From a photo's file to its surface, and to a folder of results, as the command line asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.cli.options import CameraOptions
from persfs_cl.domain import rim
from persfs_cl.errors import CameraError, InputError
from persfs_cl.grey import (
    brightest_diffuse,
    clip_highlights,
    encode_srgb,
    mean_filter,
    normalise_grey,
    normalise_linear,
)
from persfs_cl.images import Channel, Encoding, Photo, read_depth, read_mask, read_photo
from persfs_cl.metrics import Errors
from persfs_cl.solution import Solution
from persfs_cl.solver import reconstruct

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Normalise = Literal["linear", "grey", "none"]


@dataclass(frozen=True)
class Brightness:
    """How a photo becomes E.

    Attributes
    ----------
    channel, encoding
        As for :func:`persfs_cl.images.read_photo`.
    clip_highlights : float or None
        Percentile above which brightness is cut.
    mean_filter : int
        Side of the window in pixels; 1 is no filter.
    normalise : {"linear", "grey", "none"}
        Divide by the brightest value, stretch by eq. (2), or leave as it is.
    """

    channel: Channel = "luminance"
    encoding: Encoding = "auto"
    clip_highlights: float | None = None
    mean_filter: int = 1
    normalise: Normalise = "linear"

    def of(self, photo: Photo, mask: Mask) -> tuple[Array, Array, dict[str, Any]]:
        """E of a photo, the photo itself on the scale of E, and what was done to it, for the report.

        The second is neither clipped nor filtered; what is brighter than the white of E is white.

        Parameters
        ----------
        photo : Photo
        mask : ndarray of bool, shape (height, width)
            Pixels that count, at least one.

        Raises
        ------
        InputError
            When the brightness cannot be used.
        """
        _require_shading(photo, mask)
        image = photo.image
        clipped = 0
        # First, because the filter would spread a highlight over its neighbours.
        if self.clip_highlights is not None:
            image, highlights = clip_highlights(image, mask=mask, percentile=self.clip_highlights)
            clipped = int(np.count_nonzero(highlights))
        if self.mean_filter > 1:
            image = mean_filter(image, self.mean_filter, mask)
        if mask.sum() > 1 and np.ptp(image[mask]) == 0:
            raise InputError(
                "the brightness is the same everywhere after --clip-highlights and --mean-filter: there is no shading "
                "left to reconstruct from. Clip or smooth less."
            )
        black, white = 0.0, 1.0
        if self.normalise == "linear":
            white = brightest_diffuse(image, mask=mask)
            image = normalise_linear(image, mask=mask, brightest=white)
        elif self.normalise == "grey":
            black, white = float(image[mask].min()), float(image[mask].max())
            image = normalise_grey(image, mask)
        unfiltered = np.clip((photo.image - black) / (white - black), 0.0, 1.0)
        return (
            image,
            unfiltered,
            {
                **asdict(self),
                "encoding": photo.encoding,
                "bits": photo.bits,
                "clipped_pixels": clipped,
                "white_pixels": int(np.count_nonzero(image[mask] >= 1.0)),
            },
        )


@dataclass(frozen=True)
class PhotoSolution:
    """A reconstructed photo.

    Attributes
    ----------
    solution : Solution
    photo : Photo
    unfiltered : ndarray of float64, shape (height, width)
        The photo itself, on the scale of the prepared image E.
    report : mapping
        What the report says beside what it says of the solution.
    """

    solution: Solution
    photo: Photo
    unfiltered: Array
    report: Mapping[str, Any]

    def photo_errors(self) -> Errors:
        """Difference between the re-rendered image and the photo itself, in grey levels, 0 to 255."""
        return self.solution.grey_errors(self.unfiltered)

    def save(self, folder: Path) -> list[Path]:
        """Write all results to a folder, or none.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        InputError
            When a file cannot be written.
        """
        grey = self.photo_errors()
        levels = {
            "compared_with": "the photo itself, neither clipped nor filtered, where E is 1 as white",
            "mean_error": grey.mean,
            "root_mean_square": grey.root_mean_square,
        }
        report = {**self.report, "grey_levels_photo": levels}
        return self.solution.save(folder, colour=self.photo.colour, report=report, folder=True)


def solve_photo(
    path: Path,
    camera: CameraOptions,
    brightness: Brightness,
    *,
    mask: Path | None = None,
    walls: Path | None = None,
    known_depth: Path | None = None,
    **keywords: Any,
) -> PhotoSolution:
    """Read one photo and reconstruct it.

    Parameters
    ----------
    path : Path
        The photo. Its transparent pixels are not solved.
    camera : CameraOptions
    brightness : Brightness
    mask, walls, known_depth : Path, optional
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
    inside = np.ones(shape, bool) if mask is None else read_mask(mask, shape)
    barriers = np.zeros(shape, bool) if walls is None else read_mask(walls, shape)
    depths = None if known_depth is None else read_depth(known_depth, shape)
    pinhole = camera.camera(path, shape)
    wanted = opaque & inside
    known = rim(wanted) if depths is None else np.isfinite(depths)
    if not (wanted & ~barriers).any():
        why = _why_empty({"transparent": ~opaque, f"outside {mask}": ~inside, f"in {walls}": barriers})
        raise InputError(f"{path}: {why}")
    try:
        image, unfiltered, prepared = brightness.of(photo, wanted & ~barriers)
        solution = reconstruct(image, pinhole, mask=wanted, walls=barriers, known_depth=depths, **keywords)
    except (InputError, CameraError) as error:
        raise type(error)(f"{path}: {error}") from error
    files = {"path": path, "mask": mask, "walls": walls, "known_depth": known_depth}
    report = {
        "photo": prepared | {name: None if file is None else str(file) for name, file in files.items()},
        "known": {
            "pixels": int(np.count_nonzero(known & ~barriers)),
            "assumed": "z = 1 on the edge of the image or mask" if depths is None else None,
        },
        "requested": {**asdict(camera), "device": keywords.get("device")},
    }
    return PhotoSolution(solution, photo, unfiltered, report)


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
