"""``persfs-cl render``: the forward model from file to file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command import FOCAL, HEIGHT, SCENE, WIDTH, run

import persfs_cl as ps
from persfs_cl.io.export import write_depth
from persfs_cl.io.maps import read_depth
from persfs_cl.io.photos import read_photo


@pytest.mark.parametrize("white", [None, 2.0])
def test_render_with_a_flash(white: float | None, tmp_path: Path) -> None:
    write_depth(tmp_path / "depth.npy", 0.5 * SCENE.depth)
    options = ("--light=flash", "--gain=2", "--reflectance=phong", "--specular=0.2", "--bits=16", "--encoding=linear")
    limit = () if white is None else (f"--white={white}",)
    outcome = run("render", tmp_path / "depth.npy", "-o", tmp_path / "a.png", *FOCAL, *options, *limit)
    light, reflectance = ps.FlashLight(gain=2.0), ps.Phong(specular=0.2)
    expected = ps.render(0.5 * SCENE.depth, ps.Camera(WIDTH), light=light, reflectance=reflectance)
    brightest = white or expected.max()
    said = f"White is a brightness of {brightest:g}. To reconstruct from this file, give --gain {2 / brightest:.6g}."
    assert (outcome.status, outcome.stderr) == (0, said)
    written = read_photo(tmp_path / "a.png", encoding="linear").image
    np.testing.assert_allclose(written, (expected / brightest).clip(0, 1), atol=1e-5)


@pytest.mark.parametrize(("suffix", "bits"), [(".png", 8), (".png", 16), (".tiff", 16)])
def test_render_is_the_forward_model(suffix: str, bits: int, tmp_path: Path) -> None:
    depth, image = tmp_path / "depth.tiff", tmp_path / f"image{suffix}"
    write_depth(depth, SCENE.depth)
    mask = np.arange(WIDTH) * np.ones((HEIGHT, 1)) > 5
    np.save(tmp_path / "mask.npy", mask)
    options = ("--p0=0.3", "--q0=-0.1", f"--bits={bits}", "--encoding=linear", "--mask", tmp_path / "mask.npy")
    outcome = run("render", depth, "-o", image, *FOCAL, *options)
    assert outcome == (0, f"{image}\n", "")
    light = ps.ParallelLight(0.3, -0.1)
    expected = ps.render(read_depth(depth), ps.Camera(WIDTH), light=light, mask=mask)
    written = read_photo(image, encoding="linear")
    assert written.bits == bits
    white = 2**bits - 1
    np.testing.assert_array_equal(written.image, np.rint(np.nan_to_num(expected).clip(0, 1) * white) / white)


def test_render_refuses(photo: Path, tmp_path: Path) -> None:
    depth, image = tmp_path / "depth.npy", tmp_path / "image.png"
    write_depth(depth, SCENE.depth)
    np.save(tmp_path / "unknown.npy", np.full((3, 3), np.nan))
    cases: list[tuple[Sequence[str | Path], int, str]] = [
        ((depth, "-o", image), 2, "--focal-length"),
        ((depth, "-o", image, *FOCAL, "--fov=50"), 2, "not both"),
        ((depth, "-o", image, *FOCAL, "--bits=12"), 2, "16"),
        ((depth, "-o", tmp_path / "image.jpg", *FOCAL), 2, ".tiff"),
        ((depth, "-o", tmp_path / "none" / "image.png", *FOCAL), 2, "not a folder"),
        ((depth, "-o", photo, *FOCAL), 2, "--overwrite"),
        ((photo, "-o", image, *FOCAL), 1, str(photo)),
        ((tmp_path / "unknown.npy", "-o", image, *FOCAL), 1, "unknown.npy"),
        ((depth, "-o", image, *FOCAL, "--principal-point=9999,0"), 1, "no lens"),
        ((depth, "-o", image, *FOCAL, "--device=abacus"), 3, "abacus"),
    ]
    for arguments, status, message in cases:
        outcome = run("render", *arguments)
        assert (outcome.status, outcome.stdout) == (status, "")
        assert message in outcome.stderr
    assert not image.exists()
    assert run("render", depth, "-o", photo, *FOCAL, "--overwrite").status == 0
