"""NumPy files."""

from __future__ import annotations

import io
import math
import os
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.decode import Header
from persfs_cl.io.files import opened, read_bytes
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.remarks import decoding


def read_npy(path: Path) -> NDArray[Any]:
    """The array in a NumPy file; InputError when it is none, or one of Python objects."""
    data = read_bytes(path)
    with decoding(path):
        file = io.BytesIO(data)
        _npy_form(path, file, len(data))
        file.seek(0)
        return np.lib.format.read_array(file, allow_pickle=False)


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays in an archive of NumPy files, by their names; refused as by :func:`read_npy`."""
    data = read_bytes(path)
    with decoding(path), zipfile.ZipFile(io.BytesIO(data)) as archive:
        found = {}
        for entry in archive.infolist():
            if entry.file_size > len(data):
                raise InputError(f"{path} promises more bytes than it has: it was not written by this package.")
            held = io.BytesIO(archive.read(entry))
            _npy_form(path, held, entry.file_size)
            held.seek(0)
            found[entry.filename.removesuffix(".npy")] = np.lib.format.read_array(held, allow_pickle=False)
        return found


def read_npy_header(path: Path) -> Header:
    """What a NumPy file says of its array; refused as by :func:`read_npy`."""
    with opened(path) as file, decoding(path):
        shape, dtype = _npy_form(path, file, os.fstat(file.fileno()).st_size)
        return Header(shape, 8 * dtype.itemsize, dtype)


def _npy_form(path: Path, file: BinaryIO, length: int) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    # Versions 2 and 3 differ in the letters of field names only.
    read_form = np.lib.format.read_array_header_1_0 if version[0] == 1 else np.lib.format.read_array_header_2_0
    shape, _, dtype = read_form(file)
    if dtype.hasobject:
        raise InputError(f"{path} holds Python objects, which are not read: save an array of numbers.")
    promised, held = math.prod(shape) * dtype.itemsize, length - file.tell()
    if promised > held or min(shape, default=0) < 0:
        raise InputError(
            f"{path} is broken: its header promises shape {shape} of {dtype}, {promised} bytes, and {held} follow. "
            "Save or copy it again."
        )
    require_pixels(path, shape)
    return shape, dtype
