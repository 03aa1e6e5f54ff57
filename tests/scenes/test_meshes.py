from __future__ import annotations

import importlib.metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from solids import plate, rotation, strip

from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.masks import connected
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.scenes.view import mesh_view
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.surface import geometry as surface

SHAPE = (60, 80)
CAMERA = Camera(focal_length=(90.0, 85.0))


@pytest.mark.parametrize("shape", [(60, 100), (100, 60)])
@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_the_object_fills_the_view_up_to_the_margin(shape: tuple[int, int], margin: float) -> None:
    scene = mesh_scene(trimesh.creation.icosphere(subdivisions=4), shape, focal_length=70.0, margin=margin)
    rows, columns = np.nonzero(scene.mask)
    smaller = min(shape)
    for at, size in ((rows, shape[0]), (columns, shape[1])):
        assert abs((at.min() + at.max()) / 2 - (size - 1) / 2) <= 0.5
        assert at.max() - at.min() + 1 == pytest.approx(smaller * (1 - 2 * margin), abs=2.5)


def test_distance_is_the_unit_of_depth() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    near, far = mesh_scene(ball, (30, 30)), mesh_scene(ball, (30, 30), distance=7.0)
    np.testing.assert_allclose(far.depth, 7.0 * near.depth, rtol=1e-12)
    np.testing.assert_allclose(far.image, near.image, atol=1e-12)


def test_front_up_and_turn() -> None:
    """A ball with a knob on its front, one on its top, both seen where they belong."""
    ball, front, top = (trimesh.creation.icosphere(3, radius) for radius in (1.0, 0.3, 0.2))
    front.apply_translation((0.0, 0.0, 1.0))
    top.apply_translation((0.0, 1.0, 0.0))
    mesh = trimesh.util.concatenate([ball, front, top])
    assert isinstance(mesh, trimesh.Trimesh)

    def nearest(scene: Scene) -> tuple[float, float]:
        """Column and row of the nearest pixel, from the middle of the image."""
        row, column = np.unravel_index(np.nanargmin(scene.depth), scene.depth.shape)
        return float(column) - 40.0, float(row) - 40.0

    scene = mesh_scene(mesh, (81, 81))
    assert abs(nearest(scene)[0]) <= 1
    rows, columns = np.nonzero(scene.mask)
    np.testing.assert_allclose(columns[rows == rows.min()].mean(), 40.0, atol=1)
    assert nearest(mesh_scene(mesh, (81, 81), turn=30.0))[0] > 5
    assert nearest(mesh_scene(mesh, (81, 81), turn=-30.0))[0] < -5

    lying = mesh.copy().apply_transform(rotation(np.pi / 2, (1.0, 0.0, 0.0)))
    np.testing.assert_allclose(mesh_scene(lying, (81, 81), up="z").depth, scene.depth, rtol=1e-9)


@pytest.mark.parametrize("light", [ParallelLight(), ParallelLight(0.4, -0.3), FlashLight()])
def test_a_ball_is_known_where_it_faces_the_light(light: Any) -> None:
    scene = mesh_scene(trimesh.creation.icosphere(subdivisions=6), (81, 81), light=light)
    grid = scene.camera.grid((81, 81))
    radius = 1.0 - np.nanmin(scene.depth)
    to_light = np.array([-light.p0, -light.q0, -1.0]) / light.norm if isinstance(light, ParallelLight) else (0, 0, -1)
    x, y, z = np.array([0.0, 0.0, 1.0]) + radius * np.asarray(to_light)
    rows, columns = np.nonzero(np.isfinite(scene.known_depth))
    # Facets are as flat as the ball is round over a pixel or two.
    assert 1 <= len(rows) <= 9
    assert np.hypot(grid.x[columns] - x / z, grid.y[rows, 0] - y / z).max() <= 3 * grid.dx
    np.testing.assert_array_equal(scene.known_depth[rows, columns], scene.depth[rows, columns])


def test_noise_and_levels_are_on_the_object_alone() -> None:
    scene = mesh_scene(trimesh.creation.icosphere(), (40, 40), bits=4, noise=0.05, seed=3)
    assert not scene.image[~scene.mask].any()
    np.testing.assert_allclose(scene.image * 15, np.round(scene.image * 15), atol=1e-12)
    other = mesh_scene(trimesh.creation.icosphere(), (40, 40), bits=4, noise=0.05, seed=4)
    assert (other.image != scene.image).sum() > 100


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj", ".glb"])
def test_meshes_are_read_from_files(suffix: str, tmp_path: Path) -> None:
    """STL repeats its vertices, and only joined faces make a surface."""
    mesh = strip((-1.0, 0.0), (0.1, 0.0), (0.2, -1.0), (1.0, -1.0), half_height=0.5)
    mesh.export(tmp_path / f"step{suffix}")
    scene = mesh_scene(tmp_path / f"step{suffix}", (30, 50))
    np.testing.assert_allclose(scene.depth, mesh_scene(mesh, (30, 50)).depth, rtol=1e-5)
    assert scene.name == "step"
    assert np.nanmax(np.abs(np.diff(scene.depth))) > 0.2
    assert scene.walls is not None
    assert not scene.walls.any()


@pytest.mark.parametrize("turn", [0.0, 90.0])
def test_the_stanford_bunny(turn: float) -> None:
    light = FlashLight(gain=2.0)
    scene = mesh_scene(stanford_bunny(), (180, 180), up="z", turn=turn, focal_length=197.0, light=light)
    mask, walls = scene.mask, scene.walls
    assert walls is not None
    assert 0.25 < mask.mean() < 0.5
    assert (scene.depth[mask] > 0).all()
    assert 0.3 < np.ptp(scene.depth[mask]) < 0.6
    start = np.zeros_like(mask)
    start.flat[np.flatnonzero(mask)[0]] = True
    np.testing.assert_array_equal(connected(start, mask), mask)

    # The ears, chin and legs hide something; most of the bunny hides nothing.
    assert 20 < walls.sum() < 0.02 * mask.sum()
    assert not walls[~mask].any()

    grid = scene.camera.grid(mask.shape)
    shaded = light.brightness(np.log(scene.depth), *scene.log_depth_gradient, grid.x, grid.y, scene.reflectance)
    np.testing.assert_allclose(scene.image, np.where(mask, shaded, 0.0))
    # Away from the walls these are the slopes of any depth map.
    expected = surface.log_depth_gradient(scene.depth, scene.camera)
    beside = np.pad(walls, 1)
    beside = beside[:-2, 1:-1] | beside[2:, 1:-1] | beside[1:-1, :-2] | beside[1:-1, 2:] | walls
    for slopes, others in zip(scene.log_depth_gradient, expected, strict=True):
        np.testing.assert_allclose(slopes[~beside], others[~beside])
        assert (slopes[beside] != others[beside]).any()


def test_a_missing_bunny_says_where_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "distribution", missing)
    with pytest.raises(InputError, match="pymeshfix"):
        stanford_bunny()


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"mesh": np.zeros((3, 3))}, "ndarray"),
        ({"mesh": trimesh.Trimesh()}, "0 faces"),
        ({"mesh": trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, np.inf, 0)], [(0, 1, 2)], process=False)}, "1 coord"),
        ({"mesh": trimesh.Trimesh([(1, 1, 1)], [(0, 0, 0)], process=False)}, "spans"),
        ({"mesh": plate(1.0, 1e-4, 0.0), "shape": (4, 4)}, "too small"),
        ({"mesh": "missing.ply"}, "does not exist"),
        ({"shape": (2, 9)}, "shape"),
        ({"up": "x"}, "up='x'"),
        ({"turn": np.nan}, "turn=nan"),
        ({"distance": 0.0}, "distance=0.0"),
        ({"margin": 0.5}, "margin=0.5"),
        ({"margin": np.nan}, "margin=nan"),
        ({"light": "sun"}, "light='sun'"),
        ({"bits": 0}, "bits=0"),
    ],
)
def test_impossible_arguments_are_named(keywords: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"mesh": trimesh.creation.icosphere(1), "shape": (9, 9)} | keywords
    with pytest.raises(InputError, match=message):
        mesh_scene(**arguments)


def test_broken_files_and_meshes_behind_the_camera_are_named(tmp_path: Path) -> None:
    (tmp_path / "broken.ply").write_bytes(b"ply\nformat nonsense")
    with pytest.raises(InputError, match=r"broken\.ply"):
        mesh_scene(tmp_path / "broken.ply")
    with pytest.raises(InputError, match="depths from -1 to 1"):
        mesh_view(trimesh.creation.icosphere(), CAMERA, SHAPE)
