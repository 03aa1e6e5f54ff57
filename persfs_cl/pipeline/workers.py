"""One process for each device, so that what a driver does to its process stays there.

The processes are started anew, never forked: OpenCL does not survive a fork. They do not import the program that
started them either, and so need nothing of it, no ``if __name__ == "__main__"``. A process that loses its parent ends.
"""

from __future__ import annotations

import os
import secrets
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing.connection import Client, Connection, Listener
from pathlib import Path
from typing import Any

import persfs_cl
from persfs_cl._cl.device import Device
from persfs_cl._cl.selection import select_device
from persfs_cl.errors import DeviceError, InputError, PersfsError
from persfs_cl.pipeline.station import Outcome, Station, Task
from persfs_cl.pipeline.store import Store
from persfs_cl.solver.options import Options
from persfs_cl.surface.saving import Saving
from persfs_cl.told import listen

_PATIENCE = 60.0
"""Seconds in which a process must have begun to speak."""


@dataclass(frozen=True)
class Setting:
    """What a process must know to begin.

    Attributes
    ----------
    device : int, str, Device or None
        As for :func:`persfs_cl.reconstruct`.
    store : Store or None
    saving : Saving
    options : Options
        Complete, but for the device.
    memory : int
        Bytes that photos may take together.
    solutions : bool
        Whether solutions are sent.
    threads : int
        That read, and as many that write.
    """

    device: int | str | Device | None
    store: Store | None
    saving: Saving
    options: Options
    memory: int
    solutions: bool
    threads: int


class Worker:
    """A process with its device, seen from its parent.

    Parameters
    ----------
    setting : Setting
    inherited : sequence of int
        File descriptors that the process is to hold too.

    Attributes
    ----------
    connection : Connection
        Gives what the process says: ("ready", name of the device), ("refused", error), or ("outcome", Outcome).
    """

    def __init__(self, setting: Setting, inherited: Sequence[int] = ()) -> None:
        key = secrets.token_bytes(32)
        kept = {"pass_fds": tuple(inherited)} if os.name == "posix" else {}
        places = [str(Path(persfs_cl.__file__).parent.parent), os.environ.get("PYTHONPATH", "")]
        with Listener(authkey=key) as listener:
            self._process = subprocess.Popen(
                [sys.executable, "-c", "from persfs_cl.pipeline.workers import main; main()"],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                # Ctrl-C is for the parent, who says what becomes of it.
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, places))},
                **kept,  # type: ignore[call-overload]
            )
            assert self._process.stdin is not None  # noqa: S101 - for the type checker
            with self._process.stdin as first:
                address = listener.address
                first.write(f"{address if isinstance(address, str) else address[1]}\n{key.hex()}\n".encode())
            self.connection = _accepted(listener, self._process)
        self.connection.send(setting)

    @property
    def returncode(self) -> int | None:
        """As for :class:`subprocess.Popen`."""
        status: int | None = self._process.poll()
        return status

    def add(self, task: Task) -> None:
        """Have a task done."""
        self.connection.send(("task", task))

    def stop(self) -> None:
        """Drop what is not being written."""
        self._say("stop")

    def finish(self) -> None:
        """End, once everything has an outcome."""
        self._say("finish")

    def kill(self) -> None:
        """End at once."""
        self._process.kill()

    def close(self) -> int:
        """Wait for the end, and say how it was: 0, a status, or less the number of a signal."""
        self.connection.close()
        status: int = self._process.wait()
        return status

    def _say(self, word: str) -> None:
        with suppress(OSError):  # it has ended
            self.connection.send((word, None))


def main() -> None:
    """Work for the parent that says on standard input where it listens."""
    for number in (signal.SIGINT, signal.SIGHUP) if os.name == "posix" else ():
        signal.signal(number, signal.SIG_IGN)
    address, key = sys.stdin.readline().strip(), bytes.fromhex(sys.stdin.readline().strip())
    connection = Client(("localhost", int(address)) if address.isdecimal() else address, authkey=key)
    try:
        setting: Setting = connection.recv()
    except (AttributeError, ImportError) as error:
        unknown = InputError(
            f"A process for a device does not know a light or a material ({error}): define its class in a module that "
            "can be imported, not in the script or notebook itself."
        )
        connection.send(("refused", unknown))
        return
    listen()
    try:
        device = select_device(setting.device)
        device.real(setting.options["precision"])
    except PersfsError as error:
        connection.send(("refused", error))
        return
    speaking = threading.Lock()

    def say(kind: str, about: Any) -> None:
        with speaking:
            connection.send((kind, about))

    def put(outcome: Outcome) -> None:
        try:
            say("outcome", outcome)
        except OSError:
            os._exit(1)  # nobody is there any more

    say("ready", str(device))
    with ExitStack() as open_things:
        try:
            shelf = None if setting.store is None else open_things.enter_context(setting.store.opened())
        except PersfsError as error:
            say("refused", error)
            return
        station = Station(
            device,
            shelf=shelf,
            saving=setting.saving,
            options=setting.options,
            memory=setting.memory,
            put=put,
            solutions=setting.solutions,
            readers=setting.threads,
            writers=setting.threads,
        )
        ended = threading.Event()
        threading.Thread(target=_listen, args=(connection, station, ended), daemon=True).start()
        ended.wait()
        station.finish()


def _listen(connection: Connection[Any, Any], station: Station, ended: threading.Event) -> None:
    """Do what the parent says, for as long as it lives."""
    while True:
        try:
            word, task = connection.recv()
        except (EOFError, OSError):
            os._exit(1)  # whoever would note what is done is gone
        if word == "task":
            station.add(task)
        elif word == "stop":
            station.stop()
        else:
            ended.set()
            return  # the parent may leave before this process has cleaned up


def _accepted(listener: Listener, process: subprocess.Popen[bytes]) -> Connection[Any, Any]:
    """The connection of a process that has just begun, or an error when it ends instead."""
    found: list[Connection[Any, Any]] = []

    def accept() -> None:
        with suppress(OSError, EOFError):
            found.append(listener.accept())

    thread = threading.Thread(target=accept, daemon=True)
    thread.start()
    for _ in range(int(_PATIENCE / 0.05)):
        thread.join(0.05)
        if found:
            return found[0]
        if process.poll() is not None:
            break
    process.kill()
    raise DeviceError(
        f"A process for a device did not begin (status {process.wait()}): see what it wrote to standard error, and "
        "free some memory if it wrote nothing."
    )
