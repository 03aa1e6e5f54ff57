"""Processes of a device, so that what a driver does to its process stays there.

The processes are started anew, never forked: OpenCL does not survive a fork. They do not import the program that
started them either, and so need nothing of it, no ``if __name__ == "__main__"``. A process that loses its parent ends.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing import connection as connections
from multiprocessing.connection import Connection, Pipe
from multiprocessing.reduction import ForkingPickler
from typing import Any

from persfs_cl._cl.device import Device
from persfs_cl._cl.selection import select_device
from persfs_cl.blocks import share_cores
from persfs_cl.errors import DeviceError, InputError, PersfsError
from persfs_cl.pipeline.health import trouble
from persfs_cl.pipeline.station import Station, Task
from persfs_cl.pipeline.store import Store
from persfs_cl.solver.options import Options
from persfs_cl.surface.saving import Saving
from persfs_cl.told import listen
from persfs_cl.wording import Spelling, brief

LAST_WORDS = 10.0
"""Seconds in which a process must have ended that has nothing to do any more: drivers may hang in that."""
_SOLVERS = 2
"""Threads that solve, where the device has one process: one prepares while the other waits for it."""
_START = "import sys; sys.path[:] = sys.argv[2:]; from persfs_cl.pipeline.workers import main; main(int(sys.argv[1]))"


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
        Bytes that all photos in work on this machine may take together.
    solutions : bool
        Whether solutions are sent.
    threads : int
        That read, and as many that write, where the device has one process.
    spelling : callable
        As for :class:`persfs_cl.pipeline.plan.Plan`.
    cores : int
        Of the processor, which are there for the device.
    processes : int
        That may work for the device, if its work is done by these cores.
    """

    device: int | str | Device | None
    store: Store | None
    saving: Saving
    options: Options
    memory: int
    solutions: bool
    threads: int
    spelling: Spelling = str
    cores: int = 1
    processes: int = 1


@dataclass(frozen=True)
class Ready:
    """What a process says once it can begin.

    Attributes
    ----------
    name : str
        Of the device.
    is_shared : bool
        Whether others may work for the device too. Reading, preparing and writing is for the most part Python's, of
        which a process does one thing at a time: where the processor's cores are the device, one process for each
        core keeps all of them at work.
    """

    name: str
    is_shared: bool


class Worker:
    """A process with its device, seen from its parent.

    It looks for modules where its parent does, so that a light of the parent's own is found, and nothing that lies in
    the working directory by chance.

    Parameters
    ----------
    setting : Setting
    inherited : sequence of int
        File descriptors that the process is to hold too.

    Attributes
    ----------
    connection : Connection
        Gives what the process says: ("ready", Ready), ("refused", error), ("asks", (number of a task, bytes)), or
        ("outcome", Outcome).

    Raises
    ------
    InputError
        When the setting has something in it that cannot be sent.
    DeviceError
        When the system starts no process.
    """

    def __init__(self, setting: Setting, inherited: Sequence[int] = ()) -> None:
        said = _pickled(setting)
        try:
            self.connection, theirs = Pipe()
        except OSError as error:
            raise _not_started(error) from error
        number = theirs.fileno()
        if os.name == "nt":
            os.set_handle_inheritable(number, True)  # type: ignore[attr-defined] # Windows only
            kept: dict[str, Any] = {"close_fds": False}
        else:
            kept = {"pass_fds": (number, *inherited)}
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _START, str(number), *map(str, sys.path)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                # Ctrl-C is for the parent, who says what becomes of it.
                start_new_session=True,
                **kept,
            )
        except OSError as error:
            self.connection.close()
            raise _not_started(error) from error
        finally:
            theirs.close()  # so that the end of the process is the end of what it says
        with suppress(OSError):  # it has ended, which will be heard
            self.connection.send_bytes(said)

    def add(self, task: Task) -> None:
        """Have a task done."""
        self.connection.send(("task", task))

    def grant(self, number: int) -> None:
        """Let it take the memory that it asked for."""
        self._say("granted", number)

    def use(self, cores: int) -> None:
        """Have it leave all other cores to others."""
        self._say("cores", cores)

    def stop(self) -> None:
        """Drop what is not being written."""
        self._say("stop")

    def finish(self) -> None:
        """End, once everything has an outcome."""
        self._say("finish")

    def kill(self) -> None:
        """End at once."""
        self._process.kill()

    def close(self, patience: float = LAST_WORDS) -> int:
        """Wait some seconds for the end, and say how it was: 0, a status, or less the number of a signal."""
        for seconds in (patience, LAST_WORDS):
            try:
                self._process.wait(seconds)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self.connection.close()
        # What the driver does not let go will be gone when it does.
        return -int(signal.SIGTERM) if self._process.returncode is None else self._process.returncode

    def _say(self, word: str, about: int | None = None) -> None:
        with suppress(OSError):  # it has ended, which will be heard
            self.connection.send((word, about))


class _MemoryOfParent:
    """Asks the parent, of whom all processes have their memory; see :class:`persfs_cl.pipeline.room.Memory`."""

    def __init__(self, say: Callable[[str, Any], None]) -> None:
        self._say = say
        self._asking: dict[int, Callable[[], None]] = {}

    def ask(self, number: int, wanted: int, granted: Callable[[], None]) -> None:
        self._asking[number] = granted
        self._say("asks", (number, wanted))

    def grant(self, number: int) -> None:
        self._asking.pop(number)()

    def give_back(self, number: int) -> None:
        """The outcome says it."""


def _not_started(error: OSError) -> DeviceError:
    return DeviceError(f"A process for a device cannot be started ({error}): end others, or free some memory.")


def main(number: int) -> None:
    """Work for the parent at the other end of a pipe that this process was given under a number."""
    # Whoever ends everything at once, as schedulers do, ends the parent too, who says what becomes of the photos.
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if os.name == "posix" else ():
        signal.signal(ending, signal.SIG_IGN)
    if os.name != "nt":
        os.set_inheritable(number, False)  # drivers start compilers
    # Typed for one system only.
    connection = getattr(connections, "PipeConnection" if os.name == "nt" else "Connection")(number)
    speaking = threading.Lock()

    def say(kind: str, about: Any) -> None:
        data = _pickled((kind, about))
        try:
            with speaking:
                connection.send_bytes(data)
        except OSError:
            os._exit(1)  # nobody is there any more

    listen()
    try:
        setting: Setting = connection.recv()
        device = select_device(setting.device)
        device.real(setting.options["precision"])
        if error := trouble(device, setting.options):
            raise error
    except EOFError:
        return
    except PersfsError as error:
        say("refused", error)
        return
    except (AttributeError, ImportError) as error:
        unknown = InputError(
            f"A process for a device does not know a light or a material ({error}): define its class in a module that "
            "can be imported, not in the script or notebook itself."
        )
        say("refused", unknown)
        return
    is_shared = device.kind == "cpu" and setting.processes > 1
    say("ready", Ready(str(device), is_shared))
    with ExitStack() as open_things:
        try:
            shelf = None if setting.store is None else open_things.enter_context(setting.store.opened())
        except PersfsError as error:
            say("refused", error)
            return
        room = _MemoryOfParent(say)
        # Where there is a process for each core, the others work while one waits.
        threads, solvers = (1, 1) if is_shared else (setting.threads, _SOLVERS)
        station = Station(
            device,
            shelf=shelf,
            saving=setting.saving,
            options=setting.options,
            memory=room,
            put=lambda outcome: say("outcome", outcome),
            solutions=setting.solutions,
            spelling=setting.spelling,
            readers=threads,
            solvers=solvers,
            writers=threads,
        )
        ended = threading.Event()
        threading.Thread(target=_listen, args=(connection, station, room, ended), daemon=True).start()
        ended.wait()
        station.finish()


def _listen(connection: Connection[Any, Any], station: Station, room: _MemoryOfParent, ended: threading.Event) -> None:
    """Do what the parent says, for as long as it lives."""
    while True:
        try:
            word, about = connection.recv()
        except (EOFError, OSError):
            os._exit(1)  # whoever would note what is done is gone
        if word == "task":
            station.add(about)
        elif word == "granted":
            room.grant(about)
        elif word == "cores":
            share_cores(about)
        elif word == "stop":
            station.stop()
        else:
            ended.set()
            return  # the parent may leave before this process has cleaned up


def _pickled(value: Any) -> Any:
    """Bytes to be sent.

    Raises
    ------
    InputError
        When something in it cannot be pickled.
    """
    try:
        return ForkingPickler.dumps(value)
    except MemoryError:
        raise
    except Exception as error:  # an object may raise anything
        raise InputError(
            f"Something cannot be sent to the process of a device ({brief(error)}): give lights and materials whose "
            "classes are defined at the top of a module."
        ) from error
