"""From a photo's linear light to the E that is reconstructed, as the command line asks."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from persfs_cl.grey import clip_highlights, mean_filter, normalise_grey, normalise_linear
from persfs_cl.images import Channel, Encoding, Photo

Normalise = Literal["linear", "grey", "none"]


@dataclass(frozen=True)
class Brightness:
    """The photo-to-E options.

    Attributes
    ----------
    channel, encoding
        As for :func:`persfs_cl.images.read_photo`.
    clip_highlights : float or None
        Percentile above which brightness is cut.
    mean_filter : int
        Side of the window in pixels; 1 is no filter.
    normalise : {"linear", "grey", "none"}
        Divide by the brightest diffuse value, stretch by eq. (2), or leave as it is.
    """

    channel: Channel = "luminance"
    encoding: Encoding = "auto"
    clip_highlights: float | None = None
    mean_filter: int = 1
    normalise: Normalise = "linear"

    def of(self, photo: Photo, mask: NDArray[np.bool_]) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """E of a photo, and what was done, for the report.

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
            "path": str(photo.path),
            "bits": photo.bits,
            **asdict(self),
            "encoding": photo.encoding,
            "clipped_pixels": clipped,
            "white_pixels": int(np.count_nonzero(image[mask] >= 1.0)),
        }
