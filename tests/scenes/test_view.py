"""What a camera sees of a mesh: exact depths, and jumps where one part hides another."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from solids import plate, rotation, strip

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.masks import rim
from persfs_cl.scenes import view as seen
from persfs_cl.scenes.meshes import mesh_scene
from persfs_cl.scenes.view import mesh_view
from persfs_cl.surface import geometry as surface
from persfs_cl.surface import triangulation

SHAPE = (60, 80)
CAMERA = Camera(focal_length=(90.0, 85.0))


def rays(camera: Camera = CAMERA, shape: tuple[int, int] = SHAPE) -> Array:
    """Direction (x, y, 1) of every pixel, so that the distance along it is the depth."""
    return surface.points(np.ones(shape), camera)


def sphere_depth(centre: Array, radius: float, directions: Array) -> Array:
    """Nearer intersection of the rays with a sphere, NaN where they miss it."""
    squared, along = (directions**2).sum(axis=-1), directions @ centre
    inside = along**2 - squared * (centre @ centre - radius**2)
    return np.asarray((along - np.sqrt(np.where(inside >= 0, inside, np.nan))) / squared)


def test_a_box_is_hit_exactly() -> None:
    turned = rotation(0.7, (1.0, 2.0, 0.5))
    box = trimesh.creation.box((1.0, 0.8, 0.6))
    placed = box.copy().apply_transform(turned)
    placed.apply_translation((0.1, -0.1, 2.0))

    to_box = turned[:3, :3].T
    origin, directions = to_box @ (-0.1, 0.1, -2.0), rays() @ to_box.T
    first, second = (-box.extents / 2 - origin) / directions, (box.extents / 2 - origin) / directions
    enter, leave = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
    assert (enter < leave).sum() > 500

    view = mesh_view(placed, CAMERA, SHAPE)
    np.testing.assert_allclose(view.depth, np.where(enter < leave, enter, np.nan), rtol=1e-12)
    assert not view.walls.any()


def test_a_faceted_sphere_lies_between_two_spheres() -> None:
    centre = np.array([0.2, -0.1, 3.0])
    ball = trimesh.creation.icosphere(subdivisions=5)
    inner_radius = (ball.triangles[:, 0] * ball.face_normals).sum(axis=-1).min()
    assert inner_radius > 0.999
    ball.apply_translation(centre)

    view = mesh_view(ball, CAMERA, SHAPE)
    outer, inner = (sphere_depth(centre, radius, rays()) for radius in (1.0, inner_radius))
    hit = np.isfinite(view.depth)
    assert hit[np.isfinite(inner)].all()
    assert not hit[np.isnan(outer)].any()
    certain = np.isfinite(inner)
    assert (view.depth >= outer - 1e-12)[certain].all()
    assert (view.depth <= inner + 1e-12)[certain].all()
    assert not view.jump_right.any()
    assert not view.jump_down.any()


@pytest.mark.parametrize("chunk", [1, 1 << 18])
def test_a_depth_map_comes_back_from_its_mesh(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Corners lie on the pixel centres, and slopes are steep: the surface is nowhere interrupted all the same."""
    shape = (12, 15)
    monkeypatch.setattr(seen, "_CANDIDATES", 7 * chunk)
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    depth = 2.0 + np.tanh(columns - 6.3 + 0.2 * rows) + 0.1 * np.sin(rows)
    depth[3:6, 4:7] = np.nan
    assert np.nanmax(np.abs(np.diff(depth, axis=1)) * 90.0 / depth[:, :-1]) > 20

    view = mesh_view(triangulation.mesh(depth, CAMERA), CAMERA, shape)
    np.testing.assert_allclose(view.depth, depth, rtol=1e-12)
    assert not view.walls.any()


def test_walls_are_the_outline_of_what_is_in_front() -> None:
    both = trimesh.util.concatenate([plate(0.5, 0.3, -1.0), plate(2.0, 2.0, 0.0)])
    assert isinstance(both, trimesh.Trimesh)
    # The mesh is seen from +z: turned about, the small plate is in front.
    scene = mesh_scene(both, (41, 50), turn=180.0)
    near = scene.depth < 1.0
    assert near.sum() > 50
    assert scene.walls is not None
    np.testing.assert_array_equal(scene.walls, rim(near))
    # Both plates face the camera: no slope looks across the jump.
    for slopes in scene.log_depth_gradient:
        np.testing.assert_allclose(slopes[scene.mask], 0.0, atol=1e-10)


def test_a_steep_step_is_no_wall_but_an_overhang_is() -> None:
    step = mesh_view(strip((-9.0, 3.0), (0.0, 3.0), (0.01, 2.0), (9.0, 2.0)), CAMERA, SHAPE)
    overhang = mesh_view(strip((-9.0, 3.0), (0.0, 3.0), (-0.2, 2.0), (9.0, 2.0)), CAMERA, SHAPE)
    grid = CAMERA.grid(SHAPE)
    for view, edge in ((step, 0.0), (overhang, -0.1)):
        np.testing.assert_allclose(view.depth[:, grid.x < edge], 3.0)
    np.testing.assert_allclose(step.depth[:, grid.x > 0.005], 2.0)
    np.testing.assert_allclose(overhang.depth[:, grid.x > -0.1], 2.0)

    assert not step.walls.any()
    assert not overhang.jump_down.any()
    expected = np.zeros(SHAPE, dtype=bool)
    expected[:, np.flatnonzero(grid.x > -0.1)[0]] = True
    np.testing.assert_array_equal(overhang.walls, expected)
