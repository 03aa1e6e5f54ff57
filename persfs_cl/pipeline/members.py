"""The devices of a crew, and the processes that work for each."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from persfs_cl.errors import PersfsError
from persfs_cl.pipeline.station import Task
from persfs_cl.pipeline.workers import Setting, Worker

_SECONDS_AHEAD = 3.0
"""As many tasks as a process does in this time: more would leave others with nothing at the end."""
_MEASURED_EVERY = 0.5
"""Seconds over which a rate is taken."""


@dataclass(eq=False)
class Member:
    """A process, and what it has to do.

    Attributes
    ----------
    worker : Worker
    ready : bool
        Whether it has solved something, if only to show that it can.
    tasks : dict
        By their numbers.
    window : int
        How many it is to have.
    ended, since : int, float
        Tasks that have ended since a time.
    cores : int or None
        Of the processor, which it was told to use.
    """

    worker: Worker
    ready: bool = False
    tasks: dict[int, Task] = field(default_factory=dict)
    window: int = 0
    ended: int = 0
    since: float = field(default_factory=time.monotonic)
    cores: int | None = None

    def pace(self) -> None:
        """Note that a task has ended, and from time to time how many it is to have at a time."""
        self.ended += 1
        seconds = time.monotonic() - self.since
        if seconds > _MEASURED_EVERY:
            self.window = int(self.ended * _SECONDS_AHEAD / seconds)
            self.ended, self.since = 0, time.monotonic()


@dataclass(eq=False)
class Team:
    """A device, and who works for it.

    Attributes
    ----------
    setting : Setting
    members : list
        The processes that live.
    name : str
    is_shared : bool
        Whether more than one may work for it.
    most : int
        How many there may be.
    deaths : int
        Processes that ended in a row, with nothing done in between.
    refusal : PersfsError or None
        What it said last of why it does not work.
    suspects : list
        Tasks that were by themselves when the process ended, and how it ended. They are to blame if the device goes on.
    """

    setting: Setting
    members: list[Member] = field(default_factory=list)
    name: str = ""
    is_shared: bool = False
    deaths: int = 0
    refusal: PersfsError | None = None
    suspects: list[tuple[Task, int]] = field(default_factory=list)
    most: int = field(init=False)

    def __post_init__(self) -> None:
        self.most = self.setting.processes

    @property
    def title(self) -> str:
        """What warnings call it."""
        return self.name or ("A device" if self.setting.device is None else f"Device {self.setting.device}")

    @property
    def is_busy(self) -> bool:
        """Whether any of its processes has something to do."""
        return any(member.tasks for member in self.members)

    @property
    def is_careful(self) -> bool:
        """Whether it has a task that was tried before, which nothing else shall be near."""
        # It is alone.
        return any(
            len(member.tasks) == 1 and any(task.attempts for task in member.tasks.values()) for member in self.members
        )

    def share_cores(self) -> None:
        """Divide the cores of a processor among the processes that have something to do."""
        if not self.is_shared:
            return
        busy = [member for member in self.members if member.tasks]
        for place, member in enumerate(busy):
            cores = max(1, (self.setting.cores + place) // len(busy))
            if member.cores != cores:
                member.cores = cores
                member.worker.use(cores)
