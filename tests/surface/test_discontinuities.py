"""Walls after the solve: the right side, its depth, and a surface that is cut there and nowhere else."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.choices import Precision
from persfs_cl.masks import Neighbours, rim
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.surface import geometry as surface
from persfs_cl.surface import plots as pictures
from persfs_cl.surface import triangulation
from persfs_cl.surface.discontinuities import REACH, fill_walls
from persfs_cl.surface.geometry import Discontinuities

SHAPE = (60, 70)
CAMERA = ps.Camera(focal_length=(80.0, 90.0))
FLASH = ps.FlashLight(gain=2.0)
NEAR, FAR = (0.3, 0.2, 1.0), (-0.5, 0.4, 1.6)
"""Planes as (slope in x, slope in y, depth of the middle)."""

rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
REGIONS: dict[str, Mask] = {
    "upright": columns < 33,
    "level": rows >= 24,
    "diagonal": rows + columns < 60,
    "slanting": 3 * rows + columns < 110,
    "square": (np.abs(rows - 30) < 12) & (np.abs(columns - 35) < 15),
    "disc": np.hypot(rows - 28.3, columns - 31.7) < 17.2,
}
"""Of what is in front."""


def plane(tilt: tuple[float, float, float], light: Light = FLASH) -> tuple[Array, Array]:
    """Depth and image of a plane; ln z is not linear in the image."""
    grid = CAMERA.grid(SHAPE)
    x, y = np.broadcast_arrays(grid.x, grid.y)
    below = 1.0 - tilt[0] * x - tilt[1] * y
    depth = tilt[2] / below
    return depth, light.brightness(np.log(depth), tilt[0] / below, tilt[1] / below, x, y, ps.Lambertian())


def step(front: Mask, light: Light = FLASH) -> tuple[Array, Array]:
    """Depth and image of one plane in front of another."""
    near, far = plane(NEAR, light), plane(FAR, light)
    return np.where(front, near[0], far[0]), np.where(front, near[1], far[1])


def behind(front: Mask) -> Mask:
    return ~front & Neighbours.of(front).any


def thick(front: Mask) -> Mask:
    """Two pixels in front and one behind."""
    return behind(front) | rim_inside(front) | (front & Neighbours.of(rim_inside(front)).any)


def rim_inside(front: Mask) -> Mask:
    return front & Neighbours.of(~front).any


WALLS: dict[str, Callable[[Mask], Mask]] = {
    "in front": rim_inside,
    "behind": behind,
    "two pixels": lambda front: rim_inside(front) | behind(front),
    "three pixels": thick,
}
every_region = pytest.mark.parametrize("region", REGIONS)
every_wall = pytest.mark.parametrize("kind", WALLS)


def filled(depth: Array, image: Array, walls: Mask, known: Array | None = None) -> tuple[Array, Discontinuities]:
    """Depth with walls filled from exact depths beside them."""
    log_depth = np.log(np.where(walls, np.nan, depth))
    given = np.full(np.count_nonzero(walls), np.nan) if known is None else np.log(known[walls])
    discontinuities = fill_walls(log_depth, walls, image, given)
    return np.exp(log_depth), discontinuities


def jumps(front: Mask) -> Discontinuities:
    """The outline of what is in front."""
    return Discontinuities(front[:, 1:] != front[:, :-1], front[1:] != front[:-1])


def parts(mesh: trimesh.Trimesh) -> list[int]:
    """Numbers of vertices that faces join, in descending order; a vertex without a face is a part of its own."""
    labels = np.arange(len(mesh.vertices))
    one, other = mesh.edges.T
    before = np.full_like(labels, -1)
    while (labels != before).any():
        before = labels.copy()
        np.minimum.at(labels, one, before[other])
        np.minimum.at(labels, other, before[one])
        labels = labels[labels]
    return sorted(np.unique(labels, return_counts=True)[1].tolist(), reverse=True)


@every_region
@every_wall
def test_depth_and_side_are_right_where_two_planes_overlap(region: str, kind: str) -> None:
    front = REGIONS[region]
    depth, image = step(front)
    walls = WALLS[kind](front)
    assert walls.sum() > 40
    found, discontinuities = filled(depth, image, walls)
    # The depths of the two sides differ by more than 0.3.
    error = np.abs(found - depth)
    wrong = error > 0.1
    assert wrong.sum() <= (1 if kind == "three pixels" else 0)
    assert error[~wrong].max() < 0.01
    if not wrong.any():
        expected = jumps(front)
        np.testing.assert_array_equal(discontinuities.right, expected.right)
        np.testing.assert_array_equal(discontinuities.down, expected.down)


@every_region
def test_a_mesh_has_the_parts_of_the_scene_and_no_long_edge(region: str) -> None:
    front = REGIONS[region]
    depth, image = step(front)
    found, discontinuities = filled(depth, image, WALLS["in front"](front))
    mesh = triangulation.mesh(found, CAMERA, discontinuities=discontinuities)
    assert parts(mesh) == sorted([int(front.sum()), int((~front).sum())], reverse=True)
    assert mesh.edges_unique_length.max() < 0.1
    whole = triangulation.mesh(found, CAMERA)
    assert whole.edges_unique_length.max() > 0.3
    # Of each square that the jump crosses up to one triangle remains, of others both.
    crossed = (
        discontinuities.right[:-1]
        | discontinuities.right[1:]
        | discontinuities.down[:, :-1]
        | discontinuities.down[:, 1:]
    )
    assert len(whole.faces) - 2 * crossed.sum() <= len(mesh.faces) <= len(whole.faces) - crossed.sum()


@pytest.mark.parametrize("light", [ps.ParallelLight(0.2, -0.1), FLASH, ps.FlashLight(offset=(0.05, 0.0, 0.0))])
def test_normals_and_brightness_do_not_look_across(light: Light) -> None:
    front = REGIONS["disc"]
    depth, image = step(front, light)
    found, discontinuities = filled(depth, image, thick(front))
    exact = [surface.normals(plane(tilt)[0], CAMERA) for tilt in (NEAR, FAR)]
    normals = surface.normals(found, CAMERA, discontinuities)
    # One-sided differences are of first order.
    np.testing.assert_allclose(normals, np.where(front[..., None], *exact), atol=0.01)
    again = ps.render(found, CAMERA, light=light, discontinuities=discontinuities)
    np.testing.assert_allclose(again, image, rtol=0.03)
    assert (ps.render(found, CAMERA, light=light) < 0.2 * image)[rim_inside(front)].any()


@pytest.mark.quick_where(holds=lambda given: (given["precision"] == "float32") == (given["light"] == FLASH))
@pytest.mark.parametrize("light", [ps.ParallelLight(0.2, -0.1), FLASH])
def test_the_kernel_renders_cuts_like_the_formula(light: Light, device: ps.Device, precision: Precision) -> None:
    random = np.random.default_rng(5)
    depth = np.exp(0.01 * random.standard_normal((23, 31)))
    depth[random.uniform(size=depth.shape) > 0.9] = np.nan
    discontinuities = Discontinuities(random.uniform(size=(23, 30)) > 0.7, random.uniform(size=(22, 31)) > 0.7)
    p, q = surface.log_depth_gradient(depth, CAMERA, discontinuities)
    grid = CAMERA.grid((23, 31))
    expected = light.brightness(np.log(depth), p, q, grid.x, grid.y, ps.Lambertian())
    image = ps.render(depth, CAMERA, light=light, discontinuities=discontinuities, device=device, precision=precision)
    np.testing.assert_allclose(image, expected, atol=1e-4 if precision == "float32" else 1e-12)


@pytest.mark.parametrize("thickness", [4, 7, 2 * REACH, 2 * REACH + 5])
def test_thick_walls_are_filled_as_far_as_the_reach(thickness: int) -> None:
    front = REGIONS["upright"]
    depth, image = step(front)
    first = 33 - thickness // 2
    found, discontinuities = filled(depth, image, (columns >= first) & (columns < first + thickness))
    too_far = (columns >= first + REACH) & (columns < first + thickness - REACH)
    np.testing.assert_array_equal(np.isnan(found), too_far)
    np.testing.assert_allclose(found[~too_far], depth[~too_far], rtol=0.05)
    assert not discontinuities.down[~(too_far[1:] | too_far[:-1])].any()
    if not too_far.any():
        np.testing.assert_array_equal(discontinuities.right, jumps(front).right)


@pytest.mark.parametrize(
    "walls",
    [columns < 2, columns >= 68, rows < 1, rows == 59, (rows < 2) | (columns > 66)],
    ids=["left", "right", "top", "bottom", "corner"],
)
def test_walls_along_the_edge_of_the_image(walls: Mask) -> None:
    depth, image = plane(NEAR)
    found, discontinuities = filled(depth, image, walls)
    np.testing.assert_allclose(found, depth, rtol=2e-3)
    assert not discontinuities.right.any()
    assert not discontinuities.down.any()


def test_where_nothing_jumps_around_an_end_nothing_is_cut() -> None:
    depth, image = plane(NEAR)
    for walls in ((rows == 20) & (columns == 30), (rows == 20) & (np.abs(columns - 30) < 2)):
        found, discontinuities = filled(depth, image, walls)
        np.testing.assert_allclose(found, depth, rtol=1e-4)
        assert not discontinuities.right.any()
        assert not discontinuities.down.any()
    # A longer one is a seam, but for its ends, in a surface that is right all the same.
    walls = (rows == 20) & (columns > 10) & (columns < 50)
    found, discontinuities = filled(depth, image, walls)
    np.testing.assert_allclose(found, depth, rtol=1e-4)
    assert 30 < discontinuities.down.sum() < 39
    assert not discontinuities.right.any()
    assert parts(triangulation.mesh(found, CAMERA, discontinuities=discontinuities)) == [depth.size]


def test_three_sides_meet() -> None:
    front, left = REGIONS["level"], columns < 35
    sides = plane(NEAR), plane(FAR), plane((0.0, -0.6, 2.2))
    depth, image = (np.select([front, left], given[:2], given[2]) for given in zip(*sides, strict=True))
    found, discontinuities = filled(depth, image, rim_inside(front) | (~front & (columns == 35)))
    # All but the pixel where they meet.
    assert np.count_nonzero(np.abs(found / depth - 1.0) > 2e-3) <= 1
    sizes = sorted((int(part.sum()) for part in (front, ~front & left, ~front & ~left)), reverse=True)
    assert parts(triangulation.mesh(found, CAMERA, discontinuities=discontinuities)) == pytest.approx(sizes, abs=1)


@pytest.mark.parametrize("turned", [np.transpose, np.fliplr, np.flipud, np.rot90], ids=lambda turned: turned.__name__)
def test_turned_images_have_turned_results(turned: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
    """Including noise that no side fits well."""
    random = np.random.default_rng(8)
    front = REGIONS["disc"]
    depth = step(front)[0] * np.exp(0.01 * random.standard_normal(SHAPE))
    image = random.uniform(0.2, 1.0, SHAPE)
    walls = thick(front) | (random.uniform(size=SHAPE) > 0.98)
    depth[random.uniform(size=SHAPE) > 0.98] = np.nan
    found, discontinuities = filled(depth, image, walls)
    others, other_cuts = filled(turned(depth), turned(image), turned(walls))
    np.testing.assert_allclose(others, turned(found), rtol=1e-12)
    np.testing.assert_array_equal(count_cuts(other_cuts, others.shape), turned(count_cuts(discontinuities, SHAPE)))


def count_cuts(discontinuities: Discontinuities, shape: tuple[int, ...]) -> NDArray[np.intp]:
    """How many of its four neighbours each pixel is cut off from."""
    count = np.zeros(shape, dtype=np.intp)
    count[:, :-1] += discontinuities.right
    count[:, 1:] += discontinuities.right
    count[:-1] += discontinuities.down
    count[1:] += discontinuities.down
    return count


def test_a_known_depth_on_a_wall_is_kept_and_tells_its_side() -> None:
    front = REGIONS["upright"]
    depth, image = step(front)
    walls = rim_inside(front)
    known = np.full(SHAPE, np.nan)
    known[10, 32], known[40, 32] = 0.97, 1.5
    found, discontinuities = filled(depth, image, walls, known)
    assert (found[10, 32], found[40, 32]) == pytest.approx((0.97, 1.5), rel=1e-12)
    assert (discontinuities.right[10, 31], discontinuities.right[10, 32]) == (False, True)
    assert (discontinuities.right[40, 31], discontinuities.right[40, 32]) == (True, False)
    assert discontinuities.down[39:41, 32].all()
    assert discontinuities.down.sum() == 2


@pytest.mark.parametrize("lost", [np.nan, 0.0])
def test_where_the_image_tells_nothing_the_nearest_side_is_taken(lost: float) -> None:
    front = REGIONS["upright"]
    depth, image = step(front)
    walls = (columns >= 31) & (columns < 34)
    image[walls] = lost
    found, discontinuities = filled(depth, image, walls)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[:, :32], depth[:, :32], rtol=2e-3)
    np.testing.assert_allclose(found[:, 33:], depth[:, 33:], rtol=5e-3)
    assert (discontinuities.right.sum(axis=1) == 1).all()


SOLVERS: dict[str, Mapping[str, object]] = {
    "lax-friedrichs": {"light": ps.ParallelLight(0.3, -0.2)},
    "upwind": {"light": ps.ParallelLight(0.3, -0.2), "scheme": "upwind"},
    "flash": {"light": FLASH},
    "lamp beside the camera": {"light": ps.FlashLight(gain=2.0, offset=(0.02, 0.0, 0.0))},
}


def overlapping(light: Light, shape: tuple[int, int] = (50, 60)) -> tuple[Array, Array, Mask, Array, ps.Camera]:
    """A bump in front of another: depth, image, what is in front, and depths known around each."""
    scene = ps.bump(shape, light=light, relief=0.1)
    front = np.hypot(*(np.mgrid[: shape[0], : shape[1]] - np.array([25.0, 25.0])[:, None, None])) < 15.3
    depth = np.where(front, scene.depth, 1.6 * scene.depth[::-1, ::-1])
    fading = 1.6**-2 if isinstance(light, ps.FlashLight) else 1.0
    image = np.where(front, scene.image, fading * scene.image[::-1, ::-1])
    beside = rim(front) | rim(~front)
    deeper = Neighbours.of(beside).any & ~beside
    return depth, image, front, np.where(deeper, depth, np.nan), scene.camera


@pytest.mark.parametrize("kind", ["in front", "behind", "two pixels"])
@pytest.mark.parametrize("name", SOLVERS)
def test_solutions_have_depth_on_walls(name: str, kind: str) -> None:
    keywords: dict[str, Any] = dict(SOLVERS[name])
    depth, image, front, known, camera = overlapping(keywords["light"])
    walls = WALLS[kind](front)
    solution = ps.reconstruct(image, camera, walls=walls, known_depth=known, **keywords)
    assert solution.solved.all()
    np.testing.assert_allclose(np.exp(solution.log_depth), solution.depth)
    assert solution.walls is not None
    assert solution.discontinuities is not None
    np.testing.assert_array_equal(solution.walls, walls)
    error = np.abs(solution.depth - depth)
    assert (error > 0.2)[walls].mean() <= 0.1
    assert np.median(error[walls]) < 0.03
    pixels = json.loads(json.dumps(solution.report(), allow_nan=False))["pixels"]
    assert (pixels["walls"], pixels["walls_solved"]) == (walls.sum(), walls.sum())
    np.testing.assert_array_equal(solution.confidence().unreliable["on a wall"], walls)
    assert np.isfinite(solution.confidence().slope_error).all()
    mesh = solution.mesh()
    assert mesh.edges_unique_length.max() < 0.15
    assert parts(mesh)[:2] == pytest.approx([(~front).sum(), front.sum()], abs=0.1 * walls.sum())
    assert sum(parts(mesh)[2:]) <= 0.1 * walls.sum()
    # Walls change nothing elsewhere, and in a batch nothing at all.
    (again, bare) = ps.reconstruct_batch(
        [image, image], camera, walls=[walls, None], known_depth=[known, known], **keywords
    )
    np.testing.assert_array_equal(again.depth, solution.depth)
    np.testing.assert_array_equal(again.discontinuities.right, solution.discontinuities.right)  # type: ignore[union-attr] # walls were given
    assert (bare.walls, bare.discontinuities) == (None, None)
    assert "on a wall" not in bare.confidence().unreliable


def test_what_walls_enclose_without_a_known_depth_stays_unreached() -> None:
    scene = ps.bump((40, 50))
    inside = np.zeros((40, 50), dtype=bool)
    inside[12:28, 15:35] = True
    walls = ~inside & Neighbours.of(inside).any
    solution = ps.reconstruct(scene.image, scene.camera, walls=walls, known_depth=scene.known_depth)
    np.testing.assert_array_equal(solution.unreached, inside)
    np.testing.assert_array_equal(np.isnan(solution.depth), inside)
    assert np.abs(solution.depth - scene.depth)[walls].max() < 0.05
    assert parts(solution.mesh()) == [2000 - inside.sum()]


def test_walls_beyond_the_mask_are_no_surface_and_what_is_known_there_is() -> None:
    scene = ps.bump((40, 50), light=FLASH)
    mask, walls = np.zeros((2, 40, 50), dtype=bool)
    mask[:, :30] = True
    walls[20, :] = True
    image = np.where(walls, np.nan, scene.image)
    known = np.full((40, 50), np.nan)
    known[20, 5], known[20, 40] = 0.9, 1.1
    solution = ps.reconstruct(image, scene.camera, light=FLASH, mask=mask, walls=walls, known_depth=known)
    np.testing.assert_array_equal(solution.solved, mask | np.isfinite(known))
    assert (solution.depth[20, 5], solution.depth[20, 40]) == (0.9, 1.1)
    assert solution.walls is not None
    assert solution.walls.sum() == 31
    assert solution.report()["pixels"]["walls_solved"] == 31
    assert np.isfinite(solution.white)


def test_relief_has_no_facet_across_a_cut(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drawn: list[Array] = []
    monkeypatch.setattr(pictures.relief, "_draw_solid", lambda _axes, facets, *_others: drawn.append(facets))
    for size, step_width in ((60, 1), (450, 3)):
        front = np.hypot(*(np.mgrid[:size, :size] - size / 2.1)) < size / 3.3
        camera, depth = ps.Camera(float(size)), np.where(front, 1.0, 2.0)
        drawn.clear()
        pictures.relief_picture(tmp_path / "relief.png", depth, camera, discontinuities=jumps(front))
        (facets,) = drawn
        assert np.ptp(facets[..., 2], axis=1).max() == 0.0
        crossed = 4.0 * 2 * size / 3.3 / step_width
        assert (len(range(0, size, step_width)) - 1) ** 2 - 1.2 * crossed < len(facets)


def test_cuts_of_another_size_are_refused() -> None:
    depth = np.ones((5, 6))
    for wrong, message in (
        (Discontinuities.none((6, 5)), r"discontinuities.right is bool of shape \(6, 4\): give bool of shape \(5, 5\)"),
        (
            Discontinuities(np.zeros((5, 5), bool), np.zeros((4, 6))),  # type: ignore[arg-type]
            r"discontinuities.down is float64 of shape \(4, 6\)",
        ),
    ):
        for use in (
            lambda: surface.log_depth_gradient(depth, CAMERA, wrong),  # noqa: B023 # called at once
            lambda: surface.normals(depth, CAMERA, wrong),  # noqa: B023
            lambda: triangulation.mesh(depth, CAMERA, discontinuities=wrong),  # noqa: B023
            lambda: ps.render(depth, CAMERA, discontinuities=wrong),  # noqa: B023
            lambda: pictures.relief_picture("never.png", depth, CAMERA, discontinuities=wrong),  # noqa: B023
        ):
            with pytest.raises(ps.InputError, match=message):
                use()


@functools.cache
def bunny(turn: float, light: Light) -> Scene:
    return mesh_scene(stanford_bunny(), (270, 270), up="z", turn=turn, focal_length=295.0, light=light)


# Each two of the turn, the width and the light meet.
@pytest.mark.quick_where(
    holds=lambda given: (given["turn"] == 60.0) ^ (given["width"] == 1) ^ isinstance(given["light"], ps.FlashLight)
)
@pytest.mark.parametrize("light", [FLASH, ps.ParallelLight(0.3, -0.2)])
@pytest.mark.parametrize(("width", "most_wrong"), [(1, 0.1), (3, 0.2)])
@pytest.mark.parametrize("turn", [60.0, 270.0])
def test_the_bunny(turn: float, width: int, most_wrong: float, light: Light) -> None:
    scene = bunny(turn, light)
    walls = scene.walls
    assert walls is not None
    walls = walls if width == 1 else scene.mask & (np.max(around(walls.astype(float), 0.0), axis=0) > 0)
    found, discontinuities = filled(scene.depth, scene.image, walls)
    # Of what is beside a wall the nearest and the farthest; where they hardly differ there is no wrong side.
    beside = np.where(scene.mask, scene.depth, np.nan)
    near, far = (
        reduce(around(np.nan_to_num(beside, nan=empty), empty), axis=0)
        for reduce, empty in ((np.min, np.inf), (np.max, -np.inf))
    )
    error = np.abs(found - scene.depth)
    jumping = walls & (far - near > 0.03)
    assert jumping.sum() > 100
    assert (error > 0.5 * (far - near))[jumping].mean() <= most_wrong
    assert np.median(error[walls]) < 0.006
    np.testing.assert_array_equal(
        np.isfinite(surface.normals(found, scene.camera, discontinuities)[..., 0]), scene.mask
    )


def around(values: Array, outside: float) -> list[Array]:
    height, width = values.shape
    padded = np.pad(values, 1, constant_values=outside)
    return [padded[down : down + height, right : right + width] for down in range(3) for right in range(3)]
