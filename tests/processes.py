"""Commands and scripts in processes of their own, whose workers can be found, and what ends them."""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_TOKEN = "PERSFS_CL_TEST"
_PATIENCE = 600.0
"""Seconds: what takes one here may take many on a slow machine that others use too."""
_HEARD = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
"""A test run in the background of a shell would hand on that Ctrl-C is ignored."""
COMMAND = "from persfs_cl.cli import main; main()"


class Process:
    """A script that runs, with all processes that it started.

    Parameters
    ----------
    script : str
    *arguments : object
    environment : str
        Further variables.
    """

    def __init__(self, script: str, *arguments: object, **environment: str) -> None:
        self.token = secrets.token_hex(8)
        self.popen = subprocess.Popen(
            [sys.executable, "-c", _HEARD + script, *map(str, arguments)],
            env={**os.environ, **environment, _TOKEN: self.token},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def processes(self) -> list[int]:
        """The numbers of all that live, itself included."""
        return [int(place.name) for place in Path("/proc").glob("[0-9]*") if self._has(place)]

    def workers(self) -> list[int]:
        """Without itself."""
        return [number for number in self.processes() if number != self.popen.pid]

    def _has(self, place: Path) -> bool:
        with suppress(OSError):
            return f"{_TOKEN}={self.token}".encode() in place.joinpath("environ").read_bytes().split(b"\0")
        return False

    def until(self, holds: Callable[[], bool]) -> None:
        """Wait until something holds, or the script has ended."""
        wait_until(lambda: holds() or self.popen.poll() is not None)

    def kill_all(self) -> None:
        """As when the machine is reset."""
        for number in self.processes():
            with suppress(ProcessLookupError):
                os.kill(number, signal.SIGKILL)

    def ended(self) -> tuple[int, str, str]:
        """Status, standard output and standard error; no process is left then."""
        out, err = self.popen.communicate(timeout=_PATIENCE)
        wait_until(lambda: not self.processes())
        return self.popen.returncode, out, err


def wait_until(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + _PATIENCE
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.05)


@contextmanager
def running(script: str, *arguments: object, **environment: str) -> Iterator[Process]:
    """A script that runs, and is ended with the block, however that ends."""
    process = Process(script, *arguments, **environment)
    try:
        yield process
    finally:
        process.kill_all()
        process.popen.communicate()


def finished(script: str, *arguments: object, **environment: str) -> tuple[int, str, str]:
    """Status, standard output and standard error of a script."""
    with running(script, *arguments, **environment) as process:
        return process.ended()
