"""DNG files of a known light, written without the code under test."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import tifffile
from numpy.typing import NDArray

BLACK, WHITE = 512, 15871
GAINS = np.array([0.5, 1.0, 0.6])
"""What the channels of the sensor make of white light."""
BAYER = np.array([[0, 1], [1, 2]])
X_TRANS = np.array(
    [
        [1, 1, 0, 1, 1, 2],
        [1, 1, 2, 1, 1, 0],
        [2, 0, 1, 0, 2, 1],
        [1, 1, 2, 1, 1, 0],
        [1, 1, 0, 1, 1, 2],
        [0, 2, 1, 2, 0, 1],
    ]
)
"""Fujifilm's pattern of colours."""
_XYZ_BY_SRGB = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def smooth_light(shape: tuple[int, int]) -> NDArray[np.float64]:
    """A bright hill, 0.2 to 0.9."""
    row, column = np.mgrid[: shape[0], : shape[1]] / max(shape)
    return np.asarray(0.2 + 0.7 * np.exp(-((row - 0.3) ** 2 + (column - 0.5) ** 2) / 0.1))


def mosaic(
    light: NDArray[np.float64], *, black: float = BLACK, pattern: NDArray[np.int_] = BAYER
) -> NDArray[np.uint16]:
    """What a sensor with a pattern of colours counts: light of 1 saturates its green."""
    row, column = np.mgrid[: light.shape[0], : light.shape[1]]
    gain = GAINS[pattern[row % len(pattern), column % len(pattern)]]
    return np.asarray(np.rint(black + (WHITE - black) * np.minimum(light * gain, 1.0)), np.uint16)


Target = TypeVar("Target", Path, BytesIO)


def write_dng(
    path: Target,
    samples: Any,
    *,
    orientation: int = 1,
    black: int = BLACK,
    focal_length_35mm: int | None = None,
    pattern: NDArray[np.int_] = BAYER,
    **options: Any,
) -> Target:
    """Samples of a mosaic, (H, W), or of linear colours, (H, W, 3), or these as strips that are already encoded."""
    in_colours = np.ndim(samples) == 2
    matrix = np.diag(GAINS) @ np.linalg.inv(_XYZ_BY_SRGB)
    tags: list[tuple[int, Any, int, Any, bool]] = [
        (271, "s", 0, "Nobody", True),
        (272, "s", 0, "Camera", True),
        (274, "H", 1, orientation, True),
        (50706, "B", 4, (1, 4, 0, 0), True),
        (50707, "B", 4, (1, 1, 0, 0), True),
        (50708, "s", 0, "Nobody Camera", True),
        (50713, "H", 2, (1, 1), True),
        (50714, "H", 1, black, True),
        (50717, "H", 1, WHITE, True),
        (50721, "2i", 9, _fractions(matrix.ravel()), True),
        (50728, "2I", 3, _fractions(GAINS), True),
        (50778, "H", 1, 21, True),
    ]
    if focal_length_35mm is not None:
        tags.append((41989, "H", 1, focal_length_35mm, True))  # in the main directory, as DNG allows
    if in_colours:
        tags += [
            (33421, "H", 2, pattern.shape, True),
            (33422, "B", pattern.size, tuple(pattern.ravel().tolist()), True),
        ]
        tags += [(50710, "B", 3, (0, 1, 2), True), (50711, "H", 1, 1, True)]
    photometric: Any = "cfa" if in_colours else "linear_raw"
    tifffile.imwrite(path, samples, photometric=photometric, extratags=tags, metadata=None, **options)
    return path


def write_grey_dng(path: Path, samples: NDArray[np.uint16]) -> Path:
    """Samples of a sensor without colours, (H, W)."""
    tags: list[tuple[int, Any, int, Any, bool]] = [
        (271, "s", 0, "Nobody", True),
        (50706, "B", 4, (1, 4, 0, 0), True),
        (50707, "B", 4, (1, 1, 0, 0), True),
        (50708, "s", 0, "Nobody Monochrom", True),
        (50714, "H", 1, BLACK, True),
        (50717, "H", 1, WHITE, True),
    ]
    tifffile.imwrite(path, samples, photometric="minisblack", extratags=tags, metadata=None)
    with tifffile.TiffFile(path) as file:
        kind = file.pages.first.tags[262].valueoffset
    data = bytearray(path.read_bytes())
    struct.pack_into("<H", data, kind, 34892)  # LinearRaw, which tifffile writes of three colours alone
    path.write_bytes(data)
    return path


def _fractions(values: Iterable[float]) -> tuple[int, ...]:
    return tuple(number for value in values for number in (round(value * 10000), 10000))
