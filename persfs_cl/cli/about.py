"""What a report of a fault should come with: versions, devices and settings of this machine."""

from __future__ import annotations

import os
import platform
import re
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version

from persfs_cl._cl.device import devices
from persfs_cl.blocks import usable_cores
from persfs_cl.environment import processor
from persfs_cl.errors import PersfsError

_PACKAGE = "persfs-cl"
_OURS = re.compile(r"PERSFS_CL_|PYOPENCL_|OCL_ICD_|POCL_|OPENCL_|CUDA_VISIBLE_DEVICES|XDG_CACHE_HOME")
"""Environment variables that change what happens."""
_REQUIREMENT = re.compile(r"([A-Za-z0-9._-]+)[^;]*(?:;(?P<when>.*))?")
_EXTRA = re.compile(r"extra\s*==\s*['\"]([^'\"]+)['\"]")
_OF_DEVELOPERS = ("test", "dev", "docs", "release")
"""Extras that no photograph needs."""


def about() -> str:
    """Everything, in lines for people."""
    lines = [
        f"{_PACKAGE} {version(_PACKAGE)}, Python {platform.python_version()} ({sys.executable})",
        f"{platform.platform()}, {processor()}, {usable_cores()} cores",
        "",
        *_packages(),
        "",
        *_devices(),
        "",
        *(f"{name}={value}" for name, value in sorted(os.environ.items()) if _OURS.match(name)),
    ]
    return "\n".join(lines)


def _packages() -> Iterator[str]:
    """Those that the package needs, and those of its extras."""
    extras: dict[str, str] = {}
    for text in requires(_PACKAGE) or ():
        if (found := _REQUIREMENT.match(text)) is None:
            continue
        of = _EXTRA.search(found["when"] or "")
        if of is None or of[1] not in _OF_DEVELOPERS:
            extras.setdefault(found[1], "" if of is None else f" [{of[1]}]")
    for name, extra in sorted(extras.items(), key=lambda each: (each[1], each[0].lower())):
        try:
            number = version(name)
        except PackageNotFoundError:
            number = "not installed"
        yield f"{name} {number}{extra}"


def _devices() -> Iterator[str]:
    try:
        found = devices()
    except PersfsError as error:
        yield f"no device: {error}"
        return
    for number, device in enumerate(found):
        yield (
            f"device {number}: {device.name}; {device.platform}, {device.platform_version}, driver "
            f"{device.driver_version}"
        )
    if not found:
        yield "no OpenCL device"
