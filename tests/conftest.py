"""Every kernel test runs on every OpenCL device found, in every precision it has; none found is a failure.

``--device NAME`` leaves one device, which is then the default in the tests and in the processes that they start.
"""

from __future__ import annotations

import os
from contextlib import suppress

import hypothesis
import pyopencl as cl
import pytest

from persfs_cl import Device, devices
from persfs_cl._cl.selection import select_device

# No test looks at a time: tests share the processors with each other.
hypothesis.settings.register_profile("unhurried", deadline=None)
hypothesis.settings.load_profile("unhurried")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", help="run on this device alone: 'cpu', 'gpu', its number, or part of its name")


def pytest_configure(config: pytest.Config) -> None:
    if wanted := config.getoption("--device"):
        os.environ["PYOPENCL_CTX"] = address(select_device(wanted))


def address(device: Device) -> str:
    """The device as pyopencl's environment variable names it."""
    for number, platform in enumerate(cl.get_platforms()):
        with suppress(cl.Error):  # some have no devices
            for place, handle in enumerate(platform.get_devices()):
                if device.is_handle(handle):
                    return f"{number}:{place}"
    raise ValueError(f"{device} is on no platform")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    wanted = metafunc.config.getoption("--device")
    found = [select_device(wanted)] if wanted else devices()
    if {"device", "precision"} & set(metafunc.fixturenames) and not found:
        pytest.exit("No OpenCL device found: the kernels cannot be tested. Install pocl-binary-distribution.", 1)
    if {"device", "precision"} <= set(metafunc.fixturenames):
        pairs = [
            pytest.param(device, precision, id=f"{device.kind}{device.index}-{precision}")
            for device in found
            for precision in ("float32", "float64")
            if precision == "float32" or device.has_float64
        ]
        metafunc.parametrize(("device", "precision"), pairs)
    elif "device" in metafunc.fixturenames:
        metafunc.parametrize("device", found, ids=[f"{device.kind}{device.index}" for device in found])
