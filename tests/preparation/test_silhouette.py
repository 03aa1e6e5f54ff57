"""The object before a dark background."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from persfs_cl.errors import InputError, UnavailableError
from persfs_cl.preparation.silhouette import eroded, silhouette


def _scene() -> tuple[np.ndarray, np.ndarray]:
    rows, columns = np.mgrid[:60, :80]
    disc = (rows - 30) ** 2 + (columns - 35) ** 2 < 400
    image = np.where(disc, 0.3 + 0.005 * columns, 0.01)
    image[30, 35] = 0.0  # a hole
    image[5:9, 70:75] = 0.5  # another piece
    return image + 0.003 * np.random.default_rng(0).random(image.shape), disc


def test_the_largest_bright_piece_with_its_holes() -> None:
    image, disc = _scene()
    np.testing.assert_array_equal(silhouette(image), disc)


def test_what_is_masked_out_is_not_looked_at() -> None:
    image, disc = _scene()
    mask = np.ones(image.shape, bool)
    mask[:, :20] = False
    image[:, :15] = np.nan
    np.testing.assert_array_equal(silhouette(image, mask=mask), disc & mask)


@pytest.mark.parametrize("image", [np.full((20, 20), 0.5), 0.4 + 0.3 * np.random.default_rng(0).random((20, 20))])
def test_where_nothing_stands_out_it_is_said(image: np.ndarray) -> None:
    with pytest.raises(InputError, match="no object stands out from a dark background"):
        silhouette(image)


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skimage.filters", None)
    with pytest.raises(UnavailableError, match=r"pip install 'persfs-cl\[filters\]'"):
        silhouette(np.ones((5, 5)))


def test_erosion_takes_the_outline_and_not_the_edge_of_the_image() -> None:
    mask = np.zeros((9, 9), bool)
    mask[:, :6] = True
    np.testing.assert_array_equal(eroded(mask, 2), np.arange(9) < 4 * np.ones((9, 1)))
    np.testing.assert_array_equal(eroded(mask, 0), mask)
    assert eroded(np.ones((4, 4), bool), 3).all()
