"""Which pixels of a photograph are the object, where it is bright before a dark background."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Mask
from persfs_cl.errors import InputError, UnavailableError
from persfs_cl.preparation.normalise import checked

_LEAST = 0.001
"""Share of the image that an object takes at least."""
_APART = 2.0
"""How many times as bright as the background the object is at least, by their medians."""


def silhouette(image: ArrayLike, *, mask: ArrayLike | None = None) -> Mask:
    """The largest bright piece of an image, with its holes (N. Otsu's threshold, 1979, by scikit-image).

    Dark pixels that the bright ones surround, such as shadows, belong to it.

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, not negative.
    mask : array_like of bool, shape (H, W), optional
        Pixels that may be the object; the others are not looked at.

    Returns
    -------
    ndarray of bool, shape (H, W)

    Raises
    ------
    InputError
        When nothing stands out from a dark background, or `image` or `mask` cannot be used.
    UnavailableError
        When scikit-image is not installed.
    """
    values, inside = checked(image, mask)
    try:
        from skimage.filters import threshold_otsu
        from skimage.measure import label
    except ImportError as error:
        raise UnavailableError(
            "The package scikit-image, which finds the object, is missing: pip install 'persfs-cl[filters]'."
        ) from error
    from scipy.ndimage import binary_fill_holes  # slow to import

    # Shading spans decades of light, and a threshold between linear values would cut it.
    light = np.sqrt(np.maximum(values, 0.0))
    least = float(threshold_otsu(light[inside])) if np.ptp(light[inside]) > 0.0 else np.inf
    bright = inside & (light > least)
    pieces = label(bright, connectivity=1)
    sizes = np.bincount(pieces.ravel())
    sizes[0] = 0
    found = inside & binary_fill_holes(pieces == sizes.argmax()) if sizes.size > 1 else np.zeros_like(inside)
    behind = inside & ~found
    told = found.mean() >= _LEAST and (
        not behind.any() or np.median(values[found]) > _APART * np.median(values[behind])
    )
    if not told:
        raise InputError(
            "no object stands out from a dark background: give a mask of your own, or leave it out.",
            argument="mask",
            value="auto",
        )
    return np.asarray(found)


def eroded(mask: Mask, pixels: int) -> Mask:
    """A mask less what lies within so many pixels of its outline; the edge of the image is none."""
    if pixels == 0 or mask.all():
        return mask
    from scipy.ndimage import distance_transform_edt  # slow to import

    return np.asarray(distance_transform_edt(mask) > pixels)
