"""Photo to E: exact on small images, blind to what the mask hides, and clear about what it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from persfs_cl import blocks
from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.preparation.correct import divide_vignetting, subtract_ambient
from persfs_cl.preparation.normalise import (
    brightest_diffuse,
    clip_highlights,
    mean_filter,
    normalise_grey,
    normalise_linear,
)

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "mean_filter": lambda image, mask=None: mean_filter(image, 3, mask),
    "normalise_grey": normalise_grey,
    "normalise_linear": lambda image, mask=None: normalise_linear(image, mask=mask),
    "clip_highlights": lambda image, mask=None: clip_highlights(image, mask=mask)[0],
    "subtract_ambient": lambda image, mask=None: subtract_ambient(image, 0.25, mask=mask)[0],
    "divide_vignetting": lambda image, mask=None: divide_vignetting(image, np.full(np.shape(image), 0.25), mask=mask),
}
every_function = pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)


def random_image(shape: tuple[int, int], seed: int = 0) -> Array:
    return np.random.default_rng(seed).random(shape)


@pytest.mark.parametrize("size", [1, 3, 5, 7])
@pytest.mark.parametrize("masked", [False, True])
def test_mean_filter_is_the_mean_of_the_pixels_there_are(size: int, masked: bool) -> None:
    image = random_image((9, 7))
    mask = random_image((9, 7), 1) > 0.4 if masked else np.ones((9, 7), dtype=bool)
    expected = image.copy()
    for row, column in np.argwhere(mask):
        window = np.s_[
            max(row - size // 2, 0) : row + size // 2 + 1, max(column - size // 2, 0) : column + size // 2 + 1
        ]
        expected[row, column] = image[window][mask[window]].mean()
    np.testing.assert_allclose(mean_filter(image, size, mask if masked else None), expected, rtol=1e-14)


def test_mean_filter_leaves_no_trace_of_a_highlight_in_the_dark() -> None:
    image = np.zeros((50, 50))
    image[10, 10] = 1e12 / 3
    image[40, 40] = 1e-12
    smooth = mean_filter(image, 3)
    assert smooth[30, 30] == 0
    assert smooth[40, 40] == pytest.approx(1e-12 / 9, rel=1e-15)
    assert (smooth >= 0).all()


@pytest.mark.parametrize("size", [0, -3, 2, 4, 3.0, True, None])
def test_mean_filter_refuses_a_size_without_a_middle(size: Any) -> None:
    with pytest.raises(InputError, match="give an odd number, 1 or more"):
        mean_filter(np.ones((9, 9)), size)


def test_mean_filter_refuses_a_window_larger_than_the_image() -> None:
    with pytest.raises(InputError, match="size=7 is larger than the image, 9×5 pixels"):
        mean_filter(np.ones((5, 9)), 7)


def test_normalise_grey_is_equation_2() -> None:
    np.testing.assert_array_equal(normalise_grey(np.array([[50, 100], [150, 250]], np.uint8)), [[0, 0.25], [0.5, 1]])
    np.testing.assert_array_equal(normalise_grey([[-1.0, 0.0, 3.0]]), [[0.0, 0.25, 1.0]])


@pytest.mark.parametrize(("scale", "shift"), [(255, 0), (0.125, 3), (1, -2)])
def test_normalise_grey_does_not_care_for_scale_and_shift(scale: float, shift: float) -> None:
    image = random_image((6, 5))
    np.testing.assert_allclose(normalise_grey(scale * image + shift), normalise_grey(image), atol=1e-13)


def test_normalise_grey_of_a_constant_image_is_refused() -> None:
    with pytest.raises(InputError, match=r"Every pixel of the image is 0\.5: there is no shading"):
        normalise_grey(np.full((3, 3), 0.5))
    with pytest.raises(InputError, match="Every pixel of the image is 0:"):
        normalise_grey(np.zeros((3, 3)))
    with pytest.raises(InputError, match="Every pixel of the image is 2:"):
        normalise_grey([[1, 2, 2]], mask=[[False, True, True]])


def test_normalise_grey_is_not_moved_by_a_few_hot_pixels() -> None:
    image = np.arange(1001.0).reshape(7, 143)
    hot = image.copy()
    hot[-1, -1] = 1e6
    # 999 is the 99.9th percentile of 1001 values; what lies above it becomes 1.
    np.testing.assert_allclose(normalise_grey(hot, percentile=99.9), np.minimum(image / 999, 1), rtol=1e-9)
    assert np.count_nonzero(normalise_grey(hot) > 0.01) == 1
    with pytest.raises(InputError, match=r"90 % of the image is 3: there is no shading"):
        normalise_grey([[3.0] * 99 + [4.0]], percentile=90)
    with pytest.raises(InputError, match="percentile=0"):
        normalise_grey(image, percentile=0)


def test_normalise_linear_divides_by_the_brightest_diffuse_value() -> None:
    image = np.array([[0.0, 0.1, 0.2, 0.8]])
    np.testing.assert_array_equal(normalise_linear(image, brightest=0.2), [[0.0, 0.5, 1.0, 1.0]])
    np.testing.assert_allclose(normalise_linear(image, percentile=100), image / 0.8)
    np.testing.assert_allclose(normalise_linear(image, mask=image < 0.5, percentile=100), [[0.0, 0.5, 1.0, 1.0]])


def test_brightest_diffuse_is_what_normalise_linear_divides_by() -> None:
    image = random_image((20, 50))
    white = brightest_diffuse(image)
    assert white == np.percentile(image, 99.5)
    np.testing.assert_array_equal(normalise_linear(image), normalise_linear(image, brightest=white))
    assert brightest_diffuse([[0.2, 0.8]], mask=[[True, False]], percentile=100) == 0.2


def test_normalise_linear_is_not_moved_by_a_few_highlights() -> None:
    image = np.linspace(0.0, 0.5, 1000).reshape(25, 40)
    image[0, :3] = 100.0
    shade = normalise_linear(image)
    assert shade[0, 0] == 1
    np.testing.assert_allclose(shade[12], image[12] / 0.5, rtol=0.005)


@pytest.mark.parametrize(
    ("image", "options", "reason"),
    [
        ([[0.5, -0.1, -0.2]], {}, r"2 negative pixels, the lowest -0\.2"),
        ([[0.0, 0.0]], {}, "is black"),
        ([[0.0] * 999 + [1.0]], {}, r"99\.5 % of the image is black"),
        ([[0.5, 1.0]], {"brightest": 0.0}, r"brightest=0\.0"),
        ([[0.5, 1.0]], {"brightest": math.nan}, "brightest=nan"),
        ([[0.5, 1.0]], {"percentile": 0}, "percentile=0"),
        ([[0.5, 1.0]], {"percentile": 101}, "percentile=101"),
        ([[0.5, 1.0]], {"percentile": math.nan}, "percentile=nan"),
    ],
)
def test_normalise_linear_refuses_the_impossible(image: Any, options: dict[str, Any], reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        normalise_linear(image, **options)


def test_clip_highlights_cuts_at_the_threshold_and_says_where() -> None:
    clipped, highlights = clip_highlights([[0.1, 0.5, 0.9, 2.0]], threshold=0.5)
    np.testing.assert_array_equal(clipped, [[0.1, 0.5, 0.5, 0.5]])
    np.testing.assert_array_equal(highlights, [[False, False, True, True]])


def test_clip_highlights_cuts_a_percentile_of_the_pixels() -> None:
    image = random_image((20, 50))
    clipped, highlights = clip_highlights(image, percentile=90)
    assert np.count_nonzero(highlights) == 100
    assert clipped.max() <= image[~highlights].max() + 1e-3
    np.testing.assert_array_equal(clipped[~highlights], image[~highlights])


@pytest.mark.parametrize("options", [{"threshold": math.inf}, {"percentile": 0}, {"percentile": 200}])
def test_clip_highlights_refuses_the_impossible(options: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"threshold=inf|percentile="):
        clip_highlights([[0.0, 1.0]], **options)


@every_function
def test_pixels_outside_the_mask_do_not_matter_and_inputs_stay_as_they_were(
    function: Callable[..., Array],
) -> None:
    image = random_image((8, 8))
    mask = random_image((8, 8), 1) > 0.3
    spoilt = np.where(mask, image, np.where(random_image((8, 8), 2) > 0.5, np.nan, 1e6))
    before = spoilt.copy()
    np.testing.assert_array_equal(function(spoilt, mask=mask)[mask], function(image, mask=mask)[mask])
    np.testing.assert_array_equal(spoilt, before)
    assert not np.shares_memory(function(image), image)


@every_function
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.int32, np.float32])
def test_every_numeric_type_gives_float64(function: Callable[..., Array], dtype: type) -> None:
    image: NDArray[Any] = (random_image((6, 5)) * 200).astype(dtype)
    result = function(image)
    assert result.dtype == np.float64
    np.testing.assert_array_equal(result, function(image.astype(np.float64)))


@every_function
@pytest.mark.parametrize(
    ("image", "mask", "reason"),
    [
        (np.ones((4, 4, 3)), None, r"shape \(4, 4, 3\)"),
        (np.ones(4), None, r"shape \(4,\)"),
        (np.ones((0, 4)), None, r"shape \(0, 4\)"),
        (np.ones((4, 4), bool), None, "holds bool"),
        (np.ones((4, 4), complex), None, "holds complex128"),
        (np.array([["a"]]), None, "not numbers"),
        (np.full((4, 4), np.nan), None, "16 NaN or infinite"),
        (np.full((4, 4), np.inf), None, "16 NaN or infinite"),
        (np.ones((4, 4)), np.ones((4, 4)), "mask is float64 of shape"),
        (np.ones((4, 4)), np.ones((4, 5), bool), r"mask is bool of shape \(4, 5\): give .* the image's shape \(4, 4\)"),
        (np.ones((4, 4)), np.zeros((4, 4), bool), "mask selects no pixel"),
    ],
)
def test_unusable_images_and_masks_are_refused(
    function: Callable[..., Array], image: Any, mask: Any, reason: str
) -> None:
    with pytest.raises(InputError, match=reason):
        function(image, mask=mask)


@pytest.mark.parametrize("size", [3, 7])
def test_mean_filter_does_not_show_where_a_block_of_rows_ends(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(5)
    image, mask = random.random((23, 9)), random.random((23, 9)) < 0.8
    whole = mean_filter(image, size, mask)
    monkeypatch.setattr(blocks, "_PIXELS", 2 * 9)
    np.testing.assert_array_equal(mean_filter(image, size, mask), whole)
