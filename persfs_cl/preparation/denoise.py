"""Noise taken out of a photograph without smoothing across its edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import as_number
from persfs_cl.errors import UnavailableError
from persfs_cl.preparation.normalise import checked
from persfs_cl.quantiles import median

MOST_DENOISING = 5.0
"""Multiples of the noise beyond which nothing but edges is left."""
_PATCH, _DISTANCE = 5, 6
"""Pixels: side of the patches that are compared, and how far apart they may be."""
_TO_SIGMA = 1.4826
"""From the median of absolute values of a normal distribution to its standard deviation."""


def denoise(image: ArrayLike, strength: float, *, mask: ArrayLike | None = None) -> Array:
    """Means over places that look alike (A. Buades, B. Coll, J.-M. Morel, 2005, by scikit-image).

    Parameters
    ----------
    image : array_like, shape (H, W)
        Linear light, on any scale.
    strength : float
        From 0, which changes nothing, to 5: how different places may be, in units of the noise, which is found from the
        image. 0.8 is usual.
    mask : array_like of bool, shape (H, W), optional
        Pixels to use. Those outside are returned as they came.

    Returns
    -------
    ndarray of float64, shape (H, W)

    Raises
    ------
    InputError
        When `strength` is impossible, or `image` or `mask` cannot be used.
    UnavailableError
        When scikit-image is not installed.
    """
    values, inside = checked(image, mask)
    strength = as_number("strength", strength, least=0.0, most=MOST_DENOISING, what="a strength", hint=", such as 0.8")
    if strength == 0.0:
        return values.copy()
    try:
        from skimage.restoration import denoise_nl_means
    except ImportError as error:
        raise UnavailableError(
            "The package scikit-image, which takes out noise, is missing: pip install 'persfs-cl[filters]'."
        ) from error
    noise = noise_of(np.where(inside, values, 0.0), inside)
    if noise == 0.0:
        return values.copy()
    found = denoise_nl_means(
        _continued(values, inside),
        patch_size=_PATCH,
        patch_distance=_DISTANCE,
        h=strength * noise,
        sigma=noise,
        fast_mode=True,
    )
    # Means over differences of sums may fall below 0 by rounding.
    return np.where(inside, np.maximum(found, min(0.0, float(values[inside].min()))), values)


def noise_of(image: Array, there: Mask) -> float:
    """Standard deviation of the noise of an image, by what no smooth image has: second differences of second ones.

    The median of their absolute values counts, so that edges and outliers play no part (J. Immerkær, 1996).
    """
    if min(image.shape) < 3:
        return 0.0
    rows = image[:-2] - 2.0 * image[1:-1] + image[2:]
    both = rows[:, :-2] - 2.0 * rows[:, 1:-1] + rows[:, 2:]
    if there.all():
        inside = both
    else:
        held = there[:-2] & there[1:-1] & there[2:]
        inside = both[held[:, :-2] & held[:, 1:-1] & held[:, 2:]]
    # The squares of the nine weights add up to 36.
    return _TO_SIGMA / 6.0 * median(np.abs(inside)) if inside.size else 0.0


def _continued(values: Array, inside: Mask) -> Array:
    """An image with the nearest of its pixels around it."""
    from scipy.ndimage import distance_transform_edt  # slow to import

    if inside.all():
        return values
    nearest = distance_transform_edt(~inside, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])
