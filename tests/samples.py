"""Samples of any depth and number of channels, saved without the code under test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import tifffile
from numpy.typing import NDArray

from persfs_cl.colour import decode_srgb

Samples = NDArray[Any]
WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
SHAPE = (7, 5)


def random_samples(channels: int, bits: int, shape: tuple[int, int] = SHAPE) -> Samples:
    size = (*shape, channels) if channels > 1 else shape
    samples = np.random.default_rng(channels).integers(0, 2**bits, size, dtype=np.uint8 if bits == 8 else np.uint16)
    samples.flat[:2] = 0, 2**bits - 1
    return samples


def save(path: Path, samples: Samples) -> Path:
    """Write samples without loss, not through the code under test."""
    if path.suffix == ".png":
        path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(samples)))
    else:
        colour = samples.ndim == 3 and samples.shape[2] > 2
        extra = ["unassalpha"] if samples.ndim == 3 and samples.shape[2] in (2, 4) else None
        tifffile.imwrite(
            path,
            samples,
            photometric="rgb" if colour else "minisblack",
            planarconfig="contig" if samples.ndim == 3 else None,
            extrasamples=extra,
        )
    return path


def turned_upright(samples: Samples, orientation: int) -> Samples:
    """Where row 0 and column 0 of the file belong, as the EXIF standard words it."""
    upright: dict[int, Callable[[Samples], Samples]] = {
        2: np.fliplr,
        3: lambda a: np.rot90(a, 2),
        4: np.flipud,
        5: lambda a: a.swapaxes(0, 1),
        6: lambda a: np.rot90(a, -1),
        7: lambda a: np.rot90(a, 2).swapaxes(0, 1),
        8: np.rot90,
    }
    return upright[orientation](samples) if orientation in upright else samples


def light(samples: Samples, bits: int) -> NDArray[np.float64]:
    """The luminance of sRGB samples, as its definition says."""
    linear = decode_srgb(samples / (2**bits - 1))
    if samples.ndim == 2:
        return linear
    return linear[..., 0] if samples.shape[2] == 2 else np.asarray(linear[..., :3] @ WEIGHTS)
