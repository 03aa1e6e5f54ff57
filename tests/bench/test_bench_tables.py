"""The bench's records on the pages that publish them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from command import run

import persfs_cl as ps
from persfs_cl.bench import accuracy, alternatives, experiments
from persfs_cl.bench.cells import two_digits
from persfs_cl.bench.experiments import EXPERIMENTS
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents, markers
from persfs_cl.environment import environment
from persfs_cl.page import ENVIRONMENT, filled, marked

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = {name: (DOCS / name).read_text(encoding="utf-8") for name in ("performance.md", "accuracy.md", "batch.md")}


def rate(workload: str, *values: float, **others: Any) -> Record:
    common = {"experiment": "sizes", "quantity": "rate", "unit": "Mc/s", "size": 64, "images": 1}
    return Record.of(values, **{"workload": workload, "precision": "float32", **common, **others})


SIZES = [
    rate("wavefront", 900.0, 1234.0, 1000.0, factor=16.04),
    rate("plain C", 62.5, factor=1.0, detail="-O3, cc 12"),
    rate("wavefront", 7.0, size=128),
    Record("sizes", "plain C", "rate", "Mc/s", 128, 1, "float32", detail="skipped: no\ncompiler"),
]
SIZES_TABLE = """\
| pixels | wavefront | plain C |
| --- | --: | --: |
| 64² | 1,000 (900–1,234), 16.0 × | 62.5 |
| 128² | 7 | skipped: no compiler |"""


def table(records: list[Record], name: str, device: ps.Device) -> list[list[str]]:
    """The cells of a table, without its rule."""
    text = contents(environment(device, ""), records)[name]
    header, _rule, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines())
    return [header, *rows]


def test_every_table_has_one_place_on_the_pages() -> None:
    places = [name for text in PAGES.values() for name in marked(text)]
    assert sorted(name for name in places if name != ENVIRONMENT) == sorted(markers(EXPERIMENTS))
    assert places.count(ENVIRONMENT) == len(PAGES)
    for experiment in EXPERIMENTS:
        assert markers([experiment]), experiment


@pytest.mark.parametrize("name", PAGES)
def test_pages_are_filled_the_way_they_are(name: str) -> None:
    assert filled(PAGES[name], marked(PAGES[name])) == PAGES[name]
    for place, text in marked(PAGES[name]).items():
        assert place == ENVIRONMENT or len({line.count("|") for line in text.splitlines()}) == 1, place


def test_rates_stand_beside_plain_c(device: ps.Device) -> None:
    found = contents(environment(device, ""), SIZES)
    assert set(found) == {ENVIRONMENT, "sizes"}
    assert found["sizes"] == SIZES_TABLE
    assert "cc 12" in found[ENVIRONMENT]
    assert device.driver_version in found[ENVIRONMENT]


def test_what_one_precision_lacks_is_left_empty(device: ps.Device) -> None:
    records = [
        rate("wavefront", 9.0, experiment="precision", factor=3.0),
        rate("plain C", 3.0, experiment="precision"),
        Record("precision", "wavefront", "rate", "Mc/s", 64, 1, "float64", detail="skipped: none"),
    ]
    assert table(records, "precision", device)[1:] == [
        ["float32", "9, 3.0 ×", "3"],
        ["float64", "skipped: none", ""],
    ]


def test_of_a_batch_plain_c_is_not_shown(device: ps.Device) -> None:
    records = [
        rate(name, float(images), experiment="batch", images=images)
        for images in (1, 16)
        for name in ("a", "plain C", "b")
    ]
    assert table(records, "batch", device) == [["images", "a", "b"], ["1", "1", "1"], ["16", "16", "16"]]


def test_of_a_convergence_the_end_is_shown(device: ps.Device) -> None:
    records = [
        rate("wavefront", float(number), experiment="convergence", quantity=quantity, iteration=number)
        for number in (1, 2)
        for quantity in ("largest error", "elapsed")
    ]
    assert table(records, "convergence", device)[1:] == [["wavefront", "2", "2"]]


def test_errors_are_grouped_by_scheme(device: ps.Device) -> None:
    scenes = list(accuracy.SCENES)[:2]

    def error(scene: str, scheme: str, size: int, value: float) -> Record:
        name = accuracy.workload(scene, scheme)
        return rate(name, value, experiment="accuracy", quantity=accuracy.ERROR, size=size, iteration=3)

    records = [
        error(scenes[0], "Lax-Friedrichs", 51, 0.0068),
        error(scenes[0], "upwind", 51, 0.00123),
        error(scenes[0], "upwind", 101, 0.000001),
        rate(accuracy.workload(scenes[0], "upwind"), 0.966, experiment="accuracy", quantity=accuracy.ORDER, size=0),
        error(scenes[1], "Lax-Friedrichs", 101, 1.0),
    ]
    assert table(records, "accuracy", device) == [
        ["scene", "scheme", "51²", "101²", "order"],
        [scenes[0], "Lax-Friedrichs", "0.0068 (3)", "", ""],
        [scenes[1], "Lax-Friedrichs", "", "1.0 (3)", ""],
        [scenes[0], "upwind", "0.0012 (3)", "0.0000010 (3)", "0.97"],
    ]


def test_schemes_that_were_tried_stand_beside_those_taken(device: ps.Device) -> None:
    schemes = (*accuracy.SCHEMES, alternatives.WENO)

    def error(scheme: str, size: int, detail: str = "") -> Record:
        name = accuracy.workload("bump, 8 bits", scheme)
        return rate(name, 0.0123, experiment="weno", quantity=accuracy.ERROR, size=size, iteration=7, detail=detail)

    records = [error(scheme, 50) for scheme in schemes]
    records += [error(scheme, 100) for scheme in accuracy.SCHEMES]
    records.append(error(alternatives.WENO, 100, alternatives.NOT_SETTLED))
    records += [replace(error(scheme, 200, "skipped: none"), median=None) for scheme in schemes]
    assert table(records, "weno", device) == [
        ["photograph", "pixels", *schemes],
        ["bump, 8 bits", "50²", *["0.012 (7)"] * 4],
        ["bump, 8 bits", "100²", *["0.012 (7)"] * 3, "0.012 (7, not settled)"],
        ["bump, 8 bits", "200²", *["skipped: none"] * 4],
    ]


@pytest.mark.parametrize(
    ("value", "text"), [(None, ""), (0.0000026, "0.0000026"), (0.999, "1.0"), (18.4, "18"), (123.0, "120")]
)
def test_errors_have_two_digits(value: float | None, text: str) -> None:
    assert two_digits(value) == text


def test_a_missing_object_is_said_on_the_page(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> Path:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(accuracy, "stanford_bunny", missing)
    records = [record for group in accuracy.noise(Plan(device, sizes=(16,), repeats=1)) for record in group]
    first, *others = table(records, "noise", device)[1:]
    assert first == ["bunny", "16²", "skipped: get the bunny", "", ""]
    assert [row[0] for row in others] == [f"hill, {name}" for name in (*accuracy.PHOTOGRAPHS, accuracy.FILTERED)]
    assert all(cell for row in others for cell in row)


@pytest.mark.thorough
@pytest.mark.usefixtures("lexicographic_wavefront")
def test_tables_of_materials_are_whole(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    # The roughest is solved by another scheme, so that there is one of each kind.
    for name in ("Oren-Nayar 0.4", "Phong"):
        monkeypatch.delitem(accuracy.UNDER_FLASH, name)
    plan = Plan(device, sizes=(16,))
    records = [
        record for make in (accuracy.reflectance, accuracy.ambiguity) for group in make(plan) for record in group
    ]
    _, *flash = table(records, "flash-materials", device)
    assert [row[0] for row in flash] == list(accuracy.UNDER_FLASH)
    assert [[cell.startswith("**") for cell in row[1:]] for row in flash] == [
        [true == assumed for assumed in accuracy.UNDER_FLASH] for true in accuracy.UNDER_FLASH
    ]
    header, *parallel = table(records, "parallel-materials", device)
    assert len(parallel) == 4 * len(accuracy.UNDER_PARALLEL)
    for row in parallel:
        assert len(row) == len(header)
        assert ("" in row) == (row[1] == accuracy.MATT)
    _, *ambiguous = table(records, "ambiguity", device)
    assert [row[:2] for row in ambiguous] == [[name, "16²"] for name in accuracy.REFINED]
    # The same hill as in the other table.
    (right,) = [row for row in parallel if row[:2] == ["frontal, toward", accuracy.AMBIGUOUS]]
    assert ambiguous[-1][2:] == [right[2].strip("*"), right[3]]


def page(folder: Path, name: str, *places: str) -> Path:
    path = folder / name
    path.write_text("".join(f"Words.\n\n<!-- {place} -->\nold\n<!-- end -->\n" for place in places), encoding="utf-8")
    return path


def test_pages_are_filled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EXPERIMENTS, "sizes", lambda _plan: iter([SIZES[:2], SIZES[2:]]))
    first, second = (
        page(tmp_path, "a.md", ENVIRONMENT, "sizes", "flash"),
        page(tmp_path, "b.md", ENVIRONMENT, "sizes"),
    )
    options = ("--experiment", "sizes", "-o", tmp_path / "out", "--page", first, "--page", second)
    outcome = run("bench", *options)
    assert outcome.status == 0
    assert outcome.stdout.splitlines()[-2:] == [str(first), str(second)]
    once = first.read_text(encoding="utf-8")
    found = marked(once)
    assert found["sizes"] == SIZES_TABLE
    assert found["flash"] == "old"
    assert found[ENVIRONMENT] == "old", "those of another table"
    whole = marked(second.read_text(encoding="utf-8"))
    assert whole["sizes"] == SIZES_TABLE
    assert f"persfs-cl {ps.__version__}" in whole[ENVIRONMENT]
    assert once.count("Words.\n\n<!--") == 3
    assert (tmp_path / "out" / "scaling.png").exists()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ps.DeviceError("gone")])
def test_a_page_stays_as_it_is_when_something_fails(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken_off(_plan: Plan) -> Iterator[list[Record]]:
        yield SIZES
        raise error

    monkeypatch.setitem(EXPERIMENTS, "sizes", broken_off)
    place = page(tmp_path, "a.md", "sizes")
    assert run("bench", "--experiment", "sizes", "-o", tmp_path / "out", "--page", place).status != 0
    assert marked(place.read_text(encoding="utf-8")) == {"sizes": "old"}
    assert (tmp_path / "out" / "bench.json").exists()


@pytest.mark.parametrize(
    ("places", "options", "message"),
    [
        (("sizes", "nonsense"), (), "<!-- nonsense -->"),
        ((ENVIRONMENT,), (), "holds no marker"),
        ((), (), "holds no marker"),
        (("noise",), (), "<!-- sizes -->"),
        (("sizes",), ("--quick",), "leave out --quick"),
    ],
)
def test_a_page_that_cannot_be_filled_is_refused_before_any_work(
    places: tuple[str, ...],
    options: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(EXPERIMENTS, "sizes", pytest.fail)
    place = page(tmp_path, "a.md", *places) if places else tmp_path / "a.md"
    place.write_text(place.read_text(encoding="utf-8") if places else "Words.\n", encoding="utf-8")
    outcome = run("bench", "--experiment", "sizes", "-o", tmp_path / "out", "--page", place, *options)
    assert outcome.status == 2
    assert "--page" in outcome.stderr
    assert message in " ".join(outcome.stderr.replace("│", " ").split())
    assert not (tmp_path / "out").exists()


def test_a_page_that_is_missing_is_told_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EXPERIMENTS, "sizes", pytest.fail)
    outcome = run("bench", "--experiment", "sizes", "-o", tmp_path / "out", "--page", tmp_path / "no.md")
    assert outcome.status == 1
    assert "no.md does not exist" in outcome.stderr


def test_no_tuning_is_measured_twice(device: ps.Device) -> None:
    plan = Plan(device, sizes=(64,), repeats=1, least_seconds=0.0, strip_rows=(8,), tiles=((32, 64),), lanes=(8,))
    (records,) = experiments.tunings(plan)
    assert len({record.workload for record in records}) == len(records)
