"""Noise is found, and taken out but not across edges."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.errors import InputError, UnavailableError
from persfs_cl.preparation.denoise import denoise, noise_of


def test_the_noise_of_an_image_is_found() -> None:
    scene = ps.bump((80, 100), light=ps.FlashLight())
    rng = np.random.default_rng(0)
    for noise in (0.005, 0.02):
        image = scene.image + noise * rng.standard_normal(scene.image.shape)
        assert noise_of(image, np.ones(image.shape, bool)) == pytest.approx(noise, rel=0.05)


def test_noise_is_taken_out_and_an_edge_stays() -> None:
    clean = np.full((60, 60), 0.3)
    clean[:, 30:] = 0.8
    image = clean + 0.02 * np.random.default_rng(1).standard_normal(clean.shape)
    found = denoise(image, 0.8)
    assert np.abs(found - clean).mean() < 0.4 * np.abs(image - clean).mean()
    assert np.abs(found - clean)[:, 29:31].mean() < 0.02


def test_a_noisy_flash_photo_is_solved_better() -> None:
    scene = ps.bumps((60, 80), light=ps.FlashLight())
    image = scene.image + 0.02 * np.random.default_rng(2).standard_normal(scene.image.shape)

    def error(given: object) -> float:
        solution = ps.reconstruct(np.asarray(given), scene.camera, light=scene.light)
        return ps.compare(solution.depth, scene.depth).mean

    assert error(denoise(image, 0.8)) < 0.5 * error(image)


def test_pixels_outside_the_mask_play_no_part() -> None:
    image = 0.5 + 0.02 * np.random.default_rng(3).standard_normal((40, 40))
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    other = np.where(mask, image, np.nan)
    np.testing.assert_array_equal(denoise(image, 0.8, mask=mask)[mask], denoise(other, 0.8, mask=mask)[mask])
    assert np.isnan(denoise(other, 0.8, mask=mask)[~mask]).all()


def test_nothing_is_done_at_strength_0_or_without_noise() -> None:
    image = np.random.default_rng(4).random((20, 20))
    np.testing.assert_array_equal(denoise(image, 0.0), image)
    flat = np.full((20, 20), 0.5)
    np.testing.assert_array_equal(denoise(flat, 0.8), flat)
    np.testing.assert_array_equal(denoise([[1.0, 2.0]], 0.8), [[1.0, 2.0]])


def test_impossible_strengths_are_refused() -> None:
    with pytest.raises(InputError, match="strength=9"):
        denoise(np.ones((5, 5)), 9.0)
    with pytest.raises(InputError, match="denoise=-1"):
        ps.Preparation(denoise=-1.0)


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skimage.restoration", None)
    with pytest.raises(UnavailableError, match=r"pip install 'persfs-cl\[filters\]'"):
        denoise(np.random.default_rng(0).random((9, 9)), 0.8)
