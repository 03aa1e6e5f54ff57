"""ICC profiles of image files: curves and primaries, as a colour space."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.checks import warn
from persfs_cl.colour import LUMINANCE, ColourSpace, decode_srgb, profile_light, profile_xyz, three
from persfs_cl.wording import keyword

_SAME_LIGHT, _SAME_PRIMARIES = 2e-4, 2e-3
"""Differences within which profiles of the same space lie, which programs round in their own ways."""


def profile_space(path: Path, profile: bytes, channels: int) -> ColourSpace | None:
    """The colour space that an ICC profile describes.

    Parameters
    ----------
    path : Path
        Named in warnings.
    profile : bytes
    channels : int
        Colours of the image, 1 or 3. A grey image may have a profile of RGB, as programs write it.

    Returns
    -------
    ColourSpace or None
        With sRGB's own curve where the profile's is the same; None where the profile cannot be used.

    Warns
    -----
    UserWarning
        When the profile cannot be used, and why.
    """
    try:
        space = space_of(profile, channels)
    except Exception as error:  # noqa: BLE001  whatever LittleCMS raises at broken data
        space = f"is broken ({error})" if str(error) else "is broken"
    if isinstance(space, ColourSpace):
        return space
    warn(
        f"The colour profile of {path} {space}, and is not used: its numbers are taken as if it had none. Give "
        f"{keyword('encoding')}, or save it in sRGB."
    )
    return None


@lru_cache(maxsize=32)
def space_of(profile: bytes, channels: int) -> ColourSpace | str:
    """The space of a profile for images of 1 or 3 colours, or why there is none."""
    from PIL import ImageCms

    told = ImageCms.ImageCmsProfile(io.BytesIO(profile)).profile
    kind = str(told.xcolor_space).strip()
    if kind not in ("RGB", "GRAY") or (kind == "GRAY" and channels != 1):
        return f"is for {kind}, and not for {'a grey' if channels == 1 else 'an RGB'} image"
    if kind == "RGB" and not told.is_matrix_shaper:
        return "is a table of colours instead of curves and primaries"
    name = " ".join((told.profile_description or "").split()) or "a profile without a name"
    ramp = np.linspace(0.0, 1.0, 257)
    curves = np.stack([profile_light(profile, ramp, channel) for channel in range(3 if kind == "RGB" else 1)])
    if not (np.isfinite(curves).all() and (np.diff(curves) >= 0).all() and abs(curves[:, 0]).max() < 0.5):
        return "has curves that fall or are no numbers"
    space = ColourSpace("profile", name, profile=profile)
    for curve, light in (("srgb", decode_srgb(ramp)), ("linear", ramp)):
        if abs(curves - light).max() < _SAME_LIGHT:
            space = ColourSpace(curve, name)  # type: ignore[arg-type]
    if kind == "GRAY":
        return space
    matrix = np.linalg.solve(_primaries(_srgb_profile()), _primaries(profile))
    shares = np.maximum(LUMINANCE @ matrix, 0.0)
    if not (np.isfinite(matrix).all() and shares.sum() > 0):
        return "has primaries that are no colours"
    if abs(matrix - np.eye(3)).max() < _SAME_PRIMARIES:
        return space
    shares /= shares.sum()
    return replace(space, luminance=three(shares), to_srgb=(three(matrix[0]), three(matrix[1]), three(matrix[2])))


def _primaries(profile: bytes) -> Array:
    """X, Y and Z, in rows, of red, green and blue."""
    return profile_xyz(profile, np.eye(3)).T


@lru_cache(maxsize=1)
def _srgb_profile() -> bytes:
    import imagecodecs

    return bytes(imagecodecs.cms_profile("srgb"))
