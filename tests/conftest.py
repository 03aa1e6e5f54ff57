"""Every kernel test runs on every OpenCL device found, in every precision it has; none found is a failure.

``--device NAME`` leaves one device, which is then the default in the tests and in the processes that they start.

Tests marked ``thorough`` prove again what others prove, in another precision, say, or with narrower vectors. They are
left out unless ``--thorough``, ``-m`` or their own name asks for them. Without the first two, the wavefront of the
other tests has strips of a single vector; what processes of their own run is as users have it.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import hypothesis
import pyopencl as cl
import pytest
from batches import Here

from persfs_cl import Device, devices, told
from persfs_cl._cl.orderings import ORDERINGS
from persfs_cl._cl.orderings.choices import wavefront
from persfs_cl._cl.orderings.lexicographic import Lexicographic
from persfs_cl._cl.orderings.ordering import Ordering, Setup
from persfs_cl._cl.orderings.strips import Strips
from persfs_cl._cl.selection import select_device

# No test looks at a time: tests share the processors with each other.
hypothesis.settings.register_profile("unhurried", deadline=None)
hypothesis.settings.load_profile("unhurried")

# What Python compiles is kept, whatever the environment says: each of the many processes that tests start would compile
# the whole package again, and each of those that run tests all of these.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

_LEFT_OUT = pytest.StashKey[int]()
_OF_KERNELS = ("_cl", "selftest", "shading", "solver", "bench", "fuzz")
"""Folders of tests that take the same programs: one after the other, so that one process compiles, or loads, most."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--device", help="run on this device alone: 'cpu', 'gpu', its number, or part of its name")
    parser.addoption("--thorough", action="store_true", help="run the tests marked 'thorough' too")


def pytest_configure(config: pytest.Config) -> None:
    if not config.option.thorough and not config.option.markexpr:
        ORDERINGS["wavefront"] = low_wavefront
    if wanted := config.getoption("--device"):
        os.environ["PYOPENCL_CTX"] = address(select_device(wanted))


def low_wavefront(setup: Setup) -> Ordering:
    """As users have it, but for strips of a single vector, which compile in half the time and give the same bits."""
    ordering = wavefront(setup)
    return replace(ordering, vectors=1) if isinstance(ordering, Strips) else ordering


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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    # First of all, so that -m knows which are thorough by their parameters.
    for item in items:
        if isinstance(item, pytest.Function) and not all(
            mark.kwargs["holds"](item.callspec.params) for mark in item.iter_markers("quick_where")
        ):
            item.add_marker("thorough")
    items.sort(key=lambda item: item.path.parent.name not in _OF_KERNELS)
    if config.option.thorough or config.option.markexpr or any("::" in argument for argument in config.args):
        return
    left_out = [item for item in items if item.get_closest_marker("thorough")]
    items[:] = [item for item in items if not item.get_closest_marker("thorough")]
    config.hook.pytest_deselected(items=left_out)
    config.stash[_LEFT_OUT] = len(left_out)


def pytest_collection_finish() -> None:
    # What stays to the end is left out when unused objects are looked for: that takes most of a second with thousands
    # of tests, and imageio has it done for each video that it closes.
    gc.collect()
    gc.freeze()


def pytest_sessionfinish(session: pytest.Session) -> None:
    if (output := getattr(session.config, "workeroutput", None)) is not None:
        output["left_out"] = session.config.stash.get(_LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Count what the processes of pytest-xdist have left out, each of them the same: it does not do so itself."""
    count = getattr(node, "workeroutput", {}).get("left_out", 0)
    if _LEFT_OUT not in node.config.stash:
        node.config.stash[_LEFT_OUT] = count
        node.config.hook.pytest_deselected(items=[SimpleNamespace() for _ in range(count)])


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A process that is the package's own, for the time of a test."""
    monkeypatch.setattr(told._Process, "listens", False)
    with warnings.catch_warnings():
        told.listen()
        yield


@pytest.fixture
def lexicographic_wavefront(monkeypatch: pytest.MonkeyPatch) -> None:
    """By default the order that is compiled in half the time, and gives the same bits: where it plays no part."""
    monkeypatch.setitem(ORDERINGS, "wavefront", Lexicographic.of)


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch, listening: None) -> None:  # noqa: ARG001
    """A batch uses the device here: a process of its own takes seconds to start, and is not what the test is about."""
    monkeypatch.setattr("persfs_cl.pipeline.workforce.Crew", Here)
