"""Masks, depths and light beside a photograph: read as they were meant, or refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image
from samples import SHAPE, Samples, random_samples, save

from persfs_cl.errors import InputError
from persfs_cl.io.export import write_depth
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import read_image, read_photo


def test_light_is_read_from_images_and_arrays(tmp_path: Path) -> None:
    samples = random_samples(3, 8)
    picture = save(tmp_path / "a.png", samples)
    for options in ({}, {"channel": "green", "encoding": "linear"}):
        expected = read_image(picture, **options)  # type: ignore[arg-type]
        np.testing.assert_array_equal(read_light(picture, SHAPE, **options), expected)  # type: ignore[arg-type]
    stored = np.where(samples[..., 0] > 9, samples[..., 0] / 7, np.nan)
    np.save(tmp_path / "a.npy", stored)
    np.testing.assert_array_equal(read_light(tmp_path / "a.npy", SHAPE), stored)
    for name in ("a.png", "a.npy"):
        with pytest.raises(InputError, match=rf"{name} has shape \(7, 5\), but the image has \(5, 7\)"):
            read_light(tmp_path / name, (5, 7))
    np.save(tmp_path / "a.npy", np.ones(SHAPE, bool))
    with pytest.raises(InputError, match="holds bool, not numbers"):
        read_light(tmp_path / "a.npy", SHAPE)


@pytest.mark.parametrize("name", ["a.png", "a.npy", "a.tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_files_made_without_turning_the_photo_are_told_of(tmp_path: Path, name: str, orientation: int) -> None:
    read: dict[str, Callable[..., Any]] = {"a.png": read_mask, "a.npy": read_light, "a.tif": read_depth}
    on_a_side = orientation > 4

    def check(unturned: tuple[int, int], shape: tuple[int, int]) -> Any:
        samples = np.full(unturned, 255, np.uint8)
        if name == "a.npy":
            np.save(tmp_path / name, samples)
        else:
            save(tmp_path / name, samples)
        return read[name](tmp_path / name, shape, orientation=orientation)

    if on_a_side:
        reason = rf"fits the photo as it lies in its file.*EXIF orientation {orientation}: .*\(4, 6\).* Turn .*{name}"
        with pytest.raises(InputError, match=reason):
            check((6, 4), (4, 6))
        check((4, 6), (4, 6))
    with pytest.raises(InputError, match=r"has shape \(5, 4\), but the image has \(4, 6\)"):
        check((5, 4), (4, 6))
    if orientation == 1:
        check((5, 5), (5, 5))
        return
    for shape in [(5, 5)] if on_a_side else [(5, 5), (4, 6)]:
        with pytest.warns(
            UserWarning, match=rf"orientation {orientation}: .*nobody can tell whether .*{name} was made"
        ):
            check(shape, shape)


def test_a_mask_that_is_turned_as_its_photo_is_fits(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 3
    Image.fromarray(random_samples(1, 8)).save(tmp_path / "a.png", exif=exif)
    photo = read_photo(tmp_path / "a.png")
    assert photo.orientation == 3
    mask = read_mask(tmp_path / "a.png", SHAPE, orientation=photo.orientation)
    np.testing.assert_array_equal(mask, random_samples(1, 8)[::-1, ::-1] > 127)


def test_a_mask_is_true_above_half_of_the_range(tmp_path: Path) -> None:
    grey = np.array([[0, 127, 128, 255]], np.uint8)
    expected = [[False, False, True, True]]
    np.testing.assert_array_equal(read_mask(save(tmp_path / "8.png", grey), (1, 4)), expected)
    deep = np.array([[0, 32767, 32768, 65535]], np.uint16)
    np.testing.assert_array_equal(read_mask(save(tmp_path / "16.png", deep), (1, 4)), expected)
    real = np.array([[0.0, 0.5, 0.51, 1.0]], np.float32)
    np.testing.assert_array_equal(read_mask(save(tmp_path / "f.tif", real), (1, 4)), expected)
    blue = np.zeros((1, 4, 3), np.uint8)
    blue[..., 2] = grey
    np.testing.assert_array_equal(read_mask(save(tmp_path / "blue.png", blue), (1, 4)), expected)
    alpha = np.full((1, 4, 2), 255, np.uint8)
    alpha[..., 1] = grey
    np.testing.assert_array_equal(read_mask(save(tmp_path / "alpha.png", alpha), (1, 4)), expected)
    np.save(tmp_path / "a.npy", np.array(expected))
    np.testing.assert_array_equal(read_mask(tmp_path / "a.npy", (1, 4)), expected)


def test_a_black_mask_selects_nothing(tmp_path: Path) -> None:
    assert not read_mask(save(tmp_path / "a.png", np.zeros(SHAPE, np.uint8)), SHAPE).any()


def test_a_mask_of_zeros_and_ones_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.eye(5, dtype=np.uint8))
    with pytest.raises(InputError, match=r"selects no pixel: its brightest sample is 1 of 255\. Paint white"):
        read_mask(path, (5, 5))


def test_a_mask_of_another_shape_or_type_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", random_samples(1, 8))
    with pytest.raises(InputError, match=r"a\.png has shape \(7, 5\), but the image has \(5, 7\)"):
        read_mask(path, (5, 7))
    np.save(tmp_path / "a.npy", np.ones(SHAPE))
    with pytest.raises(InputError, match=r"a\.npy holds float64, not bool: save it as mask\.astype\(bool\)"):
        read_mask(tmp_path / "a.npy", SHAPE)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.uint32, np.int64])
def test_zero_is_unknown_in_a_depth_of_integers(tmp_path: Path, dtype: type) -> None:
    depth: Samples = np.array([[0, 1, 100]], dtype)
    np.save(tmp_path / "a.npy", depth)
    np.testing.assert_array_equal(read_depth(tmp_path / "a.npy"), [[np.nan, 1, 100]])
    if dtype is not np.int64:
        tifffile.imwrite(tmp_path / "a.tif", depth, photometric="minisblack")
        np.testing.assert_array_equal(read_depth(tmp_path / "a.tif"), [[np.nan, 1, 100]])


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (np.array([[1.0, 0.0, -2.0]]), "2 of 3 values are infinite or not above 0, such as 0: .*with NaN"),
        (np.array([[1.0, np.inf]]), "1 of 2 values are infinite or not above 0, such as inf"),
        (np.array([[1, -1]]), "1 of 2 values are infinite or not above 0, such as -1"),
        (np.ones((2, 3), bool), "holds bool, not numbers"),
        (np.ones((2, 3), complex), "holds complex128, not numbers"),
        (np.ones((2, 3, 3)), r"has shape \(2, 3, 3\): a depth map is \(height, width\)"),
        (np.ones((0, 3)), r"has shape \(0, 3\)"),
        (np.array({"a": 1}), "holds Python objects, which are not read: save an array of numbers"),
    ],
)
def test_arrays_that_are_no_depth_are_refused(tmp_path: Path, depth: Any, reason: str) -> None:
    np.save(tmp_path / "a.npy", depth)
    with pytest.raises(InputError, match=rf"a\.npy.* {reason}"):
        read_depth(tmp_path / "a.npy")


def test_files_that_are_no_depth_are_refused(tmp_path: Path) -> None:
    write_depth(tmp_path / "good.npy", np.ones(SHAPE))
    data = (tmp_path / "good.npy").read_bytes()
    (tmp_path / "short.npy").write_bytes(data[:-8])
    (tmp_path / "text.npy").write_text("this is no array")
    np.savez(tmp_path / "many.npz", a=np.ones(3))
    (tmp_path / "many.npz").rename(tmp_path / "many.npy")
    with pytest.raises(
        InputError, match=r"short\.npy is broken: .* shape \(7, 5\) of float64, 280 bytes, and 272 follow"
    ):
        read_depth(tmp_path / "short.npy")
    for name in ("text.npy", "many.npy"):
        with pytest.raises(InputError, match=f"{name} is broken or not supported"):
            read_depth(tmp_path / name)
    with pytest.raises(InputError, match=r"missing\.npy does not exist"):
        read_depth(tmp_path / "missing.npy")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "depth.npy").touch()
    with pytest.raises(InputError, match=r"results is a folder: give .*results/depth\.npy\."):
        read_depth(tmp_path / "results")
    with pytest.raises(InputError, match=r"depth\.png is not a depth map by its name: give a \.npy"):
        read_depth(tmp_path / "depth.png")
    with pytest.raises(InputError, match=r"good\.npy has shape \(7, 5\), but the image has \(5, 7\)"):
        read_depth(tmp_path / "good.npy", (5, 7))
    save(tmp_path / "colour.tif", random_samples(3, 8))
    with pytest.raises(InputError, match=r"colour\.tif has shape \(7, 5, 3\)"):
        read_depth(tmp_path / "colour.tif")
