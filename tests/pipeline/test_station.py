"""One device at work: what comes of photos that fail, of a stop, and how much is held at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from batches import PLAN, photos, require_whole
from processes import wait_until

import persfs_cl as ps
from persfs_cl.pipeline import health, station
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.room import Room
from persfs_cl.pipeline.station import Outcome, Station, Task
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workforce import crew_settings
from persfs_cl.solver.attempt import Attempt
from persfs_cl.solver.solve import attempt

Solve = Callable[..., Any]

# As in a process of the batch: elsewhere those who listen to warnings wait for each other.
pytestmark = pytest.mark.usefixtures("listening")


def outcomes(
    tmp_path: Path, meanwhile: Callable[[Station], None] = lambda _: None, **keywords: Any
) -> dict[str, Outcome]:
    """Of all photos of tmp_path/in, by their names."""
    [setting] = crew_settings(PLAN, FolderStore(tmp_path / "out"), [None], None)
    found: list[Outcome] = []
    with FolderStore(tmp_path / "out").opened() as shelf:
        defaults: dict[str, Any] = {"memory": Room(2**30), "shelf": shelf}
        device = Station(
            ps.devices()[0],
            saving=setting.saving,
            options=setting.options,
            put=found.append,
            **{**defaults, **keywords},
        )
        for number, one in enumerate(list_inputs(tmp_path / "in").inputs):
            device.add(Task(number, one.name, PLAN.job(one), ""))
        meanwhile(device)
        device.finish()
    named = {outcome.record.name: outcome for outcome in found}
    assert len(named) == len(found)
    return named


def test_of_photos_that_share_launches_only_the_one_to_blame_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = photos(tmp_path / "in", 6)
    shapes = photos(tmp_path / "in", 2, (9, 11), first=50)
    usual = attempt
    groups: list[Any] = []
    released = threading.Event()

    def solve(device: ps.Device, problems: Sequence[Any], *rest: Any) -> list[Attempt]:
        groups.append(len(problems))
        released.wait()
        if any(problem.image.shape == (9, 11) for problem in problems):
            raise ps.DeviceError("It does not fit.")
        return usual(device, problems, *rest)

    monkeypatch.setattr(station, "attempt", solve)

    def wait_a_moment(device: Station) -> None:
        # Some may have been taken by themselves; all others are ready then.
        wait_until(lambda: sum(groups) + len(device._ready) >= 8)
        released.set()

    found = outcomes(tmp_path, wait_a_moment)
    assert {name: outcome.end for name, outcome in found.items()} == {
        **dict.fromkeys(names, "done"),
        **dict.fromkeys(shapes, "unfit"),
    }
    assert max(groups) > 1
    assert found[shapes[0]].record.error == {"kind": "DeviceError", "message": "It does not fit."}
    require_whole(tmp_path / "out", names)


def test_a_device_that_works_no_more_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = photos(tmp_path / "in", 2)

    def broken(*_: Any) -> None:
        raise ps.DeviceError("It is broken.")

    monkeypatch.setattr(station, "attempt", broken)
    monkeypatch.setattr(health, "solve", broken)
    assert {name: outcome.end for name, outcome in outcomes(tmp_path).items()} == dict.fromkeys(names, "device")


@pytest.mark.parametrize("light", [ps.ParallelLight(), ps.FlashLight(), ps.FlashLight(offset=(0.1, 0.0, 0.0))])
def test_a_device_that_works_is_in_no_trouble(light: Any, device: ps.Device) -> None:
    [setting] = crew_settings(replace(PLAN, light=light), None, [None], None)
    assert health.trouble(device, setting.options) is None


@pytest.mark.parametrize("step", ["read_job", "prepare", "attempt", "finish", "write"])
@pytest.mark.parametrize(
    ("error", "why"),
    [
        (MemoryError(), "00001.png does not fit into memory: reduce its size"),
        (ZeroDivisionError("odd"), "00001.png: ZeroDivisionError, which should not happen: odd"),
    ],
)
def test_whatever_fails_is_one_photo(
    error: Exception, why: str, step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    photos(tmp_path / "in", 3)
    usual = getattr(station, step)

    def failing(*arguments: Any, **keywords: Any) -> Any:
        if step == "attempt":
            # By what it looks like: problems have no names.
            chosen = any(problem.photograph.max() == bright for problem in arguments[1])
        elif step == "finish":
            chosen = arguments[1].problem.photograph.max() == bright
        elif step == "write":
            chosen = keywords["name"] == "00001.png"
        else:
            job = arguments[0] if step == "read_job" else arguments[0].job
            chosen = job.path.name == "00001.png"
        if chosen:
            raise error
        return usual(*arguments, **keywords)

    bright = float(ps.read_image(tmp_path / "in" / "00001.png").max())
    monkeypatch.setattr(station, step, failing)
    found = outcomes(tmp_path)
    assert {name: outcome.end for name, outcome in found.items()} == {
        "00000.png": "done",
        "00001.png": "failed",
        "00002.png": "done",
    }
    assert why in str(found["00001.png"].error)
    require_whole(tmp_path / "out", ["00000.png", "00002.png"])


def test_a_stop_drops_what_is_not_written(tmp_path: Path) -> None:
    photos(tmp_path / "in", 5)
    found = outcomes(tmp_path, lambda device: device.stop())
    assert {outcome.end for outcome in found.values()} <= {"dropped", "done"}
    assert len(found) == 5
    require_whole(tmp_path / "out", [name for name, outcome in found.items() if outcome.end == "done"])


def test_photos_that_are_larger_than_all_the_memory_are_done_one_at_a_time(tmp_path: Path) -> None:
    names = photos(tmp_path / "in", 5)
    found = outcomes(tmp_path, memory=Room(1))
    assert {name: outcome.end for name, outcome in found.items()} == dict.fromkeys(names, "done")


def test_room_is_taken_in_the_order_of_asking() -> None:
    room, order = Room(10), []

    def ask(number: int, wanted: int) -> None:
        room.ask(number, wanted, lambda: order.append(number))

    ask(1, 6)
    ask(2, 99)
    ask(3, 1)
    assert order == [1], "what is small does not overtake what is large"
    room.give_back(1)
    assert order == [1, 2], "what is larger than all has all"
    ask(4, 9)
    room.give_back(4)  # it asks no more
    room.give_back(2)
    assert order == [1, 2, 3]
    room.give_back(2)  # has nothing
    ask(5, 9)
    assert order == [1, 2, 3, 5]
