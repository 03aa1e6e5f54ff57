"""Other pixels: the same light, the same depths, and nothing known that was not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lenses import depth, flashed, places

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.errors import CameraError, InputError
from persfs_cl.framing.frame import Frame
from persfs_cl.framing.maps import Maps
from persfs_cl.framing.reduced import Reduced, reduced_shape
from persfs_cl.framing.straightened import Straightened
from persfs_cl.pipeline.beside import other_pixels
from persfs_cl.surface.outcome import Taken

SHAPE = (96, 128)
BARREL = ps.Camera(150.0, distortion=(-0.25, 0.06, 0.002, -0.001))
LENSES = [BARREL, ps.Camera(150.0, (60.0, 50.0), (0.12, 0.02, 0.0, 0.0)), ps.Camera(140.0, distortion=ps.Fisheye(0.03))]
ANGLE = ps.Camera(150.0, distortion=ps.FieldOfView(0.6))
MOST = ps.Camera(140.0, distortion=ps.RadTanFisheye(0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.002, -0.001, 0.003, 0.001))
PRISMS = ps.Camera(140.0, distortion=ps.Fisheye(0.03, 0.0, 0.0, 0.0, 0.002, -0.001, 0.003, 0.001))


@pytest.fixture(params=["straightened", "reduced", "odd"])
def frame(request: pytest.FixtureRequest) -> Frame:
    if request.param == "straightened":
        return Straightened(BARREL, SHAPE)
    return Reduced(ps.Camera(150.0), SHAPE, (24, 32) if request.param == "reduced" else (41, 55))


def _old_depth(frame: Frame) -> Array:
    camera = BARREL if isinstance(frame, Straightened) else ps.Camera(150.0)
    return depth(*places(camera, SHAPE))


def _new_depth(frame: Frame) -> Array:
    grid = frame.camera.grid(frame.shape)
    return depth(*np.broadcast_arrays(grid.x, grid.y))


def test_light_is_that_of_the_same_rays(frame: Frame) -> None:
    light, known = frame.light(_old_depth(frame), np.ones(SHAPE, bool))
    assert known.mean() > 0.9
    assert np.abs(light - _new_depth(frame))[known].max() < 0.01
    assert np.abs(light - _new_depth(frame))[known].mean() < 0.001


def test_light_outside_the_mask_plays_no_part(frame: Frame) -> None:
    inside = np.ones(SHAPE, bool)
    inside[:, 64:] = False
    light, known = frame.light(np.where(inside, 2.0, np.nan), inside)
    np.testing.assert_allclose(light[known], 2.0, rtol=1e-12)
    assert 0.4 < known.mean() < 0.6


def test_bounds_hold_for_every_pixel_underneath(frame: Frame) -> None:
    rng = np.random.default_rng(1)
    near = 0.5 + 0.1 * rng.random(SHAPE)
    near[:, :40] = np.nan
    found, deepest = frame.nearest(near), frame.farthest(near)
    there = ~np.isnan(found)
    np.testing.assert_array_equal(there, ~np.isnan(deepest))
    assert 0.3 < there.mean() < 0.75
    means, _ = frame.light(np.nan_to_num(near), ~np.isnan(near))
    assert (found[there] <= means[there] + 1e-12).all()
    assert (means[there] <= deepest[there] + 1e-12).all()


def test_single_known_pixels_stay_known(frame: Frame) -> None:
    known = np.full(SHAPE, np.nan)
    known[20:80:20, 30:110:20] = 1.5
    found = frame.known(known)
    assert np.count_nonzero(~np.isnan(found)) == 12
    np.testing.assert_allclose(found[~np.isnan(found)], 1.5, rtol=1e-12)


def test_a_wall_stays_closed(frame: Frame) -> None:
    walls = np.zeros(SHAPE, bool)
    walls[50] = True
    framed = frame.anywhere(walls)
    first, last = frame.placed(np.array([[1.0, 50.0], [126.0, 50.0]]))[:, 0]
    assert np.all(np.any(framed, axis=0)[int(first) : int(last)])


def test_points_lie_where_their_pixels_are(frame: Frame) -> None:
    dots = np.zeros(SHAPE)
    dots[30, 70] = dots[60, 20] = 1.0
    spread = frame.mean(dots)
    found = frame.points(ps.Points([70.0, 20.0], [30.0, 60.0], [1.0, 2.0]))
    assert found is not None
    for column, row in zip(found.columns, found.rows, strict=True):
        assert spread[round(row), round(column)] > 0.0


def _middles(cells: tuple[int, ...], shape: tuple[int, int]) -> Array:
    """Column and row of the middles of the cells of a map over an image."""
    down, across = ((np.arange(count) + 0.5) * size / count - 0.5 for count, size in zip(cells, shape, strict=True))
    return np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("cells", [(12, 16), (96, 128), (120, 150)])
def test_a_guide_says_the_same_of_the_same_rays(frame: Frame, cells: tuple[int, int]) -> None:
    camera = BARREL if isinstance(frame, Straightened) else ps.Camera(150.0)
    x, y = camera.places(_middles(cells, SHAPE), SHAPE).T
    found = frame.guide(depth(x, y).reshape(cells))
    x, y = frame.camera.places(_middles(found.shape, frame.shape), frame.shape).T
    off = np.abs(found - depth(x, y).reshape(found.shape))
    assert np.isfinite(off).mean() > 0.8
    assert np.nanmean(off) < (0.01 if cells[0] < 20 else 0.002)


@pytest.mark.parametrize("camera", [*LENSES, ANGLE, MOST], ids=lambda camera: str(camera.distortion))
def test_a_bent_image_is_solved_as_well_as_a_straight_one(camera: ps.Camera) -> None:
    pinhole = ps.Camera(camera.focal_length, camera.principal_point)

    def error(one: ps.Camera) -> float:
        solution = ps.reconstruct(flashed(one, SHAPE), one, light=ps.FlashLight())
        assert solution.camera.distortion is None
        grid = solution.camera.grid((solution.depth.shape[0], solution.depth.shape[1]))
        truth = np.where(np.isfinite(solution.depth), depth(*np.broadcast_arrays(grid.x, grid.y)), np.nan)
        return ps.compare(solution.depth, truth).mean

    assert error(camera) < 1.2 * error(pinhole)


def test_everything_given_is_straightened_with_the_image() -> None:
    image, truth = flashed(BARREL, SHAPE), depth(*places(BARREL, SHAPE))
    mask = np.zeros(SHAPE, bool)
    mask[10:-10, 15:-15] = True
    known = np.where(mask, truth, np.nan)
    known[12:-12, 17:-17] = np.nan
    solution = ps.reconstruct(
        image,
        BARREL,
        light=ps.FlashLight(),
        mask=mask,
        known_depth=known,
        albedo=np.ones(SHAPE),
        depth_range=(0.9 * truth, 2.0),
        walls=np.zeros(SHAPE, bool),
        guide=ps.Points([64.0], [48.0], [truth[48, 64]]),
    )
    straight, pinhole = ps.undistort(truth, BARREL)
    assert pinhole == solution.camera
    assert solution.solved.sum() == pytest.approx(mask.sum(), rel=0.1)
    assert ps.compare(solution.depth, np.where(solution.solved, straight, np.nan)).mean < 0.01


def test_a_batch_mixes_lenses() -> None:
    cameras = [BARREL, ps.Camera(150.0)]
    images = [flashed(camera, SHAPE) for camera in cameras]
    both = ps.reconstruct_batch(images, cameras, light=ps.FlashLight())
    for image, camera, solution in zip(images, cameras, both, strict=True):
        alone = ps.reconstruct(image, camera, light=ps.FlashLight())
        np.testing.assert_array_equal(solution.depth, alone.depth)


@pytest.mark.parametrize(
    ("name", "given"),
    [
        ("mask", np.ones((3, 3), bool)),
        ("known_depth", np.ones((3, 3))),
        ("depth_range", (2.0, 1.0)),
        ("guide", "a.npy"),
    ],
)
def test_what_does_not_fit_the_bent_image_is_refused(name: str, given: Any) -> None:
    with pytest.raises(InputError, match=name):
        ps.reconstruct(flashed(BARREL, SHAPE), BARREL, light=ps.FlashLight(), **{name: given})


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("masked", [False, True])
def test_pixels_without_a_value_are_counted_in_the_image_that_was_given(value: float, masked: bool) -> None:
    image = flashed(BARREL, SHAPE).copy()
    image[60, 60:63] = image[20, 20] = value
    mask = np.ones(SHAPE, bool)
    mask[20, 20] = not masked
    said = f"image holds {3 if masked else 4} NaN or infinite values inside the mask"
    with pytest.raises(InputError, match=said):
        ps.reconstruct(image, BARREL, light=ps.FlashLight(), mask=mask)
    solution = ps.reconstruct(image, BARREL, light=ps.FlashLight(), mask=mask & np.isfinite(image))
    assert np.isfinite(solution.depth[solution.solved]).all()


def test_a_guide_that_says_nothing_of_the_view_is_refused() -> None:
    maps = Maps(guide=ps.Points([1e6], [1e6], [1.0]))
    with pytest.raises(InputError, match=r"guide.* no point"):
        maps.framed(Straightened(BARREL, SHAPE))


def test_a_lens_that_shows_nothing_is_refused() -> None:
    with pytest.raises(CameraError, match="leaves 0 %"):
        Straightened(ps.Camera(1.0, (500.0, 500.0), ps.Fisheye(9.0)), (8, 8))


def test_colours_and_bool_are_straightened_too() -> None:
    straight, pinhole = ps.undistort(np.full((*SHAPE, 3), 0.5), BARREL)
    assert straight.shape[2] == 3
    assert np.nanmin(straight) == pytest.approx(0.5)
    flags, _ = ps.undistort(np.ones(SHAPE, bool), BARREL)
    assert flags.dtype == bool
    assert flags.shape == straight.shape[:2]
    copy, same = ps.undistort(np.ones(SHAPE), pinhole)
    assert same is pinhole
    assert copy.shape == SHAPE


@pytest.mark.parametrize(
    ("shape", "longest", "reduced"),
    [((3000, 4000), 1000, (750, 1000)), ((40, 30), 20, (20, 15)), ((40, 30), 40, (40, 30)), ((1, 100), 10, (1, 10))],
)
def test_reduced_shapes(shape: tuple[int, int], longest: int, reduced: tuple[int, int]) -> None:
    assert reduced_shape(shape, longest) == reduced


def test_a_reduced_camera_sees_the_same_view() -> None:
    camera = ps.Camera((150.0, 140.0), (70.0, 40.0))
    frame = Reduced(camera, SHAPE, (24, 32))
    corners = np.array([[-0.5, -0.5], [127.5, 95.5]])
    new = np.array([[-0.5, -0.5], [31.5, 23.5]])
    np.testing.assert_allclose(frame.camera.places(new, (24, 32)), camera.places(corners, SHAPE), rtol=1e-12)
    np.testing.assert_allclose(frame.placed(corners), new, rtol=0, atol=1e-12)


@pytest.mark.parametrize("camera", [PRISMS, ANGLE, MOST], ids=["prisms", "fov", "most"])
def test_a_lens_that_opencv_does_not_know_is_straightened(camera: ps.Camera) -> None:
    straight, pinhole = ps.undistort(depth(*places(camera, SHAPE)), camera)
    grid = pinhole.grid(straight.shape)
    off = np.abs(straight - depth(*np.broadcast_arrays(grid.x, grid.y)))
    assert np.nanmean(off) < 0.001


@pytest.mark.parametrize(
    "camera", [BARREL, LENSES[-1], PRISMS, ANGLE, MOST], ids=["opencv", "fisheye", "prisms", "fov", "most"]
)
def test_what_took_the_image_is_saved_with_the_surface(camera: ps.Camera, tmp_path: Path) -> None:
    solution = ps.reconstruct(flashed(camera, SHAPE), camera, light=ps.FlashLight())
    assert solution.taken_by == Taken(camera, SHAPE)
    solution.save(tmp_path, save="depth,solution")
    assert ps.load(tmp_path).taken_by == Taken(camera, SHAPE)
    points = np.array([[64.0, 48.0, 1.0], [20.0, 30.0, 1.0]])
    height, width = solution.depth.shape
    found = other_pixels(tmp_path / "depth.npy", (height, width))
    assert found is not None
    straight = Straightened(camera, SHAPE)
    moved = found.points(points)
    np.testing.assert_allclose(moved[:, :2], straight.placed(points[:, :2]), rtol=0, atol=1e-9)
    # Linear between the same pixels; beyond them this has no value.
    values = np.random.default_rng(0).random(SHAPE)
    mapped = found.map(values)
    there = np.isfinite(mapped)
    assert there.mean() > 0.8
    np.testing.assert_allclose(mapped[there], straight.mean(values)[there], atol=1e-4)
    (tmp_path / "camera.json").write_text("[")
    with pytest.warns(UserWarning, match=r"camera\.json cannot be used .*all is taken to be in the pixels of"):
        assert other_pixels(tmp_path / "depth.npy", (height, width)) is None


@pytest.mark.parametrize(
    "camera",
    [
        ps.Camera(60.0, distortion=(1e5, 0.0, 0.0, 0.0)),
        ps.Camera(60.0, distortion=(0.0, 0.0, 1e5, 1e5)),
        ps.Camera(60.0, distortion=ps.Fisheye(-1e6)),
        ps.Camera(4.2, distortion=ps.Fisheye()),
    ],
)
def test_absurd_lenses_are_refused(camera: ps.Camera) -> None:
    with pytest.raises(CameraError, match=r"leaves .* % of an image of 60 × 40 pixels.*not in millimetres"):
        Straightened(camera, (40, 60))


def test_a_lens_that_keeps_little_is_told_of() -> None:
    for _image in range(2):
        with pytest.warns(UserWarning, match="the distortion of the lens leaves 4"):
            Straightened(ps.Camera(30.0, distortion=ps.Fisheye()), (100, 100))


def test_half_precision_is_straightened() -> None:
    straight, _ = ps.undistort(np.ones(SHAPE, np.float16), BARREL)
    assert np.nanmin(straight) == pytest.approx(1.0)
