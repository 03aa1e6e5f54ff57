"""The paper's experiments: quick form, files, the published page, and the readings that Table 1 is made of."""

from __future__ import annotations

import csv
import itertools
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import imageio.v3
import numpy as np
import pytest
from command import run

import persfs_cl as ps
from persfs_cl._cl.device import Device
from persfs_cl.colour import encode_srgb
from persfs_cl.page import filled, marked
from persfs_cl.paper import fast_marching, printed, sensitivity, statue
from persfs_cl.paper.experiments import EXPERIMENTS
from persfs_cl.paper.history import PAPERS_OWN, told
from persfs_cl.paper.literal import Reading, iterates, with_minus
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings, Table

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
PICTURES = {"table1.png", "figure2.png", "figure3.png", "figure3-camera.png", "figure3-flash.png", "sensitivity.png"}
TABLE = Table("some", "Some table", ("what", "value"), (("a", "1.5"), ("b", "")), words=1)

Cells = dict[tuple[str, str], str]


@pytest.fixture(scope="module")
def quick(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the quick form; without the pictures, half of the work, where no test looks at them."""
    folder = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as changed:
        if not any(item.get_closest_marker("thorough") for item in request.session.items if item.path == request.path):
            for name, experiment in list(EXPERIMENTS.items()):
                changed.setitem(EXPERIMENTS, name, without_pictures(experiment))
        outcome = run("paper", "--quick", "-o", folder)
    assert outcome.status == 0
    for path in folder.iterdir():
        assert str(path) in outcome.stdout
    return folder


def without_pictures(experiment: Callable[[Plan], Findings]) -> Callable[[Plan], Findings]:
    return lambda plan: replace(experiment(plan), pictures={})


def only(monkeypatch: pytest.MonkeyPatch, experiments: dict[str, Callable[..., Findings]]) -> None:
    """Run these in place of the paper's."""
    for name in list(EXPERIMENTS):
        monkeypatch.delitem(EXPERIMENTS, name)
    for name, experiment in experiments.items():
        monkeypatch.setitem(EXPERIMENTS, name, experiment)


def rows(path: Path) -> list[list[str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def cells(table: list[list[str]]) -> Cells:
    """Cells by their row and column; the words at the head of a row are joined."""
    header, *lines = table
    words = sum(name in ("varied", "to", "change", "iterations", "δ") for name in header[:2])
    return {
        (" ".join(line[:words]), name): cell
        for line in lines
        for name, cell in zip(header[words:], line[words:], strict=True)
    }


def of_markdown(text: str) -> list[list[str]]:
    header, _rule, *lines = ([cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines())
    return [header, *lines]


@pytest.mark.thorough
def test_quick_form_writes_tables(quick: Path) -> None:
    names = {path.name for path in quick.iterdir()}
    assert names >= {"tables.md", "table1-me.csv", "table2-rs.csv", "sensitivity.csv", "stopping.csv"}


@pytest.mark.thorough
def test_quick_form_writes_pictures(quick: Path) -> None:
    assert {path.name for path in quick.iterdir()} >= PICTURES
    for name in PICTURES:
        picture = imageio.v3.imread(quick / name)
        assert min(picture.shape[:2]) > 300
        assert np.ptp(picture) > 200


@pytest.mark.thorough
def test_markdown_holds_what_the_csv_files_hold(quick: Path) -> None:
    tables = marked((quick / "tables.md").read_text(encoding="utf-8"))
    assert "OpenCL" in tables.pop("environment")
    assert set(tables) == {path.stem for path in quick.glob("*.csv")}
    for name, text in tables.items():
        assert of_markdown(text) == rows(quick / f"{name}.csv"), name


@pytest.mark.thorough
def test_ours_ends_below_the_printed_errors_on_the_vase(quick: Path) -> None:
    for name, limit in (("table1-me", 0.0272), ("table1-rs", 0.0559)):
        found = cells(rows(quick / f"{name}.csv"))
        assert found["30", "paper"] == f"{limit:.4f}"
        assert float(found["30", "here"]) < limit
        assert float(found["30", "here, upwind"]) < limit


@pytest.mark.thorough
def test_the_page_holds_the_numbers_of_the_command(quick: Path) -> None:
    published = marked(PAGE)
    compared = 0
    for path in quick.glob("*.csv"):
        if path.stem.endswith("-time"):
            continue
        page = cells(of_markdown(published[path.stem]))
        for place, cell in cells(rows(path)).items():
            # Another compiler may round the last digit the other way.
            digit = 10.0 ** -len(cell.partition(".")[2])
            same = cell == page[place] or float(cell) == pytest.approx(float(page[place]), abs=1.01 * digit, rel=1e-3)
            assert same, f"{path.stem}, {place}: the page says {page[place]}, the command {cell}"
            compared += cell != ""
    assert compared > 300


def test_the_page_and_the_files_beside_it_are_of_one_run() -> None:
    folder = ROOT / "docs" / "paper"
    tables = marked(PAGE)
    assert set(tables) - {"environment"} == {path.stem for path in folder.glob("*.csv")}
    for path in folder.glob("*.csv"):
        assert of_markdown(tables[path.stem]) == rows(path)
    assert {path.name for path in folder.glob("*.png")} == PICTURES
    for path in folder.glob("*.png"):
        assert path.stat().st_size < 150_000


def test_the_photograph_is_as_the_paper_has_it() -> None:
    assert imageio.v3.imread(statue.PHOTO).shape == (280, 320) == statue.SHAPE
    assert statue.PHOTO.stat().st_size < 100_000
    image = statue.prepared()[statue.inside()]
    assert (image.min(), image.max()) == (0.0, 1.0)


def test_the_image_by_flash_is_in_the_grey_levels_of_the_photograph(device: Device) -> None:
    inside, grid = statue.inside(), statue.CAMERA.grid(statue.SHAPE)
    grey_values = statue._prepared(inside).light[inside]
    wall_at_2 = 0.25 * (1.0 + grid.x**2 + grid.y**2) ** -1.5
    expected = 255.0 * (encode_srgb(wall_at_2) - grey_values.min()) / np.ptp(grey_values)
    again = statue.flash_photographed_again(np.where(inside, 2.0, np.nan), device)
    np.testing.assert_allclose(again[inside], expected[inside], atol=0.01)
    assert np.isnan(again[~inside]).all()


def test_a_reading_without_changes_comes_to_rest_where_the_solver_does(device: Device) -> None:
    scene = ps.bump((24, 24))
    solution = ps.reconstruct(scene.image, scene.camera, device=device, tolerance=1e-7, **PAPERS_OWN, **told(scene))
    *_, last = itertools.islice(iterates(scene, Reading(1.0), device), solution.iterations + 20)
    np.testing.assert_allclose(last, solution.depth, rtol=1e-5)


def test_one_viscosity_smears_more(device: Device) -> None:
    scene = ps.bump((24, 24))
    errors = []
    for one_viscosity in (False, True):
        *_, last = itertools.islice(iterates(scene, Reading(1.0, one_viscosity), device), 200)
        errors.append(ps.compare(last, scene.depth).mean)
    assert errors[1] > 1.02 * errors[0]


def test_rescaled_heights_are_as_high_as_the_truth(device: Device) -> None:
    scene = ps.vase((20, 20), offset=2.0)
    for depth in itertools.islice(iterates(scene, Reading(1.0, rescaled=True), device), 4):
        assert depth.max() == pytest.approx(scene.depth.max(), rel=1e-9)
        assert depth.min() == pytest.approx(2.0, rel=1e-9)


def test_the_printed_minus_finds_nothing() -> None:
    scene = ps.vase((20, 20))
    first, second = itertools.islice(with_minus(scene, 1.0), 2)
    np.testing.assert_array_equal(first, second)
    assert np.abs(first - scene.depth)[scene.mask].mean() > 0.2


def test_the_vase_seen_along_another_axis_has_the_image_that_it_would_have(device: Device) -> None:
    usual = ps.vase()
    scene = sensitivity._seen_from_below(usual)
    # Without the silhouette, where central differences cannot follow.
    smooth = usual.mask & (usual.image > 0.8)
    again = ps.render(scene.depth, scene.camera, device=device)
    assert np.abs(again - scene.image)[smooth].max() < 0.06
    assert np.abs(usual.image - scene.image).max() > 0.1
    assert (scene.image[~usual.mask] == 1.0).all()


def test_every_variation_differs_from_the_protocol(device: Device) -> None:
    usual, *others = sensitivity.variations(Plan(device, quick=True))
    for one in others:
        same = replace(one, aspect=usual.aspect, choice=usual.choice, scene=usual.scene) == usual
        scene = all(
            np.array_equal(getattr(one.scene, name), getattr(usual.scene, name), equal_nan=True)
            for name in ("image", "known_depth", "depth")
        )
        assert not (same and scene and one.scene.camera == usual.scene.camera), (one.aspect, one.choice)


def test_a_missing_extra_is_named_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    # Without what it remembers of earlier calls.
    monkeypatch.setattr(fast_marching, "compiled", fast_marching.compiled.__wrapped__)
    only(monkeypatch, {"none": pytest.fail})
    outcome = run("paper", "-o", tmp_path / "out")
    assert outcome.status == 1
    assert "pip install 'persfs-cl[paper]'" in outcome.stderr
    assert not (tmp_path / "out").exists()


def test_finished_tables_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_plan: Plan) -> Findings:
        raise KeyboardInterrupt

    only(monkeypatch, {"one": lambda _plan: Findings([TABLE]), "two": interrupted})
    outcome = run("paper", "-o", tmp_path)
    assert outcome.status == 130
    assert "1 tables were kept" in outcome.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"some.csv", "tables.md"}
    assert marked((tmp_path / "tables.md").read_text(encoding="utf-8"))["some"] == TABLE.markdown


def test_a_page_is_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    only(monkeypatch, {"one": lambda _plan: Findings([TABLE])})
    page = tmp_path / "page.md"
    page.write_text("# Title\n\n<!-- some -->\n<!-- end -->\n\n<!-- environment -->\nold\n<!-- end -->\n\nEnd.\n")
    assert run("paper", "-o", tmp_path / "out", "--page", page).status == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith(f"# Title\n\n<!-- some -->\n{TABLE.markdown}\n<!-- end -->\n\n<!-- environment -->\n")
    assert text.endswith("<!-- end -->\n\nEnd.\n")
    assert "old" not in text
    assert filled(text, marked(text)) == text
    with pytest.raises(ps.InputError, match="no place for 'other'"):
        filled(text, {"other": ""})


@pytest.mark.parametrize("text", ["no marker", None])
def test_a_page_that_cannot_be_filled_is_refused(text: str | None, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text or "<!-- some -->\n<!-- end -->\n")
    outcome = run("paper", "-o", tmp_path / "out", "--page", page, *(["--quick"] if text is None else []))
    assert outcome.status == 2
    assert "--page" in outcome.stderr


def test_printed_figures_are_complete() -> None:
    for history in (printed.YANG_HAN_VASE, printed.TANKUS_VASE, printed.YANG_HAN_STATUE, printed.TANKUS_STATUE):
        assert history.seconds is not None
        for values in (history.mean, history.root_mean_square, history.seconds):
            assert len(values) == len(history.iterations) == 7
        assert all(mean < square for mean, square in zip(history.mean, history.root_mean_square, strict=True))
        assert list(history.seconds) == sorted(history.seconds)
