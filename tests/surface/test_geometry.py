from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from persfs_cl import blocks
from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.surface.geometry import Discontinuities, log_depth_gradient, normals, normals_of_rows, points
from persfs_cl.surface.triangulation import mesh

SQUARE = (100.0, 100.0)
OBLONG = (70.0, 130.0)


def a_camera(focal_length: tuple[float, float] = OBLONG) -> Camera:
    return Camera(focal_length=focal_length, principal_point=(1.3, 0.8))


def plane(shape: tuple[int, int], camera: Camera, normal: Array, offset: float) -> Array:
    """Depth of the plane normal . X = offset, in closed form."""
    grid = camera.grid(shape)
    return np.asarray(offset / (normal[0] * grid.x + normal[1] * grid.y + normal[2]))


def sphere(shape: tuple[int, int], camera: Camera, centre: Array, radius: float) -> tuple[Array, Array]:
    """Depth and outward normals of the near side of a sphere, in closed form; NaN beside it."""
    grid = camera.grid(shape)
    rays = np.stack(np.broadcast_arrays(grid.x, grid.y, 1.0), axis=-1)
    along = rays @ centre
    squared = (rays**2).sum(axis=-1)
    inside = along**2 - squared * (centre @ centre - radius**2)
    z = (along - np.sqrt(np.where(inside > 0, inside, np.nan))) / squared
    return z, (z[..., None] * rays - centre) / radius


def holed(shape: tuple[int, int], share: float, seed: int = 0) -> NDArray[np.bool_]:
    """True on the pixels that remain."""
    return np.random.default_rng(seed).random(shape) >= share


def rough_depth(finite: NDArray[np.bool_], seed: int = 1) -> Array:
    return np.where(finite, np.random.default_rng(seed).uniform(0.5, 5.0, finite.shape), np.nan)


def vertex_rgb(surface: trimesh.Trimesh) -> NDArray[np.uint8]:
    assert isinstance(surface.visual, trimesh.visual.ColorVisuals)
    return np.asarray(surface.visual.vertex_colors[:, :3])


@pytest.mark.parametrize("focal_length", [SQUARE, OBLONG])
def test_points_project_back_to_their_pixels(focal_length: tuple[float, float]) -> None:
    depth = rough_depth(holed((9, 14), 0.2))
    x, y, z = np.moveaxis(points(depth, a_camera(focal_length)), -1, 0)
    row, column = np.mgrid[:9, :14]
    known = np.isfinite(depth)
    np.testing.assert_allclose((focal_length[0] * x / z + 1.3)[known], column[known], atol=1e-12)
    np.testing.assert_allclose((focal_length[1] * y / z + 0.8)[known], row[known], atol=1e-12)
    np.testing.assert_array_equal(z, depth)
    np.testing.assert_array_equal(np.isnan(x), ~known)


def test_gradient_is_exact_where_log_depth_is_linear_and_zero_without_a_neighbour() -> None:
    finite = holed((17, 23), 0.45)
    camera = a_camera()
    grid = camera.grid(finite.shape)
    depth = np.where(finite, np.exp(0.3 + 0.7 * grid.x - 1.1 * grid.y), np.nan)
    p, q = log_depth_gradient(depth, camera)

    framed = np.pad(finite, 1)
    beside = framed[1:-1, :-2] | framed[1:-1, 2:]
    above_or_below = framed[:-2, 1:-1] | framed[2:, 1:-1]
    assert (finite & ~beside).any()
    assert (finite & ~above_or_below).any()
    np.testing.assert_allclose(p, np.where(finite, np.where(beside, 0.7, 0.0), np.nan), atol=1e-12)
    np.testing.assert_allclose(q, np.where(finite, np.where(above_or_below, -1.1, 0.0), np.nan), atol=1e-12)


def test_gradient_takes_the_central_difference_inside_and_the_one_sided_at_the_border() -> None:
    camera = Camera(focal_length=(10.0, 20.0))
    log_depth = np.array([[0.0, 1.0, 4.0, 9.0]])
    p, q = log_depth_gradient(np.exp(log_depth), camera)
    np.testing.assert_allclose(p, [[10.0, 20.0, 40.0, 50.0]], rtol=1e-12)
    np.testing.assert_array_equal(q, np.zeros((1, 4)))


def test_a_plane_across_the_optical_axis_faces_the_camera() -> None:
    depth = np.full((5, 7), 3.0)
    np.testing.assert_array_equal(normals(depth, a_camera()), np.broadcast_to([0.0, 0.0, -1.0], (5, 7, 3)))


@pytest.mark.parametrize("focal_length", [SQUARE, OBLONG])
@pytest.mark.parametrize("body", ["plane", "sphere"])
def test_normals_approach_the_exact_ones_with_second_order(body: str, focal_length: tuple[float, float]) -> None:
    towards = np.array([0.4, -0.5, -1.0]) / np.sqrt(1.41)
    worst = []
    for scale in (1, 2, 4):
        camera = Camera(focal_length=(focal_length[0] * scale, focal_length[1] * scale))
        shape = (20 * scale, 30 * scale)
        if body == "plane":
            depth = plane(shape, camera, towards, -2.0)
            exact = np.broadcast_to(towards, (*shape, 3))
        else:
            depth, exact = sphere(shape, camera, np.array([0.1, -0.2, 3.0]), 1.5)
        found = normals(depth, camera)
        np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1.0, rtol=1e-12)
        assert ((found * points(depth, camera)).sum(axis=-1) < 0).all()
        worst.append(np.abs(found - exact)[1:-1, 1:-1].max())
    assert worst[0] < 2e-3
    assert worst[0] / worst[1] > 3.5
    assert worst[1] / worst[2] > 3.5


def test_normals_of_a_sphere_seen_whole_are_nan_beside_it_only() -> None:
    camera = Camera(focal_length=(240.0, 285.0))
    depth, exact = sphere((220, 200), camera, np.array([0.0, 0.0, 3.0]), 1.0)
    found = normals(depth, camera)
    np.testing.assert_array_equal(np.isnan(found[..., 0]), np.isnan(depth))
    # At the silhouette the slope is infinite; a third of the way in it is resolved.
    facing = (exact * points(depth, camera)).sum(axis=-1) < -0.6 * np.linalg.norm(points(depth, camera), axis=-1)
    assert np.abs(found - exact)[facing].max() < 3e-3


def test_mesh_of_a_full_grid() -> None:
    camera = a_camera()
    depth = rough_depth(np.ones((6, 9), dtype=bool))
    surface = mesh(depth, camera)
    np.testing.assert_array_equal(surface.vertices, points(depth, camera).reshape(-1, 3))
    assert len(surface.faces) == 2 * 5 * 8


@pytest.mark.parametrize(("row", "column", "lost"), [(2, 2, 4), (0, 0, 1), (0, 4, 1), (4, 0, 1), (4, 4, 1), (0, 2, 2)])
def test_a_missing_pixel_costs_one_triangle_of_each_square_around_it(row: int, column: int, lost: int) -> None:
    depth = np.full((5, 5), 2.0)
    depth[row, column] = np.nan
    surface = mesh(depth, a_camera())
    assert len(surface.vertices) == 24
    assert len(surface.faces) == 32 - lost


@pytest.mark.parametrize("focal_length", [SQUARE, OBLONG])
def test_faces_cover_every_square_of_three_or_four_pixels_once_and_face_the_camera(
    focal_length: tuple[float, float],
) -> None:
    camera = a_camera(focal_length)
    finite = holed((23, 31), 0.35)
    surface = mesh(rough_depth(finite), camera)
    assert len(surface.vertices) == finite.sum()

    pixels = np.argwhere(finite)[surface.faces]
    corners = pixels.min(axis=1)
    assert ((pixels.max(axis=1) - corners) == 1).all()
    found = np.zeros((22, 30), dtype=int)
    np.add.at(found, tuple(corners.T), 1)
    present = sum(finite[down : down + 22, right : right + 30].astype(int) for down in (0, 1) for right in (0, 1))
    np.testing.assert_array_equal(found, np.select([present == 4, present == 3], [2, 1], 0))
    # Two triangles of one square share a diagonal: together they name all of its corners.
    for row, column in np.argwhere(found == 2):
        mine = pixels[(corners == (row, column)).all(axis=1)].reshape(-1, 2)
        assert len({tuple(pixel) for pixel in mine}) == 4

    towards_face = surface.triangles.mean(axis=1)
    assert ((surface.face_normals * towards_face).sum(axis=1) < 0).all()


def test_colours_stay_with_their_pixels() -> None:
    finite = holed((8, 11), 0.3)
    depth = rough_depth(finite)
    rgb = np.random.default_rng(2).integers(0, 256, (8, 11, 3), dtype=np.uint8)
    np.testing.assert_array_equal(vertex_rgb(mesh(depth, a_camera(), rgb)), rgb[finite])
    grey = rgb[..., 0]
    np.testing.assert_array_equal(vertex_rgb(mesh(depth, a_camera(), grey)), np.stack([grey[finite]] * 3, axis=-1))


def test_mesh_survives_a_ply_file(tmp_path: Path) -> None:
    surface = mesh(np.full((3, 4), 2.0), a_camera(), np.full((3, 4), 77, dtype=np.uint8))
    surface.export(tmp_path / "mesh.ply")
    again = trimesh.load_mesh(tmp_path / "mesh.ply", process=False)
    np.testing.assert_allclose(again.vertices, surface.vertices, rtol=1e-6)
    np.testing.assert_array_equal(again.faces, surface.faces)
    assert (vertex_rgb(again) == 77).all()


@pytest.mark.parametrize("shape", [(1, 6), (6, 1), (1, 1)])
def test_an_image_one_pixel_wide_has_points_normals_and_a_mesh_without_faces(shape: tuple[int, int]) -> None:
    depth = rough_depth(np.ones(shape, dtype=bool))
    camera = a_camera()
    assert np.isfinite(points(depth, camera)).all()
    assert np.isfinite(normals(depth, camera)).all()
    surface = mesh(depth, camera)
    assert len(surface.vertices) == depth.size
    assert len(surface.faces) == 0


@pytest.mark.parametrize("chosen", [[0, 3, 4, 22], [23], list(range(24))])
@pytest.mark.parametrize("cut", [False, True])
def test_normals_of_rows_are_those_of_the_whole(chosen: list[int], cut: bool) -> None:
    generator = np.random.default_rng(7)
    depth = 2.0 + 0.1 * generator.random((24, 30))
    depth[generator.random(depth.shape) < 0.1] = np.nan
    interrupted = Discontinuities(generator.random((24, 29)) < 0.2, generator.random((23, 30)) < 0.2) if cut else None
    camera = Camera(focal_length=30.0)
    rows = normals_of_rows(depth, camera, np.array(chosen), interrupted)
    np.testing.assert_array_equal(rows, normals(depth, camera, interrupted)[chosen])


def test_a_depth_that_is_nan_everywhere_has_no_mesh_and_no_normals() -> None:
    depth = np.full((3, 4), np.nan)
    with pytest.raises(InputError, match="NaN everywhere"):
        mesh(depth, a_camera())
    assert np.isnan(normals(depth, a_camera())).all()


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.inf, -np.inf])
def test_an_impossible_depth_is_named_with_its_place(wrong: float) -> None:
    depth = np.full((3, 4), 2.0)
    depth[1, 2] = wrong
    for function in (points, normals, log_depth_gradient, mesh):
        with pytest.raises(InputError, match=rf"depth\[1, 2\]={wrong}"):
            function(depth, a_camera())


@pytest.mark.parametrize("shape", [(4,), (2, 3, 1), (0, 5), (5, 0)])
def test_a_depth_of_impossible_shape_is_refused(shape: tuple[int, ...]) -> None:
    for function in (points, normals, log_depth_gradient, mesh):
        with pytest.raises(InputError, match="depth has shape"):
            function(np.ones(shape), a_camera())


@pytest.mark.parametrize(
    "colour", [np.zeros((3, 4)), np.zeros((4, 3), dtype=np.uint8), np.zeros((3, 4, 4), dtype=np.uint8)]
)
def test_a_colour_that_does_not_fit_is_refused(colour: NDArray[np.generic]) -> None:
    with pytest.raises(InputError, match="colour has shape"):
        mesh(np.ones((3, 4)), a_camera(), colour)


@pytest.mark.parametrize("shape", [(23, 7), (1, 30), (30, 1)])
def test_nothing_shows_where_a_block_of_rows_ends(shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    camera, depth = a_camera(), rough_depth(holed(shape, 0.2))
    random = np.random.default_rng(4)
    discontinuities = Discontinuities(
        random.random((shape[0], shape[1] - 1)) < 0.2, random.random((shape[0] - 1, shape[1])) < 0.2
    )

    def found() -> list[Array]:
        faces = mesh(depth, camera, discontinuities=discontinuities).faces
        return [
            *log_depth_gradient(depth, camera, discontinuities),
            normals(depth, camera, discontinuities),
            np.unique(faces, axis=0),
        ]

    whole = found()
    monkeypatch.setattr(blocks, "_PIXELS", 2 * shape[1])
    for one, other in zip(whole, found(), strict=True):
        np.testing.assert_array_equal(one, other)
