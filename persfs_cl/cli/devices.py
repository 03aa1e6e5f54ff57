"""``persfs-cl devices``: what OpenCL finds here, and whether it computes what it should."""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from persfs_cl._cl.cache import cache_folders
from persfs_cl._cl.device import Device
from persfs_cl._cl.device import devices as list_devices
from persfs_cl._cl.selection import select_device
from persfs_cl.environment import environment
from persfs_cl.errors import DeviceError, KernelBuildError, PersfsError
from persfs_cl.io.files import json_text
from persfs_cl.selftest.supervisor import Report, Show, child_command, examine

_CHECK = "Of --check"
_ALL = "all"
_FAILED = 1
_WORST_FIRST = ("failed", "skipped", "ok", "not there")
_CASE_LIMIT = 300.0


def devices(
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Compile the kernels for each device, compare their results with the NumPy reference, and measure a"
            " few rates. The first time this may take many minutes.",
        ),
    ] = False,
    device: Annotated[
        str,
        typer.Option(
            "--device",
            metavar="DEVICE",
            help="Only this device: 'cpu', 'gpu', its number, or part of its name.",
        ),
    ] = _ALL,
    as_json: Annotated[bool, typer.Option("--json", help="Print a JSON array.")] = False,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="Only the first cases, which cover each ordering and precision.", rich_help_panel=_CHECK
        ),
    ] = False,
    time_limit: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            help="Begin no further case of a device after this time; none unless given.",
            rich_help_panel=_CHECK,
        ),
    ] = None,
    case_limit: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            min=1.0,
            max=86400.0,
            help="A single case, or the start of the driver, that takes longer has hung: the device fails.",
            rich_help_panel=_CHECK,
        ),
    ] = _CASE_LIMIT,
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh",
            help="Compile everything anew, without the caches of compiled kernels, to measure how long that takes.",
            rich_help_panel=_CHECK,
        ),
    ] = False,
) -> None:
    """List the OpenCL devices, and say what to install when there are none; with --check, test them.

    The default device, marked *, is the first, unless the environment variable PYOPENCL_CTX says otherwise.
    """
    if not check and (quick or fresh or time_limit is not None or case_limit != _CASE_LIMIT):
        raise typer.BadParameter("--quick, --time-limit, --case-limit and --fresh are for a test: add --check.")
    found = list_devices()
    problem: PersfsError | None = None
    default = None
    if not check or not found or os.environ.get("PYOPENCL_CTX"):
        # A test compiles nothing in this process, which a compiler may end, or keep waiting.
        try:
            default = select_device()
        except (DeviceError, KernelBuildError) as error:
            problem = error
    chosen = found if device == _ALL else [select_device(device)]
    reports: list[Report] = []
    for number, one in enumerate(chosen if check else ()):
        report = _examined(one, quick=quick, time_limit=time_limit, case_limit=case_limit, fresh=fresh)
        reports.append(report)
        default = default or (one if report.compiles and device == _ALL else None)
        if not as_json:
            _print_report(one, report, fresh=fresh, first=number == 0)
    if as_json:
        entries = [_entry(one, default) for one in chosen]
        for one, entry, report in zip(chosen, entries, reports, strict=False):
            entry["check"] = _checked(one, report, quick=quick, fresh=fresh)
        typer.echo(json_text(entries))
    elif chosen and not check:
        _table(chosen, default)
    for one, report in zip(chosen, reports, strict=False):
        _complain(one, report)
    if problem:
        raise problem
    if not all(report.ok for report in reports):
        raise typer.Exit(_FAILED)


def _entry(device: Device, default: Device | None) -> dict[str, Any]:
    return {
        "index": device.index,
        "default": device is default,
        "kind": device.kind,
        "name": device.name,
        "platform": device.platform,
        "platform_version": device.platform_version,
        "driver_version": device.driver_version,
        "float64": device.has_float64,
        "memory_bytes": device.memory,
        "compute_units": device.compute_units,
    }


def _table(found: list[Device], default: Device | None) -> None:
    table = Table(box=box.SIMPLE)
    for title in ("index", "kind", "name", "platform", "version", "driver", "float64", "memory", "units"):
        table.add_column(title, overflow="fold", justify="right" if title in ("memory", "units") else "left")
    for device in found:
        table.add_row(
            f"{device.index}{' *' if device is default else ''}",
            device.kind,
            device.name,
            device.platform,
            device.version,
            device.driver_version,
            "yes" if device.has_float64 else "no",
            f"{device.memory / 2**30:.1f} GiB",
            str(device.compute_units),
        )
    console = _console()
    console.print(table)
    if default:
        console.print("* is the default device.")


def _examined(device: Device, *, quick: bool, time_limit: float | None, case_limit: float, fresh: bool) -> Report:
    with ExitStack() as stack:
        environment: dict[str, str] = {}
        if fresh:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="persfs-cl-"))
            environment = {**cache_folders(Path(folder)), "PYOPENCL_NO_CACHE": "1"}
        show = stack.enter_context(_progress(device))
        return examine(
            child_command(device.index),
            quick=quick,
            time_limit=time_limit,
            case_limit=case_limit,
            environment=environment,
            show=show,
        )


@contextmanager
def _progress(device: Device) -> Iterator[Show]:
    """A line on standard error with the case at hand; nothing when that is not a terminal."""
    if not sys.stderr.isatty():
        yield lambda _text: None
        return
    with Console(stderr=True, markup=False, highlight=False).status(f"{device.name}: starting") as status:
        yield lambda text: status.update(f"{device.name}: {text}")


def _checked(device: Device, report: Report, *, quick: bool, fresh: bool) -> dict[str, Any]:
    """All that is known of a test, for a report of a fault."""
    total, slowest = _compiled(report)
    return {
        "ok": report.ok,
        "failures": report.failures,
        "said": report.said,
        "seconds": report.seconds,
        "quick": quick,
        "environment": environment(device, shlex.join(["persfs-cl", *sys.argv[1:]]), report.facts),
        **report.facts,
        "kernels": [
            {"ordering": ordering, "precisions": precisions, "kernel": kernel, "reason": reason}
            for (ordering, kernel, reason), precisions in _by_kernel(report).items()
        ],
        "compilation": {"seconds": total, "slowest": slowest, "caches": "none" if fresh else "as they were"},
        "cases": report.results,
    }


def _compiled(report: Report) -> tuple[float, dict[str, Any] | None]:
    """Seconds of all compilation, and the case of the program that took longest."""
    timed = [result for result in report.results if result["compile_seconds"] is not None]
    if not timed:
        return 0.0, None
    slowest = max(timed, key=lambda result: result["compile_seconds"])
    named = {key: slowest[key] for key in ("case", "ordering", "precision")}
    return sum(result["compile_seconds"] for result in timed), {**named, "seconds": slowest["compile_seconds"]}


def _print_report(device: Device, report: Report, *, fresh: bool, first: bool) -> None:
    console = _console()
    if not first:
        console.print()
    console.print(f"{device.index}: {device.name} ({device.platform}, {device.driver_version})")
    by_title: dict[str, list[dict[str, Any]]] = {}
    for result in report.results:
        if result["kind"] not in ("rate", "copy"):
            by_title.setdefault(result["case"], []).append(result)
    table = Table(box=box.SIMPLE)
    table.add_column("case", overflow="fold")
    for precision in ("float32", "float64"):
        table.add_column(precision, overflow="fold")
    for title, results in by_title.items():
        table.add_row(title, *(_cell(results, precision) for precision in ("float32", "float64")))
    console.print(table)
    console.print("Each with the largest difference from the reference, of the orderings that were tested.")
    _print_measures(console, report)
    for (ordering, kernel, reason), precisions in _by_kernel(report).items():
        console.print(f"{ordering} in {' and '.join(precisions)}: {kernel}. {reason}")
    if level := report.facts.get("compiles_for"):
        console.print(f"Its compiler does not know the processor, and compiles for {level}.")
    total, slowest = _compiled(report)
    if slowest:
        where = ", ".join(slowest[key] for key in ("case", "ordering", "precision") if slowest[key])
        console.print(
            f"Compiled in {total:.1f} s, the slowest in {slowest['seconds']:.1f} s ({where})"
            + ("." if fresh else "; less where kernels came from a cache, see --fresh.")
        )
    counts = {status: sum(result["status"] == status for result in report.results) for status in _WORST_FIRST}
    told = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    verdict = "FAILED" if not report.ok else "works, as far as it was tested" if counts["skipped"] else "works"
    console.print(f"Device {device.index} {verdict}: {told}, in {report.seconds:.0f} s.")


def _cell(results: Sequence[Mapping[str, Any]], precision: str) -> str:
    found = [result for result in results if result["precision"] == precision]
    if not found:
        return ""
    worst = min((result["status"] for result in found), key=_WORST_FIRST.index)
    if worst in ("failed", "skipped"):
        orderings = [result["ordering"] for result in found if result["status"] == worst and result["ordering"]]
        return f"{'FAILED' if worst == 'failed' else worst} {', '.join(orderings)}".rstrip()
    differences = [result["difference"] for result in found if result["difference"] is not None]
    return f"{worst}, {max(differences):.0e}" if differences else worst


def _print_measures(console: Console, report: Report) -> None:
    for result in report.results:
        if result["rate"] is not None:
            what = result["case"] if result["kind"] == "copy" else f"{result['ordering']}, {result['precision']}"
            console.print(f"{what}: {result['rate']:.4g} {result['unit']}")


def _by_kernel(report: Report) -> dict[tuple[str, str, str], list[str]]:
    """The precisions that each kernel is taken for, by ordering, kernel and reason."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for result in report.results:
        if result["kernel"]:
            precisions = found.setdefault((result["ordering"], result["kernel"], result["reason"]), [])
            if result["precision"] not in precisions:
                precisions.append(result["precision"])
    return found


def _complain(device: Device, report: Report) -> None:
    for failure in report.failures:
        typer.echo(f"persfs-cl: device {device.index}, {device.name}: {failure}", err=True)
    if report.said:
        typer.echo("persfs-cl: the last that its driver said:", err=True)
        typer.echo("\n".join(f"    {line}" for line in report.said.splitlines()), err=True)


def _console() -> Console:
    # A file or pipe has no width to fit: one line a device.
    return Console(width=None if sys.stdout.isatty() else 250, markup=False, highlight=False)
