"""Under what environment something was measured: device, driver, versions, processor, date."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from persfs_cl._cl.device import Device
from persfs_cl._cl.processor import cpuinfo
from persfs_cl.blocks import usable_cores

_PACKAGES = (
    "persfs-cl",
    "numpy",
    "pyopencl",
    "pocl-binary-distribution",
    "numba",
    "scikit-fmm",
    "pymeshfix",
    "tvb-data",
    "distributed",
)


def environment(device: Device, command: str, facts: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything that a figure should name.

    Parameters
    ----------
    device : Device
    command : str
        What was typed.
    facts : mapping, optional
        What another process found out of the device, see :func:`persfs_cl._cl.selftest.facts`; without it the device is
        asked here.
    """
    return {
        "command": command,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "device": {
            "name": device.name,
            "kind": device.kind,
            "platform": device.platform,
            "platform_version": device.platform_version,
            "driver_version": device.driver_version,
            "compiles_for": device.processor if facts is None else facts.get("compiles_for"),
            "compute_units": device.compute_units,
            "memory_bytes": device.memory,
        },
        "processor": processor(),
        "cores": usable_cores(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "system": platform.platform(),
        "versions": {"python": platform.python_version(), **_versions()},
    }


def summary(header: Mapping[str, Any]) -> str:
    """The environment in two lines, for the foot of a plot and the head of a table."""
    device, versions = header["device"], header["versions"]
    packages = ", ".join(f"{name} {number}" for name, number in versions.items())
    platform_version = device["platform_version"].partition(",")[0]  # PoCL goes on with how it was built
    compiles_for = f", compiling for {device['compiles_for']}" if device["compiles_for"] else ""
    return (
        f"{device['name']}; {device['platform']}, {platform_version}, driver {device['driver_version']}{compiles_for}\n"
        f"{header['processor']}, {header['cores']} cores; {packages}; {header['date']}"
    )


def processor() -> str:
    """Name of the processor, as far as the system tells."""
    return cpuinfo("model name") or platform.processor() or platform.machine()


def _versions() -> dict[str, str]:
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue  # an extra, or a driver that is installed otherwise
    return found
