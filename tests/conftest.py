"""Every kernel test runs on every OpenCL device found, in every precision it has; none found is a failure."""

from __future__ import annotations

import hypothesis
import pytest

from persfs_cl import devices

# No test looks at a time: tests share the processors with each other.
hypothesis.settings.register_profile("unhurried", deadline=None)
hypothesis.settings.load_profile("unhurried")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    found = devices()
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
