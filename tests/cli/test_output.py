"""Where results go: all of them, or none."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import FOCAL, HEIGHT, WIDTH, names, run

from persfs_cl.io import files
from persfs_cl.io.export import write_grey


def test_output_folder_is_checked_before_the_photo_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    places = {"file": "is a file", "file/below": "Not a directory", "full": "--overwrite", "x" * 300: "too long"}
    for place, message in places.items():
        outcome = run("reconstruct", tmp_path / "missing.png", "-o", tmp_path / place, *FOCAL)
        assert (outcome.status, outcome.stdout) == (2, "")
        assert message in outcome.stderr
        assert "missing.png" not in outcome.stderr
    assert names(tmp_path) == {"file", "full"}
    assert names(tmp_path / "full") == {"mine"}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder in which even root can create nothing")
def test_output_folder_must_be_writable() -> None:
    outcome = run("reconstruct", "missing.png", "-o", "/proc/self/out", *FOCAL)
    assert outcome.status == 2
    assert "/proc/self/out cannot be written" in outcome.stderr


@pytest.mark.usefixtures("quick")
def test_overwrite_replaces_results_and_keeps_other_files(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine").write_text("mine")
    (out / "depth.npy").write_text("old")
    assert run("reconstruct", photo, "-o", out, *FOCAL, "--overwrite").status == 0
    assert (out / "mine").read_text() == "mine"
    assert np.load(out / "depth.npy").shape == (HEIGHT, WIDTH)
    assert names(out) == {
        "mine",
        "camera.json",
        "depth.npy",
        "depth.tiff",
        "mesh.ply",
        "report.json",
        "solution.npz",
        "index.html",
    }


@pytest.mark.usefixtures("quick")
def test_overwrite_leaves_no_file_of_the_earlier_run_and_all_of_others(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("reconstruct", photo, "-o", out, *FOCAL, "--save", "depth.npy,normals.npy,mesh.ply,page").status == 0
    (out / "mesh.obj").write_text("of another program")
    (out / "mesh.ply").write_text("changed by hand")
    os.utime(out / "normals.npy", ns=(1, 1))  # as if changed by hand, with the same size
    assert run("reconstruct", photo, "-o", out, *FOCAL, "--save", "depth.tiff").status == 2
    assert names(out) == {"depth.npy", "normals.npy", "mesh.ply", "mesh.obj", "index.html"}

    options = ("--save", "depth.tiff,report", "--guide", out / "depth.npy", "--overwrite")
    outcome = run("reconstruct", photo, "-o", out, *FOCAL, *options)
    assert outcome.status == 0, outcome.stderr
    # An input stays, whoever made it.
    assert names(out) == {"depth.npy", "depth.tiff", "report.json", "mesh.ply", "mesh.obj", "normals.npy"}
    options = ("--save", "mesh.stl", "--camera", tmp_path / "own" / "camera.json", "--overwrite")
    assert run("reconstruct", photo, "-o", tmp_path / "own", *FOCAL, "--save", "depth").status == 0
    assert run("reconstruct", photo, "-o", tmp_path / "own", *options).status == 0
    assert names(tmp_path / "own") == {"camera.json", "mesh.stl"}


@pytest.mark.usefixtures("quick")
def test_overwrite_replaces_the_camera_of_a_run_and_none_that_was_made_by_hand(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("reconstruct", photo, "-o", out, *FOCAL, "--save", "depth").status == 0
    again = ("reconstruct", photo, "-o", out, "--camera", out / "camera.json", "--save", "depth", "--overwrite")
    assert run(*again).status == 0
    written = (out / "camera.json").read_text(encoding="utf-8")
    (out / "camera.json").write_text(f"{written}\n", encoding="utf-8")
    outcome = run(*again)
    assert outcome.status == 2
    assert "camera.json is an input, and a result has this name" in outcome.stderr
    assert (out / "camera.json").read_text(encoding="utf-8") == f"{written}\n"


@pytest.mark.usefixtures("quick")
@pytest.mark.filterwarnings("always:")
def test_a_mesh_without_a_triangle_is_told_of(tmp_path: Path) -> None:
    write_grey(tmp_path / "photo.png", np.linspace(0.4, 0.9, 81).reshape(9, 9))
    dots = np.zeros((9, 9), bool)
    dots[1::2, 1::2] = True
    np.save(tmp_path / "dots.npy", dots)
    common = ("reconstruct", tmp_path / "photo.png", *FOCAL, "--light=flash", "--mask", tmp_path / "dots.npy", "-o")
    outcome = run(*common, tmp_path / "out", "--save", "depth,mesh")
    assert outcome.status == 1
    assert "warning: mesh.ply could not be made: no three neighbouring pixels have a depth" in outcome.stderr
    assert names(tmp_path / "out") == {"depth.npy", "depth.tiff", "camera.json"}
    for file in ("mesh.obj", "mesh.stl", "mesh.glb"):
        assert run(*common, tmp_path / "none", "--save", file).status == 1
        assert not (tmp_path / "none").exists()


@pytest.mark.usefixtures("quick")
def test_a_run_that_fails_leaves_the_results_of_the_earlier_one(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    common = ("reconstruct", photo, "-o", out, *FOCAL)
    assert run(*common, "--save", "depth,mesh").status == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}

    def fail(*_arguments: object, **_keywords: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("persfs_cl.io.clouds._put", fail)
    assert run(*common, "--save", "points", "--overwrite").status == 1
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


def test_no_result_takes_the_place_of_an_input(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "photo.jpg").write_bytes(photo.read_bytes())
    outcome = run("reconstruct", out / "photo.jpg", "-o", out, *FOCAL, "--overwrite")
    assert outcome.status == 2
    assert "photo.jpg is an input, and a result has this name: choose another folder" in outcome.stderr
    assert (out / "photo.jpg").read_bytes() == photo.read_bytes()


@pytest.mark.parametrize("existing", [False, True])
def test_full_disk_leaves_nothing_behind(
    existing: bool, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    out = tmp_path / "above" / "out"
    if existing:
        out.mkdir(parents=True)
        (out / "depth.npy").write_text("old")
    monkeypatch.setattr("persfs_cl.io.clouds._put", fail)  # after depth.npy and others
    if existing:  # pictures are files like the others
        monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    outcome = run("reconstruct", photo, "-o", out, *FOCAL, "--overwrite")
    assert (outcome.status, outcome.stdout) == (1, "")
    assert f"{out / 'mesh.ply'} cannot be written: No space left on device" in outcome.stderr
    assert out.parent.exists() == existing
    if existing:
        assert names(out) == {"depth.npy"}
        assert (out / "depth.npy").read_text() == "old"


@pytest.mark.usefixtures("quick")
def test_what_a_killed_run_left_does_not_fill_the_folder(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    left = out / f".persfs-cl-{files._machine()}-{'1' * 32}-abc"
    left.mkdir(parents=True)
    (left / "depth.npy").write_text("half")
    assert run("reconstruct", photo, "-o", out, *FOCAL).status == 0
    assert names(out) == {
        "camera.json",
        "depth.npy",
        "depth.tiff",
        "mesh.ply",
        "report.json",
        "solution.npz",
        "index.html",
    }


def test_what_is_written_can_be_chosen(photo: Path, tmp_path: Path) -> None:
    items = "depth.tiff,normals.npy,mesh.glb,report"
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--save", items, "--mesh-faces", "200")
    assert outcome.status == 0
    expected = ["depth.tiff", "normals.npy", "report.json", "mesh.glb"]
    assert outcome.stdout.split() == [str(tmp_path / "out" / name) for name in expected]
    assert names(tmp_path / "out") == set(expected)
    normals = np.load(tmp_path / "out" / "normals.npy")
    assert (normals.dtype, normals.shape) == (np.float32, (HEIGHT, WIDTH, 3))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, rtol=1e-6)
    mesh = trimesh.load_mesh(tmp_path / "out" / "mesh.glb")
    assert 100 < len(mesh.faces) <= 200 < 2 * (HEIGHT - 1) * (WIDTH - 1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--save", "depth,mash"), "--save has the item 'mash', which is none: is it mesh?"),
        (("--save", ","), "--save , names nothing to write"),
        (
            ("--mesh-faces", "7"),
            "--mesh-faces 7 is not a number of triangles: give a whole number, 100 or more, or 0 for all.",
        ),
    ],
)
def test_a_wrong_choice_is_refused_before_the_photo_is_read(
    options: tuple[str, str], message: str, tmp_path: Path
) -> None:
    outcome = run("reconstruct", tmp_path / "missing.png", "-o", tmp_path / "out", *FOCAL, *options)
    assert (outcome.status, outcome.stdout) == (2, "")
    assert message in outcome.stderr
    assert "missing.png" not in outcome.stderr


def test_a_solid_to_print_can_be_asked_for(photo: Path, tmp_path: Path) -> None:
    arguments = ("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--save", "report")
    outcome = run(*arguments, "--solid", "--width", "42", "--base", "1.5")
    assert outcome.status == 0
    assert names(tmp_path / "out") == {"report.json", "solid.stl"}
    solid = trimesh.load_mesh(tmp_path / "out" / "solid.stl")
    assert solid.is_watertight
    assert max(solid.extents[:2]) == pytest.approx(42.0, rel=1e-6)
    for options, message in (
        (("--width", "42"), "'--width' / '--base': a size is for what is printed: add --solid"),
        (("--solid", "--width", "-1"), "--width -1.* is not a length in millimetres"),
        (("--save", "solid.xyz"), "has the item 'solid.xyz', which is none: is it solid"),
    ):
        outcome = run(*arguments[:4], *FOCAL, "--overwrite", *options)
        assert outcome.status == 2
        assert re.search(message, outcome.stderr), outcome.stderr


@pytest.mark.usefixtures("quick")
def test_what_fails_while_files_are_made_is_told_in_the_words_of_the_command(photo: Path, tmp_path: Path) -> None:
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--save", "solid.stl", "--width", "1e-9")
    assert outcome.status == 1
    assert "--base 3.0 is too thick for --width 1e-09" in outcome.stderr
    assert not (tmp_path / "out").exists()
