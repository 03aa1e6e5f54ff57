"""``persfs-cl demo``."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest
from command import FILES, names, run, strict

import persfs_cl as ps


@pytest.mark.parametrize("failure", [ps.InputError("no"), KeyboardInterrupt()])
def test_a_demo_that_fails_leaves_nothing_behind(
    failure: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object) -> None:
        raise failure

    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", fail)
    assert run("demo", "-o", tmp_path / "a" / "b").status in (1, 130)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("output", [".", "mine"])
def test_a_folder_with_other_things_is_no_demos(output: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "note").write_text("mine")
    outcome = run("demo", "-o", output)
    assert outcome.status == 2
    assert "holds other things: choose another." in outcome.stderr
    assert names(tmp_path) == {"mine"}


def test_demo_needs_no_arguments_and_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("demo")
    assert outcome.status == 0
    assert names(tmp_path / "demo-output" / "skull") == FILES | {"outline.png"}
    assert names(tmp_path / "demo-output" / "vase") == FILES - {"preview.jpg", "photo.jpg", "relief.js", "index.html"}
    scene = ps.vase()
    errors = ps.compare(np.load("demo-output/vase/depth.npy"), scene.depth, align="range")
    assert f"ME {errors.mean:.4f}, RS {errors.root_mean_square:.4f}" in outcome.stdout
    assert errors.mean < 0.0272 and errors.root_mean_square < 0.0559  # noqa: PT018  # the paper's
    report = strict(Path("demo-output/skull/report.json"))
    said = [outcome.stdout.index(text) for text in ("from the prepared photograph", "from the photograph itself")]
    for grey_levels, place in zip((report["grey_levels"], report["grey_levels_photo"]), said, strict=True):
        text = f"ME {grey_levels['mean_error']:.2f}, RS {grey_levels['root_mean_square']:.2f}"
        assert place < outcome.stdout.index(text) < place + 200
    # One lamp's distance is the unit; the nearest point of the skull is a little farther than a white surface would be.
    skull = np.load("demo-output/skull/depth.npy")
    assert 40_000 < np.count_nonzero(np.isfinite(skull)) < 55_542
    assert 1 < np.nanmin(skull) < np.nanmax(skull) < 1.3
    for named in ("vase/relief.png", "skull/relief.png", "skull/comparison.png", "skull/mesh.ply"):
        assert str(Path("demo-output") / named) in outcome.stdout
    assert "'. .venv/bin/activate' puts persfs-cl on the path" in outcome.stdout
    # By hand it is the same.
    command = outcome.stdout.partition("The same by hand:")[2].partition("\n\n")[0].replace("\\\n", " ")
    program, *arguments = shlex.split(command)
    assert (program, run(*arguments, "--save", "depth.npy").status) == ("persfs-cl", 0)
    np.testing.assert_array_equal(np.load("skull/depth.npy"), skull)

    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    assert run("demo").status == 0
