"""``persfs-cl demo``."""

from __future__ import annotations

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


def test_demo_needs_no_arguments_and_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("demo")
    assert outcome.status == 0
    assert names(tmp_path / "demo-output" / "coin") == FILES
    assert names(tmp_path / "demo-output" / "vase") == FILES - {"preview.jpg", "photo.jpg", "relief.js", "index.html"}
    scene = ps.vase()
    errors = ps.compare(np.load("demo-output/vase/depth.npy"), scene.depth, align="range")
    assert f"ME {errors.mean:.4f}, RS {errors.root_mean_square:.4f}" in outcome.stdout
    assert errors.mean < 0.0272 and errors.root_mean_square < 0.0559  # noqa: PT018  # the paper's
    report = strict(Path("demo-output/coin/report.json"))
    said = [outcome.stdout.index(text) for text in ("from the prepared photograph", "from the photograph itself")]
    for grey_levels, place in zip((report["grey_levels"], report["grey_levels_photo"]), said, strict=True):
        text = f"ME {grey_levels['mean_error']:.2f}, RS {grey_levels['root_mean_square']:.2f}"
        assert place < outcome.stdout.index(text) < place + 200
    coin = np.load("demo-output/coin/depth.npy")
    assert np.count_nonzero(np.isfinite(coin)) == 2861
    assert np.nanmax(coin) == 1
    for named in ("vase/relief.png", "coin/relief.png", "coin/comparison.png", "coin/mesh.ply"):
        assert str(Path("demo-output") / named) in outcome.stdout

    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    assert run("demo").status == 0
