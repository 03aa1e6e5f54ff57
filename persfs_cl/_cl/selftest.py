"""What a driver says of its device, and why the sweeps are laid out on it as they are."""

from __future__ import annotations

from typing import Any

import pyopencl as cl

from persfs_cl._cl.device import Device
from persfs_cl._cl.registers import register_bits
from persfs_cl._cl.tuning import Tuning

_OF_NOTE = ("cl_khr_fp64", "cl_khr_fp16", "cl_khr_subgroups", "cl_khr_il_program", "cl_khr_int64_base_atomics")
_WITHOUT_VECTORS = ("wavefront_tiles", "checkerboard")
"""What a device without wide vectors gets in place of strips and bands."""
_REASONS = {
    "lexicographic": "One work-item follows the paper's loops, cell by cell.",
    "wavefront_tiles": "Many work-items go along the diagonals of a tile, which suits a GPU.",
    "wavefront_images": "A small image fits into the cache of one processor, which takes it through all its sweeps.",
    "wavefront_strips": "A large image is shared out to the processors in strips, which vectors run along.",
    "checkerboard": "All cells of a colour at a time, a work-item each, which suits a GPU.",
    "checkerboard_bands": "The processors take bands of rows that fit into their caches, in vectors.",
    "three_colours": "At second order a cell reads two neighbours on every side, for which two colours do not suffice.",
}


def facts(device: Device) -> dict[str, Any]:
    """What is of use in a report of a fault, beyond name and versions."""
    handle = device.context.devices[0]
    extensions = handle.extensions.split()
    return {
        "opencl": handle.version.strip(),
        "opencl_c": handle.opencl_c_version.strip(),
        "vendor": handle.vendor.strip(),
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


def explain(device: Device, tuning: Tuning) -> str:
    """Why a device is given this tuning, in a sentence."""
    reason, bits = _REASONS[tuning.variant], register_bits(device)
    if tuning.lanes > 1:
        return f"{reason[:-1]}; {tuning.lanes} cells are a vector, as its compiler's registers have {bits} bits."
    if not bits and tuning.variant in _WITHOUT_VECTORS:
        return f"{reason[:-1]}; its compiler names no vector registers, so that it gets no vectors."
    return reason
