"""Programs: kernel files composed, compiled once for each device, and kept."""

from __future__ import annotations

import functools
import logging
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyopencl as cl

from persfs_cl._cl.cache import pocl_cache
from persfs_cl._cl.device import Device
from persfs_cl._cl.parameters import COMMON, declaration
from persfs_cl.checks import warn
from persfs_cl.errors import KernelBuildError
from persfs_cl.told import hearing, pass_on

_LOG = logging.getLogger(__name__)
_PACKAGE = Path(__file__).resolve().parent.parent
_ATTEMPTS = 3
"""Times that a program is made: what lies in a damaged cache is passed over by another number in its options."""


def _packaged() -> Path:
    """kernels/ inside an installed package, or next to the package in a checkout (editable install)."""
    inside = _PACKAGE / "kernels"
    return inside if inside.is_dir() else _PACKAGE.parent / "kernels"


KERNEL_FOLDERS = [_packaged()]
"""Where kernel files are looked for, in folders of these folders; each name is there once."""


@functools.cache
def _files_in(folder: Path) -> dict[str, Path]:
    """All kernel files of a folder by their names, without the suffix."""
    return {path.stem: path for path in folder.glob("*/*.cl")}


def kernel_names() -> list[str]:
    """Names of all kernel files, without the suffix."""
    return sorted(name for folder in KERNEL_FOLDERS for name in _files_in(folder))


def kernel_source(name: str) -> str:
    """Text of one kernel file.

    Raises
    ------
    KernelBuildError
        When the file is missing: the installation is incomplete.
    """
    found = [files[name] for files in map(_files_in, KERNEL_FOLDERS) if name in files]
    try:
        return found[0].read_text(encoding="utf-8")
    except (IndexError, OSError) as error:
        folders = ", ".join(map(str, KERNEL_FOLDERS))
        raise KernelBuildError(
            f"Kernel file {name}.cl in {folders} cannot be read ({error}): the installation is incomplete, "
            "reinstall persfs-cl."
        ) from error


def program(
    device: Device,
    names: Sequence[str],
    precision: str,
    definitions: Mapping[str, int] | None = None,
    parameters: Iterable[str] = COMMON,
) -> cl.Program:
    """The program made of some kernel files, compiled at first use and kept with its device.

    Parameters
    ----------
    device : Device
    names : sequence of str
        Kernel files in order; the prelude, and the structure of the parameters, are put before them.
    precision : {"float32", "float64"}
    definitions : mapping, optional
        Preprocessor constants: sizes of work-groups and vectors, nothing else.
    parameters : iterable of str, optional
        Fields of that structure, see :mod:`persfs_cl._cl.parameters`.

    Raises
    ------
    KernelBuildError
        With the compiler's log, which names files and lines.
    """
    key = program_key(device, names, precision, definitions, parameters)
    with device.lock:
        if key not in device.programs:
            constants = _constants(device, precision, definitions)
            device.programs[key] = _build(device, names, constants, list(parameters))
        return device.programs[key]


def program_key(
    device: Device,
    names: Sequence[str],
    precision: str,
    definitions: Mapping[str, int] | None,
    parameters: Iterable[str],
) -> tuple[object, ...]:
    """What tells a program from others; its arguments are those of :func:`program`."""
    constants = _constants(device, precision, definitions)
    return tuple(names), tuple(sorted(constants.items())), tuple(parameters)


def _constants(device: Device, precision: str, definitions: Mapping[str, int] | None) -> dict[str, int]:
    """What a program is compiled with."""
    return {
        "USE_DOUBLE": int(precision == "float64"),
        "LANES": 1,
        # PoCL keeps its mathematical functions out of line, which costs more than they save.
        "FUSED": int(not device.is_pocl),
        "BUILTINS": int(device.is_pocl),
        **(definitions or {}),
    }


def _build(device: Device, names: Sequence[str], constants: Mapping[str, int], parameters: Sequence[str]) -> cl.Program:
    names = ["prelude", *names]
    texts = [(f"{name}.cl", kernel_source(name)) for name in names]
    texts.insert(1, ("parameters", declaration(parameters)))
    # '#line' lets the compiler's messages name the kernel file; -I would break on paths with spaces in PoCL.
    source = "\n".join(f'#line 1 "{name}"\n{text}' for name, text in texts)
    options = ["-cl-std=CL1.2", *(f"-D{name}={value}" for name, value in constants.items())]
    if device.rounds_correctly:
        options.append("-cl-fp32-correctly-rounded-divide-sqrt")
    if device.processor:
        # PoCL's cache goes by the name that its compiler has for the processor, and may serve several machines.
        options.append(f"-DPROCESSOR={device.processor.replace('-', '_')}")
    remedy = f"Delete the kernel cache, which is {pocl_cache()} for PoCL, or use another device."
    for attempt in range(_ATTEMPTS):
        try:
            return _compiled(device, source, [*options, f"-DATTEMPT={attempt}"] if attempt else options, names)
        except Exception as error:  # noqa: BLE001  # pyopencl's own cache raises whatever a damaged file leads to
            failure = error
            if _names_a_file(str(error), names):
                remedy = "Report this, with the output of 'persfs-cl devices --check', or use another device."
                break
            _LOG.debug("%s on %s is built again from source after: %s", " + ".join(names), device, error)
    raise KernelBuildError(f"{' + '.join(names)} did not compile on {device}:\n{failure}\n{remedy}") from failure


def _compiled(device: Device, source: str, options: Sequence[str], names: Sequence[str]) -> cl.Program:
    """The program. What the compiler says goes to the log, and becomes a warning where it is about our source."""
    with hearing() as heard:
        built: cl.Program = cl.Program(device.context, source).build(options)
    # All that the compiler says is read below.
    pass_on(warning for warning in heard if not issubclass(warning.category, cl.CompilerWarning))
    if not built.get_info(cl.program_info.NUM_KERNELS):
        raise KernelBuildError("The program came without kernels.")
    log: Callable[..., Any] = built.get_build_info
    said = str(log(device.context.devices[0], cl.program_build_info.LOG) or "").strip()
    if said:
        _LOG.debug("%s on %s: %s", " + ".join(names), device, said)
    if _names_a_file(said, names):
        warn(f"The compiler of {device} warns about {' + '.join(names)}:\n{said}")
    return built


def _names_a_file(said: str, names: Sequence[str]) -> bool:
    """Whether a compiler's words are about one of the kernel files."""
    return re.search(rf"\b(?:{'|'.join(map(re.escape, names))})\.cl:\d+", said) is not None
