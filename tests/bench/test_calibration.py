"""The experiment that finds lights again, and its table."""

from __future__ import annotations

from pathlib import Path

import pytest

import persfs_cl as ps
from persfs_cl.bench import calibration
from persfs_cl.bench.calibration import AFTER, BEFORE, CASES, DIRECTION, EXPONENT, GAIN, LAMP, QUANTITIES
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents
from persfs_cl.environment import environment


@pytest.mark.thorough
def test_what_is_sought_is_told_in_a_row(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> Path:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(calibration, "stanford_bunny", missing)
    kept = (
        "bump, points: tone",
        "bunny, points: tone, lamp",
        "bump, map: tone, lamp",
        "bump and hill, maps: sun, tone",
    )
    for name in set(CASES).difference(kept):
        monkeypatch.delitem(CASES, name)
    records = [record for group in calibration.calibration(Plan(device, sizes=(48,), repeats=2)) for record in group]
    found: dict[str, dict[str, Record]] = {}
    for record in records:
        found.setdefault(record.workload, {})[record.quantity] = record
    assert [*found] == [*kept]
    tone, bunny, lamp, sun = found.values()
    assert {*tone} == {GAIN, EXPONENT, BEFORE, AFTER}
    assert {*lamp} == {GAIN, EXPONENT, LAMP, BEFORE, AFTER}
    assert {*sun} == {EXPONENT, DIRECTION}
    assert bunny[GAIN].detail == "skipped: get the bunny"
    assert (tone[GAIN].repeats, lamp[GAIN].repeats) == (2, 1)
    for one in (tone, lamp):
        assert (one[AFTER].median or 0.0) < 0.7 * (one[BEFORE].median or 0.0)
    assert (lamp[LAMP].median or 1.0) < 0.02
    assert (sun[DIRECTION].median or 1.0) < 0.5

    header, _rule, *rows = contents(environment(device, ""), records)["calibration"].splitlines()
    assert header.count("|") == len(QUANTITIES) + 2
    assert {row.count("|") for row in rows} == {len(QUANTITIES) + 2}
    assert "skipped: get the bunny" in rows[1]
