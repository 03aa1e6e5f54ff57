"""The preparation of a photo: each step undoes exactly what was done to a synthetic photo, in the right order."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

from persfs_cl.camera import Camera
from persfs_cl.colour import decode_srgb
from persfs_cl.errors import InputError
from persfs_cl.io.photos import Photo, read_photo
from persfs_cl.preparation.correct import cosine_vignetting
from persfs_cl.preparation.normalise import clip_highlights, mean_filter, normalise_grey, normalise_linear
from persfs_cl.preparation.prepare import Preparation, prepare_photo

SHAPE = HEIGHT, WIDTH = 30, 40
CAMERA = Camera((50.0, 60.0), (12.0, 20.0))
ROWS, COLUMNS = np.mgrid[:HEIGHT, :WIDTH].astype(float)
SURFACE = 0.2 + 0.003 * ROWS + 0.004 * COLUMNS
MapToPhoto = Callable[..., Photo]


@pytest.fixture
def floats(tmp_path: Path) -> MapToPhoto:
    """A photo of exactly these floats, linear light."""

    def make(light: NDArray[Any], **options: Any) -> Photo:
        photometric = "rgb" if light.ndim == 3 else "minisblack"
        tifffile.imwrite(tmp_path / "photo.tif", light, photometric=photometric)
        return read_photo(tmp_path / "photo.tif", **options)

    return make


@pytest.fixture
def bytes_(tmp_path: Path) -> MapToPhoto:
    """A photo of 8 bits."""

    def make(levels: NDArray[Any], **options: Any) -> Photo:
        photometric = "rgb" if levels.ndim == 3 else "minisblack"
        tifffile.imwrite(tmp_path / "photo.tif", levels.astype(np.uint8), photometric=photometric)
        return read_photo(tmp_path / "photo.tif", **options)

    return make


def test_by_default_nothing_is_done(floats: MapToPhoto) -> None:
    prepared = prepare_photo(floats(SURFACE), CAMERA)
    np.testing.assert_array_equal(prepared.light, SURFACE)
    np.testing.assert_array_equal(prepared.unfiltered, SURFACE)
    assert prepared.mask.all()
    for pixels in ("below_ambient", "saturated", "specular", "masked", "filled", "clipped"):
        assert not getattr(prepared, pixels).any()
    assert json.loads(json.dumps(dict(prepared.report))) == {
        "tone_exponent": 1.0,
        "ambient": 0.0,
        "below_ambient_pixels": 0,
        "vignetting": "none",
        "saturation": None,
        "saturated_pixels": None,
        "despeckle": False,
        "speck_pixels": 0,
        "highlights": "keep",
        "specular_pixels": None,
        "masked_pixels": 0,
        "filled_pixels": 0,
        "clip_highlights": None,
        "clipped_pixels": 0,
        "denoise": 0.0,
        "mean_filter": 1,
    }


def test_the_law_of_vignetting_is_the_cosine_between_ray_and_axis() -> None:
    rays = np.stack([(COLUMNS - 12) / 50, (ROWS - 20) / 60, np.ones(SHAPE)], axis=-1)
    cosine = rays[..., 2] / np.linalg.norm(rays, axis=-1)
    np.testing.assert_allclose(cosine_vignetting(CAMERA, SHAPE), cosine**4, rtol=1e-14)
    assert cosine_vignetting(CAMERA, SHAPE)[20, 12] == 1


@pytest.mark.parametrize("power", [0.0, 2.5, 4.0])
def test_the_power_of_the_law_can_be_told(floats: MapToPhoto, power: float) -> None:
    photo = floats(SURFACE * cosine_vignetting(CAMERA, SHAPE) ** (power / 4.0))
    prepared = prepare_photo(photo, CAMERA, Preparation(vignetting=f"cos{power:g}"))
    np.testing.assert_allclose(prepared.light, SURFACE, rtol=1e-12)


@pytest.mark.parametrize("law", ["cos", "cos-1", "cos21", "cos4.", "cosine", "cos1e1"])
def test_no_other_text_is_a_law(law: str) -> None:
    with pytest.raises(InputError, match=r"vignetting='.*' is unknown: give 'none', a power of the cosine up to 20"):
        Preparation(vignetting=law)


@pytest.mark.parametrize("ambient", ["number", "array"])
def test_a_tone_curve_is_undone_before_all_else(floats: MapToPhoto, ambient: str) -> None:
    lens = cosine_vignetting(CAMERA, SHAPE)
    photo = floats((SURFACE * lens + 0.09) ** (1 / 1.5))
    dark = 0.09 ** (1 / 1.5)
    given = dark if ambient == "number" else np.full(SHAPE, dark)
    plate = lens ** (1 / 1.5)
    prepared = prepare_photo(photo, CAMERA, Preparation(ambient=given, vignetting=plate, tone_exponent=1.5))
    np.testing.assert_allclose(prepared.light, SURFACE * lens[20, 12], rtol=1e-12)
    by_law = prepare_photo(photo, CAMERA, Preparation(ambient=given, vignetting="cos4", tone_exponent=1.5))
    np.testing.assert_allclose(by_law.light, SURFACE, rtol=1e-12)
    assert by_law.report["tone_exponent"] == 1.5


@pytest.mark.parametrize("exponent", [0.0, 11.0, float("nan"), "2"])
def test_an_impossible_exponent_is_refused(exponent: Any) -> None:
    with pytest.raises(InputError, match=r"tone_exponent=.* is not an exponent: give a finite number from 0\.1 to 10"):
        Preparation(tone_exponent=exponent)


def test_a_white_level_takes_the_place_of_a_percentile(floats: MapToPhoto) -> None:
    prepared = prepare_photo(floats(SURFACE), CAMERA)
    normalised = prepared.normalised(white=0.4)
    np.testing.assert_allclose(normalised.image, np.minimum(SURFACE / 0.4, 1.0), rtol=1e-14)
    assert (normalised.report["white"], normalised.report["white_percentile"]) == (0.4, None)
    for keywords in ({"how": "grey"}, {"how": "none"}, {"percentile": 99.0}):
        with pytest.raises(InputError, match=r'white=0\.4 goes with "linear", instead of a percentile'):
            prepared.normalised(white=0.4, **keywords)
    with pytest.raises(InputError, match=r"white=0\.0 is not a brightness"):
        prepared.normalised(white=0.0)


def test_vignetting_of_a_uniform_plate_is_undone(floats: MapToPhoto) -> None:
    photo = floats(0.37 * cosine_vignetting(CAMERA, SHAPE))
    prepared = prepare_photo(photo, CAMERA, Preparation(vignetting="cos4"))
    np.testing.assert_allclose(prepared.light, 0.37, rtol=1e-12)
    np.testing.assert_array_equal(prepared.unfiltered, prepared.light)


@pytest.mark.parametrize("exposure", [1.0, 0.01, 250.0])
def test_the_exposure_of_the_plate_does_not_matter(floats: MapToPhoto, exposure: float) -> None:
    lens = 1.0 - 0.01 * np.hypot(ROWS - 14, COLUMNS - 17)
    prepared = prepare_photo(floats(SURFACE * lens), CAMERA, Preparation(vignetting=exposure * lens))
    np.testing.assert_allclose(prepared.light, SURFACE, rtol=1e-12)
    assert prepared.report["vignetting"] == "an array"
    # The brightest pixel counts, and outside the mask there may be anything.
    mask = COLUMNS < 35
    spoilt = np.where(mask, exposure * lens, np.where(ROWS > 9, np.nan, 1e9))
    prepared = prepare_photo(floats(SURFACE * lens), CAMERA, Preparation(vignetting=spoilt), mask=mask)
    np.testing.assert_allclose(prepared.light[mask], SURFACE[mask], rtol=1e-12)


def test_a_level_of_ambient_light_is_one_of_the_file(bytes_: MapToPhoto) -> None:
    levels = np.arange(HEIGHT * WIDTH).reshape(SHAPE) % 256
    photo = bytes_(levels)
    prepared = prepare_photo(photo, CAMERA, Preparation(ambient=20))
    expected = np.maximum(decode_srgb(levels / 255) - decode_srgb(20 / 255), 0)
    np.testing.assert_allclose(prepared.light, expected, rtol=1e-13, atol=1e-16)
    np.testing.assert_array_equal(prepared.below_ambient, levels < 20)
    assert prepared.report["below_ambient_pixels"] == np.count_nonzero(levels < 20)
    linear = prepare_photo(bytes_(levels, encoding="linear"), CAMERA, Preparation(ambient=20))
    np.testing.assert_allclose(linear.light, np.maximum(levels - 20, 0) / 255, atol=1e-16)


@pytest.mark.parametrize("channel", ["luminance", "red", "max"])
def test_a_level_of_ambient_light_is_that_of_each_colour(bytes_: MapToPhoto, channel: str) -> None:
    levels = np.random.default_rng(0).integers(30, 256, (*SHAPE, 3))
    photo = bytes_(levels, channel=channel)
    prepared = prepare_photo(photo, CAMERA, Preparation(ambient=30.0))
    np.testing.assert_allclose(prepared.light, photo.image - decode_srgb(30 / 255), rtol=1e-12, atol=1e-15)
    assert not prepared.below_ambient.any()


def test_a_photo_without_the_lamp_is_subtracted_before_the_lens_is_undone(floats: MapToPhoto) -> None:
    lens = cosine_vignetting(CAMERA, SHAPE)
    ambient = 0.125 * (1 + np.sin(ROWS))
    photo = floats(SURFACE * lens + ambient)
    prepared = prepare_photo(photo, CAMERA, Preparation(ambient=ambient, vignetting="cos4"))
    np.testing.assert_allclose(prepared.light, SURFACE, rtol=1e-12)
    assert prepared.report["ambient"] == "an array"


def test_saturated_pixels_are_found_in_the_numbers_of_the_file(bytes_: MapToPhoto) -> None:
    levels = np.full((*SHAPE, 3), (200, 100, 50))
    levels[3, 4, 0], levels[5, 6, 1], levels[7, 8, 2], levels[9, 9, 0] = 255, 250, 251, 249
    for channel, places in (
        ("luminance", [[3, 4], [5, 6], [7, 8]]),
        ("red", [[3, 4]]),
        ("green", [[5, 6]]),
        ("blue", [[7, 8]]),
    ):
        prepared = prepare_photo(bytes_(levels, channel=channel), CAMERA)
        assert np.argwhere(prepared.saturated).tolist() == places
        assert (prepared.report["saturation"], prepared.report["saturated_pixels"]) == (0.98 * 255, len(places))
    lower = prepare_photo(bytes_(levels, channel="red"), CAMERA, Preparation(saturation=249))
    assert np.argwhere(lower.saturated).tolist() == [[3, 4], [9, 9]]


def test_floats_are_saturated_only_from_a_given_number_on(floats: MapToPhoto) -> None:
    light = SURFACE.copy()
    light[8, 9] = 4.0
    assert not prepare_photo(floats(light), CAMERA).saturated.any()
    prepared = prepare_photo(floats(light), CAMERA, Preparation(saturation=4.0))
    assert np.argwhere(prepared.saturated).tolist() == [[8, 9]]


def test_highlights_are_masked_or_filled_with_what_is_around_them(floats: MapToPhoto) -> None:
    light = SURFACE.copy()
    light[10:12, 20:22] = 2.0  # a spot
    light[20, 30] = 0.9  # saturated
    light[0, 0] = 50.0  # outside the mask
    mask = np.ones(SHAPE, bool)
    mask[:5, :5] = False
    grown = np.zeros(SHAPE, bool)
    grown[8:14, 18:24] = grown[18:23, 28:33] = True
    options: dict[str, Any] = {"saturation": 0.9}

    masked = prepare_photo(floats(light), CAMERA, Preparation(highlights="mask", **options), mask=mask)
    assert np.argwhere(masked.specular).tolist() == [[10, 20], [10, 21], [11, 20], [11, 21]]
    assert np.argwhere(masked.saturated).tolist() == [[10, 20], [10, 21], [11, 20], [11, 21], [20, 30]]
    np.testing.assert_array_equal(masked.masked, grown)
    np.testing.assert_array_equal(masked.mask, mask & ~grown)
    np.testing.assert_array_equal(masked.light, light)
    assert (masked.report["specular_pixels"], masked.report["saturated_pixels"]) == (4, 5)
    assert (masked.report["masked_pixels"], masked.report["filled_pixels"]) == (grown.sum(), 0)

    filled = prepare_photo(floats(light), CAMERA, Preparation(highlights="fill", **options), mask=mask)
    np.testing.assert_allclose(filled.light[mask], SURFACE[mask], rtol=1e-11)
    np.testing.assert_array_equal(filled.unfiltered, light)
    np.testing.assert_array_equal(filled.filled, grown)
    np.testing.assert_array_equal(filled.mask, mask)
    assert not filled.masked.any()
    assert (filled.report["masked_pixels"], filled.report["filled_pixels"]) == (0, grown.sum())


def test_a_highlight_that_cannot_be_filled_is_masked(floats: MapToPhoto) -> None:
    mask = np.ones(SHAPE, bool)
    mask[:, 6] = False
    light = np.where(COLUMNS < 6, 1.0, SURFACE)
    prepared = prepare_photo(floats(light), CAMERA, Preparation(highlights="fill", saturation=1.0), mask=mask)
    # Two columns beyond the gap go with the highlight.
    np.testing.assert_array_equal(prepared.masked, mask & (COLUMNS < 6))
    np.testing.assert_array_equal(prepared.filled, (COLUMNS == 7))
    np.testing.assert_array_equal(prepared.mask, COLUMNS > 6)


@pytest.mark.parametrize("channel", ["luminance", "red", "green", "blue", "mean", "max"])
def test_a_white_spot_on_a_coloured_surface_is_found_in_every_channel(bytes_: MapToPhoto, channel: str) -> None:
    levels = np.full((*SHAPE, 3), (210, 90, 70))
    levels[15:18, 22:24] = (245, 240, 235)
    prepared = prepare_photo(bytes_(levels, channel=channel), CAMERA, Preparation(highlights="mask"))
    expected = np.zeros(SHAPE, bool)
    expected[15:18, 22:24] = True
    np.testing.assert_array_equal(prepared.specular, expected)


def test_highlights_go_before_the_percentile_and_the_filter(floats: MapToPhoto) -> None:
    light = SURFACE.copy()
    light[10, 20] = 30.0
    options: dict[str, Any] = {"clip_highlights": 90.0, "mean_filter": 3}
    prepared = prepare_photo(floats(light), CAMERA, Preparation(highlights="mask", **options))
    clipped, pixels = clip_highlights(light, mask=prepared.mask, percentile=90.0)
    np.testing.assert_array_equal(prepared.clipped, pixels)
    np.testing.assert_array_equal(prepared.light, mean_filter(clipped, 3, prepared.mask))
    assert prepared.light[prepared.mask].max() < SURFACE.max()
    np.testing.assert_array_equal(prepared.unfiltered, light)


def test_light_becomes_e_by_the_functions_of_grey(floats: MapToPhoto) -> None:
    light = SURFACE.copy()
    light[10, 20], light[0, 0] = 30.0, np.nan
    mask = light > 0
    photo = floats(light, keep_nan=True)
    prepared = prepare_photo(photo, CAMERA, Preparation(mean_filter=3), mask=mask)
    inside = prepared.light[mask]
    for how, percentile, expected, black, white in (
        ("linear", None, normalise_linear(prepared.light, mask=mask), 0.0, np.percentile(inside, 99.5)),
        ("linear", 90.0, normalise_linear(prepared.light, mask=mask, percentile=90), 0, np.percentile(inside, 90)),
        ("grey", None, normalise_grey(prepared.light, mask), inside.min(), inside.max()),
        ("grey", 90.0, normalise_grey(prepared.light, mask, percentile=90), inside.min(), np.percentile(inside, 90)),
        ("none", None, prepared.light, 0.0, 1.0),
    ):
        result = prepared.normalised(how, percentile=percentile)  # type: ignore[arg-type]
        np.testing.assert_array_equal(result.image[mask], expected[mask])
        itself = np.clip((photo.image - black) / (white - black), 0, 1)
        np.testing.assert_array_equal(result.unfiltered[mask], itself[mask])
        assert result.report["white_pixels"] == np.count_nonzero(expected[mask] >= 1)
        assert (result.report["black"], result.report["white"]) == (black, white)
        json.dumps(dict(result.report), allow_nan=False)
    assert prepared.normalised().image[12, 20] < 1 == prepared.normalised().image[11, 20]


def test_transparent_pixels_are_left_out_unless_a_mask_is_given(tmp_path: Path) -> None:
    levels = np.stack([np.full(SHAPE, 100), 255 * (COLUMNS < 20)], axis=-1).astype(np.uint8)
    tifffile.imwrite(tmp_path / "a.tif", levels, photometric="minisblack", extrasamples=["unassalpha"])
    photo = read_photo(tmp_path / "a.tif")
    np.testing.assert_array_equal(prepare_photo(photo, CAMERA).mask, COLUMNS < 20)
    assert prepare_photo(photo, CAMERA, mask=np.ones(SHAPE, bool)).mask.all()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"highlights": "remove"}, "highlights='remove' is unknown: choose .keep., .mask. or .fill."),
        ({"vignetting": "cos^5"}, "vignetting='cos.5' is unknown"),
        ({"vignetting": 0.5}, r"vignetting=0\.5 is unknown"),
        ({"ambient": -1}, "ambient=-1 is not a brightness"),
        ({"ambient": math.nan}, "ambient=nan"),
        ({"ambient": "dark"}, "ambient='dark'"),
        ({"saturation": math.inf}, "saturation=inf"),
    ],
)
def test_impossible_preparations_are_refused(options: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        Preparation(**options)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"ambient": 256}, "ambient=256 is more than 255, the largest number in a photo of 8 bits"),
        ({"saturation": 1000}, "saturation=1000 is more than 255"),
        ({"ambient": 200}, "No pixel is brighter than the ambient light"),
        ({"ambient": np.ones(SHAPE)}, "No pixel is brighter than the ambient light"),
        ({"ambient": np.ones((3, 3))}, r"ambient is float64 of shape \(3, 3\)"),
        ({"vignetting": np.ones((3, 3))}, r"vignetting is float64 of shape \(3, 3\)"),
        ({"vignetting": np.zeros(SHAPE)}, "vignetting is 0 or so at 1200 pixels"),
        ({"saturation": 100, "highlights": "mask"}, "All of the 1200 pixels are highlights"),
        ({"saturation": 100, "highlights": "fill"}, "All of the 1200 pixels are highlights"),
    ],
)
def test_what_does_not_fit_the_photo_is_refused(bytes_: MapToPhoto, options: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        prepare_photo(bytes_(np.full(SHAPE, 100)), CAMERA, Preparation(**options))


def test_ambient_light_of_the_largest_colour_is_refused(bytes_: MapToPhoto) -> None:
    photo = bytes_(np.full((*SHAPE, 3), 100), channel="max")
    with pytest.raises(InputError, match="cannot be told by subtraction: read photo and ambient light with another"):
        prepare_photo(photo, CAMERA, Preparation(ambient=np.full(SHAPE, 0.01)))


def test_impossible_normalisations_are_refused(floats: MapToPhoto) -> None:
    prepared = prepare_photo(floats(SURFACE), CAMERA)
    wrong: Any = "stretch"
    with pytest.raises(InputError, match=r"how='stretch' is unknown: choose .linear., .level., .grey. or .none."):
        prepared.normalised(wrong)
    with pytest.raises(InputError, match="has no meaning"):
        prepared.normalised("none", percentile=99)
    for how in ("linear", "grey"):
        with pytest.raises(InputError, match="percentile=0"):
            prepared.normalised(how, percentile=0)


def test_the_median_of_level_ground(floats: MapToPhoto) -> None:
    level = 1.0 / np.hypot(1.0, 1.0)
    photo = floats(np.array([[0.1, 0.2, 0.25], [0.2, 0.2, 0.9]]))
    normalised = prepare_photo(photo, CAMERA).normalised("level", level=level)
    assert float(np.median(normalised.image)) == pytest.approx(level)
    assert normalised.report["level"] == level
    assert normalised.report["white_pixels"] == 1
    for wrong in (None, 1.0, 0.0):
        with pytest.raises(InputError, match="the light must be oblique"):
            prepare_photo(photo, CAMERA).normalised("level", level=wrong)
    with pytest.raises(InputError, match='goes with "level"'):
        prepare_photo(photo, CAMERA).normalised(level=0.5)


def test_specks_and_noise_are_told(floats: MapToPhoto) -> None:
    surface = np.full((20, 20), 0.5)
    surface[5, 5] = 2.0
    prepared = prepare_photo(floats(surface), CAMERA, Preparation(despeckle=True))
    assert prepared.report["speck_pixels"] == prepared.specks.sum() == 1
    smooth = prepare_photo(floats(prepared.light), CAMERA, Preparation(despeckle=True))
    # A large photo takes no memory for the same light twice.
    assert smooth.light is smooth.unfiltered
    assert prepared.light[5, 5] == 0.5
    assert prepared.unfiltered[5, 5] == 2.0
    noisy = np.maximum(surface + 0.02 * np.random.default_rng(0).standard_normal(surface.shape), 0.0)
    prepared = prepare_photo(floats(noisy), CAMERA, Preparation(despeckle=True, denoise=0.8))
    assert np.abs(prepared.light - 0.5).mean() < 0.5 * np.abs(noisy - 0.5).mean()
