"""What a photo becomes in a folder."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.io.export import write_grey
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.job import Job, solve_photo
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.results import EVERYTHING, PhotoSolution, write
from persfs_cl.surface import geometry
from persfs_cl.surface import render as forward
from persfs_cl.surface.formats.pictures import PREVIEW
from persfs_cl.surface.saving import Saving

BATCH = Saving.of("depth,normals,preview,report")


@pytest.fixture
def solved(tmp_path: Path) -> PhotoSolution:
    scene = ps.bump((16, 20))
    path = tmp_path / "photo.png"
    write_grey(path, scene.image, 16)
    return solve_photo(Job(path, CameraChoice(20.0), Brightness()))


def test_only_what_is_wanted_is_written(solved: PhotoSolution, tmp_path: Path) -> None:
    written = write(solved, tmp_path / "some", BATCH)
    assert {path.name for path in written} == set(BATCH.files) == {path.name for path in (tmp_path / "some").iterdir()}
    report = json.loads((tmp_path / "some" / "report.json").read_text())
    assert report["grey_levels"]["mean_error"] == solved.prepared_residual.mean
    assert report["grey_levels_photo"]["mean_error"] == solved.photo_residual.mean
    assert "photo.png" in (tmp_path / "some" / "relief.js").read_text()
    write(solved, tmp_path / "named", Saving.of("preview"), name="a/b.png")
    assert "a/b.png" in (tmp_path / "named" / "relief.js").read_text()


@pytest.mark.parametrize("file", [*PREVIEW, "index.html", "normals.npy", "mesh.glb"])
def test_a_file_may_be_wanted_alone(solved: PhotoSolution, tmp_path: Path, file: str) -> None:
    written = write(solved, tmp_path / "one", Saving.of(file))
    assert written == [tmp_path / "one" / file] == list((tmp_path / "one").iterdir())


@pytest.mark.parametrize(("items", "said"), [("page,report", "report.json has the same figures."), ("page", "")])
def test_without_scripts_a_page_names_only_what_is_beside_it(
    items: str, said: str, solved: PhotoSolution, tmp_path: Path
) -> None:
    write(solved, tmp_path, Saving.of(items))
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert f"<noscript><p>This page needs JavaScript. {said}".rstrip() + "</p></noscript>" in page


def test_everything_has_the_same_files_and_more(solved: PhotoSolution, tmp_path: Path) -> None:
    few, everything = (write(solved, tmp_path / name, what) for name, what in (("few", BATCH), ("all", EVERYTHING)))
    of_others = {"guide.png", "outline.png"}
    assert {path.name for path in few} < {path.name for path in everything} == {*EVERYTHING.files} - of_others
    for path in few:
        assert path.read_bytes() == (tmp_path / "all" / path.name).read_bytes()


@pytest.mark.parametrize(
    ("items", "expected"),
    [
        ("depth", []),
        ("depth,mesh", []),
        ("normals.npy", ["normal_blocks"]),
        ("normals,report", ["normal_blocks", "render"]),
        ("rendered.png", ["render"]),
        ("report", ["normal_blocks", "render"]),
        # Once for all pixels, and once for those that the relief shows.
        ("depth,normals,pictures,report,mesh", ["normal_blocks", "normal_blocks", "render"]),
    ],
)
def test_nothing_is_computed_twice_or_in_vain(
    items: str, expected: list[str], solved: PhotoSolution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    for module, name in ((geometry, "normal_blocks"), (forward, "render")):
        original = getattr(module, name)

        def counted(*arguments: object, original: object = original, name: str = name, **keywords: object) -> object:
            asked.append(name)
            return original(*arguments, **keywords)  # type: ignore[operator]

        monkeypatch.setattr(module, name, counted)
    write(solved, tmp_path / "out", Saving.of(items))
    if "report" in items:
        assert solved.prepared_residual.count == solved.photo_residual.count == 320
    assert sorted(asked) == expected


def test_a_failure_leaves_nothing(solved: PhotoSolution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object, **_keywords: object) -> list[str]:
        raise ps.InputError("no room for previews")

    monkeypatch.setattr("persfs_cl.pipeline.results.write_preview", fail)
    with pytest.raises(ps.InputError, match="no room for previews"):
        write(solved, tmp_path / "above" / "out", BATCH)
    assert not (tmp_path / "above").exists()


@pytest.mark.thorough
def test_results_are_written_in_threads_at_once(solved: PhotoSolution, tmp_path: Path) -> None:
    saving = Saving.of("pictures,mesh,report", mesh_faces=100)

    def contents(name: str) -> dict[str, bytes]:
        return {path.name: path.read_bytes() for path in write(solved, tmp_path / name, saving)}

    alone = contents("alone")
    with ThreadPoolExecutor(4) as pool:
        assert all(found == alone for found in pool.map(contents, "abcd"))


def test_colours_of_the_photograph_go_to_a_mesh_that_was_simplified(solved: PhotoSolution, tmp_path: Path) -> None:
    write(solved, tmp_path / "out", Saving.of("mesh", mesh_faces=100))
    mesh = trimesh.load_mesh(tmp_path / "out" / "mesh.ply", process=False)
    assert 50 <= len(mesh.faces) <= 100
    colours: NDArray[np.uint8] = np.asarray(mesh.visual.vertex_colors)[:, :3]  # type: ignore[union-attr]
    own = {tuple(colour) for colour in solved.colour.reshape(-1, 3)}
    assert {tuple(colour) for colour in colours} <= own
