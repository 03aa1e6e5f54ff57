"""Files that guide: what each format says of a photo, and which cannot be used."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import trimesh
from PIL import Image

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.guide.guide import Points
from persfs_cl.io.export import write_grey
from persfs_cl.pipeline.guides import GuideFile
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.plan import Plan

SHAPE = (40, 60)
CAMERA = ps.Camera((70.0, 80.0), (31.0, 17.5))
NUMBERS = np.array([[1.25, np.nan, 1.5], [2.0, 1.75, 1.0]], np.float32)
PLACES = np.array([[3.0, 4.5, 1.5], [50.25, 20.0, 2.0], [31.0, 17.5, 1.0]])
"""Column, row and depth."""


def in_camera_axes() -> Array:
    column, row, depth = PLACES.T
    return np.column_stack([(column - 31.0) / 70.0 * depth, (row - 17.5) / 80.0 * depth, depth])


def write_exr(path: Path, **channels: np.ndarray) -> None:
    openexr = pytest.importorskip("OpenEXR")
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    openexr.File(header, channels).write(str(path))


def write_ply(path: Path, points: Array) -> None:
    cloud: Any = trimesh.PointCloud
    cloud(points).export(path)


def write_colmap(folder: Path) -> Path:
    """A model with two images, of which the second sees the points, and one that lies behind it."""
    angle = 0.7
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    shift = np.array([0.3, -0.2, 0.5])
    there = in_camera_axes()
    world = (there - shift) @ turn
    behind = (np.array([0.0, 0.0, -1.0]) - shift) @ turn
    seen = " ".join(f"{column + 0.5} {row + 0.5} {number}" for number, (column, row, _) in enumerate(PLACES, 7))
    (folder / "images.txt").write_text(
        "# Image list\n1 1 0 0 0 0 0 0 1 other.png\n\n"
        f"2 {np.cos(angle / 2)} 0 {np.sin(angle / 2)} 0 {shift[0]} {shift[1]} {shift[2]} 1 folder/photo.png\n"
        f"{seen} 1.0 2.0 -1 5.0 6.0 99\n"
    )
    points = [f"{number} {x} {y} {z} 0 0 0 0.5 2 {number}" for number, (x, y, z) in enumerate(world, 7)]
    points.append("99 " + " ".join(map(str, behind)) + " 0 0 0 0.5 2 3")
    points.append("1000 1 2 3 0 0 0 0.5 1 0")
    (folder / "points3D.txt").write_text("# Points\n" + "\n".join(points) + "\n")
    return folder / "points3D.txt"


def read(path: Path, unit: float = 1.0, photo: str = "folder/photo.png") -> Array | Points:
    return GuideFile(path, unit).read(path.parent / photo, CAMERA, SHAPE)


@pytest.mark.parametrize("name", ["guide.npy", "guide.tiff", "guide.tif", "guide.exr", "guide.png"])
def test_maps_of_any_format(tmp_path: Path, name: str) -> None:
    path, unit = tmp_path / name, 1.0
    if path.suffix == ".npy":
        np.save(path, NUMBERS)
    elif path.suffix == ".exr":
        write_exr(path, Z=NUMBERS)
    elif path.suffix == ".png":
        # Millimetres, 0 for none.
        Image.fromarray(np.nan_to_num(1000.0 * NUMBERS).astype(np.uint16)).save(path)
        unit = 0.001
    else:
        tifffile.imwrite(path, NUMBERS)
    np.testing.assert_allclose(np.asarray(read(path, unit)), NUMBERS)


@pytest.mark.parametrize("name", ["points.csv", "points.json", "points.ply", "points3D.txt"])
def test_points_of_any_format(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if path.suffix == ".csv":
        np.savetxt(path, PLACES, delimiter=",")
    elif path.suffix == ".json":
        path.write_text(str([{"column": c, "row": r, "depth": d} for c, r, d in PLACES.tolist()]).replace("'", '"'))
    elif path.suffix == ".ply":
        write_ply(path, np.vstack([in_camera_axes(), [0.0, 0.0, -1.0]]))
    else:
        path = write_colmap(tmp_path)
    found = read(path, 2.0)
    assert isinstance(found, Points)
    np.testing.assert_allclose(found.columns, PLACES[:, 0], atol=1e-5)
    np.testing.assert_allclose(found.rows, PLACES[:, 1], atol=1e-5)
    np.testing.assert_allclose(found.depths, 2.0 * PLACES[:, 2], atol=1e-5)


def test_other_channels_of_an_exr_file(tmp_path: Path) -> None:
    write_exr(tmp_path / "many.exr", A=NUMBERS + 1, Z=NUMBERS)
    np.testing.assert_array_equal(np.asarray(read(tmp_path / "many.exr")), NUMBERS)
    write_exr(tmp_path / "one.exr", whatever=NUMBERS)
    np.testing.assert_array_equal(np.asarray(read(tmp_path / "one.exr")), NUMBERS)
    write_exr(tmp_path / "colour.exr", A=NUMBERS, B=NUMBERS)
    with pytest.raises(InputError, match=r"colour\.exr has the channels A, B.*save the depth as Z"):
        read(tmp_path / "colour.exr")


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("none.npy", None, "none.npy.*exist"),
        ("empty.csv", b"", "empty.csv.*empty"),
        ("guide.jpg", b"x", "guide.jpg is no guide by its name"),
        ("broken.exr", b"v/1\x01 and then nothing", "broken.exr"),
        ("broken.ply", b"ply\nformat ascii 1.0\n", "broken.ply"),
        ("text.png", b"no picture", "text.png"),
        ("points3D.txt", b"1 0 0 1 0 0 0 0.1 1 0\n", "images.txt"),
    ],
)
def test_files_that_are_no_guides(tmp_path: Path, name: str, data: bytes | None, message: str) -> None:
    path = tmp_path / name
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InputError, match=message):
        read(path)


def test_a_colmap_model_of_other_photos(tmp_path: Path) -> None:
    path = write_colmap(tmp_path)
    with pytest.raises(InputError, match=r"images\.txt has no image elsewhere\.png"):
        read(path, photo="elsewhere.png")
    path.write_text("1000 1 2 3 0 0 0 0.5 1 0\n")
    with pytest.raises(InputError, match="none of the 4 points"):
        read(path)
    path.write_text("7 1 2\n7 x 2 3 0 0 0 1\n")
    with pytest.raises(InputError, match="line 2"):
        read(path)


SIDES = {5: (60, 40), 6: (60, 40), 7: (60, 40), 8: (60, 40)}
"""Height and width, in the file, of a photo that is read with 40 x 60 pixels, by the EXIF orientation."""


def in_file(column: float, row: float, orientation: int) -> tuple[float, float]:
    """Of a pixel of the upright photo, where it is in the file; by EXIF's own words."""
    return {
        5: (row, column),
        6: (row, SHAPE[1] - 1 - column),
        7: (SHAPE[0] - 1 - row, SHAPE[1] - 1 - column),
        8: (SHAPE[0] - 1 - row, column),
    }[orientation]


@pytest.mark.parametrize("orientation", SIDES)
def test_a_map_of_the_photo_as_it_lies_in_its_file_is_turned_with_it(tmp_path: Path, orientation: int) -> None:
    upright = np.random.default_rng(0).uniform(1.0, 2.0, SHAPE)
    lying = np.empty(SIDES[orientation])
    for row, column in np.ndindex(SHAPE):
        there = in_file(column, row, orientation)
        lying[int(there[1]), int(there[0])] = upright[row, column]
    for name, stored in (("upright", upright), ("lying", lying)):
        np.save(tmp_path / f"{name}.npy", stored)
        found = GuideFile(tmp_path / f"{name}.npy").read(tmp_path / "photo.jpg", CAMERA, SHAPE, orientation=orientation)
        np.testing.assert_array_equal(np.asarray(found), upright)
    # Coarse ones too.
    np.save(tmp_path / "coarse.npy", np.ones((3, 2)))
    found = GuideFile(tmp_path / "coarse.npy").read(tmp_path / "photo.jpg", CAMERA, SHAPE, orientation=orientation)
    assert np.asarray(found).shape == (2, 3)


@pytest.mark.parametrize(("orientation", "shape"), [(3, SHAPE), (6, (7, 7))])
def test_where_the_ratio_does_not_tell_it_is_said(tmp_path: Path, orientation: int, shape: tuple[int, int]) -> None:
    np.save(tmp_path / "guide.npy", np.ones(shape))
    with pytest.warns(UserWarning, match=r"nobody can tell whether .*guide\.npy"):
        GuideFile(tmp_path / "guide.npy").read(tmp_path / "photo.jpg", CAMERA, SHAPE, orientation=orientation)


@pytest.mark.parametrize("orientation", [1, *SIDES])
def test_colmap_has_seen_the_photo_in_another_size_and_lying(tmp_path: Path, orientation: int) -> None:
    write_colmap(tmp_path)
    images = tmp_path / "images.txt"
    size = SIDES.get(orientation, SHAPE)
    (tmp_path / "cameras.txt").write_text(f"1 SIMPLE_RADIAL {3 * size[1]} {3 * size[0]} 210 60 90 0.1\n")
    *lines, _ = images.read_text().splitlines()
    places = [(column, row) if orientation == 1 else in_file(column, row, orientation) for column, row in PLACES[:, :2]]
    seen = [f"{3.0 * (column + 0.5)} {3.0 * (row + 0.5)} {number}" for number, (column, row) in enumerate(places, 7)]
    images.write_text("\n".join([*lines, " ".join(seen)]) + "\n")
    guide = GuideFile(tmp_path / "points3D.txt")
    assert guide.beside == (images, tmp_path / "cameras.txt")
    found = guide.read(tmp_path / "folder/photo.png", CAMERA, SHAPE, orientation=orientation)
    assert isinstance(found, Points)
    np.testing.assert_allclose(np.stack([found.columns, found.rows, found.depths], axis=1), PLACES, atol=1e-5)


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        ("1 PINHOLE 80 40 70 80 30 17\n", r"cameras\.txt has images of 80 x 40 pixels, and the photo has 60 x 40"),
        ("2 PINHOLE 60 40 70 80 30 17\n", r"cameras\.txt has no camera 1, which .*images\.txt names"),
    ],
)
def test_cameras_of_other_photos(tmp_path: Path, cameras: str, message: str) -> None:
    path = write_colmap(tmp_path)
    (tmp_path / "cameras.txt").write_text(cameras)
    with pytest.raises(InputError, match=message):
        read(path)


def test_two_images_of_one_name_are_told(tmp_path: Path) -> None:
    path = write_colmap(tmp_path)
    images = tmp_path / "images.txt"
    images.write_text(images.read_text() + "3 1 0 0 0 0 0 0 1 photo.png\n1.0 2.0 7\n")
    with pytest.raises(InputError, match=r"2 images that .*folder/photo\.png may be, folder/photo\.png and photo\.png"):
        read(path)


def test_points_behind_the_camera(tmp_path: Path) -> None:
    write_ply(tmp_path / "behind.ply", np.array([[0.0, 0.0, -1.0]]))
    with pytest.raises(InputError, match=r"behind\.ply has none of its 1 points in front"):
        read(tmp_path / "behind.ply")


@pytest.mark.parametrize("unit", [0.0, -1.0, float("nan")])
def test_units_are_above_0(unit: float) -> None:
    with pytest.raises(InputError, match="guide_unit="):
        GuideFile(Path("guide.npy"), unit)


def test_each_photo_has_the_guide_of_its_name(tmp_path: Path) -> None:
    photos, guides = tmp_path / "photos", tmp_path / "guides"
    scene = ps.bump((12, 16), light=ps.FlashLight(gain=0.5))
    for name in ("a.png", "sub/b.png", "c.png"):
        (photos / name).parent.mkdir(parents=True, exist_ok=True)
        write_grey(photos / name, scene.image, 16)
    for name in ("a.png.npy", "sub/b.png.npy"):
        (guides / name).parent.mkdir(parents=True, exist_ok=True)
        np.save(guides / name, scene.depth[::4, ::4])
    plan = Plan(guides=guides, guide_unit=0.5)
    inputs = {one.name: one for one in list_inputs([photos]).inputs}
    assert plan.job(inputs["sub/b.png"]).guide == GuideFile(guides / "sub/b.png.npy", 0.5)
    with pytest.raises(InputError, match=r"c\.png has no guide.*c\.png\{\.npy"):
        plan.job(inputs["c.png"])
    with pytest.raises(InputError, match=r"no folder.*guides"):
        Plan(guides=tmp_path / "nowhere").require_files()


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_is_guided(tmp_path: Path) -> None:
    scene = ps.bump((24, 32), light=ps.FlashLight(gain=0.5))
    write_grey(tmp_path / "photo.png", scene.image, 16)
    np.save(tmp_path / "guide.npy", 3.0 * scene.depth.reshape(6, 4, 8, 4).mean(axis=(1, 3)))
    given: dict[str, Any] = {"light": ps.FlashLight(gain=None), "camera": scene.camera, "guide": tmp_path / "guide.npy"}
    [result] = ps.batch(tmp_path / "photo.png", tmp_path / "out", save="solution", **given)
    assert result.error is None
    solution = ps.load(tmp_path / "out" / "photo.png")
    assert solution.guide is not None
    assert solution.guide.gain == pytest.approx(4.5, rel=0.02)
    np.testing.assert_allclose(solution.depth, 3.0 * scene.depth, rtol=0.02)
    with pytest.raises(InputError, match="guide say the same in two ways"):
        list(ps.batch(tmp_path / "photo.png", guides=tmp_path, **given))
    with pytest.raises(InputError, match=r"near=3\.0 is beyond far=2\.0"):
        list(ps.batch(tmp_path / "photo.png", near=3, far=2))
