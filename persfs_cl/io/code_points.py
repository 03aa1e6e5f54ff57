"""Code points of colours (ITU-T H.273), which HEIC and AVIF files may have in place of a profile."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from persfs_cl.checks import warn
from persfs_cl.colour import ColourSpace, Curve, three
from persfs_cl.io.profiles import space_of
from persfs_cl.wording import keyword

_CURVES: dict[int, tuple[Curve, str, float]] = {
    # Decoders take the curve of video for that of screens, as whoever wrote the file has seen it.
    **dict.fromkeys((1, 2, 6, 13, 14, 15), ("srgb", "", 1.0)),
    8: ("linear", "linear", 1.0),
    16: ("pq", "PQ", 10_000.0 / 203.0),
    18: ("hlg", "HLG", 1.0 / 0.265),
}
"""By the code of the transfer: the curve, its name, and what makes its paper white the white of a screen."""
_WHITE = (0.3127, 0.3290, 1.0)
_PRIMARIES: dict[int, tuple[str, tuple[float, ...]]] = {
    9: ("BT.2020", (0.708, 0.292, 1.0, 0.170, 0.797, 1.0, 0.131, 0.046, 1.0)),
    12: ("Display P3", (0.680, 0.320, 1.0, 0.265, 0.690, 1.0, 0.150, 0.060, 1.0)),
}
"""By their code: a name, and x, y and 1 of red, green and blue."""
_LIKE_SRGB = 1, 2, 4, 5, 6, 7, 22
"""sRGB's own, those that are not told, and those of older television, which differ little."""
_BOX = b"colrnclx"


@dataclass(frozen=True)
class CodePoints:
    """What a file says of its numbers by codes.

    Attributes
    ----------
    primaries, transfer : int
        Of the colours, and of the curve.
    """

    primaries: int
    transfer: int


def code_points_in(data: bytes) -> CodePoints | None:
    """Those of the first picture of a file in boxes, whose beginning this is; None where it has none."""
    place = data.find(_BOX)
    begin = place + len(_BOX)
    return None if place < 0 or len(data) < begin + 4 else CodePoints(*struct.unpack_from(">HH", data, begin))


def coded_space(path: Path, codes: CodePoints) -> ColourSpace | None:
    """The colour space that the codes of a file tell.

    Parameters
    ----------
    path : Path
        Named in warnings.
    codes : CodePoints

    Returns
    -------
    ColourSpace or None
        None where the file has the codes of sRGB, or such as are not known.

    Warns
    -----
    UserWarning
        When the curve, or the primaries, are not known.
    """
    if codes.transfer not in _CURVES:
        warn(
            f"{path} says that its numbers follow the curve {codes.transfer} of ITU-T H.273, which is not known here, "
            f"and they are taken for sRGB: save it in sRGB, or give {keyword('encoding')}."
        )
        return None
    curve, name, white = _CURVES[codes.transfer]
    if codes.primaries not in {*_PRIMARIES, *_LIKE_SRGB}:
        warn(
            f"{path} says that its colours have the primaries {codes.primaries} of ITU-T H.273, which are not known "
            "here, and they are taken for those of sRGB: save it in sRGB."
        )
    where, primaries = _PRIMARIES.get(codes.primaries, ("", ()))
    if curve == "srgb" and not primaries:
        return None
    space = ColourSpace(curve) if not primaries else _with(primaries)
    to_srgb = white * (np.eye(3) if space.to_srgb is None else np.array(space.to_srgb))
    rows = three(to_srgb[0]), three(to_srgb[1]), three(to_srgb[2])
    return replace(space, curve=curve, name=" ".join(filter(None, (where, name))), to_srgb=rows)


def _with(primaries: tuple[float, ...]) -> ColourSpace:
    import imagecodecs

    space = space_of(bytes(imagecodecs.cms_profile("rgb", whitepoint=_WHITE, primaries=primaries, gamma=1.0)), 3)
    assert isinstance(space, ColourSpace)  # noqa: S101  # a profile of our own
    return space
