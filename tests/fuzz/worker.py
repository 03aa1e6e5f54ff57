"""A process that runs cases, so that one that crashes or hangs is reported and does not end the others."""

from __future__ import annotations

import multiprocessing
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

_OF_FILES = ("image", "exif", "array", "points", "compare")
_FILE_SECONDS, _CALL_SECONDS = 20.0, 180.0
"""What a case may take at most; a call may compile several programs."""
_MEMORY = 8 << 30
"""Address space of the process of the cases."""


def _work(pipe: Connection, task: Task) -> None:
    """Run the cases that come by the pipe, and send back what became of each."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        setting = Setting(Path(folder))
        pipe.send(None)
        while True:
            kind, seed = pipe.recv()
            try:
                pipe.send((task(kind, seed, setting), None))
            except Violation as violation:
                pipe.send(([], violation))
            except Exception as error:  # noqa: BLE001 # one case must not end the others
                text = "".join(traceback.format_exception(error))
                pipe.send(([], Violation(f"{kind}: {type(error).__name__} in the suite itself", text)))


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
        self._pipe, theirs = self._context.Pipe()
        self._process = self._context.Process(target=_work, args=(theirs, self._task), daemon=True)
        self._process.start()
        theirs.close()
        self._pipe.recv()  # it has begun

    def run(self, kind: str, seed: int) -> tuple[list[str], Violation | None]:
        """What became of a case."""
        seconds = self._seconds or (_FILE_SECONDS if kind in _OF_FILES else _CALL_SECONDS)
        self._pipe.send((kind, seed))
        try:
            if self._pipe.poll(seconds):
                answer: tuple[list[str], Violation | None] = self._pipe.recv()
                return answer
            violation = Violation(f"{kind}: no end after {seconds:g} s")
        except (EOFError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode or 0
            how = signal.Signals(-code).name if code < 0 else f"status {code}"
            violation = Violation(f"{kind}: the process ended by {how}")
        self.close()
        self._start()
        return [], violation

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()
