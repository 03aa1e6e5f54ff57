"""A process that runs cases, so that one that crashes or hangs is reported and does not end the others."""

from __future__ import annotations

import faulthandler
import multiprocessing
import re
import resource
import signal
import tempfile
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

from fuzz.cases import Setting, run
from fuzz.invariants import Violation

Task = Callable[[str, int, Setting], list[str]]
_Answer = tuple[list[str], Violation | None]

_OF_FILES = ("image", "exif", "array", "points", "compare")
_FILE_SECONDS, _CALL_SECONDS = 20.0, 180.0
"""What a case may take at most; a call may compile several programs."""
_GRACE = 2.0
"""Until then a process that hangs has written where it is."""
_MEMORY = 8 << 30
"""Address space of the process of the cases."""
_TRACE = "trace.txt"
"""In the folder of the cases: where a process was when it crashed or time was up."""


def _work(pipe: Connection, task: Task, folder: Path) -> None:
    """Run the cases that come by the pipe, and send back what became of each."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    setting = Setting(folder)
    with (folder / _TRACE).open("w") as trace:
        faulthandler.enable(trace)
        pipe.send(None)
        while True:
            kind, seed, seconds = pipe.recv()
            faulthandler.dump_traceback_later(seconds, file=trace)
            try:
                answer: _Answer = task(kind, seed, setting), None
            except Violation as violation:
                answer = [], violation
            except Exception as error:  # noqa: BLE001 # one case must not end the others
                text = "".join(traceback.format_exception(error))
                answer = [], Violation(f"{kind}: {type(error).__name__} in the suite itself", text)
            faulthandler.cancel_dump_traceback_later()
            pipe.send(answer)


class Worker:
    """A process that runs cases; another takes its place when it dies or hangs.

    Parameters
    ----------
    task : callable
        What a case is; of a module, so that another process finds it.
    seconds : float, optional
        What a case may take at most.
    """

    def __init__(self, task: Task = run, seconds: float | None = None) -> None:
        self._task, self._seconds = task, seconds
        # A fork would share OpenCL's threads with this process, which have none in it.
        self._context = multiprocessing.get_context("spawn")
        self._start()

    def _start(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="fuzz-")
        self._pipe, theirs = self._context.Pipe()
        arguments = (theirs, self._task, Path(self._folder.name))
        self._process = self._context.Process(target=_work, args=arguments, daemon=True)
        self._process.start()
        theirs.close()
        self._pipe.recv()  # it has begun

    def run(self, kind: str, seed: int) -> _Answer:
        """What became of a case: its verdicts, and what does not hold, if anything."""
        seconds = self._seconds or (_FILE_SECONDS if kind in _OF_FILES else _CALL_SECONDS)
        self._pipe.send((kind, seed, seconds))
        try:
            if self._pipe.poll(seconds + _GRACE):
                answer: _Answer = self._pipe.recv()
                return answer
            what = f"no end after {seconds:g} s"
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode or 0
            how = signal.Signals(-code).name if code < 0 else f"status {code}"
            what = f"the process ended by {how}"
        trace = (Path(self._folder.name) / _TRACE).read_text()
        inside = re.search(r"persfs_cl/(\S+\.py)\", line (\d+)", trace)
        where = f" at {inside[1]}:{inside[2]}" if inside else ""
        self.close()
        self._start()
        return [], Violation(f"{kind}: {what}{where}", trace[:3000])

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()
        self._folder.cleanup()
