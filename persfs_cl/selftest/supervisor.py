"""The test of one device by a child process, which a driver may crash or hang without harm."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from persfs_cl._cl import probes, rendering
from persfs_cl.bench.fresh import child_environment
from persfs_cl.selftest.cases import Case, cases
from persfs_cl.solver.schemes import SCHEMES

Show = Callable[[str], None]
"""Is told what is being done."""

_MOST_CRASHES = 10
"""Children that are started again after one that died; by then enough is known."""
_LAST_LINES, _LAST_CHARACTERS = 40, 6000
_COUNTED = ("difference", "tolerance", "seconds", "compile_seconds", "kernel", "reason", "rate", "unit", "message")


@dataclass
class Report:
    """What is known of a device after its test.

    Attributes
    ----------
    facts : dict
        See :func:`persfs_cl._cl.selftest.facts`; empty when the child did not come so far.
    results : list of dict
        One a case: what it is, its status ("ok", "failed", "not there", "skipped"), and what was found.
    failures : list of str
        A sentence for all that is wrong.
    said : str
        The last lines that the children that failed wrote to their standard error.
    seconds : float
    """

    facts: dict[str, Any] = field(default_factory=dict)
    results: list[dict[str, Any]] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    said: str = ""
    seconds: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return not self.failures

    @property
    def compiles(self) -> bool:
        """Whether any kernel came as far as to be compared with the reference."""
        return any(result["status"] == "ok" for result in self.results)


def child_command(device: int) -> list[str]:
    """How the child of a device is started; more arguments follow."""
    return [sys.executable, "-m", "persfs_cl.selftest.child", str(device)]


def examine(
    command: Sequence[str],
    *,
    quick: bool = False,
    time_limit: float | None = None,
    case_limit: float = 300.0,
    environment: Mapping[str, str] | None = None,
    show: Show = lambda _text: None,
) -> Report:
    """Test a device, in as many processes as it takes.

    After a crash, or an error that may have left the driver in disorder, another process goes on with the next case;
    one that hangs or talks nonsense ends the test.

    Parameters
    ----------
    command : sequence of str
        See :func:`child_command`.
    quick : bool
        Only the first cases.
    time_limit : float, optional
        Seconds after which no further case is begun.
    case_limit : float
        Seconds that a case may take, or a process to start, before it counts as hung.
    environment : mapping, optional
        Variables for the children.
    show : callable
    """
    began = time.monotonic()
    report, listed = Report(), cases(quick=quick)
    place, crashes = 0, 0
    while place < len(listed) and crashes <= _MOST_CRASHES:
        arguments = [*command, f"--first={place}", *(["--quick"] if quick else [])]
        if time_limit is not None:
            arguments.append(f"--seconds={time_limit - (time.monotonic() - began):.3f}")
        child = _Child(report, listed, place, case_limit, show)
        with _process(arguments, environment or {}) as (process, said):
            fault = child.follow(process)
            if fault:
                _kill(process)
                report.said = _tail(said)
        place = child.place
        if child.done or child.hopeless:
            break
        if fault:
            crashes += 1
    report.results += [_result(case, status="skipped", message="not reached") for case in listed[len(report.results) :]]
    if not (report.failures or report.compiles):
        report.failures.append("nothing was tested in the time that was given: raise the time limit")
    report.seconds = time.monotonic() - began
    return report


@dataclass
class _Child:
    """What one process reports; `place` is the case that is to be next."""

    report: Report
    listed: Sequence[Case]
    place: int
    case_limit: float
    show: Show
    done: bool = False
    hopeless: bool = False
    begun: bool = False
    compiled: bool = False

    def follow(self, process: subprocess.Popen[bytes]) -> str:
        """Read until the end; the sentence of what went wrong, or nothing."""
        lines: queue.Queue[bytes | None] = queue.Queue()
        threading.Thread(target=_read, args=(process, lines), daemon=True).start()
        while True:
            try:
                line = lines.get(timeout=self.case_limit)
            except queue.Empty:
                self.hopeless = True
                return self._fail(f"unusable here: no answer within {self.case_limit:g} s")
            if line is None:
                return self._ended(process.wait())
            try:
                self._take(json.loads(line))
            except (ValueError, TypeError, KeyError, IndexError):
                self.hopeless = True
                words = line[:200].decode(errors="replace").strip()
                return self._fail(f"the process said {words!r}, which is no answer,")

    def _ended(self, status: int) -> str:
        if self.done or (status == 0 and not self.begun and self.place > 0):
            return ""
        if not self.begun:
            # It would come to the same end again.
            self.hopeless = True
        return self._fail(_ending(status))

    def _take(self, event: dict[str, Any]) -> None:
        name = event["event"]
        if name == "device":
            self.report.facts = event["facts"]
            return
        if name == "done":
            self.done = True
            return
        case = self.listed[self.place]
        if event["case"] != self.place:
            raise ValueError(event)
        if name == "begin":
            self.begun, self.compiled = True, False
            self.show(f"{case}, {self.place + 1} of {len(self.listed)}: compiling {_kernels(case)}")
        elif name == "compiled":
            self.compiled = True
            self.show(f"{case}, {self.place + 1} of {len(self.listed)}")
        elif name == "end":
            found = {key: event[key] for key in _COUNTED if key in event}
            self.report.results.append(_result(case, status=event["status"], **found))
            if event["status"] == "failed":
                self.report.failures.append(f"{case}: {event['message']}")
            self.place, self.begun = self.place + 1, False
        else:
            raise ValueError(event)

    def _fail(self, what: str) -> str:
        """Note what went wrong in the case at hand, or before the first one."""
        if self.begun:
            case = self.listed[self.place]
            doing = "running" if self.compiled else "compiling"
            sentence = f"{what} while {doing} {_kernels(case)} ({case})"
            self.report.results.append(_result(case, status="failed", message=sentence))
            self.place += 1
        else:
            after = f"after {self.listed[self.place - 1]}" if self.place else "before the first case"
            sentence = f"{what} {after}"
        self.report.failures.append(sentence)
        return sentence


def _kernels(case: Case) -> str:
    """The program in the words of its files: the last of the model and the scheme, precision and ordering."""
    if case.kind == "copy":
        return probes.KERNEL_FILE
    if case.kind == "render":
        return f"{rendering.KERNEL_FILE} in {case.precision}"
    if case.kind == "smoothing":
        return f"smooth in {case.precision}"
    if case.kind == "energy":
        return f"linearise and conjugate_gradients in {case.precision}"
    if case.kind == "multigrid":
        return f"grid_level, transfer and small_levels in {case.precision}"
    solved_by = SCHEMES[case.scheme]
    scheme = solved_by.kernels(solved_by.model(case.light_source, case.reflectance))[-1]
    order = " at second order" if case.kind == "second order" else ""
    return f"{scheme}{order} in {case.precision}: {case.ordering}"


def _result(case: Case, *, status: str, **found: Any) -> dict[str, Any]:
    about = {
        "case": case.title,
        "kind": case.kind,
        "ordering": case.ordering or None,
        "precision": case.precision,
        "light": case.light,
        "material": case.material,
        "scheme": case.scheme,
        "surface": case.surface,
        "boundary": case.boundary,
        "status": status,
    }
    return {**about, **dict.fromkeys(_COUNTED), **found}


def _ending(status: int) -> str:
    if status < 0:
        name = signal.strsignal(-status) or f"signal {-status}"
        return f"{name[0].lower()}{name[1:]}"
    return f"the process ended with status {status}"


def _read(process: subprocess.Popen[bytes], lines: queue.Queue[bytes | None]) -> None:
    pipe = process.stdout
    # Nobody waits for this thread when the process is ended: the pipe may be closed under it.
    with suppress(ValueError, OSError):
        if pipe is not None:
            for line in pipe:
                lines.put(line)
    lines.put(None)


@contextmanager
def _process(
    command: Sequence[str], environment: Mapping[str, str]
) -> Iterator[tuple[subprocess.Popen[bytes], BinaryIO]]:
    """A process in a group of its own, which ends with the block, and the file that its standard error goes to."""
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(
            list(command),
            env=child_environment(environment),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=said,
            start_new_session=True,
        )
        try:
            yield process, said
        finally:
            _kill(process)
            if process.stdout is not None:
                process.stdout.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End the process, and the compilers that it may have started, if it has not ended by itself."""
    if process.poll() is not None:
        return
    if sys.platform == "win32":
        process.kill()
    else:
        # It has not been waited for, so that its number cannot be another's.
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _tail(said: BinaryIO) -> str:
    said.seek(0, os.SEEK_END)
    said.seek(max(0, said.tell() - _LAST_CHARACTERS))
    return "\n".join(said.read().decode(errors="replace").strip().splitlines()[-_LAST_LINES:])
