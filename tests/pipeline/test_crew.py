"""How devices share tasks, and who is to blame when one of them fails: with processes that only pretend."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any, cast

import pytest
from batches import PLAN

import persfs_cl as ps
from persfs_cl.pipeline import crew as crews
from persfs_cl.pipeline.crew import Crew
from persfs_cl.pipeline.listing import Input
from persfs_cl.pipeline.manifest import Record
from persfs_cl.pipeline.station import End, Outcome, Task
from persfs_cl.pipeline.workers import Ready, Setting
from persfs_cl.pipeline.workforce import crew_settings


@dataclass
class Devices:
    """What devices do, by their number.

    Attributes
    ----------
    kills, refuses : mapping of int to names
        Photos that end the process, or cannot be done by this device.
    dies_after, breaks_after : mapping of int to int
        So many photos are done; from then on its processes end, or it can do nothing.
    absent : set of int
        Devices that are not there at all.
    most : int
        Processes that a device lets in.
    dies_early : set of int
        Which of its processes end before they are ready, the first being 1.
    waits_for : int
        Device 1 does nothing before device 0 was started so often.
    shared : bool
        Whether more than one process may work for each.
    room : int
        Bytes that each photo asks for.
    """

    kills: dict[int, Collection[str]] = field(default_factory=dict)
    refuses: dict[int, Collection[str]] = field(default_factory=dict)
    dies_after: dict[int, int] = field(default_factory=dict)
    breaks_after: dict[int, int] = field(default_factory=dict)
    absent: set[int] = field(default_factory=set)
    most: int = 100
    dies_early: set[int] = field(default_factory=set)
    waits_for: int = 0
    shared: bool = False
    room: int = 0
    held: int = 0
    most_held: int = 0
    cores: list[int] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)
    did: dict[int, list[str]] = field(default_factory=lambda: {0: [], 1: []})
    started: dict[int, int] = field(default_factory=lambda: {0: 0, 1: 0})
    stopped: bool = False

    def end_of(self, number: int, name: str) -> End | None:
        """None where the process ends."""
        done = len(self.did[number])
        if name in self.kills.get(number, ()) or done >= self.dies_after.get(number, done + 1):
            return None
        if done >= self.breaks_after.get(number, done + 1):
            return "device"
        if name in self.refuses.get(number, ()):
            return "unfit"
        if self.stopped:
            return "dropped"
        self.did[number].append(name)
        return "done"

    def broken(self, number: int) -> bool:
        done = len(self.did[number])
        lets_in = number not in self.absent and self.started[number] <= self.most
        return not lets_in or done >= self.breaks_after.get(number, done + 1)


class Worker:
    """As :class:`persfs_cl.pipeline.workers.Worker`, with a thread in place of a process."""

    devices: Devices
    _granted: dict[int, threading.Event]

    def __init__(self, setting: Setting, _inherited: object) -> None:
        self.devices = Worker.devices  # its thread may outlive a test
        self._number = cast("int", setting.device)
        self.connection, self._end = Pipe()
        self.devices.started[self._number] += 1
        self._start = self.devices.started[self._number]
        self._status = 0
        self._granted = {}
        threading.Thread(target=self._work, daemon=True).start()

    def _work(self) -> None:
        with suppress(EOFError, OSError), self._end as parent:
            if self._start in self.devices.dies_early:
                return
            if self.devices.broken(self._number):
                parent.send(("refused", ps.DeviceError("It is broken.")))
                return
            parent.send(("ready", Ready(f"device {self._number}", self.devices.shared)))
            self._do(parent)

    def _do(self, parent: Connection[Any, Any]) -> None:
        while True:
            word, task = parent.recv()
            if word == "stop":
                self.devices.stopped = True
            if word != "task":
                continue
            if self.devices.room:
                parent.send(("asks", (task.number, self.devices.room)))
                if not self._granted.setdefault(task.number, threading.Event()).wait(10.0):
                    return
                with self.devices.lock:
                    self.devices.held += self.devices.room
                    self.devices.most_held = max(self.devices.held, self.devices.most_held)
                time.sleep(0.001)
            while self._number == 1 and self.devices.started[0] < self.devices.waits_for:
                time.sleep(0.01)
            end = self.devices.end_of(self._number, task.name)
            if end is None:
                self._status = -9
                return
            error = None if end == "done" else ps.DeviceError(f"{task.name} does not fit.")
            record = Record(name=task.name, path="", status="done" if end == "done" else "failed")
            with self.devices.lock:
                self.devices.held -= self.devices.room
            parent.send(("outcome", Outcome(task.number, end, record, error)))

    def add(self, task: Task) -> None:
        self.connection.send(("task", task))

    def grant(self, number: int) -> None:
        self._granted.setdefault(number, threading.Event()).set()

    def use(self, cores: int) -> None:
        self.devices.cores.append(cores)

    def stop(self) -> None:
        with suppress(OSError):
            self.connection.send(("stop", None))

    def finish(self) -> None:
        with suppress(OSError):
            self.connection.send(("finish", None))

    def kill(self) -> None:
        self._status = self._status or -9

    def close(self, _patience: float = 0.0) -> int:
        self.connection.close()
        return self._status


@dataclass
class Result:
    done: list[str]
    failed: dict[str, str]
    dropped: list[str]


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crews, "Worker", Worker)
    monkeypatch.setattr(crews, "_MOST", 16)


def share(
    devices: Devices,
    names: Collection[str],
    count: int = 2,
    interrupted: Callable[[], bool] = lambda: False,
    result: Result | None = None,
    *,
    processes: int = 1,
    cores: int = 1,
    memory: int = 2**30,
) -> Result:
    Worker.devices = devices
    result = Result([], {}, []) if result is None else result
    settings = crew_settings(PLAN, None, list(range(count)), memory)
    made = [replace(one, processes=processes, cores=cores) for one in settings]
    for outcome in Crew(made).outcomes(tasks(names), interrupted):
        if outcome.end == "done":
            result.done.append(outcome.record.name)
        elif outcome.end == "failed":
            result.failed[outcome.record.name] = str(outcome.error)
        else:
            result.dropped.append(outcome.record.name)
    result.done.sort()
    return result


def tasks(names: Collection[str]) -> Iterator[Task]:
    for number, name in enumerate(names):
        yield Task(number, name, PLAN.job(Input(Path(name), name)), "")


NAMES = [f"{number:03}" for number in range(200)]


def test_devices_share_the_work() -> None:
    devices = Devices()
    assert share(devices, NAMES).done == NAMES
    assert min(map(len, devices.did.values())) >= 8
    assert devices.started == {0: 1, 1: 1}


@pytest.mark.parametrize("count", [1, 2])
def test_a_photo_that_ends_every_process_is_to_blame(count: int) -> None:
    devices = Devices(kills={0: ["100"], 1: ["100"]})
    result = share(devices, NAMES, count)
    assert list(result.failed) == ["100"]
    assert "the process that solved it ended twice (signal 9)" in result.failed["100"]
    assert result.done == [name for name in NAMES if name != "100"]
    assert sum(len(done) for done in devices.did.values()) == len(NAMES) - 1


def test_so_are_several_of_them_one_after_the_other() -> None:
    devices = Devices(kills={0: NAMES[100:103]})
    result = share(devices, NAMES, 1)
    assert (sorted(result.failed), len(result.done)) == (NAMES[100:103], 197)


def test_a_photo_alone_that_ends_processes_is_to_blame_too() -> None:
    result = share(Devices(kills={0: ["a"]}), ["a"], 1)
    assert list(result.failed) == ["a"]


@pytest.mark.parametrize("kind", ["kills", "refuses"])
def test_what_one_device_cannot_do_another_does(kind: str) -> None:
    # Fewer than a device is given up for, should it come to them one right after the other.
    impossible = NAMES[::70]
    assert len(impossible) < crews._DEATHS
    devices = Devices(**cast("Any", {kind: {0: impossible}}))
    assert share(devices, NAMES) == Result(NAMES, {}, [])
    assert not set(impossible) & set(devices.did[0])


def test_photos_that_no_device_can_do_fail_with_its_reason_and_cost_no_process() -> None:
    devices = Devices(refuses={0: NAMES[:20], 1: NAMES[:20]})
    result = share(devices, NAMES)
    assert result.failed == {name: f"{name} does not fit." for name in NAMES[:20]}
    assert result.done == NAMES[20:]
    assert devices.started == {0: 1, 1: 1}


@pytest.mark.parametrize(
    ("way", "starts", "why"),
    [("dies_after", 4, "Its processes ended, the last with signal 9"), ("breaks_after", 2, "It is broken")],
)
def test_a_device_that_fails_midway_leaves_its_photos_to_the_other(way: str, starts: int, why: str) -> None:
    devices = Devices(**cast("Any", {way: {0: 50}}), waits_for=starts)
    with pytest.warns(ps.errors.PersfsWarning, match=f"device 0 is not used any more. {why}"):
        result = share(devices, NAMES)
    assert result == Result(NAMES, {}, [])
    assert len(devices.did[0]) == 50
    assert devices.started == {0: starts, 1: 1}


@pytest.mark.parametrize("way", ["dies_after", "breaks_after"])
def test_when_all_devices_fail_no_photo_is_blamed(way: str) -> None:
    devices = Devices(**cast("Any", {way: {0: 50, 1: 70}}))
    result = Result([], {}, [])
    with (
        pytest.warns(ps.errors.PersfsWarning, match="is not used any more"),
        pytest.raises(ps.DeviceError, match=r"No device is left, and at least \d+ photos are not done: the same"),
    ):
        share(devices, NAMES, result=result)
    assert result.failed == {}
    assert len(result.done) == 120


def test_a_device_that_is_not_there_leaves_all_to_the_other() -> None:
    devices = Devices(absent={1})
    with pytest.warns(ps.errors.PersfsWarning, match="Device 1 is not used any more. It is broken."):
        assert share(devices, NAMES).done == NAMES
    assert devices.did[1] == []
    with (
        pytest.warns(ps.errors.PersfsWarning, match="is not used any more"),
        pytest.raises(ps.DeviceError, match="It is broken"),
    ):
        share(Devices(absent={0, 1}), NAMES)
    assert share(Devices(absent={0, 1}), []) == Result([], {}, [])


def test_an_interrupt_drops_what_is_in_hand_and_takes_no_more() -> None:
    devices = Devices(kills={0: ["003"]})
    asked = iter([False, False, False])
    result = share(devices, NAMES, 2, lambda: next(asked, True))
    assert result.failed == {}
    assert result.done == sorted(devices.did[0] + devices.did[1])
    assert len({*result.done, *result.dropped}) == len(result.done) + len(result.dropped) <= 2 * 16 + 3


def test_processes_share_a_device_whose_cores_are_their_own() -> None:
    devices = Devices(shared=True)
    assert share(devices, NAMES, 1, cores=6, processes=3).done == NAMES
    assert devices.started[0] == 3
    assert set(devices.cores) <= {6, 3, 2}
    assert 2 in devices.cores


def test_no_more_of_them_are_started_than_there_are_photos() -> None:
    devices = Devices(shared=True)
    assert share(devices, NAMES[:3], 1, cores=64, processes=64).done == NAMES[:3]
    assert devices.started[0] <= 2
    alone = Devices()
    assert share(alone, NAMES, 1, cores=64, processes=64).done == NAMES
    assert (alone.started[0], alone.cores) == (1, [])


@pytest.mark.parametrize("count", [1, 2])
def test_of_a_shared_device_a_photo_that_ends_every_process_is_to_blame(count: int) -> None:
    devices = Devices(kills={0: ["100"], 1: ["100"]}, shared=True)
    result = share(devices, NAMES, count, cores=4, processes=4)
    assert list(result.failed) == ["100"]
    assert result.done == [name for name in NAMES if name != "100"]
    # Once among others, and once by itself, on each device.
    assert sum(devices.started.values()) <= 6 * count


@pytest.mark.parametrize("way", ["dies_after", "breaks_after"])
def test_a_shared_device_that_fails_midway_leaves_its_photos_to_the_other(way: str) -> None:
    devices = Devices(**cast("Any", {way: {0: 50}}), shared=True)
    with pytest.warns(ps.errors.PersfsWarning, match="device 0 is not used any more") as said:
        result = share(devices, NAMES, cores=2, processes=2)
    assert result == Result(NAMES, {}, [])
    assert len(said) == 1


def test_photos_in_all_processes_have_the_memory_together() -> None:
    devices = Devices(shared=True, room=10)
    assert share(devices, NAMES, 2, cores=3, processes=3, memory=25).done == NAMES
    assert devices.most_held == 20
    large = Devices(shared=True, room=100)
    assert share(large, NAMES, 2, cores=3, processes=3, memory=25).done == NAMES
    assert large.most_held == 100


def test_what_a_process_held_when_it_ended_is_given_back() -> None:
    devices = Devices(kills={0: ["003", "100"]}, shared=True, room=10)
    result = share(devices, NAMES, 1, cores=2, processes=2, memory=10)
    assert sorted(result.failed) == ["003", "100"]
    assert len(result.done) == 198


def test_a_device_that_lets_no_more_processes_in_goes_on_with_those_it_has() -> None:
    devices = Devices(shared=True, most=2)
    assert share(devices, NAMES, 1, cores=8, processes=8) == Result(NAMES, {}, [])
    assert devices.started[0] > 2


def test_further_processes_that_come_to_nothing_do_not_cost_the_device() -> None:
    devices = Devices(shared=True, dies_early={2, 3, 4, 5, 6, 7})
    assert share(devices, NAMES, 1, cores=8, processes=8) == Result(NAMES, {}, [])
