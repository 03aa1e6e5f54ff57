"""Who does the tasks of a batch: the devices of this machine, or a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Protocol, cast

from persfs_cl._cl.device import Device, devices
from persfs_cl.blocks import usable_cores
from persfs_cl.checks import as_whole_number
from persfs_cl.errors import DeviceError, InputError
from persfs_cl.io.limits import memory
from persfs_cl.pipeline.cluster import Cluster
from persfs_cl.pipeline.crew import Crew
from persfs_cl.pipeline.plan import Plan
from persfs_cl.pipeline.room import BYTES_PER_PROCESS
from persfs_cl.pipeline.station import Outcome, Task
from persfs_cl.pipeline.store import Store
from persfs_cl.pipeline.workers import Setting
from persfs_cl.solver.complete import complete

ALL = "all"
"""Every device."""

_SHARE_OF_MEMORY = 0.5
_THREADS = 2
_MOST_PROCESSES = 60 if os.name == "nt" else 1000
"""Windows waits for 63 pipes at a time."""


class Workforce(Protocol):
    """Who does tasks: the devices of this machine, or a cluster."""

    def outcomes(self, tasks: Iterable[Task], interrupted: Callable[[], bool]) -> Generator[Outcome, None, None]:
        """See :meth:`persfs_cl.pipeline.crew.Crew.outcomes`."""


def workforce(
    plan: Plan,
    store: Store | None,
    device: int | str | Device | Sequence[int | str | Device] | None,
    max_memory: int | None,
    scheduler: str | None = None,
) -> Callable[[Sequence[int]], Workforce]:
    """Who does the tasks of a batch, as :meth:`Batch.results` wants it.

    Parameters
    ----------
    plan : Plan
    store : Store or None
    device, max_memory, scheduler
        As for :func:`batch`.

    Raises
    ------
    InputError
        When an option or `max_memory` is impossible.
    DeviceError
        When all devices are wanted and there is none.
    UnavailableError
        When Dask is wanted and is not installed.
    """
    if scheduler is None:
        settings = crew_settings(plan, store, chosen_devices(device), max_memory)
        return lambda held: Crew(settings, held)
    if device == ALL or isinstance(device, (list, tuple)):
        raise InputError.about(
            "device", device, "means several, and a worker has one: start a worker for each device, and leave it out."
        )
    (setting,) = crew_settings(plan, store, chosen_devices(device), max_memory)
    cluster = Cluster(scheduler, setting, None if max_memory is None else setting.memory)
    return lambda _: cluster


def crew_settings(
    plan: Plan, store: Store | None, chosen: Sequence[int | str | Device | None], max_memory: int | None
) -> list[Setting]:
    """What the process of each device must know.

    Raises
    ------
    InputError
        When an option or `max_memory` is impossible.
    """
    options = complete({**plan.keywords, "light": plan.light, "reflectance": plan.reflectance})
    options["device"] = options["callback"] = None
    options["throw"] = False
    room = (
        int(_SHARE_OF_MEMORY * memory()) if max_memory is None else as_whole_number("max_memory", max_memory, least=1)
    )
    cores = max(1, usable_cores() // len(chosen))
    threads = max(_THREADS, cores // 2)
    # Of what photos leave of the memory, others have half.
    beside = max(0, memory() - room) // 2 // BYTES_PER_PROCESS
    processes = max(1, min(cores, beside // len(chosen), _MOST_PROCESSES // len(chosen)))
    return [
        Setting(one, store, plan.saving, options, room, store is None, threads, plan.spelling, cores, processes)
        for one in chosen
    ]


def chosen_devices(
    selector: int | str | Device | Sequence[int | str | Device] | None,
) -> list[int | str | Device | None]:
    """One selector for each device.

    Raises
    ------
    DeviceError
        When all are wanted and there is none.
    """
    if selector == ALL:
        if not (found := devices()):
            raise DeviceError("No OpenCL device found: 'persfs-cl devices' says what to install.")
        return [device.index for device in found]
    if isinstance(selector, (list, tuple)):
        return list(selector)
    return [cast("int | str | Device | None", selector)]
