"""Programs: kernel files composed, compiled once for each device, and kept."""

from __future__ import annotations

import functools
import logging
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyopencl as cl

from persfs_cl._cl.cache import pocl_cache
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.parameters import COMMON, declaration
from persfs_cl.checks import changing_warnings, warn
from persfs_cl.errors import KernelBuildError

_LOG = logging.getLogger(__name__)
_PACKAGE = Path(__file__).resolve().parent.parent
_ATTEMPTS = 3
"""Times that a program is made: what lies in a damaged cache is passed over by another number in its options."""


def _kernel_directory() -> Path:
    """kernels/ inside an installed package, or beside the package in a checkout (editable install)."""
    packaged = _PACKAGE / "kernels"
    return packaged if packaged.is_dir() else _PACKAGE.parent / "kernels"


@functools.cache
def _kernel_files() -> dict[str, Path]:
    """All kernel files by their names, without the suffix: each name is there once, in whatever folder."""
    return {path.stem: path for path in _kernel_directory().glob("*/*.cl")}


def kernel_names() -> list[str]:
    """Names of all kernel files, without the suffix."""
    return sorted(_kernel_files())


def kernel_source(name: str) -> str:
    """Text of one kernel file.

    Raises
    ------
    KernelBuildError
        When the file is missing: the installation is incomplete.
    """
    try:
        return _kernel_files()[name].read_text(encoding="utf-8")
    except (KeyError, OSError) as error:
        raise KernelBuildError(
            f"Kernel file {name}.cl in {_kernel_directory()} cannot be read ({error}): the installation is incomplete, "
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
    key, constants = _key(device, names, precision, definitions, parameters)
    with device.lock:
        if key not in device.programs:
            device.programs[key] = _build(device, names, constants, list(parameters))
        return device.programs[key]


def kernel(
    device: Device,
    names: Sequence[str],
    precision: str,
    definitions: Mapping[str, int] | None,
    name: str,
    scalars: Sequence[type | None],
    parameters: Iterable[str] = COMMON,
) -> cl.Kernel:
    """A kernel of a program, made once: what pyopencl prepares for its arguments takes longer than a small image.

    Its arguments must all be given in each call, by one thread at a time: the one that holds the device's lock.

    Parameters
    ----------
    device, names, precision, definitions, parameters
        As for :func:`program`.
    name : str
        Of the kernel's function.
    scalars : sequence of type or None
        NumPy type of each argument that is a number; None for the buffers.

    Raises
    ------
    KernelBuildError
        As :func:`program`.
    DeviceError
        When the program has no such kernel, as one that a driver has left half-made.
    """
    key = (*_key(device, names, precision, definitions, parameters)[0], name)
    with device.lock:
        if key not in device.kernels:
            with in_words(device):
                built = program(device, names, precision, definitions, parameters)
                device.kernels[key] = _made(built, name, scalars)
        return device.kernels[key]


def _made(built: cl.Program, name: str, scalars: Sequence[type | None]) -> cl.Kernel:
    """A kernel that knows the types of its arguments."""
    try:
        made = cl.Kernel(built, name)
        made.set_scalar_arg_dtypes(scalars)
    except cl.Error:
        raise
    except Exception as error:
        # pyopencl keeps what it prepares in a database, and raises whatever one leads to that is damaged or another's.
        # The environment variable of this name is only read when pyopencl is imported.
        if cl._PYOPENCL_NO_CACHE:  # noqa: SLF001
            raise KernelBuildError(
                f"The kernel {name} cannot be prepared ({type(error).__name__}: {error}). Install another version of "
                "pyopencl."
            ) from error
        _LOG.debug("pyopencl's cache is left alone after: %s", error)
        cl._PYOPENCL_NO_CACHE = True  # noqa: SLF001
        return _made(built, name, scalars)
    return made


def _key(
    device: Device,
    names: Sequence[str],
    precision: str,
    definitions: Mapping[str, int] | None,
    parameters: Iterable[str],
) -> tuple[tuple[object, ...], dict[str, int]]:
    """What tells a program from others, and the constants that it is compiled with."""
    constants = {
        "USE_DOUBLE": int(precision == "float64"),
        "LANES": 1,
        # PoCL keeps its mathematical functions out of line, which costs more than they save.
        "FUSED": int(not device.is_pocl),
        "BUILTINS": int(device.is_pocl),
        **(definitions or {}),
    }
    return (tuple(names), tuple(sorted(constants.items())), tuple(parameters)), constants


def _build(device: Device, names: Sequence[str], constants: Mapping[str, int], parameters: Sequence[str]) -> cl.Program:
    names = ["prelude", *names]
    texts = [(f"{name}.cl", kernel_source(name)) for name in names]
    texts.insert(1, ("parameters", declaration(parameters)))
    # '#line' lets the compiler's messages name the kernel file; -I would break on paths with spaces in PoCL.
    source = "\n".join(f'#line 1 "{name}"\n{text}' for name, text in texts)
    options = ["-cl-std=CL1.2", *(f"-D{name}={value}" for name, value in constants.items())]
    if device.rounds_correctly:
        options.append("-cl-fp32-correctly-rounded-divide-sqrt")
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
    with changing_warnings, warnings.catch_warnings():
        # All of it is read below.
        warnings.simplefilter("ignore", cl.CompilerWarning)
        built: cl.Program = cl.Program(device.context, source).build(options)
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
