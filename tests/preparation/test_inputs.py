"""What is given to a preparation stays as it is, and what comes back is nobody else's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from persfs_cl.preparation.correct import divide_vignetting, subtract_ambient
from persfs_cl.preparation.denoise import denoise
from persfs_cl.preparation.highlights import fill_smoothly
from persfs_cl.preparation.specks import replace_specks

SPECK = np.full((12, 12), 0.5)
SPECK[6, 6] = 2.0
NONE = np.zeros(SPECK.shape, bool)


@pytest.mark.parametrize(
    "function",
    [
        pytest.param(replace_specks, id="specks"),
        pytest.param(lambda image: fill_smoothly(image, image > 1.0), id="holes"),
        pytest.param(lambda image: fill_smoothly(image, NONE), id="no holes"),
        pytest.param(lambda image: denoise(image, 0.0), id="no denoising"),
        pytest.param(lambda image: denoise(image, 1.0), id="denoising"),
        pytest.param(lambda image: subtract_ambient(image, 0.0), id="ambient light"),
        pytest.param(lambda image: divide_vignetting(image, np.ones(image.shape)), id="vignetting"),
    ],
)
@pytest.mark.parametrize("image", [SPECK, np.full(SPECK.shape, 0.5)], ids=["speck", "even"])
def test_an_image_is_neither_changed_nor_given_back(image: Any, function: Callable[..., Any]) -> None:
    given = image.copy()
    result = function(given)
    np.testing.assert_array_equal(given, image)
    assert not np.shares_memory(result[0] if isinstance(result, tuple) else result, given)
