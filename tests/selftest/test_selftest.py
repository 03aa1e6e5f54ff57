"""``persfs-cl devices --check``: right kernels pass, wrong ones are found, and whatever a driver does is reported."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import wait_until
from typer.testing import CliRunner

import persfs_cl as ps
from persfs_cl._cl import device as device_room
from persfs_cl._cl.energy import Descent
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.choices import Surface
from persfs_cl.cli.app import app
from persfs_cl.selftest import checks
from persfs_cl.selftest.cases import ORDERINGS, PRECISIONS, Case, cases
from persfs_cl.selftest.checks import Checks
from persfs_cl.selftest.scenes import EVEN, OBLIQUE, noise
from persfs_cl.selftest.smoothing import smoothed_from_blocks
from persfs_cl.selftest.supervisor import examine
from persfs_cl.shading.equations import HeadlightEquation, MaterialEquation
from persfs_cl.solver.reference import Reference
from persfs_cl.solver.schemes import SCHEMES

FIRST, SECOND = cases(quick=True)[:2]
MATERIALS = [ps.OrenNayar(0.4), ps.Phong()]

# Programs that the suite compiles anyway, or soon compiled.
QUICK = [
    Case("sweeps", "float32", "lexicographic", surface="toward"),
    Case("sweeps", "float32", "wavefront", surface="toward"),
    Case("sweeps", "float32", "checkerboard", surface="toward"),
    Case("sweeps", "float32", "checkerboard", boundary="outflow"),
    Case("sweeps", "float32", "wavefront", boundary="extrapolate"),
    Case("sweeps", "float32", "lexicographic", boundary="fixed"),
    Case("sweeps", "float32", "lexicographic", "flash", scheme="upwind"),
    Case("render", "float32", "", "flash"),
    Case("shared image", "float32", "checkerboard"),
    Case("smoothing", "float32"),
    Case("energy", "float32"),
    Case("energy", "float32", "", "flash", "Phong"),
    Case("energy", "float32", painted=True),
    Case("energy", "float32", bounded=True),
    Case("copy", "float32"),
    Case("rate", "float32", "lexicographic"),
]


def invoked(*arguments: str) -> Any:
    return CliRunner(env={"COLUMNS": "300", "TERM": "dumb"}).invoke(app, ["devices", *arguments])


def script(tmp_path: Path, *bodies: str) -> list[str]:
    """A child that says what `bodies` make it say; it is given the options of the real one."""
    lines = """
        import json, os, sys, time
        first = int(next(word for word in sys.argv if word.startswith("--first=")).split("=")[1])
        def say(event, **more):
            print(json.dumps({"event": event, **more}), flush=True)
        def passed(case):
            say("begin", case=case); say("compiled", case=case)
            say("end", case=case, status="ok", difference=1e-7, tolerance=1e-4, seconds=0.1, compile_seconds=0.05)
        say("device", name="pretended", facts={"vendor": "nobody"})
    """
    path = tmp_path / "child.py"
    path.write_text("".join(map(textwrap.dedent, (lines, *bodies))), encoding="utf-8")
    return [sys.executable, str(path)]


def goes_on(after: int) -> str:
    """The rest of a script: the cases from one on pass."""
    return f"\nfor case in range(max(first, {after}), {len(cases(quick=True))}): passed(case)\nsay('done')\n"


@pytest.mark.parametrize("case", QUICK, ids=str)
def test_the_kernels_are_right(case: Case) -> None:
    outcome = Checks(ps.devices()[0]).run(case)
    assert outcome.ok, outcome.message
    if case.measures:
        assert outcome.rate is not None
        assert outcome.rate > 0
    else:
        assert outcome.difference is not None
        assert outcome.tolerance is not None
        assert 0 <= outcome.difference <= outcome.tolerance
    assert bool(outcome.kernel and outcome.reason.endswith(".")) == (case.ordering != "")


@pytest.mark.parametrize(
    ("method", "case"),
    [
        ("lax_friedrichs", QUICK[0]),
        ("lax_friedrichs", QUICK[2]),
        ("upwind", QUICK[6]),
        ("renew_boundary", QUICK[3]),
        ("lax_friedrichs", Case("multigrid", "float32")),
    ],
    ids=str,
)
def test_kernels_that_do_something_else_are_found(method: str, case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same as kernels that are off by a little."""
    right = getattr(Reference, method)

    def wrong(self: Reference, *given: Any, **more: Any) -> Any:
        if method == "renew_boundary":
            return right(replace(self, max_slope=0.9 * self.max_slope), *given)
        return right(self, *given, **more) * (1.0 - 1e-3)

    monkeypatch.setattr(Reference, method, wrong)
    outcome = Checks(ps.devices()[0]).run(case)
    assert not outcome.ok
    assert "differ by" in outcome.message


def test_a_wrong_bit_of_the_wavefront_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    tested = Checks(ps.devices()[0])
    assert tested.run(QUICK[0]).ok
    right = Sweeper.log_depth

    def wrong(self: Sweeper) -> Any:
        values = right(self)
        values[0, 4, 5] = np.nextafter(values[0, 4, 5], np.float32(9.0))
        return values

    monkeypatch.setattr(Sweeper, "log_depth", wrong)
    outcome = tested.run(QUICK[1])
    assert not outcome.ok
    assert "same bits: 1 values differ" in outcome.message


@pytest.mark.parametrize(
    ("method", "factor", "found"),
    [
        ("log_depth", 1.1, "values after a step differ"),
        ("turn", 1.01, "slopes along the step differ"),
        ("assemble", 1.0, "slopes differ"),
        ("linearise", 1.001, "energies differ"),
    ],
)
def test_a_wrong_energy_is_found(method: str, factor: float, found: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right = getattr(Descent, method)

    def wrong(self: Descent, *given: Any, **more: Any) -> Any:
        if method == "assemble":
            # As kernels do that read an array of something else.
            self._values["residuals"] = self._values["prior"]
        result = right(self, *given, **more)
        if method == "assemble":
            return result
        return replace(result, energy=factor * result.energy) if method == "linearise" else factor * result

    monkeypatch.setattr(Descent, method, wrong)
    outcome = Checks(ps.devices()[0]).run(Case("energy", "float32"))
    assert not outcome.ok
    assert found in outcome.message


def test_wrong_blocks_of_the_smoothing_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "_LEVELS", 1)
    right = smoothed_from_blocks
    monkeypatch.setattr(checks, "smoothed_from_blocks", lambda given, levels: right(given, 2 * levels))
    outcome = Checks(ps.devices()[0]).run(Case("smoothing", "float32"))
    assert "residuals smoothed on 2 grids differ" in outcome.message
    assert not outcome.message.startswith("residuals differ")


def test_a_wrong_forward_model_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "render", lambda *given, **more: 1.001 * ps.render(*given, **more))
    assert "brightnesses differ" in Checks(ps.devices()[0]).run(QUICK[7]).message
    monkeypatch.setattr(checks, "render", lambda *given, **more: np.nan_to_num(ps.render(*given, **more)))
    assert "show no surface" in Checks(ps.devices()[0]).run(QUICK[7]).message


@pytest.mark.parametrize("material", MATERIALS, ids=str)
@pytest.mark.parametrize("surface", ["away", "toward"])
def test_the_reference_has_a_viscosity_that_bounds_the_slope(material: Any, surface: Surface) -> None:
    """Of the two equations that the kernels were not compared with otherwise."""
    for light in (OBLIQUE, EVEN):
        reference = Reference.of(noise(light, material, "lax-friedrichs", surface, "wall"))
        rows, columns = (axis.ravel() for axis in np.indices(reference.log_depth.shape))
        equation = reference.equation(rows, columns, 30.0)
        assert isinstance(equation, MaterialEquation if light is OBLIQUE else HeadlightEquation)
        random = np.random.default_rng(1)
        p, q = (np.sinh(random.uniform(-2.0, 2.0, (500, rows.size))) for _ in range(2))
        step = 1e-6
        for bound, (a, b) in zip(equation.viscosity(), ((step, 0.0), (0.0, step)), strict=True):
            slope = (equation.hamiltonian(p + a, q + b) - equation.hamiltonian(p - a, q - b)) / (2.0 * step)
            assert (np.abs(slope) <= bound * (1.0 + 1e-6)).all()
            assert np.abs(slope).max() > 0.3 * bound.max()
        for least, along_p in ((equation.argmin_p(q), True), (equation.argmin_q(p), False)):
            if light is OBLIQUE:
                continue  # of other materials the brightest matt surface is a guess
            lowest = equation.hamiltonian(least, q) if along_p else equation.hamiltonian(p, least)
            for aside in (-0.01, 0.01):
                beside = equation.hamiltonian(least + aside, q) if along_p else equation.hamiltonian(p, least + aside)
                assert (lowest <= beside).all()


@pytest.mark.parametrize("quick", [False, True])
def test_cases_cover_what_there_is_and_begin_with_what_matters(quick: bool) -> None:
    listed = cases(quick=quick)
    assert len(set(listed)) == len(set(map(str, listed))) == len(listed)
    swept = [case for case in listed if case.kind == "sweeps"]
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            for scheme in ("lax-friedrichs", "upwind"):
                assert any(
                    (case.precision, case.ordering, case.scheme) == (precision, ordering, scheme) for case in swept[:12]
                )
    # Each is measured by one before it.
    for place, case in enumerate(listed):
        if case.ordering == "wavefront" and case.material == "Lambertian" and case.kind in ("sweeps", "shared image"):
            assert replace(case, ordering="lexicographic") in listed[:place]
    if quick:
        return
    for precision in PRECISIONS:
        compared = {
            SCHEMES[case.scheme].kernels(SCHEMES[case.scheme].model(case.light_source, case.reflectance))
            for case in swept
            if case.precision == precision and case.ordering == "wavefront"
        }
        assert len(compared) == 19, "kernels of all lights, materials and schemes"
        assert {case.boundary for case in swept} == {"wall", "outflow", "extrapolate", "fixed"}
        assert {case.surface for case in swept} == {"away", "toward"}
        rendered = {
            (case.light, case.material) for case in listed if (case.kind, case.precision) == ("render", precision)
        }
        assert len(rendered) == 9
        lowered = {
            (case.light, case.material) for case in listed if (case.kind, case.precision) == ("energy", precision)
        }
        assert len(lowered) == 11
        corrected = [case for case in listed if (case.kind, case.precision) == ("second order", precision)]
        assert {case.ordering for case in corrected} == set(ORDERINGS)


def test_a_child_that_passes(tmp_path: Path) -> None:
    shown: list[str] = []
    report = examine(script(tmp_path, goes_on(0)), quick=True, show=shown.append)
    assert report.ok
    assert report.facts == {"vendor": "nobody"}
    assert [result["status"] for result in report.results] == ["ok"] * len(cases(quick=True))
    assert shown[0] == f"{FIRST}, 1 of {len(report.results)}: compiling lax_friedrichs in float32: lexicographic"


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_crash_is_a_sentence_and_the_test_goes_on(tmp_path: Path) -> None:
    body = """
        if first == 0:
            passed(0)
            say("begin", case=1)
            print("LLVM is at a loss", file=sys.stderr, flush=True)
            os.abort()
    """
    report = examine(script(tmp_path, body, goes_on(2)), quick=True)
    assert report.failures == [f"aborted while compiling lax_friedrichs in float32: wavefront ({SECOND})"]
    assert [result["status"] for result in report.results][:3] == ["ok", "failed", "ok"]
    assert len(report.results) == len(cases(quick=True))
    assert report.said == "LLVM is at a loss"


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_a_crash_in_every_process_comes_to_an_end(tmp_path: Path) -> None:
    body = "say('begin', case=first); say('compiled', case=first); os.kill(os.getpid(), 11)"
    report = examine(script(tmp_path, body), quick=True)
    assert report.failures[0] == f"segmentation fault while running lax_friedrichs in float32: lexicographic ({FIRST})"
    assert 3 < len(report.failures) < len(report.results)
    assert report.results[-1]["status"] == "skipped"


def test_a_device_of_which_nothing_was_tested_is_not_right(tmp_path: Path) -> None:
    report = examine(script(tmp_path, "say('done')"), quick=True, time_limit=0)
    assert report.failures == ["nothing was tested in the time that was given: raise the time limit"]
    assert not report.ok


def test_a_hang_is_ended_with_all_that_it_started(tmp_path: Path) -> None:
    body = f"""
        import subprocess
        passed(0)
        helper = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        open({str(tmp_path / "helper")!r}, "w").write(str(helper.pid))
        say("begin", case=1)
        time.sleep(600)
    """
    # Time enough for a process to start on a slow machine that others use too.
    report = examine(script(tmp_path, body), quick=True, case_limit=4.0)
    assert report.failures == [
        f"unusable here: no answer within 4 s while compiling lax_friedrichs in float32: wavefront ({SECOND})"
    ]
    assert [result["status"] for result in report.results][:3] == ["ok", "failed", "skipped"]
    assert report.seconds < 500
    if os.name == "posix":
        assert_ended(int((tmp_path / "helper").read_text()))


def assert_ended(process: int) -> None:
    """Or soon: one that was killed may be there until it is collected."""

    def has_ended() -> bool:
        try:
            os.kill(process, 0)
            return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except (ProcessLookupError, FileNotFoundError):
            return True

    wait_until(has_ended)


@pytest.mark.parametrize(
    "rubbish",
    ["print('Build log: 3 warnings', flush=True)", "say('end', case=5, status='ok')", "say('party', case=1)", "say(1)"],
)
def test_rubbish_is_reported(tmp_path: Path, rubbish: str) -> None:
    body = f"passed(0)\nsay('begin', case=1)\n{rubbish}\n"
    report = examine(script(tmp_path, body, goes_on(2)), quick=True)
    assert len(report.failures) == 1
    assert report.failures[0].startswith("the process said ")
    assert str(SECOND) in report.failures[0]
    assert [result["status"] for result in report.results][:3] == ["ok", "failed", "skipped"]


def test_a_child_that_does_not_start_is_reported() -> None:
    report = examine([sys.executable, "-c", "import sys; sys.exit('no libOpenCL')"], quick=True)
    assert report.failures == ["the process ended with status 1 before the first case"]
    assert report.said == "no libOpenCL"
    assert {result["status"] for result in report.results} == {"skipped"}


def test_after_an_error_of_the_driver_another_process_goes_on(tmp_path: Path) -> None:
    body = """
        if first == 0:
            passed(0)
            say("begin", case=1)
            say("end", case=1, status="failed", message="RuntimeError: out of resources", seconds=0.1)
            sys.exit()
    """
    report = examine(script(tmp_path, body, goes_on(2)), quick=True)
    assert report.failures == [f"{SECOND}: RuntimeError: out of resources"]
    assert [result["status"] for result in report.results].count("ok") == len(report.results) - 1


def real_child(*arguments: str) -> list[dict[str, Any]]:
    """What the real child says of the first device."""
    started = [sys.executable, "-m", "persfs_cl.selftest.child", "0", "--quick", *arguments]
    done = subprocess.run(started, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_the_real_child_begins_where_it_is_told_and_heeds_the_time_limit() -> None:
    last = len(cases(quick=True))
    said = real_child(f"--first={last - 2}", "--seconds=-1")
    assert [line["event"] for line in said] == ["device", "end", "end", "done"]
    assert said[1]["status"] == "skipped"
    copy = next(place for place, case in enumerate(cases(quick=True)) if case.kind == "copy")
    said = real_child(f"--first={copy}", "--seconds=0.001")
    assert {line["status"] for line in said if line["event"] == "end"} <= {"ok", "skipped"}


def test_a_device_without_double_precision_does_not_fail(monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    """The child, in this process, on a device that is taken for such a one."""
    from persfs_cl.selftest import child  # noqa: PLC0415 - a module that is a program

    device = ps.devices()[0]
    monkeypatch.setattr(device, "has_float64", False)
    monkeypatch.setattr(child, "cases", lambda **_: [Case("copy", "float32"), Case("rate", "float64", "wavefront")])
    with os.fdopen(os.dup(1), "w") as lines:
        child._check(lines, 0, 0, time.monotonic() + 600.0, quick=True)
    said = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert [line["status"] for line in said if line["event"] == "end"] == ["ok", "not there"]


@pytest.fixture
def pretended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Let the command start a script in place of the child."""

    def pretend(body: str) -> None:
        started = script(tmp_path, body)
        # By name, for the package's attribute is the function.
        command = importlib.import_module("persfs_cl.cli.devices")
        monkeypatch.setattr(command, "child_command", lambda device: [*started, str(device)])

    return pretend


def test_json_holds_everything(pretended: Callable[[str], None]) -> None:
    pretended(goes_on(0))
    result = invoked("--check", "--quick", "--json", "--device=0")
    assert result.exit_code == 0
    assert result.stderr == ""
    (entry,) = json.loads(result.stdout)
    device = ps.devices()[0]
    assert (entry["name"], entry["driver_version"]) == (device.name, device.driver_version)
    check = entry["check"]
    assert check["ok"]
    assert check["failures"] == []
    assert check["vendor"] == "nobody"
    assert check["compilation"]["seconds"] == pytest.approx(0.05 * len(check["cases"]))
    assert {"persfs-cl", "python", "numpy", "pyopencl"} <= set(check["environment"]["versions"])
    assert {"system", "processor", "cores", "date", "command", "device"} <= set(check["environment"])
    assert len(check["cases"]) == len(cases(quick=True))
    for found, case in zip(check["cases"], cases(quick=True), strict=True):
        assert (found["case"], found["precision"]) == (case.title, case.precision)
        assert {"status", "difference", "tolerance", "seconds", "compile_seconds", "kernel", "reason"} <= set(found)


def test_the_table_says_ok(pretended: Callable[[str], None]) -> None:
    pretended(goes_on(0))
    result = invoked("--check", "--quick", "--device=cpu")
    assert result.exit_code == 0
    assert result.stderr == ""
    (row,) = (line for line in result.stdout.splitlines() if line.strip().startswith("flash, Lambertian, upwind"))
    assert row.split("upwind")[1].split() == ["ok,", "1e-07"] * 2
    assert f"works: {len(cases(quick=True))} ok" in result.stdout


def test_a_failure_has_status_1_and_a_sentence_on_standard_error(pretended: Callable[[str], None]) -> None:
    pretended(
        "print('what the driver says', file=sys.stderr)\nif first == 0: say('begin', case=0); sys.exit(7)" + goes_on(1)
    )
    for more in ((), ("--json",)):
        result = invoked("--check", "--quick", "--device=0", *more)
        assert result.exit_code == 1
        assert f"device 0, {ps.devices()[0].name}: the process ended with status 7 while compiling" in result.stderr
        assert "what the driver says" in result.stderr
        assert "FAILED lexicographic" in result.stdout or more
    (entry,) = json.loads(result.stdout)
    assert not entry["check"]["ok"]
    assert entry["check"]["said"] == "what the driver says"
    assert entry["check"]["cases"][0]["status"] == "failed"


def test_all_devices_unless_one_is_chosen(pretended: Callable[[str], None]) -> None:
    pretended(goes_on(0))
    everything = json.loads(invoked("--check", "--quick", "--json").stdout)
    assert [entry["index"] for entry in everything] == [device.index for device in ps.devices()]
    assert json.loads(invoked("--check", "--quick", "--json", "--device=all").stdout)[0]["check"]["ok"]
    chosen = json.loads(invoked("--json", "--device=0").stdout)
    assert [entry["index"] for entry in chosen] == [0]
    assert "check" not in chosen[0]
    assert invoked("--check", "--device=abacus").exit_code == 3


@pytest.mark.parametrize("more", [(), ("--json",), ("--device=gpu",)])
def test_no_device_has_nothing_to_test(more: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_room, "_all_devices", lambda: ())
    result = invoked("--check", *more)
    assert result.exit_code == 3
    assert "pip install pocl-binary-distribution" in result.stderr


def test_a_test_compiles_nothing_in_this_process(
    pretended: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A compiler may end its process, or keep it waiting."""
    pretended(goes_on(0))
    monkeypatch.setattr("persfs_cl._cl.selection.register_bits", lambda device: pytest.fail(f"{device} compiles"))
    monkeypatch.delenv("PYOPENCL_CTX", raising=False)
    result = invoked("--check", "--quick", "--json")
    entries = json.loads(result.stdout)
    found = [(entry["index"], entry["default"]) for entry in entries]
    assert found == [(device.index, device.index == 0) for device in ps.devices()]
    assert result.exit_code == 0


@pytest.mark.parametrize("option", ["--quick", "--fresh", "--time-limit=3", "--case-limit=3"])
def test_options_of_the_test_want_the_test(option: str) -> None:
    result = invoked(option)
    assert result.exit_code == 2
    assert "--check" in result.stderr


def test_differences_without_a_number_leave_json_that_everybody_reads(pretended: Callable[[str], None]) -> None:
    pretended("say('end', case=0, status='failed', message='wrong', difference=float('inf'), seconds=0)\nsys.exit()")
    result = invoked("--check", "--quick", "--device=0", "--json")
    (entry,) = json.loads(result.stdout, parse_constant=pytest.fail)
    assert entry["check"]["cases"][0]["difference"] is None
    assert entry["check"]["cases"][0]["status"] == "failed"


def test_fresh_moves_the_caches(pretended: Callable[[str], None]) -> None:
    pretended("say('end', case=0, status='failed', message=os.environ['POCL_CACHE_DIR'], seconds=0)\nsys.exit()")
    result = invoked("--check", "--quick", "--fresh", "--device=0", "--json")
    (entry,) = json.loads(result.stdout)
    assert "persfs-cl-" in entry["check"]["failures"][0]
    assert entry["check"]["compilation"]["caches"] == "none"


@pytest.mark.skipif(os.name == "nt", reason="signals")
def test_ctrl_c_ends_the_child_too(tmp_path: Path) -> None:
    """In a process of its own, as from a shell."""
    note = tmp_path / "pid"
    started = script(tmp_path, f"open({str(note)!r}, 'w').write(str(os.getpid()))\ntime.sleep(600)")
    code = f"""
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import persfs_cl.cli.app as room
import persfs_cl.cli.devices
import sys
sys.modules["persfs_cl.cli.devices"].child_command = lambda device: {started!r}
room.app(["devices", "--check", "--device=0"])
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_until(lambda: (note.exists() and note.read_text() != "") or process.poll() is not None)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 130
    assert errors == "persfs-cl: interrupted.\n"
    assert_ended(int(note.read_text()))
