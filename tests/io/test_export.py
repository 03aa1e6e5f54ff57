"""Depth maps and grey images written, and read again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import tifffile
from PIL import Image
from samples import SHAPE

from persfs_cl.colour import encode_srgb
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_depth, write_grey
from persfs_cl.io.maps import read_depth
from persfs_cl.io.photos import read_photo


@pytest.mark.parametrize("name", ["a.npy", "a.tif", "a.TIFF"])
def test_a_depth_comes_back_as_it_was_written(tmp_path: Path, name: str) -> None:
    depth = np.random.default_rng(0).random(SHAPE) + 0.1
    depth[2, 3] = np.nan
    write_depth(tmp_path / name, depth)
    expected = depth if name == "a.npy" else depth.astype(np.float32).astype(np.float64)
    again = read_depth(tmp_path / name, SHAPE)
    assert again.dtype == np.float64
    np.testing.assert_array_equal(again, expected)
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (3, 4), (7, 3)])
def test_small_depths_keep_their_axes(tmp_path: Path, shape: tuple[int, int]) -> None:
    for name in ("a.npy", "a.tiff"):
        write_depth(tmp_path / name, np.ones(shape))
        assert read_depth(tmp_path / name).shape == shape


def test_the_depth_tiff_is_plain_float32(tmp_path: Path) -> None:
    write_depth(tmp_path / "a.tiff", np.ones(SHAPE))
    stored = tifffile.imread(tmp_path / "a.tiff")
    assert stored.dtype == np.float32
    assert stored.shape == SHAPE


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("encoding", ["srgb", "linear"])
def test_a_grey_image_comes_back_within_half_a_level(
    tmp_path: Path, name: str, bits: Literal[8, 16], encoding: Literal["srgb", "linear"]
) -> None:
    image = np.linspace(0, 1, 35).reshape(SHAPE)
    write_grey(tmp_path / name, image, bits, encoding=encoding)
    photo = read_photo(tmp_path / name, encoding=encoding)
    assert photo.bits == bits
    given, read = (encode_srgb(values) if encoding == "srgb" else values for values in (image, photo.image))
    np.testing.assert_allclose(read, given, atol=0.5001 / (2**bits - 1))
    assert (photo.image[0, 0], photo.image[-1, -1]) == (0, pytest.approx(1))
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_grey_image_is_cut_to_its_range_and_nan_is_black(tmp_path: Path) -> None:
    write_grey(tmp_path / "a.png", [[-1.0, np.nan, 0.5, 2.0, np.inf, -np.inf]], encoding="linear")
    np.testing.assert_array_equal(Image.open(tmp_path / "a.png"), [[0, 0, 128, 255, 255, 0]])


def test_writers_refuse_what_they_cannot_write(tmp_path: Path) -> None:
    wrong: Any = 12
    with pytest.raises(InputError, match=r"a\.png cannot hold a depth map: give a name that ends in \.npy"):
        write_depth(tmp_path / "a.png", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"The depth has shape \(7,\)"):
        write_depth(tmp_path / "a.npy", np.ones(7))
    with pytest.raises(InputError, match="The depth holds complex128"):
        write_depth(tmp_path / "a.npy", np.ones(SHAPE, complex))
    with pytest.raises(InputError, match=r"a\.jpg cannot hold a grey image: give a name that ends in \.png"):
        write_grey(tmp_path / "a.jpg", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"The image has shape \(7, 5, 3\)"):
        write_grey(tmp_path / "a.png", np.ones((*SHAPE, 3)))
    for write, name, what in ((write_grey, "a.png", "image"), (write_depth, "a.npy", "depth")):
        with pytest.raises(InputError, match=f"{what} is no array .*rows of equal length"):
            write(tmp_path / name, [[1.0], [1.0, 2.0]])
    with pytest.raises(InputError, match="bits=12 is impossible: give 8 or 16"):
        write_grey(tmp_path / "a.png", np.ones(SHAPE), wrong)
    with pytest.raises(InputError, match=r"encoding=12 is unknown: choose .srgb. or .linear."):
        write_grey(tmp_path / "a.png", np.ones(SHAPE), encoding=wrong)
    for write, name in ((write_depth, "a.npy"), (write_depth, "a.tif"), (write_grey, "a.png")):
        with pytest.raises(InputError, match=f"{name} cannot be written: No such file.*Create the folder first"):
            write(tmp_path / "missing" / name, np.ones(SHAPE))
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="needs a limit on the size of files")
@pytest.mark.parametrize("write", ["write_grey('a.png', x)", "write_grey('a.tif', x)", "write_depth('a.npy', x)"])
def test_a_file_that_does_not_fit_is_one_clear_error(write: str, tmp_path: Path) -> None:
    code = f"""
import resource, numpy as np
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_depth, write_grey
x = np.random.default_rng(0).random((100, 100))
resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))
try:
    {write}
except InputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    assert "cannot be written" in done.stdout
    assert "disk" in done.stdout
    assert "None" not in done.stdout
    assert not list(tmp_path.iterdir())
