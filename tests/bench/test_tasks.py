"""What handing out photographs costs: each part, with a few."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

import persfs_cl as ps
from persfs_cl.bench import tasks
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record

COUNT = 400


@pytest.fixture
def plan(device: ps.Device) -> Plan:
    return Plan(device, tasks=COUNT)


def values(records: list[Record]) -> dict[str, float]:
    assert all(record.experiment == "tasks" for record in records)
    return {record.quantity: record.median or 0.0 for record in records}


def test_listing_and_manifest(plan: Plan, tmp_path: Path) -> None:
    listed = values(tasks.listing(plan, tmp_path / "photos"))
    assert len(list((tmp_path / "photos").rglob("*.jpg"))) == COUNT
    # At least a path and a name, and no image.
    assert 100 < listed["memory a file"] < 2000
    noted = values(tasks.manifest(plan, tmp_path / "manifest"))
    (file,) = (tmp_path / "manifest").rglob("*.jsonl")
    assert noted["size of a line"] == pytest.approx(file.stat().st_size / COUNT)
    assert 100 < noted["memory a photograph"] < 2000
    assert min(*listed.values(), *noted.values()) > 0


@pytest.mark.thorough
def test_processes_here(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tasks, "_FEW", 1)
    assert values(tasks.crew(replace(plan, tasks=100)))["tasks"] > 1


@pytest.mark.usefixtures("listening")
def test_workers_of_dask(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = values(tasks.cluster(plan, tmp_path / "output", processes=False))
    assert found["tasks"] > 1
    assert 1 <= found["chunks with the scheduler at most"] <= 3, "two ahead, and one that is being asked for"
    assert found["size of a chunk at most"] < 256 * 2000
    monkeypatch.setitem(sys.modules, "distributed", None)
    (record,) = tasks.cluster(plan, tmp_path)
    assert record.detail.startswith("skipped: Dask is not installed")
