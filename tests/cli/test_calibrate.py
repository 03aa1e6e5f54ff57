"""The command that fits a light: what it reads, writes and says, and that its file is one for --config."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomlkit
from command import png, run
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.preparation.correct import cosine_vignetting

SIZE = 60
CAMERA = ps.Camera(SIZE)
DEPTH = ps.bump((SIZE, SIZE), surface="toward", relief=0.4).depth
OPTIONS = ("--focal-length", str(SIZE), "--encoding", "linear")


def points(path: Path, depth: NDArray[np.float64]) -> Path:
    draw = np.random.default_rng(0)
    rows, columns = draw.integers(3, SIZE - 3, (2, 80))
    known = np.stack([columns, rows, depth[rows, columns] * (1.0 + 0.005 * draw.normal(size=80))], axis=1)
    np.savetxt(path, known, delimiter=",", header="column,row,depth", comments="")
    return path


@pytest.fixture
def flash(tmp_path: Path) -> tuple[Path, Path, float]:
    """A photo by an off-axis flash and a camera with a tone curve, points, and the gain."""
    image = ps.render(DEPTH, CAMERA, light=ps.FlashLight(offset=(0.1, 0.0, 0.0)))
    png(tmp_path / "photo.png", (image / image.max()) ** (1 / 1.2))
    return tmp_path / "photo.png", points(tmp_path / "points.csv", DEPTH), 1.0 / float(image.max())


@pytest.mark.usefixtures("quick")
@pytest.mark.usefixtures("in_this_process")
def test_what_was_fitted_makes_a_better_surface(flash: tuple[Path, Path, float], tmp_path: Path) -> None:
    photo, known, gain = flash
    file = tmp_path / "light.toml"
    outcome = run("calibrate", photo, known, "-o", file, *OPTIONS, "--light", "flash", "--fit", "gain,exponent,lamp")
    assert (outcome.status, outcome.stdout) == (0, f"{file}\n")
    for said in ("gain", "exponent", "lamp_x", "lamp_y", "standard error", "Not told: lamp_z. The place of the lamp"):
        assert said in outcome.stderr
    assert "Mean error of the depth: 5" in outcome.stderr
    assert "cross-validated over 5 folds." in outcome.stderr

    text = file.read_text(encoding="utf-8")
    values = tomlkit.parse(text).unwrap()
    assert values.keys() == {"focal-length", "encoding", "light", "gain", "lamp", "reflectance", "tone-exponent"}
    assert values["gain"] == pytest.approx(gain, rel=0.02)
    assert values["tone-exponent"] == pytest.approx(1.2, abs=0.03)
    np.testing.assert_allclose(values["lamp"], (0.1, 0.0, 0.0), atol=0.02)
    assert (values["light"], values["focal-length"], values["encoding"]) == ("flash", SIZE, "linear")
    assert "# Not told: lamp_z." in text
    assert "  # gain ± 0.00" in text

    errors = {}
    for name, options in {"before": (*OPTIONS, "--light=flash"), "after": ("--config", file)}.items():
        assert run("reconstruct", photo, "-o", tmp_path / name, *options, "--save=depth").status == 0
        depth = np.load(tmp_path / name / "depth.npy")
        errors[name] = ps.compare(depth, DEPTH).mean, ps.compare(depth, DEPTH, align="scale").mean
    assert errors["after"][0] < 0.01
    # Not by the gain alone, which is but a scale.
    assert errors["after"][1] < 0.2 * errors["before"][1]
    assert run("batch", photo, "-o", tmp_path / "many", "--config", file, "--save=depth.npy").status == 0
    np.testing.assert_array_equal(np.load(tmp_path / "many" / "photo.png" / "depth.npy"), depth)


def test_a_parallel_light_has_options_too(tmp_path: Path) -> None:
    light, rough = ps.ParallelLight(0.2, -0.1), ps.OrenNayar(0.4)
    files: list[Path] = []
    for name, depth in (("one", ps.bump((SIZE, SIZE)).depth), ("two", ps.hillside((SIZE, SIZE)).depth)):
        image = 0.8 * ps.render(depth, CAMERA, light=light, reflectance=rough)
        png(tmp_path / f"{name}.png", image * cosine_vignetting(CAMERA, (SIZE, SIZE), 3.0))
        np.save(tmp_path / f"{name}.npy", depth)
        inside = np.zeros((SIZE, SIZE))
        inside[4:, :50] = 1.0
        png(tmp_path / f"{name}-mask.png", inside)
        files += [tmp_path / f"{name}.png", tmp_path / f"{name}.npy"]
    masks = ("--mask", tmp_path / "one-mask.png", "--mask", tmp_path / "two-mask.png")
    material = ("--reflectance=oren-nayar", "--roughness=0.4", "--vignetting=cos3")
    outcome = run("calibrate", *files, "-o", tmp_path / "sun.toml", *OPTIONS, *material, *masks)
    assert outcome.status == 0
    assert "Mean error of the brightness" in outcome.stderr
    assert "cross-validated over 2 photographs" in outcome.stderr
    values = tomlkit.parse((tmp_path / "sun.toml").read_text(encoding="utf-8")).unwrap()
    assert values == {
        "focal-length": SIZE,
        "encoding": "linear",
        "light": "parallel",
        "p0": pytest.approx(0.2, abs=0.01),
        "q0": pytest.approx(-0.1, abs=0.01),
        "reflectance": "oren-nayar",
        "roughness": 0.4,
        "vignetting": "cos3",
        "white-level": pytest.approx(0.8, rel=0.01),
    }
    outcome = run("reconstruct", "--config", tmp_path / "sun.toml", "--dump-config")
    assert outcome.status == 0
    assert {**tomlkit.parse(outcome.stdout).unwrap(), "light": "parallel", "reflectance": "oren-nayar"} == values


def test_what_it_begins_with_can_stand_in_a_file(flash: tuple[Path, Path, float], tmp_path: Path) -> None:
    photo, known, _ = flash
    config = tmp_path / "start.toml"
    config.write_text(f'light = "flash"\nfocal-length = {SIZE}\nencoding = "linear"\ntone-exponent = 1.2\n')
    outcome = run("calibrate", photo, known, "-o", tmp_path / "light.toml", "--config", config)
    assert outcome.status == 0
    values = tomlkit.parse((tmp_path / "light.toml").read_text(encoding="utf-8")).unwrap()
    assert values["tone-exponent"] == 1.2
    assert values["focal-length"] == SIZE


WRONG: dict[str, tuple[tuple[str, ...], str]] = {
    "no pairs": (("b.png",), "an odd number of files, 3, makes no pairs: give each photo, and after it its truth"),
    "a word": (("--fit=lump",), "'--fit': --fit lump is nothing that can be fitted. Is it lamp? Give some of gain"),
    "another light": (("--fit=lamp",), "give --light flash, or fit direction. Taken are --light parallel"),
    "normalised": (("--normalise=grey",), "'--normalise' / '--white-percentile': a calibration is by linear light"),
    "masks": (("--mask=a.png", "--mask=b.png"), "'--mask': 2 masks for 1 photos: give one for all, or one for each"),
    "no TOML": (("-o", "light.txt"), "light.txt must end in one of .toml"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_command_lines_are_refused(case: str, tmp_path: Path) -> None:
    options, message = WRONG[case]
    outcome = run("calibrate", "a.png", "a.csv", "-o", tmp_path / "light.toml", *OPTIONS, *options)
    assert outcome.status == 2
    assert message in outcome.stderr


def test_a_file_is_kept_unless_told_otherwise(flash: tuple[Path, Path, float], tmp_path: Path) -> None:
    photo, known, _ = flash
    file = tmp_path / "light.toml"
    file.write_text("mine", encoding="utf-8")
    command: tuple[Any, ...] = ("calibrate", photo, known, "-o", file, *OPTIONS, "--light=flash")
    outcome = run(*command)
    assert (outcome.status, file.read_text(encoding="utf-8")) == (2, "mine")
    assert "exists: choose another name, or add --overwrite" in outcome.stderr
    assert run(*command, "--overwrite").status == 0
    assert 'light = "flash"' in file.read_text(encoding="utf-8")


def test_files_that_cannot_be_used_are_named(flash: tuple[Path, Path, float], tmp_path: Path) -> None:
    photo, _, _ = flash
    np.save(tmp_path / "small.npy", DEPTH[:9])
    far = tmp_path / "far.json"
    far.write_text('[{"column": 900, "row": 3, "depth": 1}]', encoding="utf-8")
    for truth, said in (
        ("missing.csv", "missing.csv"),
        (str(tmp_path / "small.npy"), "small.npy has shape (9, 60), but the image has (60, 60)"),
        (str(far), "photo.png: truth has no known depth at any pixel"),
    ):
        outcome = run("calibrate", photo, truth, "-o", tmp_path / "light.toml", *OPTIONS, "--light=flash")
        assert outcome.status == 1
        assert said in outcome.stderr
        assert not (tmp_path / "light.toml").exists()
