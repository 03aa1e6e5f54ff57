"""``persfs-cl devices``: what OpenCL finds here."""

from __future__ import annotations

import json
import sys
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from persfs_cl._cl.device import Device
from persfs_cl._cl.device import devices as list_devices
from persfs_cl._cl.selection import select_device
from persfs_cl.errors import DeviceError


def devices(as_json: Annotated[bool, typer.Option("--json", help="Print a JSON array.")] = False) -> None:
    """List the OpenCL devices, and say what to install when there are none.

    The default device, marked *, is the first, unless the environment variable PYOPENCL_CTX says otherwise.
    """
    found = list_devices()
    problem = None
    default = None
    try:
        default = select_device()
    except DeviceError as error:
        problem = error
    if as_json:
        typer.echo(json.dumps([_entry(device, default) for device in found], indent=2))
    elif found:
        _table(found, default)
    if problem:
        raise problem


def _entry(device: Device, default: Device | None) -> dict[str, object]:
    return {
        "index": device.index,
        "default": device is default,
        "kind": device.kind,
        "name": device.name,
        "platform": device.platform,
        "platform_version": device.platform_version,
        "driver_version": device.driver_version,
        "float64": device.has_float64,
        "memory_bytes": device.memory,
        "compute_units": device.compute_units,
    }


def _table(found: list[Device], default: Device | None) -> None:
    table = Table(box=box.SIMPLE)
    for title in ("index", "kind", "name", "platform", "version", "driver", "float64", "memory", "units"):
        table.add_column(title, overflow="fold", justify="right" if title in ("memory", "units") else "left")
    for device in found:
        table.add_row(
            f"{device.index}{' *' if device is default else ''}",
            device.kind,
            device.name,
            device.platform,
            device.platform_version,
            device.driver_version,
            "yes" if device.has_float64 else "no",
            f"{device.memory / 2**30:.1f} GiB",
            str(device.compute_units),
        )
    # A file or pipe has no width to fit: one line a device.
    console = Console(width=None if sys.stdout.isatty() else 250, markup=False, highlight=False)
    console.print(table)
    if default:
        console.print("* is the default device.")
