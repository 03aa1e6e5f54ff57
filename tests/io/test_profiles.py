"""Colour profiles: the same light, whatever curve and primaries it was written with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pillow_heif
import pytest
import tifffile
from command import run, strict
from numpy.typing import NDArray
from PIL import Image, ImageCms

from persfs_cl.colour import decode_srgb, encode_srgb
from persfs_cl.io.photos import read_photo

WHITE = (0.3127, 0.3290, 1.0)
SRGB = (0.64, 0.33, 1, 0.30, 0.60, 1, 0.15, 0.06, 1)
P3 = (0.68, 0.32, 1, 0.265, 0.69, 1, 0.15, 0.06, 1)
ADOBE = (0.64, 0.33, 1, 0.21, 0.71, 1, 0.15, 0.06, 1)
Light = NDArray[np.float64]
Curve = Callable[[Light], Light]

SPACES: dict[str, tuple[tuple[float, ...], Curve, dict[str, Any]]] = {
    "sRGB": (SRGB, encode_srgb, {"transferfunction": decode_srgb(np.linspace(0, 1, 4096)).astype(np.float32)}),
    "Display P3": (P3, encode_srgb, {"transferfunction": decode_srgb(np.linspace(0, 1, 4096)).astype(np.float32)}),
    "Adobe RGB": (ADOBE, lambda light: light ** (256 / 563), {"gamma": 563 / 256}),
    "linear": (SRGB, lambda light: light, {"gamma": 1.0}),
    "linear P3": (P3, lambda light: light, {"gamma": 1.0}),
}


def profile(space: str) -> bytes:
    primaries, _, curve = SPACES[space]
    return bytes(imagecodecs.cms_profile("rgb", whitepoint=WHITE, primaries=primaries, **curve))


def xyz_by_rgb(primaries: tuple[float, ...]) -> Light:
    """X, Y and Z of linear RGB, by the definition of its primaries and its white."""
    corners = np.array(primaries).reshape(3, 3)[:, :2]
    columns = np.stack([(x / y, 1.0, (1 - x - y) / y) for x, y in corners], axis=1)
    white = np.array([WHITE[0] / WHITE[1], 1.0, (1 - WHITE[0] - WHITE[1]) / WHITE[1]])
    return np.asarray(columns * np.linalg.solve(columns, white))


def coloured_light() -> Light:
    """Linear sRGB that all of the spaces can hold."""
    return np.random.default_rng(3).uniform(0.05, 0.95, (20, 30, 3))


def samples_in(space: str, light: Light, bits: int) -> NDArray[Any]:
    primaries, encode, _ = SPACES[space]
    there = light @ np.linalg.solve(xyz_by_rgb(primaries), xyz_by_rgb(SRGB)).T
    stored = np.rint(encode(there.clip(0, 1)) * (2**bits - 1))
    return np.asarray(stored, np.uint8 if bits == 8 else np.uint16)


@pytest.mark.parametrize("space", SPACES)
def test_the_same_light_in_each_space_is_read_alike(tmp_path: Path, space: str) -> None:
    light = coloured_light()
    samples = samples_in(space, light, 16)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", iccprofile=profile(space))
    photo = read_photo(tmp_path / "a.tif")
    np.testing.assert_allclose(photo.image, light @ xyz_by_rgb(SRGB)[1], rtol=1e-3)
    np.testing.assert_allclose(photo.colour, np.rint(255 * encode_srgb(light)), atol=1)
    assert photo.profile == "RGB built-in"
    assert photo.encoding == {"sRGB": "srgb", "Display P3": "srgb", "Adobe RGB": "profile"}.get(space, "linear")
    green = read_photo(tmp_path / "a.tif", channel="green").image
    there = light @ np.linalg.solve(xyz_by_rgb(SPACES[space][0]), xyz_by_rgb(SRGB)).T
    np.testing.assert_allclose(green, there[..., 1], rtol=1e-3)
    largest = read_photo(tmp_path / "a.tif", channel="max").image
    np.testing.assert_allclose(largest, there.max(axis=2), rtol=1e-3)


def test_nothing_is_rounded_to_eight_bits(tmp_path: Path) -> None:
    ramp = np.arange(0, 65536, 7, dtype=np.uint16).reshape(1, -1)
    tifffile.imwrite(tmp_path / "a.tif", ramp, photometric="minisblack", iccprofile=profile("Adobe RGB"))
    photo = read_photo(tmp_path / "a.tif")
    np.testing.assert_allclose(photo.image, (ramp / 65535) ** (563 / 256), atol=2e-6)
    np.testing.assert_allclose(photo.linear(ramp), photo.image, rtol=1e-6)
    floats = (ramp / 65535).astype(np.float32)
    tifffile.imwrite(tmp_path / "b.tif", floats, photometric="minisblack", iccprofile=profile("Adobe RGB"))
    np.testing.assert_allclose(read_photo(tmp_path / "b.tif").image, photo.image, atol=1e-6)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.webp", "a.avif", "a.heic"])
def test_every_format_keeps_its_profile(tmp_path: Path, name: str) -> None:
    light = np.full((16, 16, 3), (0.6, 0.4, 0.2))
    picture = Image.fromarray(samples_in("Adobe RGB", light, 8))
    options: dict[str, Any] = {"a.webp": {"lossless": True}, "a.png": {}}.get(name, {"quality": 100})
    if name == "a.heic":
        picture.info["icc_profile"] = profile("Adobe RGB")
        pillow_heif.from_pillow(picture).save(tmp_path / name, quality=-1, chroma=444)
    else:
        picture.save(tmp_path / name, icc_profile=profile("Adobe RGB"), **options)
    photo = read_photo(tmp_path / name)
    assert photo.encoding == "profile"
    np.testing.assert_allclose(photo.image, light @ xyz_by_rgb(SRGB)[1], rtol=0.03)


def test_a_grey_profile_has_a_curve(tmp_path: Path) -> None:
    samples = np.arange(256, dtype=np.uint8).reshape(16, 16)
    grey = bytes(imagecodecs.cms_profile("gray", gamma=2.2))
    Image.fromarray(samples).save(tmp_path / "a.png", icc_profile=grey)
    photo = read_photo(tmp_path / "a.png")
    assert (photo.encoding, photo.profile) == ("profile", "gray built-in")
    np.testing.assert_allclose(photo.image, (samples / 255) ** 2.2, atol=2e-6)


def test_what_is_said_goes_before_the_profile(tmp_path: Path) -> None:
    samples = samples_in("Adobe RGB", coloured_light(), 16)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", iccprofile=profile("Adobe RGB"))
    tifffile.imwrite(tmp_path / "b.tif", samples, photometric="rgb")
    for encoding in ("srgb", "linear"):
        told = read_photo(tmp_path / "a.tif", encoding=encoding)
        np.testing.assert_array_equal(told.image, read_photo(tmp_path / "b.tif", encoding=encoding).image)
        assert (told.encoding, told.profile) == (encoding, "")


def test_a_profile_of_srgb_itself_changes_no_bit(tmp_path: Path) -> None:
    samples = samples_in("sRGB", coloured_light(), 8)
    own = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(samples).save(tmp_path / "a.png", icc_profile=own)
    Image.fromarray(samples).save(tmp_path / "b.png")
    np.testing.assert_array_equal(read_photo(tmp_path / "a.png").image, read_photo(tmp_path / "b.png").image)
    assert read_photo(tmp_path / "a.png").profile.startswith("sRGB")


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"no profile", r"is broken"),
        (profile("Adobe RGB")[:200], r"is broken"),
        (bytes(imagecodecs.cms_profile("gray", gamma=2.2)), r"is for GRAY, and not for an RGB image"),
        (ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes(), r"is for Lab"),
    ],
)
def test_a_profile_that_cannot_be_used_is_warned_of(tmp_path: Path, data: bytes, why: str) -> None:
    samples = samples_in("sRGB", coloured_light(), 16)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", iccprofile=data)
    with pytest.warns(UserWarning, match=rf"The colour profile of .*a\.tif {why}.*Give encoding, or save it in sRGB"):
        photo = read_photo(tmp_path / "a.tif")
    assert (photo.encoding, photo.profile) == ("srgb", "")
    tifffile.imwrite(tmp_path / "b.tif", samples, photometric="rgb")
    np.testing.assert_array_equal(photo.image, read_photo(tmp_path / "b.tif").image)


def test_the_report_names_the_profile(tmp_path: Path) -> None:
    ramp = np.linspace(0.2, 0.9, 12)[:, None, None] * np.ones((12, 14, 3))
    samples = samples_in("Display P3", ramp, 16)
    tifffile.imwrite(tmp_path / "a.tif", samples, photometric="rgb", iccprofile=profile("Display P3"))
    out = tmp_path / "out"
    outcome = run("reconstruct", tmp_path / "a.tif", "-o", out, "--focal-length", "14", "--save", "report")
    assert outcome.status == 0, outcome.stderr
    assert strict(out / "report.json")["photo"]["profile"] == "RGB built-in"
