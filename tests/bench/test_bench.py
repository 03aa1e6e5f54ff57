"""The bench: what it measures with, what it measures against, and what it leaves behind. No test looks at a time."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest
from command import run

import persfs_cl as ps
from persfs_cl._cl.image import Image
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.bench import accuracy, baselines, experiments, fresh, memory, photograph, plots
from persfs_cl.bench.baselines import Baseline
from persfs_cl.bench.calls import FAST_MARCHING
from persfs_cl.bench.experiments import EXPERIMENTS
from persfs_cl.bench.fresh import FreshProcessError, run_fresh
from persfs_cl.bench.peaks import peak_memory
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import PLAIN_C, measured
from persfs_cl.bench.results import Record, write_csv, write_json
from persfs_cl.bench.tables import contents
from persfs_cl.bench.timing import Spread, Work, take_turns, warm_up
from persfs_cl.bench.workloads import Workload
from persfs_cl.choices import Surface
from persfs_cl.environment import environment
from persfs_cl.errors import UnavailableError
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare


class FakeClock:
    """Stands still, except while something works."""

    def __init__(self) -> None:
        self.now = 0.0
        self.log: list[tuple[str, int]] = []

    def __call__(self) -> float:
        return self.now

    def work(self, name: str, seconds: Iterator[float], *, share: float | None = None) -> Work:
        """Work whose units take the given seconds, one value a run; `share` of them on the device."""

        def do(count: int) -> float | None:
            took = count * next(seconds)
            self.now += took
            self.log.append((name, count))
            return None if share is None else share * took

        return do


def always(seconds: float) -> Iterator[float]:
    while True:
        yield seconds


def test_warm_up_leaves_out_the_first_run_and_finds_a_long_enough_count() -> None:
    clock = FakeClock()
    first_is_slow = iter([1000.0, *[0.001] * 100])
    count = warm_up(clock.work("a", first_is_slow), least_seconds=0.1, step=4, clock=clock)
    assert count % 4 == 0
    assert 0.1 <= 0.001 * count <= 0.2
    assert clock.log[0] == ("a", 4)


def test_warm_up_is_content_with_one_long_step() -> None:
    clock = FakeClock()
    assert warm_up(clock.work("a", always(5.0)), least_seconds=0.1, step=4, clock=clock) == 4
    assert len(clock.log) == 2


def test_warm_up_ends_though_the_clock_stands_still() -> None:
    assert warm_up(lambda _count: None, least_seconds=0.1, step=1, clock=lambda: 0.0) < 10**8


def test_works_take_turns_and_their_repeats_stay_in_order() -> None:
    clock = FakeClock()
    # A warm-up run and a calibrating run, then the rounds.
    slow = clock.work("slow", iter([9.0, 1.0, 3.0, 1.0, 2.0]), share=0.5)
    timings = take_turns(
        {"slow": slow, "fast": clock.work("fast", always(0.25))}, repeats=3, least_seconds=1.0, clock=clock
    )
    assert timings["slow"].wall == (3.0, 1.0, 2.0)
    assert timings["slow"].device == (1.5, 0.5, 1.0)
    assert timings["fast"].wall == (0.25, 0.25, 0.25)
    assert timings["fast"].device == ()
    assert [name for name, _ in clock.log[-6:]] == ["slow", "fast"] * 3
    assert Spread.of(timings["slow"].wall) == Spread(2.0, 1.0, 3.0, 3)
    assert timings["slow"].rates(6.0) == [2.0, 6.0, 3.0]
    assert timings["slow"].device_rates(6.0) == [4.0, 12.0, 6.0]


def test_factors_are_taken_round_by_round(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disturbance that slows a whole round down leaves the factor as it is."""
    clock = FakeClock()
    monkeypatch.setattr(
        "persfs_cl.bench.rates.take_turns", lambda works, **options: take_turns(works, clock=clock, **options)
    )
    disturbed = [1.0, 1.0, 1.0, 10.0, 100.0]
    ours = Workload("ours", clock.work("ours", iter(disturbed)), 100, "")
    plain = Workload(PLAIN_C, clock.work("plain", iter(4.0 * second for second in disturbed)), 50, "")
    plan = Plan(device, repeats=3, least_seconds=0.0)
    first, second = measured(plan, "sizes", 10, "float32", [ours, plain], images=2)
    assert (first.factor, second.factor) == (8.0, 1.0)
    assert first.median == pytest.approx(100e-6 / 10.0)
    assert (first.images, second.images) == (2, 1)


def framed_problem(seed: int, shape: tuple[int, int], surface: Surface) -> Problem:
    """Noise with a known frame and known values inside."""
    random = np.random.default_rng(seed)
    known = np.where(random.uniform(size=shape) > 0.9, random.uniform(0.8, 1.2), np.nan)
    known[[0, -1]] = known[:, [0, -1]] = 1.0
    known[1, 1] = np.nan
    image, camera, light = random.uniform(0.2, 1.0, shape), ps.Camera(shape[1] + 7.0), ps.ParallelLight(0.3, -0.2)
    options = complete({"light": light, "scheme": "lax-friedrichs", "surface": surface, "boundary": "fixed"})
    return prepare(image, camera, None, None, known, options=options)


@pytest.mark.parametrize("make", [baselines.plain_c, baselines.numba_loop])
@pytest.mark.parametrize("surface", ["away", "toward"])
def test_yardsticks_do_the_lexicographic_sweep(
    device: ps.Device, precision: str, make: Callable[[Image, str], Baseline], surface: Surface
) -> None:
    for seed, shape in enumerate([(3, 3), (5, 4), (17, 31), (40, 33)]):
        problem = framed_problem(seed, shape, surface)
        try:
            baseline = make(problem.kernel_arguments, precision)
        except UnavailableError as reason:
            pytest.skip(str(reason))
        sweeps = Sweeper(
            device,
            [problem.kernel_arguments],
            model=problem.kernels,
            ordering="lexicographic",
            precision=precision,
        )
        for number in range(8):
            before = baseline.log_depth.copy()
            sweeps.sweep(number % 4)
            baseline.sweep(number % 4)
            # Kernels fuse multiply-adds, which plain C does not: that rounds otherwise, on the start value's scale.
            swept, rounding = sweeps.log_depth()[0], np.finfo(precision).eps * before.max()
            np.testing.assert_allclose(baseline.log_depth, swept, rtol=0, atol=4 * rounding)
            baseline.log_depth[:] = swept
            assert number > 0 or (baseline.log_depth < before).any(), "something must have moved"


def test_a_missing_or_failing_compiler_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = framed_problem(1, (5, 5), "away").kernel_arguments
    baselines._compiled.cache_clear()
    for compiler, reason in (("no-such-compiler", "no C compiler 'no-such-compiler'"), ("false", "failed")):
        monkeypatch.setenv("CC", compiler)
        with pytest.raises(UnavailableError, match=reason):
            baselines.plain_c(grid, "float32")


def test_a_failing_process_is_told() -> None:
    with pytest.raises(FreshProcessError, match="memory 0 nonsense"):
        run_fresh("memory", "0", "nonsense", "float32")


RECORDS = [
    Record.of([3.0, 1.0, 2.0], experiment="sizes", workload="a", quantity="rate", unit="Mc/s", size=64, images=1,
              precision="float32", by_device=2.5, factor=1 / 3, detail='with "quotes", commas\nand two lines'),
    Record("sizes", "b", "rate", "Mc/s", 64, 1, "float32", detail="skipped: ü"),
]  # fmt: skip


def test_records_survive_json(tmp_path: Path) -> None:
    write_json(tmp_path / "r.json", {"date": "today"}, RECORDS)
    content = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert content["header"] == {"date": "today"}
    assert [Record(**entry) for entry in content["records"]] == RECORDS


def test_records_survive_csv(tmp_path: Path) -> None:
    write_csv(tmp_path / "r.csv", RECORDS)
    kinds: dict[str, type] = {"size": int, "images": int, "repeats": int, "iteration": int}
    kinds |= dict.fromkeys(("median", "lowest", "highest", "by_device", "factor"), float)
    with (tmp_path / "r.csv").open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    read = [
        {name: kinds.get(name, str)(text) if text or name == "detail" else None for name, text in line.items()}
        for line in lines
    ]
    assert read == [asdict(record) for record in RECORDS]
    assert list(lines[0]) == [field.name for field in fields(Record)]


def test_plots_that_the_records_do_not_allow_go(tmp_path: Path) -> None:
    (tmp_path / "scaling.png").write_bytes(b"old")
    bar = replace(RECORDS[0], experiment="orderings")
    assert plots.draw(tmp_path, [bar, *RECORDS[1:]], "foot") == [tmp_path / "yardsticks.png"]
    assert [path.name for path in tmp_path.iterdir()] == ["yardsticks.png"]


def test_rates_on_the_yardsticks_are_rounded_to_three_digits() -> None:
    bars = [Record.of([rate], experiment="orderings", workload="a", quantity="rate", unit="Mc/s", size=64, images=1,
                      precision="float32") for rate in (1184.0, 3.456)]  # fmt: skip
    figure = plots._yardsticks(bars)
    assert figure is not None
    assert [text.get_text().strip() for text in figure.axes[0].texts] == ["3.46 Mc/s", "1,180 Mc/s"]


def load(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "bench.json").read_text(encoding="utf-8"))
    return content


@pytest.mark.thorough
def test_every_experiment_from_the_command_line(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    # Every height, tile and width is a program to compile.
    few = ("--strip-rows", "8,16", "--tiles", "32x64", "--lanes", "8", "--band-rows", "5", "--work-groups", "1,3")
    settings = ("--quick", "--sizes", "64", "--batch", "1,3", "--repeats", "2", *few, "-o", folder)
    # Some are called by other tests: in processes of their own, and at the sizes that are claimed.
    whole_calls = ("calls", "flash", "masked")
    exact = ("distance", "noise", "reflectance", "ambiguity", "lamp", "calibration", "weno")
    elsewhere = {"compilation", "endoscopy", "memory", "photograph", "tasks", *whole_calls, *exact}
    in_process = [name for name in EXPERIMENTS if name not in elsewhere]
    outcome = run("bench", *settings, *(part for name in in_process for part in ("--experiment", name)))
    assert outcome.status == 0
    pictures = ("scaling.png", "yardsticks.png", "convergence.png", "accuracy.png")
    names = ("bench.json", "bench.csv", *pictures)
    assert outcome.stdout.splitlines()[-len(names) :] == [str(folder / name) for name in names]
    content = load(folder)
    records = [Record(**entry) for entry in content["records"]]
    assert list(dict.fromkeys(record.experiment for record in records)) == in_process
    for record in records:
        if record.median is None:
            assert record.detail.startswith("skipped: ")
        else:
            assert record.lowest is not None
            assert record.highest is not None
            assert 0 < record.lowest <= record.median <= record.highest
    assert {record.images for record in records if record.experiment == "batch"} == {1, 3}
    of_upwind = [record for record in records if record.workload.endswith(", upwind")]
    assert {record.experiment for record in of_upwind} == {"orderings"}
    assert {record.factor for record in of_upwind} == {None}, "another cell than that of the plain C sweep"
    tuned = {record.workload for record in records if record.experiment == "tunings"}
    assert {"wavefront_tiles, 32 × 64", "checkerboard, 8 lanes"} <= tuned
    if content["header"]["device"]["kind"] == "cpu":
        strips = {f"wavefront_strips, 8 lanes, rows: {rows}, groups: {groups}" for rows in (8, 16) for groups in (1, 3)}
        bands = {f"checkerboard_bands, 8 lanes, rows: 5, groups: {groups}" for groups in (1, 3)}
        assert strips | bands <= tuned
    assert re.search(r"largest error after \d+ iterations, ln z", outcome.stdout)
    header = content["header"]
    assert header["device"]["driver_version"]
    assert header["versions"]["persfs-cl"] == ps.__version__
    assert header["processor"]
    assert header["cores"] >= 1
    with (folder / "bench.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(records)
    for name in pictures:
        assert imageio.v3.imread(folder / name).std() > 1


def test_only_the_schemes_asked_for_are_measured(device: ps.Device) -> None:
    plan = Plan(device, sizes=(16,), batch=(2,), schemes=("upwind",), repeats=1, least_seconds=0.0)
    plan = replace(plan, strip_rows=(), tiles=((32, 64),), work_groups=(1,))
    baselines = {PLAIN_C, "numba", "NumPy reference", FAST_MARCHING}
    # What changes is all that matters, so they go by the ordering whose programs other tests have too, if they can.
    by_itself = ("batch", "tunings", "calls")
    for name in ("orderings", "sizes", "precision", *by_itself):
        plan = replace(plan, orderings=("wavefront" if name in by_itself else "lexicographic",))
        workloads = {record.workload for group in EXPERIMENTS[name](plan) for record in group} - baselines
        assert workloads
        assert all(workload.endswith(("upwind", FAST_MARCHING)) for workload in workloads)


@pytest.mark.usefixtures("lexicographic_wavefront")
def test_errors_are_drawn_as_far_as_they_go(device: ps.Device, tmp_path: Path) -> None:
    """Broken off after the first scheme, and after all schemes of a scene at several sizes."""
    plan = Plan(device, sizes=(16, 24))
    records: list[Record] = []
    for scheme in accuracy.SCHEMES:
        records += accuracy.refined(plan, "hill, flash", scheme, plan.edges())
        assert plots.draw(tmp_path, records, "foot") == [tmp_path / "accuracy.png"]
    orders = [record.median or 0.0 for record in records if record.quantity == accuracy.ORDER]
    assert len(orders) == len(accuracy.SCHEMES)
    assert min(orders) > 0.5
    assert plots.draw(tmp_path, [], "foot") == []
    assert not list(tmp_path.iterdir())


def test_without_the_scanned_object_it_is_said_where_it_comes_from(
    device: ps.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> Path:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(accuracy, "stanford_bunny", missing)
    records = [record for group in accuracy.noise(Plan(device, sizes=(16,), repeats=1)) for record in group]
    assert [record.detail for record in records if record.median is None] == ["skipped: get the bunny"]
    assert len(records) == 1 + 2 * len([*accuracy.PHOTOGRAPHS, accuracy.FILTERED])


@pytest.mark.thorough
def test_experiments_in_processes_of_their_own(
    device: ps.Device, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = Plan(device, sizes=(64,), orderings=("lexicographic",), repeats=1)
    (builds,) = experiments.compilation(plan)
    assert [record.quantity for record in builds] == ["build, empty caches", "build, filled caches"]

    def here(*arguments: str) -> dict[str, float]:
        fresh._main(*arguments)
        found: dict[str, float] = json.loads(capsys.readouterr().out)
        return found

    # What another process would have to compile first.
    monkeypatch.setattr(fresh, "run_fresh", here)
    # The batch itself is run in tests/pipeline/test_room.py.
    monkeypatch.setattr(memory, "take", lambda *_: memory.Peaks(2**29, 2**27, 2**28, 2**29))
    sizes, rooms = memory.memory(replace(plan, tasks=20))
    by_quantity = {record.quantity: record.median or 0.0 for record in sizes}
    assert by_quantity["peak memory"] >= by_quantity["before the image"] > 10
    found = {(record.workload, record.quantity): record.median or 0.0 for record in rooms}
    half, whole = "1 of 24 × 30", "2 of 24 × 30 and one of 64²"
    assert {workload for workload, _ in found} == {half, whole}
    assert [found[half, quantity] for quantity in (memory.OF_PHOTOGRAPHS, memory.PEAK)] == [256, 256]
    assert [found[whole, quantity] for quantity in (memory.OF_PHOTOGRAPHS, memory.PEAK)] == [512, 512]
    assert found[whole, memory.OF_PROCESS] == 512 + 500
    assert found[whole, memory.SHARE] == pytest.approx(512 / 1012)
    monkeypatch.setattr(memory, "tells_of_others", lambda: False)
    _, (untold,) = memory.memory(plan)
    assert untold.detail.startswith("skipped: this system does not tell")
    table = contents(environment(device, ""), [*sizes, untold])["room"]
    assert "skipped: this system does not tell" in table
    # Of both kinds of photographs the one whose files take longer to decode.
    *_, (kind, how) = photograph._PHOTOS.items()
    monkeypatch.setattr(photograph, "_PHOTOS", {kind: how})
    ballast = np.ones(2**26)  # more than the command needs, which is none of its memory
    del ballast
    (calls,) = photograph.photograph(plan)
    assert [record.quantity for record in calls] == ["from start to end", "processor time", "peak memory"]
    seconds, processor, peak = (record.median or 0.0 for record in calls)
    assert (seconds > 0.1, processor > 0.1) == (True, True)
    assert 50 < peak < 512 < peak_memory() / 2**20
    assert calls[0].detail.startswith("17 files, ")


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [(KeyboardInterrupt(), 130, "1 records were kept"), (ps.DeviceError("gone"), 3, "gone")],
)
def test_what_was_measured_is_kept(
    error: BaseException, status: int, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken_off(_plan: Plan) -> Iterator[list[Record]]:
        yield RECORDS[:1]
        raise error

    monkeypatch.setitem(EXPERIMENTS, "sizes", broken_off)
    outcome = run("bench", "--experiment", "sizes", "--experiment", "memory", "-o", tmp_path)
    assert outcome.status == status
    assert message in outcome.stderr
    assert [Record(**entry) for entry in load(tmp_path)["records"]] == RECORDS[:1]
    assert "Mc/s" in outcome.stdout, "the table is printed too"
    assert (tmp_path / "bench.csv").exists()
    assert (tmp_path / "scaling.png").exists()


def test_nothing_is_written_when_nothing_was_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_plan: Plan) -> Iterator[list[Record]]:
        raise KeyboardInterrupt

    monkeypatch.setitem(EXPERIMENTS, "sizes", interrupted)
    assert run("bench", "--experiment", "sizes", "-o", tmp_path / "out").status == 130
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--experiment", "nonsense"),
        ("--sizes", "64,x"),
        ("--sizes", "1"),
        ("--batch", "0"),
        ("--orderings", "wavefront,spiral"),
        ("--repeats", "0"),
        ("--schemes", "weno"),
        ("--strip-rows", "12"),
        ("--lanes", "4,5"),
        ("--band-rows", "0"),
        ("--work-groups", "two"),
        ("--tiles", "8x8,9"),
        ("--tiles", "1000000x8"),
    ],
)
def test_a_wrong_option_is_told(option: str, value: str) -> None:
    outcome = run("bench", option, value)
    assert outcome.status == 2
    assert option in outcome.stderr
