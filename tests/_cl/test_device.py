"""Which device is taken, and that nothing is made twice."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import pyopencl as cl
import pytest

import persfs_cl as ps
from persfs_cl._cl import device as device_module
from persfs_cl._cl import selection
from persfs_cl._cl.kernel import kernel
from persfs_cl._cl.orderings import ordering_for
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.lexicographic import Lexicographic
from persfs_cl._cl.orderings.ordering import Ordering, Setup
from persfs_cl._cl.orderings.three_colours import ThreeColours
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.program import program
from persfs_cl._cl.registers import SUFFICIENT, lanes
from persfs_cl._cl.selection import select_device
from persfs_cl.shading.model import Light


def handle(
    name: str, kind: int, version: str, platform: str = "Portable Computing Language", *, double: bool = True
) -> Any:
    """What the module reads of a pyopencl device."""
    return SimpleNamespace(
        name=name,
        type=kind,
        platform=SimpleNamespace(name=platform, version=version),
        driver_version=version,
        double_fp_config=63 if double else 0,
        single_fp_config=63,
        global_mem_size=2**30,
        max_compute_units=2,
        max_work_group_size=64,
    )


CPU, GPU = cl.device_type.CPU, cl.device_type.GPU


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Pretend that some devices are installed."""

    def install(*handles: Any) -> list[ps.Device]:
        platforms = [SimpleNamespace(name=h.platform.name, get_devices=lambda h=h: [h]) for h in handles]
        monkeypatch.setattr(cl, "get_platforms", lambda: platforms)
        monkeypatch.setattr(selection, "register_bits", lambda _: 256)
        monkeypatch.setattr(device_module, "name_processor", lambda _: None)
        monkeypatch.delenv("PYOPENCL_CTX", raising=False)
        device_module._all_devices.cache_clear()
        return ps.devices()

    yield install
    monkeypatch.undo()
    device_module._all_devices.cache_clear()


def test_of_several_pocl_versions_the_newest_comes_first(machine: Any) -> None:
    found = machine(
        handle("pthread", CPU, "OpenCL 3.0 PoCL 3.1+debian Linux"),
        handle("cpu", CPU, "OpenCL 3.0 PoCL 10.0 Linux"),
        handle("pthread", CPU, "OpenCL 3.0 PoCL 3.0-rc2 Linux"),
    )
    assert [device.platform_version.split()[3] for device in found] == ["10.0", "3.1+debian", "3.0-rc2"]
    assert select_device() is found[0]
    assert [device.index for device in found] == [0, 1, 2]


def test_versions_of_several_makers_are_not_compared(machine: Any) -> None:
    """Nor does a device without double precision come before one that has it."""
    found = machine(
        handle("weak GPU", GPU, "OpenCL 3.0", "rusticl", double=False),
        handle("llvmpipe", CPU, "OpenCL 9.9", "rusticl", double=False),
        handle("Xeon", CPU, "OpenCL 3.1 LINUX", "Intel(R) OpenCL"),
        handle("GPU", GPU, "OpenCL 1.2 CUDA", "NVIDIA CUDA"),
        handle("pthread", CPU, "OpenCL 3.0 PoCL 1.8"),
    )
    assert [device.name for device in found] == ["pthread", "Xeon", "GPU", "llvmpipe", "weak GPU"]


def test_a_device_that_compiles_nothing_is_taken_last(machine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = machine(
        handle("broken", CPU, "OpenCL 3.0 PoCL 9.0"), handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1")
    )

    def register_bits(device: ps.Device) -> int:
        if device in broken:
            raise ps.KernelBuildError(f"{device.name} does not compile.")
        return 256

    monkeypatch.setattr(selection, "register_bits", register_bits)
    broken = [first]
    with pytest.warns(UserWarning, match=r"pthread-EPYC.* is used.*broken does not compile"):
        assert select_device() is second
    assert select_device(0) is first
    broken = [first, second]
    with pytest.raises(ps.KernelBuildError, match="broken does not compile"):
        select_device()


def test_selection_by_kind_index_and_name(machine: Any) -> None:
    found = machine(
        handle("NVIDIA H100", GPU, "OpenCL 3.0 CUDA 13.0", "NVIDIA CUDA"),
        handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1"),
    )
    cpu, gpu = found
    assert (cpu.kind, gpu.kind) == ("cpu", "gpu")
    for selector, expected in (
        (None, cpu),
        ("cpu", cpu),
        ("gpu", gpu),
        (1, gpu),
        ("1", gpu),
        ("h100", gpu),
        ("PoCL", cpu),
        ("nvidia cuda", gpu),
        (gpu, gpu),
    ):
        assert select_device(selector) is expected


@pytest.mark.parametrize(
    ("selector", "message"),
    [
        ("gpu", "No OpenCL device fits.*Give one of these numbers"),
        (7, "does not exist.*Give one of these numbers"),
        ("quantum", "fits"),
        ("", "choice"),
        (1.5, "choice"),
    ],
)
def test_a_device_that_is_not_there_is_an_error_that_lists_what_is(machine: Any, selector: Any, message: str) -> None:
    machine(handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1"))
    with pytest.raises(ps.DeviceError, match=message):
        select_device(selector)


def test_no_device_says_what_to_install(machine: Any) -> None:
    assert machine() == []
    with pytest.raises(ps.DeviceError, match="pocl-binary-distribution"):
        select_device()


def test_pyopencl_ctx_is_honoured(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    for number, platform in enumerate(cl.get_platforms()):
        with suppress(cl.Error, IndexError):  # some have no devices
            found.append((number, platform.get_devices()[0]))
    number, last = found[-1]
    monkeypatch.setenv("PYOPENCL_CTX", f"{number}:0")
    assert select_device().is_handle(last)
    monkeypatch.setenv("PYOPENCL_CTX", "no such device")
    with pytest.raises(ps.DeviceError, match="no such device"):
        select_device()


@pytest.mark.parametrize(("bits", "single", "double"), [(0, 1, 1), (128, 4, 2), (256, 8, 4), (512, 16, 8)])
def test_vectors_are_as_wide_as_the_registers_of_the_compiler(
    monkeypatch: pytest.MonkeyPatch, bits: int, single: int, double: int
) -> None:
    """Without any the device gets the kernels of GPUs, whatever it calls itself."""
    (device, *_) = ps.devices()
    monkeypatch.setattr(device, "register_bits", bits)
    monkeypatch.setattr(device, "has_float64", True)
    for precision, wide in (("float32", single), ("float64", double)):
        assert lanes(device, precision) == wide
        assert lanes(device, precision, 8) == min(wide, 8)
        for name, settles, taken, for_gpus in (
            ("wavefront", False, min(wide, 8), WavefrontTiles),
            ("wavefront", True, wide, WavefrontTiles),
            ("checkerboard", False, wide, Checkerboard),
        ):
            ordering = ordering_for(name, Setup(device, precision, (700, 800), 1, settles=settles))
            assert ordering.lanes == taken
            assert (type(ordering) is for_gpus) == (wide == 1)


def test_contexts_and_programs_are_made_once() -> None:
    device = select_device()
    assert select_device() is device
    assert device.context is device.context
    names = ["boundary", "renew"]
    assert program(device, names, "float32") is program(device, names, "float32")


def test_a_kernel_that_does_not_compile_names_its_file_and_line(monkeypatch: pytest.MonkeyPatch) -> None:
    device = select_device()
    source = "\n\n__kernel void broken(__global float *a) { a[0] = nonsense; }\n"
    monkeypatch.setattr("persfs_cl._cl.program.kernel_source", lambda name: source if name == "renew" else "\n")
    with pytest.raises(ps.KernelBuildError, match=r"renew\.cl:3"):
        program(device, ["boundary", "renew"], "float32", {"ONLY_HERE": 1})


def test_a_program_without_its_kernel_is_an_error_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise cl.LogicError("clCreateKernel failed: INVALID_KERNEL_NAME")

    device, constants = select_device(), {"ONLY_IN_THE_TEST_OF_HALF_A_PROGRAM": 1}
    monkeypatch.setattr(cl, "Kernel", refuse)
    with pytest.raises(ps.DeviceError, match=r"INVALID_KERNEL_NAME.*devices --check"):
        kernel(device, ["boundary", "renew"], "float32", constants, "renew_boundary")


def test_a_missing_kernel_file_says_to_reinstall() -> None:
    with pytest.raises(ps.KernelBuildError, match="reinstall"):
        program(select_device(), ["absent"], "float32")


def fields(light: Light) -> list[str]:
    """Of the parameters of a Lambertian surface under the light, for the upwind scheme."""
    return list(light.upwind_model(ps.Lambertian()).parameters(ps.Camera(10.0).grid((4, 4))))


# A warning about kernels that other tests compile makes these fail.
@pytest.mark.thorough
def test_kernels_compile_without_warnings(device: ps.Device, precision: str) -> None:
    wide = lanes(device, precision)
    by_cells: list[Ordering] = [Lexicographic(), WavefrontTiles(), Checkerboard(), ThreeColours()]
    by_vectors: list[Ordering] = [kind(wide) for kind in (Checkerboard, CheckerboardBands)]
    by_vectors += [kind(lanes(device, precision, SUFFICIENT)) for kind in (WavefrontStrips, WavefrontImages)]
    for ordering in [*by_cells, *(by_vectors if wide > 1 else [])]:
        kernels = ["light_cone", "parallel_light", "lax_friedrichs", *ordering.kernels]
        program(device, kernels, precision, ordering.definitions, fields(ps.ParallelLight()))
    flash = ["elementary", "lambertian", "flash_light", "steepness", "upwind_flash"]
    parallel = ["light_cone", "parallel_light", "climb", "upwind"]
    headlight = ["elementary", "lambertian", "headlight", "climb", "upwind"]
    beside = ["elementary", "lambertian", "steepness", "light_cone", "off_axis_lamp", "climb", "upwind_off_axis"]
    lights: tuple[Light, ...] = (
        ps.ParallelLight(),
        ps.FlashLight(falloff=False),
        ps.FlashLight(),
        ps.FlashLight(offset=(0.1, 0.0, 0.0)),
    )
    for light, scheme in zip(lights, (parallel, headlight, flash, beside), strict=True):
        second: list[Ordering] = [WavefrontTiles(second_order=True, only_lower=False)]
        strips = WavefrontStrips(wide, vectors=1, second_order=True, only_lower=False)
        for ordering in [*second, *([strips] if wide > 1 else [])]:
            program(device, [*scheme, *ordering.kernels], precision, ordering.definitions, fields(light))
    program(device, ["light_cone", "parallel_light", "render"], precision, None, fields(ps.ParallelLight()))


def test_a_wrong_environment_is_an_error_and_never_a_question() -> None:
    environment = {**os.environ, "PYOPENCL_CTX": "no such device"}
    code = "import persfs_cl as ps, numpy as np; ps.reconstruct(np.eye(9), ps.Camera(9.0))"
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert "DeviceError: PYOPENCL_CTX='no such device'" in run.stderr


def test_of_equal_devices_a_pickled_one_is_the_same_again(machine: Any) -> None:
    gpus = [handle("NVIDIA H100", GPU, "OpenCL 3.0 CUDA 13.0", "NVIDIA CUDA") for _ in range(3)]
    found = machine(*gpus, handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1"))
    pickled = [pickle.dumps(device) for device in found]
    assert [pickle.loads(each) for each in pickled] == found
    machine(gpus[0])
    assert pickle.loads(pickled[1]).name == "NVIDIA H100"
    with pytest.raises(ps.DeviceError, match="Number 3 of the devices NVIDIA H100"):
        pickle.loads(pickled[3])


def in_eight_threads(function: Callable[[], object]) -> set[int]:
    """Identities of what a function gives to threads that call it at once."""
    barrier = threading.Barrier(8)

    def call() -> object:
        barrier.wait()
        return function()

    with ThreadPoolExecutor(8) as pool:
        results = [pool.submit(call) for _ in range(8)]
        return {id(result.result()) for result in results}


def test_threads_get_the_same_objects(machine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def slowly(*_arguments: object, **_keywords: object) -> Any:
        threading.Event().wait(0.01)
        return object()

    machine(handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1"))
    platforms = cl.get_platforms()
    monkeypatch.setattr(cl, "get_platforms", lambda: slowly() and platforms)
    monkeypatch.setattr(cl, "Context", slowly)
    monkeypatch.setattr(cl, "CommandQueue", slowly)
    device_module._all_devices.cache_clear()
    assert len(in_eight_threads(lambda: ps.devices()[0])) == 1
    device = ps.devices()[0]
    assert len(in_eight_threads(lambda: device.queue)) == 1
    assert len(in_eight_threads(lambda: device.context)) == 1


class Refusing:
    """A platform or device of which a driver tells nothing."""

    def __getattr__(self, _name: str) -> Any:
        raise cl.LogicError("refused")


def test_what_a_driver_refuses_is_a_warning_or_an_error_of_ours(machine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    machine(handle("pthread-EPYC", CPU, "OpenCL 3.0 PoCL 3.1"))
    good = cl.get_platforms()
    bad = SimpleNamespace(name="bad", get_devices=lambda: [Refusing()])
    monkeypatch.setattr(cl, "get_platforms", lambda: [Refusing(), bad, *good])
    device_module._all_devices.cache_clear()
    with pytest.warns(UserWarning, match="OpenCL") as warned:
        (device,) = ps.devices()
    assert [str(each.message) for each in warned] == [
        "OpenCL platform number 0 lists no devices: refused",
        "An OpenCL device that does not say what it is was left out: refused",
    ]
    assert (device.name, device.index) == ("pthread-EPYC", 0)

    def refuse(*_arguments: object, **_keywords: object) -> None:
        raise cl.MemoryError("refused")

    monkeypatch.setattr(cl, "Context", refuse)
    for use in (lambda: device.context, lambda: device.queue):
        with pytest.raises(ps.DeviceError, match=r"pthread-EPYC .* gives no context: refused"):
            use()
