"""Processes that work for one device together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from batches import PLAN, photos

import persfs_cl as ps
from persfs_cl.blocks import usable_cores
from persfs_cl.pipeline import crew as crews
from persfs_cl.pipeline import workforce
from persfs_cl.pipeline.crew import Crew
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.run import Batch, BatchResult
from persfs_cl.pipeline.workers import Setting, Worker
from persfs_cl.pipeline.workforce import crew_settings


@pytest.mark.parametrize(
    ("cores", "gibibytes", "devices", "processes"),
    [(1, 8, 1, 1), (6, 8, 1, 6), (6, 15, 1, 1), (6, 12, 1, 4), (6, 8, 2, 3), (2, 8, 4, 1), (200, 0.25, 2, 8)],
)
def test_there_are_as_many_as_cores_and_memory_allow(
    cores: int, gibibytes: float, devices: int, processes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workforce, "usable_cores", lambda: cores)
    monkeypatch.setattr(workforce, "memory", lambda: 16 * 2**30)
    room = int(gibibytes * 2**30)
    settings = crew_settings(PLAN, None, list(range(devices)), room)
    assert {(one.processes, one.memory) for one in settings} == {(processes, room)}


def test_on_windows_there_are_no_more_than_can_be_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workforce, "usable_cores", lambda: 200)
    monkeypatch.setattr(workforce, "memory", lambda: 2**40)
    monkeypatch.setattr(workforce, "_MOST_PROCESSES", 60)
    settings = crew_settings(PLAN, None, [0, 1, 2], None)
    assert sum(one.processes for one in settings) == 60


def test_photos_come_out_the_same_from_one_process_or_several(
    tmp_path: Path, device: ps.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = photos(tmp_path, 8)
    started: list[Worker] = []

    class Counted(Worker):
        def __init__(self, setting: Setting, inherited: Sequence[int] = ()) -> None:
            super().__init__(setting, inherited)
            started.append(self)

    monkeypatch.setattr(crews, "Worker", Counted)

    def solved(processes: int) -> dict[str, Any]:
        started.clear()
        settings = crew_settings(PLAN, None, [device], None)
        made = [replace(one, cores=max(2, usable_cores()), processes=processes) for one in settings]
        results: list[BatchResult] = list(
            Batch(list_inputs(tmp_path), PLAN, None).results(lambda held: Crew(made, held))
        )
        assert [result.error for result in results] == [None] * len(names)
        return {result.name: result.solution for result in results}

    alone = solved(1)
    assert len(started) == 1
    together = solved(2)
    assert len(started) == (2 if device.kind == "cpu" else 1)
    assert sorted(together) == sorted(alone) == names
    for name in names:
        np.testing.assert_array_equal(together[name].depth, alone[name].depth)
