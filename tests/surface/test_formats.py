"""Every file that is written is read back to the right values, by another reader than the package's own."""

from __future__ import annotations

import json
import re
import struct
import zipfile
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image

import persfs_cl as ps
from persfs_cl.arrays import Array
from persfs_cl.io.exr import read_exr
from persfs_cl.pipeline.room import bytes_for
from persfs_cl.surface.formats import FORMATS, GROUPS
from persfs_cl.surface.formats.depths import Levels
from persfs_cl.surface.formats.format import Format, Source
from persfs_cl.surface.saving import Saving
from persfs_cl.surface.solved import Derived

SHAPE = (20, 26)
COLOUR: NDArray[np.uint8] = np.random.default_rng(3).integers(0, 256, (*SHAPE, 3), np.uint8)


@pytest.fixture(scope="module")
def solution() -> ps.Solution:
    """A surface with holes, under a camera with two focal lengths and its axis aside."""
    camera = ps.Camera((30.0, 33.0), (11.0, 7.5))
    scene = ps.bump(SHAPE, light=ps.FlashLight())
    mask = np.ones(SHAPE, bool)
    mask[:4, :5] = mask[10, 12] = False
    return ps.reconstruct(scene.image, camera, light=scene.light, mask=mask)


def saved(solution: ps.Solution, folder: Path, items: str, **keywords: Any) -> dict[str, Any]:
    """What the report says of the files."""
    solution.save(folder, save=f"{items},report", colour=COLOUR, **keywords)
    found: dict[str, Any] = json.loads((folder / "report.json").read_text()).get("files", {})
    return found


def test_exr_holds_the_depth_as_z(solution: ps.Solution, tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    solution.save(tmp_path / "depth.exr")
    with openexr.File(str(tmp_path / "depth.exr")) as file:
        assert list(file.channels()) == ["Z"]
        pixels = file.channels()["Z"].pixels
    assert pixels.dtype == np.float32
    np.testing.assert_array_equal(pixels, solution.depth.astype(np.float32))
    np.testing.assert_array_equal(read_exr(tmp_path / "depth.exr"), pixels)


def test_an_exr_that_cannot_be_written_leaves_nothing(
    solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    openexr = pytest.importorskip("OpenEXR")

    def fail(_file: object, name: str) -> None:
        Path(name).write_bytes(b"half")
        raise RuntimeError("No space left on device")

    monkeypatch.setattr(openexr.File, "write", fail)
    with pytest.raises(ps.InputError, match=r"depth\.exr cannot be written: No space left on device"):
        solution.save(tmp_path / "depth.exr")
    assert not list(tmp_path.iterdir())


def test_heights_turn_back_into_depths(solution: ps.Solution, tmp_path: Path) -> None:
    said = saved(solution, tmp_path, "height.png")["height.png"]
    with Image.open(tmp_path / "height.png") as image:
        levels = np.array(image).astype(np.float64)
        text = image.info
        assert image.mode == "I;16"
    assert {name: float(text[name]) for name in said} == said
    assert "depth = depth_offset + depth_scale * level" in text["Description"]
    depth = np.where(levels > 0, said["depth_offset"] + said["depth_scale"] * levels, np.nan)
    np.testing.assert_allclose(depth, solution.depth, rtol=0, atol=0.5001 * abs(said["depth_scale"]))
    # The nearest is the brightest.
    assert levels[solution.depth == np.nanmin(solution.depth)] == 2**16 - 1
    assert levels[solution.solved].min() == 1


@pytest.mark.parametrize("depth", [[[1.0, 1.0]], [[np.nan, np.nan]], [[1e-30, 1e30]], [[1e30, np.nan]]])
def test_any_depths_have_heights(depth: list[list[float]]) -> None:
    given = np.array(depth)
    height = Levels.of(given)
    np.testing.assert_array_equal(height.levels == 0, np.isnan(given))
    again = np.where(height.levels > 0, height.offset + height.scale * height.levels, np.nan)
    np.testing.assert_allclose(again, given, rtol=1e-12, atol=0.5001 * abs(height.scale))


@pytest.mark.parametrize("faces", [0, 300])
def test_glb_has_the_axes_of_gltf_and_wears_the_photograph(faces: int, solution: ps.Solution, tmp_path: Path) -> None:
    saved(solution, tmp_path, "mesh.glb", mesh_faces=faces)
    scene = trimesh.load_scene(tmp_path / "mesh.glb", process=False)
    [mesh] = scene.geometry.values()
    visual: Any = mesh.visual
    texture = np.array(visual.material.baseColorTexture.convert("RGB"))
    np.testing.assert_array_equal(texture, COLOUR)
    vertices, expected = np.asarray(mesh.vertices), solution.mesh(mesh_faces=faces)
    assert len(mesh.faces) == len(expected.faces)
    # Right stays, down and forward turn around; so a triangle that faced the camera still does.
    np.testing.assert_allclose(vertices, expected.vertices * (1, -1, -1), rtol=1e-6)
    assert (vertices[:, 2] < 0).all()
    np.testing.assert_array_equal(scene.bounds, mesh.bounds, "turned by no node")
    assert (mesh.face_normals[:, 2] > 0).mean() > 0.9
    # Pixels of the texture are where the camera sees the vertices; trimesh counts from below.
    place = visual.uv * (1, -1) + (0, 1)
    column, row = (place * (SHAPE[1], SHAPE[0]) - 0.5).T
    x, y, z = np.asarray(expected.vertices).T
    np.testing.assert_allclose(column, 30.0 * x / z + 11.0, atol=1e-4)
    np.testing.assert_allclose(row, 33.0 * y / z + 7.5, atol=1e-4)
    if not faces:
        assert len(vertices) == solution.solved.sum()
        np.testing.assert_array_equal(np.stack([row, column], axis=-1).round(), np.argwhere(solution.solved))


def test_points_have_normals_and_colours(solution: ps.Solution, tmp_path: Path) -> None:
    saved(solution, tmp_path, "points.ply")
    cloud: Any = trimesh.load(tmp_path / "points.ply", process=False)
    there = solution.solved
    np.testing.assert_array_equal(cloud.vertices, solution.points()[there].astype(np.float32))
    np.testing.assert_array_equal(cloud.colors[:, :3], COLOUR[there])
    # trimesh passes over normals of points.
    header, _, body = (tmp_path / "points.ply").read_bytes().partition(b"end_header\n")
    names = re.findall(r"property (\w+) (\w+)", header.decode())
    assert f"element vertex {there.sum()}\n" in header.decode()
    table = np.frombuffer(body, [(name, {"float": "<f4", "uchar": "u1"}[kind]) for kind, name in names])
    normals = np.stack([table[name] for name in ("nx", "ny", "nz")], axis=-1)
    np.testing.assert_array_equal(normals, solution.normals()[there].astype(np.float32))
    assert (normals[:, 2] < 0).all(), "to the camera"


@pytest.mark.parametrize(
    ("file", "green", "bits"),
    [
        ("normals.png", -1, 8),
        ("normals-16.png", -1, 16),
        ("normals-directx.png", 1, 8),
        ("normals-directx-16.png", 1, 16),
    ],
)
def test_normal_maps_have_green_up_or_down(
    file: str, green: int, bits: int, solution: ps.Solution, tmp_path: Path
) -> None:
    saved(solution, tmp_path, file)
    levels = imagecodecs.png_decode((tmp_path / file).read_bytes())
    assert levels.dtype == (np.uint8 if bits == 8 else np.uint16)
    most = 2**bits - 1
    normals = (2.0 * levels / most - 1.0) * (1, green, -1)
    np.testing.assert_allclose(normals[solution.solved], solution.normals()[solution.solved], atol=1.01 / most)
    assert (levels[~solution.solved] == (most + 1) // 2).all()


def test_colmap_reads_the_depth_with_its_camera(solution: ps.Solution, tmp_path: Path) -> None:
    saved(solution, tmp_path, "colmap")
    # As COLMAP's read_write_dense.py reads them.
    width, height, channels, body = (tmp_path / "depth.geometric.bin").read_bytes().split(b"&", 3)
    assert (int(width), int(height), int(channels)) == (SHAPE[1], SHAPE[0], 1)
    depth = np.frombuffer(body, np.float32).reshape((SHAPE[1], SHAPE[0], 1), order="F").transpose(1, 0, 2).squeeze()
    np.testing.assert_array_equal(depth, np.nan_to_num(solution.depth.astype(np.float32), nan=0.0))
    [line] = [line for line in (tmp_path / "cameras.txt").read_text().splitlines() if line and not line.startswith("#")]
    number, model, *sizes = line.split()
    assert (number, model, sizes[:2]) == ("1", "PINHOLE", [str(SHAPE[1]), str(SHAPE[0])])
    fx, fy, cx, cy = map(float, sizes[2:])
    # There, pixels are centred on halves.
    back = unprojected(depth, fx, fy, cx, cy, first=0.5)
    np.testing.assert_allclose(back[solution.solved], solution.points()[solution.solved], rtol=1e-6, atol=1e-7)
    assert ps.Camera.from_file(tmp_path / "cameras.txt") == ps.Camera((30.0, 33.0), (11.0, 7.5))


def test_open3d_reads_the_depth_with_its_camera(solution: ps.Solution, tmp_path: Path) -> None:
    said = saved(solution, tmp_path, "open3d")["open3d-depth.png"]
    camera = json.loads((tmp_path / "open3d-camera.json").read_text())
    assert (camera["width"], camera["height"]) == (SHAPE[1], SHAPE[0])
    matrix = np.array(camera["intrinsic_matrix"]).reshape((3, 3), order="F")
    np.testing.assert_array_equal(matrix, [[30.0, 0.0, 11.0], [0.0, 33.0, 7.5], [0.0, 0.0, 1.0]])
    with Image.open(tmp_path / "open3d-depth.png") as image:
        levels, scale = np.array(image), float(image.info["depth_scale"])
    assert levels.dtype == np.uint16
    assert scale == camera["depth_scale"] == said["depth_scale"]
    # As it makes points of them: 0 is none.
    depth = levels / scale
    np.testing.assert_array_equal(levels > 0, solution.solved)
    np.testing.assert_allclose(depth[solution.solved], solution.depth[solution.solved], rtol=0, atol=0.5001 / scale)
    back = unprojected(depth, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], first=0.0)
    np.testing.assert_allclose(back[solution.solved], solution.points()[solution.solved], atol=1 / scale)


def unprojected(depth: NDArray[Any], fx: float, fy: float, cx: float, cy: float, first: float) -> Array:
    """Points in space; the centre of the first pixel is at `first`."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]] + first
    return np.stack([(column - cx) / fx * depth, (row - cy) / fy * depth, depth], axis=-1)


@pytest.mark.parametrize("file", ["solid.stl", "solid.3mf"])
def test_solids_are_in_millimetres(file: str, solution: ps.Solution, tmp_path: Path) -> None:
    said = saved(solution, tmp_path, file, width=70, base=1.5, mesh_faces=0)
    assert said[file] == {"width": 70.0, "base": 1.5, "unit": "mm"}
    [mesh] = trimesh.load_scene(tmp_path / file).geometry.values()
    expected = solution.solid(70, 1.5)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(expected.volume, rel=1e-5)
    np.testing.assert_allclose(mesh.bounds, expected.bounds, atol=1e-4)
    assert max(mesh.extents[:2]) == pytest.approx(70.0, rel=1e-6)
    if file.endswith("3mf"):
        with zipfile.ZipFile(tmp_path / file) as archive:
            assert b'unit="millimeter"' in archive.read("3D/3dmodel.model")
    else:
        count = struct.unpack("<I", (tmp_path / file).read_bytes()[80:84])[0]
        assert count == len(expected.faces)
    saved(solution, tmp_path / "few", file, mesh_faces=700)
    [few] = trimesh.load_scene(tmp_path / "few" / file).geometry.values()
    assert few.is_watertight
    assert 300 < len(few.faces) <= 700 < len(mesh.faces)


@pytest.mark.parametrize("file", [name for name, one in FORMATS.items() if one.kind in ("data", "mesh", "solid")])
def test_nothing_is_left_half_written(
    file: str, solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = FORMATS[file].write
    assert write is not None
    target = tmp_path / file
    target.write_text("old")

    def fail(*_arguments: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as changed:
        changed.setattr(Path, "replace", fail)
        with pytest.raises(ps.InputError, match=rf"{re.escape(file)} cannot be written: No space left"):
            write(target, Source(solution, Derived(solution)))
    assert [path.name for path in tmp_path.iterdir()] == [file]
    assert target.read_text() == "old"


def test_a_new_kind_of_file_is_a_line_in_the_table(
    solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def write(target: Path, source: Source) -> None:
        np.savetxt(target, source.solution.depth, delimiter=";")

    csv = Format("depth.csv", write, ("table",), alone=True, about=lambda _: {"delimiter": ";"}, memory=10_000)
    monkeypatch.setitem(FORMATS, csv.file, csv)
    monkeypatch.setitem(GROUPS, "table", (csv.file,))
    assert saved(solution, tmp_path / "out", "table") == {"depth.csv": {"delimiter": ";"}}
    [alone] = solution.save(tmp_path / "alone.csv")
    for path in (alone, tmp_path / "out" / "depth.csv"):
        np.testing.assert_allclose(np.loadtxt(path, delimiter=";"), solution.depth)
    assert bytes_for(10**6, Saving.of("table")) > 10**10
    with pytest.raises(ps.InputError, match=r"is it table\?"):
        Saving.of("tabel")
    with pytest.raises(ps.InputError, match=r"table.*depth\.csv"):
        Saving.of("xyz")
