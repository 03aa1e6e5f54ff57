"""What a driver says of its device, and why the sweeps are laid out on it as they are."""

from __future__ import annotations

from typing import Any

import pyopencl as cl

from persfs_cl._cl.device import Device
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.registers import register_bits

_OF_NOTE = ("cl_khr_fp64", "cl_khr_fp16", "cl_khr_subgroups", "cl_khr_il_program", "cl_khr_int64_base_atomics")


def facts(device: Device) -> dict[str, Any]:
    """What is of use in a report of a fault, beyond name and versions."""
    handle = device.context.devices[0]
    extensions = handle.extensions.split()
    return {
        "opencl": handle.version.strip(),
        "opencl_c": handle.opencl_c_version.strip(),
        "vendor": handle.vendor.strip(),
        "compiles_for": device.processor,
        "clock_mhz": handle.max_clock_frequency,
        "largest_group": device.largest_group,
        "local_memory_bytes": handle.local_mem_size,
        "vector_width": {"float32": handle.native_vector_width_float, "float64": handle.native_vector_width_double},
        "correctly_rounded_divide_sqrt": bool(
            handle.single_fp_config & cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        ),
        "denormals": bool(handle.single_fp_config & cl.device_fp_config.DENORM),
        "extensions": {name: name in extensions for name in _OF_NOTE},
    }


def explain(device: Device, ordering: Ordering) -> str:
    """Why a device is given this ordering, in a sentence."""
    reason, bits = ordering.reason, register_bits(device)
    if ordering.lanes > 1:
        return f"{reason[:-1]}; {ordering.lanes} cells are a vector, and its compiler's registers have {bits} bits."
    if not bits and ordering.for_want_of_vectors:
        return f"{reason[:-1]}; its compiler names no vector registers, so that it gets no vectors."
    return reason
