"""Bright specks are replaced, and nothing else is touched."""

from __future__ import annotations

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.errors import InputError
from persfs_cl.preparation.specks import replace_specks

SCENES = {
    "bump": ps.bump((60, 80), light=ps.FlashLight()),
    "bumps": ps.bumps((60, 80), light=ps.FlashLight()),
    "frontal bump": ps.bump((60, 80)),
    "sphere": ps.sphere_cap((60, 60)),
}


def _photo(scene: ps.Scene) -> tuple[Array, Mask]:
    mask = np.isfinite(scene.image) if scene.mask is None else scene.mask & np.isfinite(scene.image)
    return np.where(mask, scene.image, 0.0), mask


def _specked(image: Array, mask: Mask) -> tuple[Array, Mask]:
    """One pixel of a hundred twice to four times too bright."""
    rng = np.random.default_rng(0)
    hit = mask & (rng.random(mask.shape) < 0.01)
    return np.where(hit, image * rng.uniform(2.0, 4.0, mask.shape), image), hit


def _error(scene: ps.Scene, image: Array, mask: Mask) -> float:
    solution = ps.reconstruct(
        np.minimum(image, 1.0) if scene.light.normalised else image,
        scene.camera,
        light=scene.light,
        mask=mask,
        known_depth=scene.known_depth,
    )
    return ps.compare(solution.depth, np.where(solution.solved, scene.depth, np.nan)).mean


@pytest.mark.parametrize("name", SCENES)
def test_clean_images_stay_as_they_are(name: str) -> None:
    image, mask = _photo(SCENES[name])
    found, specks = replace_specks(image, mask=mask)
    assert not specks.any()
    np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize("name", SCENES)
def test_a_specked_image_is_solved_as_well_as_a_clean_one(name: str) -> None:
    scene = SCENES[name]
    image, mask = _photo(scene)
    specked, hit = _specked(image, mask)
    found, specks = replace_specks(specked, mask=mask)
    assert (specks & hit).sum() >= 0.95 * hit.sum()
    assert _error(scene, found, mask) < 1.3 * _error(scene, image, mask)


def test_without_it_specks_drag_a_basin_forward() -> None:
    scene = SCENES["bump"]
    image, mask = _photo(scene)
    specked, _ = _specked(image, mask)
    assert _error(scene, specked, mask) > 30 * _error(scene, image, mask)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_specks_of_up_to_three_pixels(size: int) -> None:
    image = np.full((20, 20), 0.5)
    image[8 : 8 + size, 9 : 9 + size] = 2.0
    found, specks = replace_specks(image)
    assert specks.sum() == size**2
    np.testing.assert_array_equal(found, 0.5)


def test_larger_things_and_lines_belong_to_the_surface() -> None:
    image = np.full((30, 30), 0.5)
    image[5:9, 5:9] = 2.0
    image[20, 3:25] = 2.0
    image[10:28, 27] = 2.0
    assert not replace_specks(image)[1].any()


def test_dark_specks_and_noise_are_left() -> None:
    rng = np.random.default_rng(1)
    image = 0.5 + 0.02 * rng.standard_normal((50, 50))
    image[10, 10] = 0.0
    found, specks = replace_specks(image)
    assert not specks.any()
    assert found[10, 10] == 0.0


def test_specks_at_the_edge_of_a_mask_are_found_by_what_is_inside() -> None:
    image, mask = np.full((20, 20), 0.5), np.zeros((20, 20), bool)
    mask[5:15, 5:15] = True
    image[~mask] = np.nan
    image[5, 5] = image[14, 9] = 1.5
    found, specks = replace_specks(image, mask=mask)
    assert specks.sum() == 2
    np.testing.assert_array_equal(found[mask], 0.5)
    assert np.isnan(found[~mask]).all()


def test_blocks_of_rows_leave_no_seam() -> None:
    rng = np.random.default_rng(2)
    image = 0.5 + 0.1 * rng.random((700, 600))
    hit = rng.random(image.shape) < 0.002
    image[hit] = 2.0
    assert (replace_specks(image)[1] & hit).sum() >= 0.99 * hit.sum()
    part, _ = replace_specks(image[100:300])
    np.testing.assert_array_equal(part[10:-10], replace_specks(image)[0][110:290])


def test_negative_light_is_refused() -> None:
    with pytest.raises(InputError, match="goes down to -1"):
        replace_specks([[1.0, -1.0]])
