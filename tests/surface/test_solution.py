"""What a solution can do: geometry, report, files."""

from __future__ import annotations

import dataclasses
import errno
import io
import itertools
import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image

import persfs_cl as ps
from persfs_cl import blocks
from persfs_cl.io.maps import read_depth
from persfs_cl.shading.model import Light
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.phong import Phong
from persfs_cl.surface import plots as pictures
from persfs_cl.surface.confidence import SlopeErrors
from persfs_cl.surface.solved import Derived


@pytest.fixture(scope="module")
def solution() -> ps.Solution:
    scene = ps.bump(shape=(40, 50))
    mask = np.ones((40, 50), bool)
    mask[10:14, 20:30] = False
    return ps.reconstruct(scene.image, scene.camera, mask=mask, known_depth=5.0 * scene.known_depth)


def test_geometry_belongs_together(solution: ps.Solution) -> None:
    np.testing.assert_allclose(solution.points()[..., 2], solution.depth)
    np.testing.assert_allclose(np.exp(solution.log_depth), solution.depth)
    lengths = np.linalg.norm(solution.normals(), axis=-1)
    np.testing.assert_allclose(lengths[solution.solved], 1.0)
    assert (np.isnan(lengths) == ~solution.solved).all()
    mesh = solution.mesh()
    assert len(mesh.vertices) == solution.solved.sum()
    visual: Any = mesh.visual
    assert visual.vertex_colors.shape == (len(mesh.vertices), 4)


def test_it_says_what_it_is_in_a_line(solution: ps.Solution) -> None:
    said = repr(solution)
    assert "\n" not in said
    low, high = np.nanmin(solution.depth), np.nanmax(solution.depth)
    for part in ("CONVERGED", f"{solution.iterations} iterations", "1960 of 50 x 40", f"{low:.4g} to {high:.4g}"):
        assert part in said


def test_it_travels_to_other_processes(solution: ps.Solution) -> None:
    other = pickle.loads(pickle.dumps(solution))
    assert other.device is solution.device
    np.testing.assert_array_equal(other.depth, solution.depth)
    elsewhere = pickle.dumps(solution).replace(solution.device.name.encode(), b"?" * len(solution.device.name))
    with pytest.raises(ps.DeviceError, match="is not there"):
        pickle.loads(elsewhere)


def test_the_rendered_surface_resembles_the_image(solution: ps.Solution) -> None:
    rendered = solution.render()
    assert (np.isnan(rendered) == ~solution.solved).all()
    errors = solution.residual()
    assert errors.mean == pytest.approx(255 * np.nanmean(np.abs(np.clip(rendered, 0, 1) - solution.image)), rel=1e-6)
    assert errors.mean < 6.0
    shifted = solution.residual(solution.image + 2.0)
    assert shifted.mean == pytest.approx(255 * np.nanmean(solution.image + 2.0 - np.clip(rendered, 0, 1)), rel=1e-6)


def test_report_is_plain_json_and_complete(solution: ps.Solution) -> None:
    report = json.loads(json.dumps(solution.report(), allow_nan=False))
    assert report["status"] == "CONVERGED"
    assert report["iterations"] == len(report["changes"]) == solution.iterations
    none = dict.fromkeys(("unreached", "clamped", "at_bound", "walls", "walls_solved"), 0)
    pixels = {"all": 2000, "solved": 1960, **none}
    assert report["pixels"] == pixels
    assert report["parameters"]["scheme"] == "upwind"
    assert report["parameters"]["boundary"] == "wall"
    assert report["parameters"]["light"] == {"kind": "ParallelLight", "p0": 0.0, "q0": 0.0}
    assert report["device"]["name"] == solution.device.name
    assert report["versions"]["persfs-cl"] == ps.__version__
    assert 0 < report["seconds"]["kernels"] < report["seconds"]["total"]
    assert report["grey_levels"]["mean_error"] == pytest.approx(solution.residual().mean)
    assert report["parameters"]["principal_point"] == [24.5, 19.5]


@pytest.mark.parametrize("light", [ps.ParallelLight(0.3, -0.2), ps.FlashLight(), ps.FlashLight(offset=(0.1, 0.0, 0.0))])
def test_slope_error_is_that_of_a_brightness_one_percent_wrong(light: Light, solution: ps.Solution) -> None:
    confidence = dataclasses.replace(solution, light=light).confidence()
    points, normals = solution.points(), solution.normals()
    if isinstance(light, ps.FlashLight):
        directions = np.array(light.offset) - points
    else:
        directions = np.broadcast_to([-0.3, 0.2, -1.0], points.shape)
    cosine = (normals * directions).sum(-1) / np.linalg.norm(directions, axis=-1)
    cosine[cosine < 0.01] = np.nan
    slope, darker = (np.sqrt(1.0 / (share * cosine) ** 2 - 1.0) for share in (1.0, 0.99))
    matching = np.isfinite(cosine)
    assert matching.sum() > 0.8 * solution.solved.sum()
    np.testing.assert_allclose(confidence.slope_error[matching], (darker - slope)[matching], rtol=0.07)
    np.testing.assert_array_equal(np.isnan(confidence.slope_error), ~solution.solved)


def test_slope_error_foretells_what_noise_does() -> None:
    light = ps.FlashLight()
    scene = ps.bump((120, 120), light=light, relief=0.5)
    noise = 1.0 + 0.01 * np.random.default_rng(3).standard_normal(scene.image.shape)
    clean, noisy = (ps.reconstruct(image, scene.camera, light=light) for image in (scene.image, scene.image * noise))

    def slope(solution: ps.Solution) -> NDArray[np.float64]:
        points = solution.points()
        cosine = -(solution.normals() * points).sum(-1) / np.linalg.norm(points, axis=-1)
        return np.asarray(np.sqrt(1.0 / cosine**2 - 1.0))

    foretold = clean.confidence().slope_error
    found = np.abs(slope(noisy) - slope(clean))
    bounds = np.quantile(foretold, (0.0, 0.25, 0.5, 0.75, 1.0))
    for low, high in itertools.pairwise(bounds):
        quarter = (foretold >= low) & (foretold <= high)
        # 0.67 is the median of |noise| in units of its deviation; differences of neighbours hear more than one pixel.
        assert 0.4 < np.median(found[quarter]) / np.median(foretold[quarter]) < 1.5


def test_doubts_are_counted_after_those_of_the_solver(solution: ps.Solution) -> None:
    shadow, paint = np.zeros((2, 40, 50), dtype=bool)
    shadow[:3] = True
    paint[2:4] = True
    confidence = solution.confidence({"shadow": shadow, "paint": paint})
    assert list(confidence.unreliable) == ["unreached", "clamped", "shadow", "paint"]
    report = solution.report({"shadow": shadow, "paint": paint})["confidence"]
    assert report == json.loads(json.dumps(confidence.report(), allow_nan=False))
    assert report["doubtful_pixels"] == {"unreached": 0, "clamped": 0, "shadow": 150, "paint": 100, "any": 200}
    assert report["slope_error"]["median"] == pytest.approx(np.nanmedian(confidence.slope_error))
    with pytest.raises(ps.InputError, match=r"unreliable\['shadow'\] is bool of shape \(3, 50\)"):
        solution.confidence({"shadow": shadow[:3]})


@pytest.mark.parametrize("reflectance", [ps.OrenNayar(0.3), ps.OrenNayar(0.9), ps.Phong(0.7, 0.3, 20)])
def test_slope_error_of_other_materials(reflectance: OrenNayar | Phong) -> None:
    slope = np.array([0.1, 0.3, 0.6, 0.9, 1.5, 4.0])
    change = SlopeErrors(reflectance)(1.0 / np.hypot(1.0, slope))
    here, beyond, before = (
        np.log(reflectance.coaxial(1.0 / np.hypot(1.0, slope + sign * change))) for sign in (0, 1, -1)
    )
    # The expansion is for small changes: one side or the other may be off, but not both.
    moved = np.maximum(np.abs(beyond - here), np.abs(before - here))
    np.testing.assert_allclose(moved, 0.01, rtol=0.5)


def test_saving_to_a_folder_writes_everything(solution: ps.Solution, tmp_path: Path) -> None:
    written = solution.save(tmp_path / "new" / "folder", report={"photo": "a.png"})
    assert all(path.is_file() and path.stat().st_size > 0 for path in written)
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == sorted(p.name for p in written)
    assert {"depth.npy", "depth.tiff", "depth.png", "normals.png", "mesh.ply", "rendered.png", "report.json"} <= {
        path.name for path in written
    }
    np.testing.assert_array_equal(np.load(tmp_path / "new" / "folder" / "depth.npy"), solution.depth)
    np.testing.assert_allclose(read_depth(tmp_path / "new" / "folder" / "depth.tiff"), solution.depth, rtol=1e-6)
    mesh = trimesh.load_mesh(tmp_path / "new" / "folder" / "mesh.ply", process=False)
    assert len(mesh.vertices) == solution.solved.sum()
    assert json.loads((tmp_path / "new" / "folder" / "report.json").read_text())["photo"] == "a.png"


def test_saving_to_a_folder_writes_what_is_wanted(solution: ps.Solution, tmp_path: Path) -> None:
    written = solution.save(tmp_path / "some", save=["normals.npy", "mesh.obj", "mesh.stl"], mesh_faces=500)
    assert [path.name for path in written] == ["normals.npy", "mesh.obj", "mesh.stl"]
    assert sorted(path.name for path in (tmp_path / "some").iterdir()) == sorted(path.name for path in written)
    np.testing.assert_array_equal(np.load(written[0]), solution.normals().astype(np.float32))
    for path in written[1:]:
        assert 300 < len(trimesh.load_mesh(path).faces) <= 500 < len(solution.mesh().faces)
    with pytest.raises(ps.InputError, match="save='depth,preview' has previews"):
        solution.save(tmp_path / "none", save="depth,preview")
    assert not (tmp_path / "none").exists()


def test_a_mesh_is_simplified_on_request(solution: ps.Solution, tmp_path: Path) -> None:
    solution.save(tmp_path / "few.ply", mesh_faces=500)
    solution.save(tmp_path / "all.ply", mesh_faces=None)
    few, everything = (trimesh.load_mesh(tmp_path / f"{name}.ply", process=False) for name in ("few", "all"))
    assert 300 < len(few.faces) <= 500
    assert len(everything.faces) == len(solution.mesh().faces) == len(solution.mesh(mesh_faces=0).faces)
    with pytest.raises(ps.InputError, match="mesh_faces=3 is not a number of triangles"):
        solution.mesh(mesh_faces=3)


@pytest.mark.parametrize(
    "name", ["z.npy", "z.tiff", "z.tif", "z.png", "z.ply", "z.obj", "z.stl", "z.glb", "z.json", "z.exr", "z.3mf"]
)
def test_saving_to_one_file(solution: ps.Solution, tmp_path: Path, name: str) -> None:
    assert solution.save(tmp_path / name) == [tmp_path / name]
    assert (tmp_path / name).stat().st_size > 0
    assert [path.name for path in tmp_path.iterdir()] == [name], "nothing else is left behind"


def test_saving_where_it_cannot_be_is_refused(solution: ps.Solution, tmp_path: Path) -> None:
    with pytest.raises(ps.InputError, match="no known suffix"):
        solution.save(tmp_path / "surface.xyz")
    (tmp_path / "file").write_text("")
    with pytest.raises(ps.InputError, match=r"folder cannot be written: Not a directory.*choose another path"):
        solution.save(tmp_path / "file" / "folder")
    with pytest.raises(ps.InputError, match="3 is no path"):
        solution.save(3)  # type: ignore[arg-type]
    assert not (tmp_path / "surface.xyz").exists()


@pytest.mark.parametrize("exists", [True, False])
def test_a_folder_may_have_a_dot_in_its_name(
    exists: bool, solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Pictures take far longer than the rest.
    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    folder = tmp_path / "run.2"
    if exists:
        folder.mkdir()
    written = solution.save(folder, folder=not exists)
    assert sorted(folder.iterdir()) == sorted(written)
    assert folder / "report.json" in written


@pytest.mark.parametrize("exists", [True, False])
def test_saving_to_a_folder_writes_all_or_nothing(
    exists: bool, solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("persfs_cl.io.clouds._put", fail)  # after depth.npy and others
    # Pictures are files like the others.
    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    folder = tmp_path / "above" / "folder"
    if exists:
        folder.mkdir(parents=True)
        (folder / "depth.npy").write_text("old")
    with pytest.raises(ps.InputError, match=r"above/folder/mesh\.ply cannot be written: No space left"):
        solution.save(folder)
    if exists:
        assert {path.name: path.read_text() for path in folder.iterdir()} == {"depth.npy": "old"}
    else:
        assert not list(tmp_path.iterdir())


def test_confidence_does_not_depend_on_the_size_of_blocks(
    solution: ps.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    for light in (ps.ParallelLight(0.3, -0.2), ps.FlashLight(offset=(0.1, 0.0, 0.0))):
        lit = dataclasses.replace(solution, light=light)
        with monkeypatch.context() as changed:
            changed.setattr(blocks, "_PIXELS", 150)
            by_blocks = lit.confidence().slope_error
        np.testing.assert_array_equal(by_blocks, lit.confidence().slope_error)


def test_a_matplotlib_that_cannot_be_imported_costs_nothing_else(
    solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail() -> None:
        # As it does where it may write nowhere.
        raise OSError("requires access to a writable cache directory") from FileNotFoundError("no temporary directory")

    monkeypatch.setattr(pictures.canvas, "load_matplotlib", fail)
    with pytest.warns(UserWarning, match=r"could not be drawn \(OSError: requires access"):
        solution.save(tmp_path / "result")
    assert {file.name for file in (tmp_path / "result").iterdir()} >= {"depth.npy", "mesh.ply", "report.json"}


@pytest.mark.parametrize("name", ["depth", "normals", "relief", "comparison", "confidence", "convergence"])
def test_a_picture_that_cannot_be_drawn_costs_nothing_else(
    name: str, solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise RuntimeError("no\nlatex")

    drawings = ("depth", "relief", "comparison", "confidence", "convergence")
    for drawing in drawings:
        # The others need not be drawn for this.
        monkeypatch.setattr(pictures, f"{drawing}_picture", fail if drawing == name else lambda *_a, **_k: None)
    if name == "normals":
        monkeypatch.setattr(Derived, "normal_colours", property(fail))
    with pytest.warns(UserWarning, match=rf"^{name}.png could not be drawn \(RuntimeError: no latex\)") as caught:
        written = solution.save(tmp_path / "out")
    assert [warning.filename for warning in caught] == [__file__]
    kept = {
        "camera.json",
        "depth.npy",
        "depth.tiff",
        "mesh.ply",
        "report.json",
        "solution.npz",
        "rendered.png",
        "normals.png",
    }
    kept -= {f"{name}.png"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == kept
    assert {path.name for path in written} == kept | {f"{drawing}.png" for drawing in drawings if drawing != name}


def test_reports_are_strict_json(solution: ps.Solution, tmp_path: Path) -> None:
    solution.save(tmp_path / "z.json", report={"odd": [np.inf, {"nan": float("nan")}, (1.5, -np.inf)]})

    def refuse(name: str) -> None:
        raise AssertionError(name)

    loaded = json.loads((tmp_path / "z.json").read_text(), parse_constant=refuse)
    assert loaded["odd"] == [None, {"nan": None}, [1.5, None]]


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        ((3, 3), 1),
        pytest.param((1, 2), 2, marks=pytest.mark.thorough),
        pytest.param((9, 1), 9, marks=pytest.mark.thorough),
    ],
)
def test_the_smallest_surfaces_can_be_saved(shape: tuple[int, int], count: int, tmp_path: Path) -> None:
    image = np.random.default_rng(1).uniform(0.4, 0.9, shape)
    mask = np.arange(image.size).reshape(shape) < count
    found = ps.reconstruct(image, ps.Camera(20.0), light=ps.FlashLight(), mask=mask)
    np.testing.assert_array_equal(np.isfinite(found.depth), found.solved)
    assert found.solved.sum() == count
    with pytest.warns(UserWarning, match="mesh.ply could not be made: no three neighbouring pixels have a depth"):
        files = found.save(tmp_path)
    assert len(files) == 12
    assert all(path.stat().st_size > 0 for path in files)


def test_what_is_compared_and_doubted_is_checked(solution: ps.Solution) -> None:
    with pytest.raises(ps.InputError, match=r"photo has shape \(3,\)"):
        solution.residual(np.ones(3))
    with pytest.raises(ps.InputError, match=r"photo goes up to 1e\+308"):
        solution.residual(np.full(solution.depth.shape, 1e308))
    with pytest.raises(ps.InputError, match="photo is no array"):
        solution.residual([[1.0], [2.0, 3.0]])  # type: ignore[arg-type]
    for unreliable in (3.0, np.ones((40, 50), bool)):
        with pytest.raises(ps.InputError, match="no mapping"):
            solution.confidence(unreliable)  # type: ignore[arg-type]


@pytest.mark.parametrize("black", [0.0, np.nan, np.inf, 1e308])
def test_black_or_no_brightness_at_known_depths_spoils_no_report(black: float) -> None:
    image = np.full((3, 4), black)
    image[1, 1:3] = 0.5, 0.6
    known = np.where(np.isfinite(image) & (image > 0) & (image < 1), np.nan, 1.0)
    mask = np.isnan(known)
    found = ps.reconstruct(image, ps.Camera(20.0), light=ps.FlashLight(falloff=False), mask=mask, known_depth=known)
    alone = dataclasses.replace(found, depth=known, log_depth=np.log(known), solved=~mask)
    for solution in (found, alone):
        assert solution.white == (1.0 if solution is alone else 0.6)
    json.dumps(found.report(), allow_nan=False)


def test_a_notebook_shows_the_surface(solution: ps.Solution) -> None:
    shown = solution._repr_png_()
    assert shown is not None
    with Image.open(io.BytesIO(shown)) as picture:
        assert min(picture.size) > 150
    page = solution._repr_html_()
    assert page is not None
    assert page.count("<img ") == 2
    assert page.count("<iframe ") == 1
    nothing = dataclasses.replace(
        solution, depth=np.full_like(solution.depth, np.nan), solved=np.zeros_like(solution.solved)
    )
    for empty in (nothing, dataclasses.replace(solution, depth=nothing.depth)):
        assert empty._repr_png_() is None
        assert empty._repr_html_() is None
        assert "nan" not in repr(empty)
