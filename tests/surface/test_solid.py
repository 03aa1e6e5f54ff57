"""Solids to be printed: closed, to size, and the surface on top."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.surface import solid
from persfs_cl.surface.simplify import simplified_mesh
from persfs_cl.surface.solid import Block, solid_mesh

SHAPE = (24, 30)
CAMERA = ps.Camera((30.0, 33.0))
rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]


def relief(seed: int = 0) -> Array:
    return np.asarray(2.0 + 0.3 * np.sin(columns / 3.0 + seed) * np.cos(rows / 4.0))


MASKS: dict[str, Mask] = {
    "whole": np.ones(SHAPE, bool),
    "round": np.hypot(rows - 11, columns - 14) < 10,
    "holes": ~((np.abs(rows - 8) < 3) & (np.abs(columns - 9) < 3)) & ~((rows == 16) & (columns == 20)),
    "pieces": (columns % 10 < 7) & (rows % 9 < 6),
    # Squares whose corners touch in a pixel, and in nothing but a diagonal.
    "touching": ((rows // 4 + columns // 4) % 2 == 0) | ((rows % 4 == 0) & (columns % 4 == 0)),
    "diagonal": (rows // 3 + columns // 3) % 2 == 0,
    "single pixels too": (np.hypot(rows - 11, columns - 14) < 6) | ((rows % 5 == 0) & (columns % 5 == 0)),
    "corner": rows + columns < 12,
    "three pixels": (rows < 2) & (columns < 2) & (rows + columns < 2),
}


def require_printable(solid: trimesh.Trimesh) -> None:
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0.0
    np.testing.assert_allclose(solid.bounds[0], 0.0, atol=1e-5)


def with_mask(mask: Mask, seed: int = 0) -> Array:
    return np.where(mask, relief(seed), np.nan)


@pytest.mark.parametrize("name", MASKS)
@pytest.mark.parametrize("axis", [(14.5, 11.5), (-20.0, 60.0)])
def test_a_solid_is_closed_and_to_size_as_other_programs_read_it(
    name: str, axis: tuple[float, float], tmp_path: Path
) -> None:
    camera = ps.Camera((30.0, 33.0), axis)
    solid = solid_mesh(with_mask(MASKS[name]), camera, Block(80.0, 2.5))
    require_printable(solid)
    # All that its file says of corners is where they are.
    solid.export(tmp_path / "solid.stl")
    read = trimesh.load_mesh(tmp_path / "solid.stl")
    require_printable(read)
    assert read.volume == pytest.approx(solid.volume, rel=1e-5)
    for one in (solid, read):
        assert max(one.extents[:2]) == pytest.approx(80.0, rel=1e-6)
        # The lowest point of the top is above the base.
        assert np.sort(np.unique(one.vertices[:, 2].round(4)))[1] == pytest.approx(2.5, abs=1e-3)


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.3, 1.0))
def test_any_mask_gives_a_closed_solid(seed: int, share: float) -> None:
    random = np.random.default_rng(seed)
    shape = random.integers(2, 12, 2)
    depth = np.where(random.random(shape) < share, random.uniform(1.0, 3.0, shape), np.nan)
    pixels = ~np.isnan(depth)
    corners = [pixels[a : a + shape[0] - 1, b : b + shape[1] - 1] for a in (0, 1) for b in (0, 1)]
    if np.sum(corners, axis=0).max() < 3:
        with pytest.raises(ps.InputError, match=r"three neighbouring pixels|NaN everywhere"):
            solid_mesh(depth, CAMERA, Block())
        return
    solid = solid_mesh(depth, CAMERA, Block())
    require_printable(solid)
    # With corners joined by their places alone.
    merged = trimesh.Trimesh(solid.vertices.astype(np.float32), solid.faces)
    assert len(merged.vertices) == len(solid.vertices)
    require_printable(merged)


def test_the_volume_is_that_along_the_lines_of_sight() -> None:
    """Of a pyramid's frustum, between a sphere around the camera and a plane, by integration over the image."""
    side, camera = 201, ps.Camera(200.0)
    grid = camera.grid((side, side))
    depth = 1.0 / np.sqrt(1.0 + grid.x**2 + grid.y**2)
    solid = solid_mesh(depth, camera, Block(100.0, 4.0))
    # The deepest point is in the middle, at depth 1.
    half = float(grid.x[-1])
    scale = (100.0 - 4.0 * 2.0 * half) / (2.0 * half)
    bottom = 1.0 + 4.0 / scale
    # z² of each line of sight from top to bottom, over dx dy.
    line, weights = np.polynomial.legendre.leggauss(40)
    x, y = np.meshgrid(half * line, half * line)
    top = 1.0 / np.sqrt(1.0 + x**2 + y**2)
    volume = half**2 * np.sum(np.outer(weights, weights) * (bottom**3 - top**3) / 3.0) * scale**3
    assert solid.volume == pytest.approx(volume, rel=1e-3)
    assert solid.extents[2] == pytest.approx((bottom - depth.min()) * scale)


def test_proportions_stay() -> None:
    mask = MASKS["round"]
    solid = solid_mesh(with_mask(mask), CAMERA, Block(50.0, 2.0))
    points = np.stack([CAMERA.grid(SHAPE).x + 0 * rows, -CAMERA.grid(SHAPE).y + 0 * rows, -1 + 0.0 * rows], axis=-1)
    points = (points * relief()[..., None])[mask]
    count = len(points)
    top = np.asarray(solid.vertices)[:count]
    scale = np.ptp(top, axis=0) / np.ptp(points, axis=0)
    np.testing.assert_allclose(scale, scale[0], rtol=1e-9)
    np.testing.assert_allclose(top - top[0], scale[0] * (points - points[0]), atol=1e-9)
    # Each point of the bottom is on the line of sight of one of the top.
    bottom = np.asarray(solid.vertices)[count:]
    np.testing.assert_allclose(bottom[:, 2], 0.0, atol=1e-9)
    assert solid.faces.max() + 1 == 2 * count


def test_pieces_and_holes_stay_what_they_are() -> None:
    assert len(solid_mesh(with_mask(MASKS["pieces"]), CAMERA, Block()).split()) == 9
    # Once around for each hole: a torus has 0, a sphere 2.
    assert solid_mesh(with_mask(MASKS["holes"]), CAMERA, Block()).euler_number == 2 - 2 * 2


@pytest.mark.parametrize("name", ["whole", "round", "holes", "pieces", "touching"])
def test_few_triangles_are_closed_too(name: str) -> None:
    large = np.kron(MASKS[name], np.ones((4, 4), bool))
    y, x = np.mgrid[: large.shape[0], : large.shape[1]]
    depth = np.where(large, 2.0 + 0.1 * np.sin(x / 12.0) * np.cos(y / 15.0), np.nan)
    camera = ps.Camera(120.0)
    whole, few = (solid_mesh(depth, camera, Block(), faces) for faces in (None, 4000))
    assert len(few.faces) <= 4000 < len(whole.faces)
    require_printable(few)
    require_printable(trimesh.Trimesh(few.vertices.astype(np.float32), few.faces))
    assert few.volume == pytest.approx(whole.volume, rel=0.01)
    assert max(few.extents[:2]) == pytest.approx(100.0)


@pytest.mark.parametrize("most", [100, 150, 300, 1000])
@pytest.mark.parametrize("name", MASKS)
def test_no_more_triangles_than_were_asked_for(name: str, most: int) -> None:
    solid = solid_mesh(with_mask(MASKS[name]), CAMERA, Block(), most)
    assert len(solid.faces) <= most
    require_printable(solid)


def test_fewer_triangles_than_holes_take_are_refused_with_a_number_that_is_enough(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # How far simplification gets is its own affair; here, not below 120.
    monkeypatch.setattr(solid, "simplified_mesh", lambda z, camera, most: simplified_mesh(z, camera, max(most, 120)))
    down, across = np.mgrid[:40, :40]
    depth = np.where((across % 2 == 0) | (down % 2 == 0), 2.0 + 0.01 * np.sin(down), np.nan)
    with pytest.raises(ps.InputError, match=r"mesh_faces=100 is too few for a solid .*: give \d+ or more") as refused:
        solid_mesh(depth, CAMERA, Block(), 100)
    enough = int(re.findall(r"give (\d+) or more", str(refused.value))[0])
    assert 100 < len(solid_mesh(depth, CAMERA, Block(), enough).faces) <= enough


def test_a_wall_is_no_gap() -> None:
    scene = ps.bump((20, 20), light=ps.FlashLight())
    walls = np.zeros(scene.image.shape, bool)
    walls[:, 10] = True
    solution = ps.reconstruct(scene.image, scene.camera, light=scene.light, walls=walls)
    assert len(solution.mesh().split(only_watertight=False)) == 2
    solid = solution.solid(40.0, 1.0)
    require_printable(solid)
    assert len(solid.split()) == 1


@pytest.mark.parametrize("keywords", [{"width": 0.0}, {"base": -1.0}, {"width": "60"}, {"base": float("nan")}])
def test_impossible_sizes_are_refused(keywords: dict[str, Any]) -> None:
    with pytest.raises(ps.InputError, match=r"(width|base)=.* is not a length in millimetres"):
        Block(**keywords)


def test_a_base_that_is_wider_than_all_is_refused() -> None:
    with pytest.raises(ps.InputError, match=r"base=20.0 is too thick for width=10.0"):
        solid_mesh(relief(), CAMERA, Block(10.0, 20.0))
    with pytest.raises(ps.InputError, match="three neighbouring pixels"):
        solid_mesh(with_mask((rows % 2 == 0) & (columns % 2 == 0)), CAMERA, Block())
