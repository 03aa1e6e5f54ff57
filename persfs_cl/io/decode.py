"""Image files decoded: the samples as they stand in the file, upright."""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from persfs_cl.errors import InputError
from persfs_cl.io.files import opened, read_bytes
from persfs_cl.io.formats import FORMATS
from persfs_cl.io.formats.format import Format, Source
from persfs_cl.io.raster import Header, Raster
from persfs_cl.io.remarks import decoding

SUFFIXES = frozenset[str]().union(*(form.suffixes for form in FORMATS))
"""Of files that :func:`read_raster` reads, in small letters; it goes by what is in them, not by these."""


def read_header(path: Path, *, page: int | None = None, half_size: bool = False) -> Header:
    """What an image file says of its samples; refused for what :func:`read_raster` would refuse it so far.

    Only its beginning is read, or the directories of a TIFF file. So what is wrong behind these is not found, and an
    orientation that a PNG file has behind its pixels is not heeded.

    Parameters
    ----------
    path, page, half_size
        As for :func:`read_raster`.
    """
    with asked(path, page=page, half_size=half_size) as (form, source):
        return form.header(source)


def read_raster(path: Path, *, page: int | None = None, half_size: bool = False) -> Raster:
    """The samples of an image file.

    Parameters
    ----------
    path : Path
    page : int, optional
        Which of its pictures, from 1.
    half_size : bool
        Make one pixel of each four of a camera's sensor; other files are read as they are.

    Raises
    ------
    InputError
        When it is no image, or one of several of which none is chosen.
    """
    data = read_bytes(path)
    with decoding(path):
        source = Source(path, data, None, page, half_size)
        raster = _form(source).raster(source)
        samples = raster.samples
        if samples.ndim != 3 or samples.size == 0 or samples.shape[2] > 4:
            raise InputError(f"{path} holds an array of shape {samples.shape}: save one grey or RGB image.")
        return raster


def is_of_sensor(path: Path) -> bool:
    """Whether a file holds what a camera's sensor measured, which can be read in half the size."""
    with asked(path) as (form, _):
        return form.sensor


def require_sensor(path: Path) -> None:
    """Refuse a file that cannot be read in half the size."""
    if not is_of_sensor(path):
        raise InputError.about("half_size", True, f"is for camera raw files, and {path} is none: leave it out.")


@contextmanager
def asked(
    path: Path, failure: str = "is broken or not supported", *, page: int | None = None, half_size: bool = False
) -> Iterator[tuple[Format, Source]]:
    """A block that asks a file what it is, without reading all of it.

    Parameters
    ----------
    path : Path
    failure : str
        As for :func:`persfs_cl.io.remarks.decoding`.
    page, half_size
        As for :func:`read_raster`.

    Yields
    ------
    format : Format
    source : Source

    Raises
    ------
    InputError
        When its format is not read, or what is done in the block fails.
    """
    with (
        opened(path) as file,
        decoding(path, failure),
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
    ):
        source = Source(path, data, file, page, half_size)
        yield _form(source), source


def _form(source: Source) -> Format:
    form = next((form for form in FORMATS if form.claims(source)), None)
    if form is None:
        *names, last = (form.name for form in FORMATS)
        raise InputError(
            f"{source.path} is no image of a format that is read ({', '.join(names)} and {last}): convert it to one of "
            "these."
        )
    return form


def require_brightness(path: Path, raster: Raster, *, keep_nan: bool = False) -> None:
    """Refuse samples that are no brightness: negative, infinite, NaN unless it is kept, or of another type."""
    samples = raster.colours
    require_type(path, samples.dtype, raster.bits)
    if samples.dtype.kind == "f":
        bad = np.count_nonzero(np.isinf(samples) if keep_nan else ~np.isfinite(samples))
        if bad:
            raise InputError(f"{path} has {bad} NaN or infinite samples: replace them, and save it again.")
        negative = np.count_nonzero(samples < 0)
        if negative:
            raise InputError(
                f"{path} has {negative} negative samples, the lowest {np.nanmin(samples):g}: brightness cannot be "
                "negative. Cut them to 0, and save it again."
            )


def require_type(path: Path, dtype: np.dtype[Any], bits: int) -> None:
    """Refuse samples of a type that is not taken for brightness."""
    if dtype.kind != "f" and (dtype.kind not in "ub" or bits > 16):
        raise InputError(f"{path} holds samples of type {dtype}: save it as floats or unsigned 8 or 16 bits.")
