"""``persfs-cl devices``, but for its check."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command import FOCAL, run

import persfs_cl as ps
from persfs_cl._cl import device as device_room


def test_devices_lists_every_device() -> None:
    found = ps.devices()
    table = run("devices")
    assert table.status == 0
    listed = json.loads(run("devices", "--json").stdout)
    assert [entry["index"] for entry in listed] == list(range(len(found)))
    assert sum(entry["default"] for entry in listed) == 1
    for entry, device in zip(listed, found, strict=True):
        (row,) = (line for line in table.stdout.splitlines() if line.split()[:1] == [str(device.index)])
        assert (entry["name"], entry["kind"], entry["memory_bytes"]) == (device.name, device.kind, device.memory)
        assert entry["platform_version"] == device.platform_version
        for text in (device.name, device.platform, device.version, device.driver_version, device.kind):
            assert text in row
        assert entry["default"] == (f"{device.index} *" in row)


def test_devices_says_what_to_install_where_there_is_none(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device_room, "_all_devices", lambda: ())
    for arguments, stdout in ((("devices",), ""), (("devices", "--json"), "[]\n")):
        outcome = run(*arguments)
        assert (outcome.status, outcome.stdout) == (3, stdout)
        assert "pip install pocl-binary-distribution" in outcome.stderr
    assert run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL).status == 3
    assert not (tmp_path / "out").exists()


def test_devices_reports_a_default_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENCL_CTX", "99")
    outcome = run("devices")
    assert outcome.status == 3
    assert ps.devices()[0].name in outcome.stdout
    assert "PYOPENCL_CTX" in outcome.stderr
