"""Meshes of few triangles stay near the surface, keep its rims, and are cut where it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.arrays import Array, Mask
from persfs_cl.scenes.view import mesh_view
from persfs_cl.surface import geometry, simplify, triangulation
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.surface.simplify import simplified_mesh

SHAPE = (121, 150)
CAMERA = ps.Camera((150.0, 170.0), (70.2, 66.0))
COLUMN, ROW = np.meshgrid(np.arange(150.0), np.arange(121.0))
WAVY = 3.0 + 0.2 * np.sin(COLUMN / 15) * np.cos(ROW / 12) + 0.002 * COLUMN
ROUND = np.hypot(COLUMN - 75, ROW - 60) < 55
HOLED = ROUND & (np.hypot(COLUMN - 60, ROW - 50) > 12)


def in_image(mesh: trimesh.Trimesh, camera: ps.Camera = CAMERA) -> Array:
    """Column and row of the vertices."""
    x, y, z = np.asarray(mesh.vertices).T
    cx, cy = camera.centre(SHAPE)
    return np.stack([camera.fx * x / z + cx, camera.fy * y / z + cy], axis=-1)


def facing(mesh: trimesh.Trimesh) -> Mask:
    a, b, c = (np.asarray(mesh.vertices)[corner] for corner in mesh.faces.T)
    return np.asarray((np.cross(b - a, c - a) * a).sum(axis=-1) < 0)


def deviation(mesh: trimesh.Trimesh, z: Array, camera: ps.Camera) -> Array:
    """By how many pixels' width the mesh is nearer or farther, at each pixel that both show."""
    seen = mesh_view(mesh, camera, (z.shape[0], z.shape[1])).depth
    difference = camera.fx * np.log(seen / z)
    return np.asarray(np.abs(difference[~np.isnan(difference)]))


@pytest.mark.parametrize("most", [4000, 1000, 300])
@pytest.mark.parametrize("region", [np.ones(SHAPE, bool), HOLED], ids=["whole", "holed"])
def test_it_stays_near_the_surface_and_keeps_its_rims(region: Mask, most: int) -> None:
    z = np.where(region, WAVY, np.nan)
    mesh = simplified_mesh(z, CAMERA, most)
    assert 0.75 * most <= len(mesh.faces) <= most
    assert facing(mesh).all()
    off = deviation(mesh, z, CAMERA)
    assert np.median(off) < 90 / most
    assert off.max() < 2000 / most
    # Of pixels on the rim half are just outside of a line drawn through their middles.
    seen = ~np.isnan(mesh_view(mesh, CAMERA, SHAPE).depth)
    framed = np.pad(region.astype(float), 1)
    rim = np.hypot(*np.gradient(framed))[1:-1, 1:-1] > 0
    assert (seen == region)[~rim].mean() > 1 - 3 / most
    corners = in_image(mesh)
    low, high = np.argwhere(region).min(axis=0)[::-1], np.argwhere(region).max(axis=0)[::-1]
    np.testing.assert_allclose(corners.min(axis=0), low, atol=0.05 if region.all() else 1.0)
    np.testing.assert_allclose(corners.max(axis=0), high, atol=0.05 if region.all() else 1.0)


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.FlashLight()])
def test_solutions_are_simplified(light: ps.FlashLight | ps.ParallelLight) -> None:
    scene = ps.bump((90, 110), light=light)
    solution = ps.reconstruct(scene.image, scene.camera, light=light, max_iterations=30)
    mesh = solution.mesh(mesh_faces=1500)
    assert 1100 < len(mesh.faces) <= 1500
    assert facing(mesh).all()
    off = deviation(mesh, solution.depth, scene.camera)
    assert np.percentile(off, 99) < 0.1


def test_flat_ground_keeps_its_corners() -> None:
    mesh = simplified_mesh(np.full(SHAPE, 2.0), CAMERA, 100)
    assert len(mesh.faces) <= 100
    np.testing.assert_allclose(mesh.area, 2.0**2 * 149 * 120 / (150 * 170), rtol=1e-6)
    np.testing.assert_allclose(np.asarray(mesh.vertices)[:, 2], 2.0, rtol=1e-9)


def test_a_mesh_that_is_small_enough_stays_as_it_is() -> None:
    z = np.where(HOLED, WAVY, np.nan)
    whole = triangulation.mesh(z, CAMERA, np.zeros(SHAPE, np.uint8))
    mesh = simplified_mesh(z, CAMERA, len(whole.faces), np.zeros(SHAPE, np.uint8))
    np.testing.assert_array_equal(mesh.vertices, whole.vertices)
    np.testing.assert_array_equal(mesh.faces, whole.faces)
    assert len(simplified_mesh(z, CAMERA, len(whole.faces) - 1).faces) < len(whole.faces)


def test_both_sides_of_a_cut_stay_apart() -> None:
    cut = Discontinuities.none(SHAPE)
    cut.right[20:100, 74] = True
    cut.down[60, 75:130] = True
    steps = np.where((COLUMN > 74) & (ROW > 60), WAVY + 0.02 * (COLUMN - 74), WAVY)
    for z in (WAVY, steps):
        mesh = simplified_mesh(z, CAMERA, 1500, discontinuities=cut)
        assert facing(mesh).all()
        column, row = in_image(mesh).T
        for a, b in mesh.edges_unique:
            for (across, along), (place, begin, end) in (
                ((column, row), (74.5, 20, 99)),
                ((row, column), (60.5, 75, 129)),
            ):
                if (across[a] - place) * (across[b] - place) < 0:
                    share = (place - across[a]) / (across[b] - across[a])
                    crossing = along[a] + share * (along[b] - along[a])
                    assert not begin < crossing < end
        off = deviation(mesh, z, CAMERA)
        assert np.percentile(off, 99) < 0.5


def test_sides_with_a_wall_between_are_separate_bodies() -> None:
    z = np.where(COLUMN > 74, 6.0, WAVY)
    cut = Discontinuities.none(SHAPE)
    cut.right[:, 74] = True
    mesh = simplified_mesh(z, CAMERA, 1000, discontinuities=cut)
    far = np.asarray(mesh.vertices)[:, 2] > 5
    of_faces = far[mesh.faces]
    assert (of_faces.all(axis=1) | ~of_faces.any(axis=1)).all()
    assert in_image(mesh)[far, 0].min() > 74.9
    assert in_image(mesh)[~far, 0].max() < 74.1


def test_vertices_have_the_colour_of_the_pixel_nearest_in_space() -> None:
    colours = np.stack([COLUMN, ROW, np.full(SHAPE, 7.0)], axis=-1).astype(np.uint8)
    z = np.where(HOLED, WAVY, np.nan)
    mesh = simplified_mesh(z, CAMERA, 1000, colours)
    visual: Any = mesh.visual
    found: NDArray[np.uint8] = visual.vertex_colors
    assert HOLED[found[:, 1], found[:, 0]].all()
    points = geometry.points(z, CAMERA)[HOLED]
    for number in range(0, len(mesh.vertices), 25):
        nearest = np.argmin(((points - mesh.vertices[number]) ** 2).sum(axis=-1))
        row, column = np.argwhere(HOLED)[nearest]
        # Two that are about equally near count as the same.
        assert np.hypot(found[number, 0] - column, found[number, 1] - row) <= 1.5


def test_far_from_the_surface_the_nearest_pixel_is_still_found() -> None:
    z = np.full((9, 40), np.nan)
    z[4, 3] = 2.0
    view = simplify._View(z, CAMERA)
    there = view.of_pixels(np.array([4 * 40 + 3]))
    assert view.nearest_pixels(there + np.array([30.0, 2.0, 0.0]), np.array([4 * 40 + 3])).tolist() == [4 * 40 + 3]
    np.testing.assert_allclose(view.in_space(there)[0], geometry.points(z, CAMERA)[4, 3])


@pytest.mark.parametrize("seed", [0, 1])
def test_steep_and_torn_surfaces_face_the_camera(seed: int) -> None:
    random = np.random.default_rng(seed)
    rough = WAVY * np.exp(0.02 * random.standard_normal(SHAPE))
    mesh = simplified_mesh(rough, CAMERA, 5000)
    assert 4000 <= len(mesh.faces) <= 5000
    assert facing(mesh).all()
    torn = np.where(random.random(SHAPE) < 0.02, np.nan, WAVY)
    mesh = simplified_mesh(torn, CAMERA, 5000)
    assert 4000 <= len(mesh.faces) <= 5000
    assert facing(mesh).all()


@pytest.mark.parametrize("unit", [1e-3, 1e4])
def test_the_unit_does_not_matter(unit: float) -> None:
    one, other = (simplified_mesh(scale * WAVY, CAMERA, 1000) for scale in (1.0, unit))
    assert abs(len(one.faces) - len(other.faces)) < 20
    assert deviation(other, unit * WAVY, CAMERA).max() == pytest.approx(deviation(one, WAVY, CAMERA).max(), rel=0.3)


@pytest.mark.parametrize("step", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_thinned_grid_covers_the_surface_once_and_has_no_gaps(step: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    shape = (43, 52)
    finite = random.random(shape) > 0.004
    finite[10:17, 20:33] = False
    cut = Discontinuities(random.random((43, 51)) < 0.003, random.random((42, 52)) < 0.003)
    joined = triangulation.joined(finite, cut)
    index = np.arange(finite.size, dtype=np.int32).reshape(shape)
    full, thin = triangulation.triangles(index, *joined), simplify._thinned(*joined, step)

    def covered(faces: NDArray[np.int32]) -> Array:
        """Twice the area of each triangle, above 0 where it faces the camera."""
        rows, columns = np.divmod(faces, shape[1])
        (ax, bx, cx), (ay, by, cy) = columns.T, rows.T
        return np.asarray((bx - ax) * (ay - cy) - (by - ay) * (ax - cx))

    assert (covered(thin) > 0).all()
    assert covered(thin).sum() == covered(full).sum()
    assert finite.reshape(-1)[thin].all()
    if step > 1:
        assert len(thin) < len(full)

    def rim(faces: NDArray[np.int32]) -> set[tuple[int, int]]:
        """Edges with a triangle on one side only, but for those at the edge of the image."""
        edges, count = np.unique(
            np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_counts=True
        )
        rows, columns = np.divmod(edges[count == 1], shape[1])
        outside = [
            (part == part[:, :1]).all(axis=1) & ((part[:, 0] == 0) | (part[:, 0] == size - 1))
            for part, size in ((rows, shape[0]), (columns, shape[1]))
        ]
        return {(int(a), int(b)) for a, b in edges[count == 1][~(outside[0] | outside[1])]}

    assert rim(thin) == rim(full)


def test_slivers_of_surfaces_survive() -> None:
    line = np.full((2, 400), 2.0)
    mesh = simplified_mesh(line, CAMERA, 100)
    assert 1 <= len(mesh.faces) <= 100
    assert facing(mesh).all()


def test_crumbs_do_not_become_nothing() -> None:
    random = np.random.default_rng(0)
    crumbs = np.where(random.random(SHAPE) < 0.4, WAVY, np.nan)
    mesh = simplified_mesh(crumbs, CAMERA, 100)
    assert 1 <= len(mesh.faces) <= 100
    assert facing(mesh).all()


def test_a_jagged_outline_gives_way_where_few_triangles_are_wanted() -> None:
    random = np.random.default_rng(0)
    ragged = np.hypot(COLUMN - 75, ROW - 60) < 50 + 4 * random.standard_normal(SHAPE)
    steep = np.where(ragged, WAVY * np.exp(0.1 * random.standard_normal(SHAPE)), np.nan)
    mesh = simplified_mesh(steep, CAMERA, 200)
    assert 100 <= len(mesh.faces) <= 200
    assert facing(mesh).all()


def test_a_mesh_with_some_triangles_too_many_is_simplified() -> None:
    scene = ps.bump((60, 60), light=ps.FlashLight())
    solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    for most in range(2500, 7000, 300):
        assert 0.5 * most < len(solution.mesh(mesh_faces=most).faces) <= most
