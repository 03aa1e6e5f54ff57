"""What a solution can do: geometry, report, files."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import persfs_cl as ps
from persfs_cl.images import read_depth


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


def test_the_rendered_surface_resembles_the_image(solution: ps.Solution) -> None:
    rendered = solution.render()
    assert (np.isnan(rendered) == ~solution.solved).all()
    errors = solution.grey_errors()
    assert errors.mean == pytest.approx(255 * np.nanmean(np.abs(np.clip(rendered, 0, 1) - solution.image)), rel=1e-6)
    assert errors.mean < 6.0
    shifted = solution.grey_errors(solution.image + 2.0)
    assert shifted.mean == pytest.approx(255 * np.nanmean(solution.image + 2.0 - np.clip(rendered, 0, 1)), rel=1e-6)


def test_report_is_plain_json_and_complete(solution: ps.Solution) -> None:
    report = json.loads(json.dumps(solution.report(), allow_nan=False))
    assert report["status"] == "CONVERGED"
    assert report["iterations"] == len(report["changes"]) == solution.iterations
    assert report["pixels"] == {"all": 2000, "solved": 1960, "unreached": 0, "clamped": 0}
    assert report["parameters"]["scheme"] == "lax-friedrichs"
    assert report["parameters"]["boundary"] == "outflow"
    assert report["parameters"]["light"] == {"kind": "ParallelLight", "p0": 0.0, "q0": 0.0}
    assert report["device"]["name"] == solution.device.name
    assert report["versions"]["persfs-cl"] == ps.__version__
    assert 0 < report["seconds"]["kernels"] < report["seconds"]["total"]
    assert report["grey_levels"]["mean_error"] == pytest.approx(solution.grey_errors().mean)
    assert report["parameters"]["principal_point"] == [24.5, 19.5]


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


@pytest.mark.parametrize("name", ["z.npy", "z.tiff", "z.tif", "z.png", "z.ply", "z.obj", "z.stl", "z.glb", "z.json"])
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
    assert not (tmp_path / "surface.xyz").exists()


@pytest.mark.parametrize("exists", [True, False])
def test_a_folder_may_have_a_dot_in_its_name(
    exists: bool, solution: ps.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ps.Solution, "_draw", lambda _self, _folder: [])
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

    monkeypatch.setattr(trimesh.Trimesh, "export", fail)  # after depth.npy and others
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
