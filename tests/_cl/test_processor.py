"""Processors that PoCL's compiler does not know."""

from __future__ import annotations

import ctypes
import mmap
import platform
import sys
from types import SimpleNamespace
from typing import Any

import pyopencl as cl
import pytest

import persfs_cl as ps
from persfs_cl._cl import processor
from persfs_cl._cl.processor import level_of, name_processor
from persfs_cl._cl.program import program
from persfs_cl._cl.registers import register_bits

V2 = {"cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"}
V3 = V2 | {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"}
V4 = V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}

on_x86_linux = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() != "x86_64", reason="names of x86-64, as Linux tells them"
)


class Record:
    """A device as PoCL keeps it: numbers, and the addresses of texts, some of which are no addresses."""

    def __init__(
        self,
        target: str,
        name: str,
        *between: str,
        version: str = "OpenCL 3.0 PoCL 3.0",
        width: int = 8,
        kind: int = cl.device_type.CPU,
        beside: Record | None = None,
    ) -> None:
        texts = ("pthread", target, *between, name, "later")
        self.texts = [ctypes.create_string_buffer(text.encode()) for text in texts]
        self.place = 2 + texts.index(name)
        others: list[int] = list(beside.words[:16]) if beside else []
        words: list[int] = [1, 2**63 + 5, *map(ctypes.addressof, self.texts)]
        self.words: Any = (ctypes.c_uint64 * 1024)(*words, *[0] * (16 - len(words)), *others)
        self.handle: Any = SimpleNamespace(
            name="pthread",
            platform=SimpleNamespace(version=version),
            type=kind,
            int_ptr=ctypes.addressof(self.words),
            native_vector_width_float=width,
        )

    @property
    def name(self) -> str:
        found = [ctypes.string_at(self.words[place]).decode() for place in range(2, 2 + len(self.texts))]
        assert [text for place, text in enumerate(found, 2) if place != self.place] == [
            text.value.decode() for place, text in enumerate(self.texts, 2) if place != self.place
        ], "nothing else was written"
        return found[self.place - 2]


@pytest.fixture(autouse=True)
def _flags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processor, "cpuinfo", lambda _: " ".join(V4))
    # Addresses of what is made for a test come again.
    monkeypatch.setattr(processor, "_named", {})


@on_x86_linux
@pytest.mark.parametrize(("width", "level"), [(16, "x86-64-v4"), (8, "x86-64-v3"), (4, "x86-64-v2"), (1, "x86-64")])
def test_an_unknown_processor_is_named_by_its_level(width: int, level: str) -> None:
    record = Record("x86_64-unknown-linux-gnu", "generic", width=width)
    assert name_processor(record.handle) == level
    assert record.name == level


@on_x86_linux
def test_other_texts_may_stand_between_target_and_processor() -> None:
    """As since PoCL 5."""
    between = "kernel-x86_64-pc-linux-gnu-generic", "fallback", "x86_64"
    record = Record("x86_64-pc-linux-gnu", "generic", *between, version="OpenCL 3.0 PoCL 7.1")
    assert name_processor(record.handle) == record.name == "x86-64-v3"


@on_x86_linux
def test_what_was_named_before_is_told_again() -> None:
    record = Record("x86_64-pc-linux-gnu", "generic", width=8)
    name_processor(record.handle)
    record.handle.native_vector_width_float = 4
    assert name_processor(record.handle) == record.name == "x86-64-v3"


@pytest.mark.parametrize(
    ("target", "name", "version"),
    [
        ("x86_64-unknown-linux-gnu", "znver3", "OpenCL 3.0 PoCL 3.0"),
        ("x86_64-unknown-linux-gnu", "generic-not", "OpenCL 3.0 PoCL 3.0"),
        ("x86_64-unknown-linux-gnu", "x86-64", "OpenCL 3.0 PoCL 7.1"),
        ("x86_64-unknown-linux-gnu", "generic", "OpenCL 3.0 LINUX"),
        ("aarch64-unknown-linux-gnu", "generic", "OpenCL 3.0 PoCL 3.0"),
    ],
)
def test_a_known_processor_and_another_driver_are_left_alone(target: str, name: str, version: str) -> None:
    record = Record(target, name, version=version)
    assert name_processor(record.handle) is None
    assert record.name == name


def test_a_gpu_is_left_alone() -> None:
    record = Record("x86_64-unknown-linux-gnu", "generic", kind=cl.device_type.GPU)
    assert name_processor(record.handle) is None
    assert record.name == "generic"


def test_the_record_of_another_device_is_left_alone() -> None:
    """Where the first is of a processor that its compiler knows; records lie side by side."""
    other = Record("x86_64-unknown-linux-gnu", "generic")
    record = Record("x86_64-unknown-linux-gnu", "znver3", beside=other)
    assert name_processor(record.handle) is None
    assert record.name == "znver3"
    assert list(record.words[16:32]) == list(other.words[:16])


def test_no_processor_is_named_where_memory_cannot_be_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another system, or a container that hides it: the compiler says what is wrong."""
    record = Record("x86_64-unknown-linux-gnu", "generic")

    def refuse(*_: object) -> int:
        raise PermissionError("not yours")

    monkeypatch.setattr("persfs_cl._cl.processor.os.open", refuse)
    assert name_processor(record.handle) is None
    assert record.name == "generic"


@on_x86_linux
def test_a_record_at_the_end_of_memory_is_read_as_far_as_it_goes() -> None:
    """Neither no memory at all nor a page that is the last ends the process."""
    nowhere: Any = SimpleNamespace(**{**vars(Record("x86_64-", "generic").handle), "int_ptr": 64})
    assert name_processor(nowhere) is None
    record = Record("x86_64-unknown-linux-gnu", "generic")
    pages = mmap.mmap(-1, 2 * mmap.PAGESIZE)
    begin = ctypes.addressof(ctypes.c_char.from_buffer(pages))
    ctypes.memmove(begin + mmap.PAGESIZE - 128, record.words, 128)
    protect = ctypes.CDLL(None, use_errno=True).mprotect
    protect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    assert protect(begin + mmap.PAGESIZE, mmap.PAGESIZE, 0) == 0
    record.handle.int_ptr = begin + mmap.PAGESIZE - 128
    assert name_processor(record.handle) == "x86-64-v3"


def test_levels_need_all_their_flags_and_all_below() -> None:
    assert level_of(V4, 16) == "x86-64-v4"
    assert level_of(V4 - {"avx512dq"}, 16) == "x86-64-v3"
    assert level_of(V4 - {"bmi2"}, 16) == "x86-64-v2"
    assert level_of(V4 - {"popcnt"}, 16) == "x86-64"
    assert level_of(set(), 16) == "x86-64"


def test_a_cache_for_many_machines_tells_levels_apart(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """PoCL files programs under the name that its compiler had, one for all unknown processors."""
    asked: list[list[str]] = []
    device.context  # noqa: B018  # is made before it is told another name
    monkeypatch.setattr("persfs_cl._cl.program._compiled", lambda _, __, options, ___: asked.append(list(options)))
    for level in ("x86-64-v3", "x86-64-v4", None):
        monkeypatch.setattr(device, "_processor", level)
        monkeypatch.setattr(device, "programs", {})
        program(device, ["registers"], "float32")
    assert ["-DPROCESSOR=x86_64_v3" in options for options in asked] == [True, False, False]
    assert ["-DPROCESSOR=x86_64_v4" in options for options in asked] == [False, True, False]
    assert len(asked[0]) == len(asked[2]) + 1


def test_vectors_are_as_wide_as_the_level(device: ps.Device) -> None:
    """What is compiled for the level runs here."""
    if device.processor is None:
        pytest.skip(f"the compiler of {device} knows the processor")
    expected = {"x86-64-v4": 512, "x86-64-v3": 256, "x86-64-v2": 128, "x86-64": 128}
    assert register_bits(device) == expected[device.processor]
