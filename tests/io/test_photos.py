"""Photos, masks and depth maps: every format to the last bit, and every bad file named with its reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from PIL import Image
from samples import SHAPE, WEIGHTS, Samples, light, random_samples, save

from persfs_cl.colour import decode_srgb, encode_srgb
from persfs_cl.errors import InputError
from persfs_cl.io.photos import read_image, read_photo


@pytest.mark.parametrize("suffix", [".png", ".tiff"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_integers_are_read_to_the_last_bit(tmp_path: Path, suffix: str, bits: int, channels: int) -> None:
    samples = random_samples(channels, bits)
    photo = read_photo(save(tmp_path / f"a{suffix}", samples))
    assert photo.image.dtype == np.float64
    assert photo.image.shape == SHAPE
    # One step of 16 bits is 1.5e-5 of the range, and decoding makes it 1e-6 at the dark end.
    np.testing.assert_allclose(photo.image, light(samples, bits), rtol=1e-13, atol=1e-15)
    assert (photo.bits, photo.encoding, photo.path) == (bits, "srgb", tmp_path / f"a{suffix}")
    if channels in (1, 3):
        assert photo.mask is None
    else:
        np.testing.assert_array_equal(photo.mask, samples[..., -1] > (2**bits - 1) / 2)
    shown = samples[..., :3] if channels > 2 else np.stack([samples.reshape(*SHAPE, -1)[..., 0]] * 3, axis=-1)
    assert photo.colour.dtype == np.uint8
    np.testing.assert_array_equal(photo.colour, np.rint(shown / (2**bits - 1) * 255))


def test_jpeg_grey_and_colour(tmp_path: Path) -> None:
    flat = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    Image.fromarray(flat).save(tmp_path / "a.jpg", quality=100, subsampling=0)
    decoded = np.asarray(Image.open(tmp_path / "a.jpg"))
    photo = read_photo(tmp_path / "a.jpg")
    np.testing.assert_allclose(photo.image, light(decoded, 8), rtol=1e-13)
    np.testing.assert_array_equal(photo.colour, decoded)
    Image.fromarray(flat[..., 0]).save(tmp_path / "grey.jpg", quality=100)
    np.testing.assert_allclose(read_image(tmp_path / "grey.jpg"), decode_srgb(200 / 255), rtol=1e-13)


@pytest.mark.parametrize(
    ("channel", "weights"),
    [
        ("luminance", WEIGHTS),
        ("red", (1, 0, 0)),
        ("green", (0, 1, 0)),
        ("blue", (0, 0, 1)),
        ("mean", (1 / 3, 1 / 3, 1 / 3)),
    ],
)
def test_a_channel_is_a_weighted_sum_of_linear_light(tmp_path: Path, channel: Any, weights: Any) -> None:
    samples = random_samples(3, 8)
    path = save(tmp_path / "a.png", samples)
    expected = decode_srgb(samples / 255) @ np.array(weights, dtype=float)
    np.testing.assert_allclose(read_image(path, channel=channel), expected, rtol=1e-13, atol=1e-15)
    grey = save(tmp_path / "grey.png", samples[..., 0])
    np.testing.assert_array_equal(read_image(grey, channel=channel), decode_srgb(samples[..., 0] / 255))


def test_the_channel_max_is_the_largest_linear_light(tmp_path: Path) -> None:
    samples = random_samples(3, 8)
    photo = read_photo(save(tmp_path / "a.png", samples), channel="max")
    np.testing.assert_allclose(photo.image, decode_srgb(samples / 255).max(axis=2), rtol=1e-13)
    assert photo.channel == "max"
    floats: Samples = (samples / 100).astype(np.float32)
    floats[0, 1, 2] = np.nan
    tifffile.imwrite(tmp_path / "a.tif", floats, photometric="rgb")
    image = read_photo(tmp_path / "a.tif", channel="max", keep_nan=True).image
    np.testing.assert_array_equal(image, floats.max(axis=2).astype(float))
    grey = save(tmp_path / "grey.png", samples[..., 0])
    np.testing.assert_array_equal(read_image(grey, channel="max"), read_image(grey))
    wrong: Any = "maximum"
    with pytest.raises(InputError, match=r"channel='maximum' is unknown: choose \"luminance\", .* or \"max\""):
        read_image(grey, channel=wrong)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize(
    ("channel", "used"), [("red", [0]), ("green", [1]), ("blue", [2]), ("luminance", [0, 1, 2]), ("max", [0, 1, 2])]
)
def test_a_photo_keeps_its_extreme_samples(tmp_path: Path, bits: int, channel: Any, used: list[int]) -> None:
    samples = random_samples(4, bits)
    photo = read_photo(save(tmp_path / "a.png", samples), channel=channel)
    np.testing.assert_array_equal(photo.largest_sample, samples[..., used].max(axis=2))
    np.testing.assert_array_equal(photo.smallest_sample, samples[..., :3].min(axis=2))
    assert photo.white == 2**bits - 1


def test_numbers_of_a_file_become_light_as_its_pixels_do(tmp_path: Path) -> None:
    samples = random_samples(1, 8)
    for encoding in ("srgb", "linear"):
        photo = read_photo(save(tmp_path / "a.png", samples), encoding=encoding)
        np.testing.assert_allclose(photo.linear(samples), photo.image, rtol=1e-14)
    tifffile.imwrite(tmp_path / "a.tif", samples.astype(np.float32))
    photo = read_photo(tmp_path / "a.tif")
    assert photo.white is None
    np.testing.assert_array_equal(photo.linear(samples), photo.image)


def test_integers_can_be_taken_as_linear(tmp_path: Path) -> None:
    samples = random_samples(1, 8)
    photo = read_photo(save(tmp_path / "a.png", samples), encoding="linear")
    np.testing.assert_allclose(photo.image, samples / 255, rtol=1e-15)
    np.testing.assert_array_equal(photo.colour[..., 1], np.rint(255 * encode_srgb(samples / 255)))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_floats_are_linear_and_keep_their_scale(tmp_path: Path, dtype: type) -> None:
    samples: Samples = (random_samples(3, 8) / 100).astype(dtype)
    photo = read_photo(save(tmp_path / "a.tiff", samples))
    assert photo.encoding == "linear"
    assert photo.image.max() > 1
    np.testing.assert_allclose(photo.image, samples.astype(float) @ WEIGHTS, rtol=1e-14)
    np.testing.assert_array_equal(photo.colour, np.rint(255 * encode_srgb(samples.clip(0, 1))))
    decoded = read_image(tmp_path / "a.tiff", encoding="srgb")
    np.testing.assert_allclose(decoded, decode_srgb(samples.astype(float)) @ WEIGHTS, rtol=1e-13)


def test_alpha_of_exactly_one_half_is_transparent(tmp_path: Path) -> None:
    samples = np.full((1, 2, 2), 100, np.uint8)
    samples[0, :, 1] = 127, 128
    np.testing.assert_array_equal(read_photo(save(tmp_path / "a.png", samples)).mask, [[False, True]])


def test_unknown_options_are_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", random_samples(1, 8))
    wrong: Any = "gamma"
    with pytest.raises(InputError, match=r'channel=.gamma. is unknown: choose "luminance", "red"'):
        read_image(path, channel=wrong)
    with pytest.raises(InputError, match=r"encoding='gamma' is unknown: choose .auto., .srgb. or .linear."):
        read_image(path, encoding=wrong)


def test_nan_is_kept_when_asked_for_and_black_in_the_colours(tmp_path: Path) -> None:
    light = np.full((4, 5, 3), 0.5, np.float32)
    light[1, 2, 0] = np.nan
    tifffile.imwrite(tmp_path / "a.tif", light, photometric="rgb")
    with pytest.raises(InputError, match="1 NaN"):
        read_photo(tmp_path / "a.tif")
    photo = read_photo(tmp_path / "a.tif", keep_nan=True)
    assert np.argwhere(np.isnan(photo.image)).tolist() == [[1, 2]]
    assert photo.colour[1, 2].tolist() == [0, 188, 188]
    for wrong, reason in ((np.inf, "1 NaN or infinite"), (-1.0, "1 negative samples, the lowest -1")):
        light[0, 0, 0] = wrong
        tifffile.imwrite(tmp_path / "a.tif", light, photometric="rgb")
        with pytest.raises(InputError, match=reason):
            read_photo(tmp_path / "a.tif", keep_nan=True)
