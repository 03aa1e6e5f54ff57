"""From a photo's file to its surface, and to a folder of results, as the command line asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.cli.options import CameraOptions
from persfs_cl.cli.output import filling
from persfs_cl.errors import CameraError, InputError
from persfs_cl.grey import clip_highlights, mean_filter, normalise_grey, normalise_linear
from persfs_cl.images import Channel, Encoding, Photo, read_depth, read_mask, read_photo
from persfs_cl.solution import Solution
from persfs_cl.solver import reconstruct

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

    def of(self, photo: Photo, mask: NDArray[np.bool_]) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """E of a photo, and what was done to it, for the report.

        Parameters
        ----------
        photo : Photo
        mask : ndarray of bool, shape (height, width)
            Pixels that count.

        Raises
        ------
        InputError
            When the brightness cannot be used.
        """
        image = photo.image
        clipped = 0
        # First, because the filter would spread a highlight over its neighbours.
        if self.clip_highlights is not None:
            image, highlights = clip_highlights(image, mask=mask, percentile=self.clip_highlights)
            clipped = int(np.count_nonzero(highlights))
        if self.mean_filter > 1:
            image = mean_filter(image, self.mean_filter, mask)
        if self.normalise == "linear":
            image = normalise_linear(image, mask=mask)
        elif self.normalise == "grey":
            image = normalise_grey(image, mask)
        return image, {
            **asdict(self),
            "encoding": photo.encoding,
            "bits": photo.bits,
            "clipped_pixels": clipped,
            "white_pixels": int(np.count_nonzero(image[mask] >= 1.0)),
        }


@dataclass(frozen=True)
class PhotoSolution:
    """A reconstructed photo.

    Attributes
    ----------
    solution : Solution
    photo : Photo
    report : mapping
        What the report says of the photo beside what it says of the solution.
    """

    solution: Solution
    photo: Photo
    report: Mapping[str, Any]

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
        with filling(folder) as temporary:
            files = self.solution.save(temporary, colour=self.photo.colour, report={"photo": self.report})
        return [folder / file.name for file in files]


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
    photo = read_photo(path, channel=brightness.channel, encoding=brightness.encoding)
    shape = (photo.image.shape[0], photo.image.shape[1])
    wanted = np.ones(shape, bool) if photo.mask is None else photo.mask
    if mask is not None:
        wanted = wanted & read_mask(mask, shape)
    barriers = np.zeros(shape, bool) if walls is None else read_mask(walls, shape)
    depths = None if known_depth is None else read_depth(known_depth, shape)
    pinhole = camera.camera(path, shape)
    try:
        image, report = brightness.of(photo, wanted & ~barriers)
        solution = reconstruct(image, pinhole, mask=wanted, walls=barriers, known_depth=depths, **keywords)
    except (InputError, CameraError) as error:
        raise type(error)(f"{path}: {error}") from error
    files = {"path": path, "mask": mask, "walls": walls, "known_depth": known_depth}
    report |= {name: None if file is None else str(file) for name, file in files.items()}
    return PhotoSolution(solution, photo, report)
