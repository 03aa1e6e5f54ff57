"""Files as cameras write them, from the command line: raw photographs, dark frames and pages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from command import FOCAL, HEIGHT, SCENE, WIDTH, run, strict
from dng import mosaic, write_dng
from videos import make_video

import persfs_cl as ps
from persfs_cl.colour import encode_srgb
from persfs_cl.preparation.normalise import normalise_linear

DARK = 0.05


@pytest.fixture
def raw(tmp_path: Path) -> Path:
    """A raw photo of a scene, twice as large, with light that is not the lamp's."""
    light = np.repeat(np.repeat(0.7 * SCENE.image, 2, axis=0), 2, axis=1)
    return write_dng(tmp_path / "photo.dng", mosaic(light + DARK), focal_length_35mm=40)


def test_a_raw_photo_and_its_dark_frame_become_a_surface(raw: Path, tmp_path: Path) -> None:
    dark = write_dng(tmp_path / "dark.dng", mosaic(np.full((2 * HEIGHT, 2 * WIDTH), DARK)))
    out = tmp_path / "out"
    outcome = run("reconstruct", raw, "-o", out, *FOCAL, "--half-size", "--ambient", dark, "--save", "depth,report")
    assert outcome.status == 0, outcome.stderr
    expected = ps.reconstruct(normalise_linear(SCENE.image), ps.Camera(WIDTH)).depth
    np.testing.assert_allclose(np.load(out / "depth.npy"), expected, rtol=2e-3)
    photo = strict(out / "report.json")["photo"]
    told = {name: photo[name] for name in ("encoding", "bits", "profile", "half_size", "ambient")}
    assert told == {"encoding": "linear", "bits": 16, "profile": "camera", "half_size": True, "ambient": str(dark)}


def test_a_flat_field_of_the_same_camera_is_divided_by(raw: Path, tmp_path: Path) -> None:
    flat = write_dng(tmp_path / "flat.dng", mosaic(np.full((2 * HEIGHT, 2 * WIDTH), 0.5)))
    depths = []
    for name, more in (("plain", ()), ("flat", ("--vignetting", flat))):
        out = tmp_path / name
        outcome = run("reconstruct", raw, "-o", out, *FOCAL, "--half-size", "--save", "depth", *more)
        assert outcome.status == 0, outcome.stderr
        depths.append(np.load(out / "depth.npy"))
    np.testing.assert_allclose(depths[1], depths[0], rtol=1e-3)


def test_a_batch_knows_raw_photos_by_their_headers(raw: Path, tmp_path: Path) -> None:
    outcome = run("batch", raw.parent, "-o", tmp_path / "out", "--half-size", "--dry-run")
    assert outcome.status == 0, outcome.stderr
    assert f"{WIDTH} x {HEIGHT}" in outcome.stdout + outcome.stderr


def test_the_focal_length_of_the_exif_data_is_of_half_the_size(raw: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("reconstruct", raw, "-o", out, "--half-size", "--save", "report").status == 0
    expected = 40 * np.hypot(HEIGHT, WIDTH) / np.hypot(24, 36)
    assert strict(out / "report.json")["parameters"]["focal_length"] == pytest.approx([expected, expected])


def test_half_the_size_of_another_file_is_refused(photo: Path, tmp_path: Path) -> None:
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--half-size")
    assert outcome.status == 1
    assert "--half-size is for camera raw files" in outcome.stderr
    outcome = run("batch", photo, "-o", tmp_path / "out", *FOCAL, "--half-size", "--dry-run")
    assert "--half-size is for camera raw files" in outcome.stdout + outcome.stderr


def test_a_page_is_chosen(tmp_path: Path) -> None:
    path = tmp_path / "pages.tif"
    samples = np.rint(65535 * encode_srgb(SCENE.image)).astype(np.uint16)
    tifffile.imwrite(path, np.stack([samples[::-1], samples]), photometric="minisblack")
    outcome = run("reconstruct", path, "-o", tmp_path / "out", *FOCAL)
    assert outcome.status == 1
    assert "has 2 pages: choose one by --page, from 1 to 2" in outcome.stderr
    outcome = run("reconstruct", path, "-o", tmp_path / "out", *FOCAL, "--page", "2", "--save", "depth,report")
    assert outcome.status == 0, outcome.stderr
    expected = ps.reconstruct(normalise_linear(SCENE.image), ps.Camera(WIDTH)).depth
    np.testing.assert_allclose(np.load(tmp_path / "out" / "depth.npy"), expected, rtol=1e-3)
    assert strict(tmp_path / "out" / "report.json")["photo"]["page"] == 2
    assert "there is no page 3" in run("reconstruct", path, "-o", tmp_path / "o", *FOCAL, "--page", "3").stderr


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("option", [("--page", "2"), ("--half-size",)])
def test_frames_of_a_video_have_neither_pages_nor_half_sizes(tmp_path: Path, option: tuple[str, ...]) -> None:
    levels = np.rint(255 * encode_srgb(SCENE.image)).astype(np.uint8)
    make_video(tmp_path / "clip.mkv", [np.repeat(levels[..., None], 3, axis=-1)])
    outcome = run("batch", tmp_path / "clip.mkv", "-o", tmp_path / "out", *FOCAL, *option)
    assert outcome.status == 1
    assert f"{' '.join(option)} is not for a video such as" in outcome.stdout + outcome.stderr
