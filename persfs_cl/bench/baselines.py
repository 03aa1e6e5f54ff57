"""Yardsticks: the same sweep by other means, to be measured in the same run."""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.image import Image
from persfs_cl._cl.parameters import COMMON
from persfs_cl._cl.run import DIRECTIONS
from persfs_cl.bench import lexicographic
from persfs_cl.errors import UnavailableError
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.reference import Reference

_OF_LIGHT = ("p0", "q0", "inverse_norm")
"""Numbers that the loops want after those of COMMON."""
_SOURCE = Path(__file__).with_name("lexicographic.c")
# Without contraction, which some compilers do unasked on some processors: plain C, the same everywhere.
_FLAGS = ("-O3", "-ffp-contract=off", "-shared", "-fPIC")


@dataclass
class Baseline:
    """A sweep by other means, and its own copy of the values.

    Attributes
    ----------
    log_depth : ndarray, shape (height, width)
        Changed in place.
    sweep : callable
        Takes the direction, 0 to 3, as :data:`persfs_cl._cl.run.DIRECTIONS` has them.
    detail : str
        How it was made.
    """

    log_depth: NDArray[np.floating]
    sweep: Callable[[int], None]
    detail: str

    def work(self, count: int) -> None:
        """So many sweeps, in all directions in turn."""
        for number in range(count):
            self.sweep(number % 4)


def plain_c(image: Image, precision: str) -> Baseline:
    """The plain double loop in C, compiled on the spot.

    Parameters
    ----------
    image : Image
        With every pixel on the frame known.
    precision : {"float32", "float64"}

    Raises
    ------
    UnavailableError
        When there is no C compiler, or it fails.
    """
    function, detail = _compiled(precision)
    arrays = _arrays(image, precision)

    def sweep(number: int) -> None:
        function(*(array.ctypes.data for array in arrays), *arrays[0].shape, *DIRECTIONS[number])

    return Baseline(arrays[0], sweep, detail)


def numba_loop(image: Image, precision: str) -> Baseline:
    """The same double loop in Python, compiled by numba.

    Raises
    ------
    UnavailableError
        When numba is not installed.
    """
    function, detail = _jitted()
    arrays = _arrays(image, precision)
    # As numbers of the arrays' own type, since a literal would make everything double.
    one, half = arrays[0].dtype.type(1), arrays[0].dtype.type(0.5)

    def sweep(number: int) -> None:
        function(*arrays, *DIRECTIONS[number], one, half)

    return Baseline(arrays[0], sweep, detail)


def numpy_diagonals(problem: Problem) -> Baseline:
    """The reference in NumPy, float64, one anti-diagonal at a time."""
    measure = Reference.of(problem)
    return Baseline(
        measure.log_depth, lambda number: measure.sweep(*DIRECTIONS[number]), f"NumPy {np.__version__}, float64"
    )


def _arrays(image: Image, precision: str) -> list[NDArray[np.floating]]:
    """What both loops take, each a C-contiguous copy."""
    given = (
        image.log_depth,
        image.marked_brightness(slice(None)),
        image.x_axis,
        image.y_axis,
        [image.parameters[name] for name in (*COMMON, *_OF_LIGHT)],
    )
    return [np.array(array, precision, order="C") for array in given]


def compiled_by_numba(function: Callable[..., Any]) -> Any:
    """The function, to be compiled by numba on its first call.

    Raises
    ------
    UnavailableError
        When numba is not installed.
    """
    try:
        import numba
    except ImportError as error:
        raise UnavailableError(f"numba cannot be imported ({error}): pip install 'persfs-cl[bench]'.") from error
    return numba.njit(function)


@functools.cache
def _jitted() -> tuple[Any, str]:
    return compiled_by_numba(lexicographic.sweep), f"numba {importlib.metadata.version('numba')}"


@functools.cache
def _compiled(precision: str) -> tuple[Any, str]:
    compiler = shlex.split(os.environ.get("CC", "")) or ["cc"]
    if shutil.which(compiler[0]) is None:
        raise UnavailableError(f"there is no C compiler {compiler[0]!r}: install one, or name it in the variable CC.")
    real = {"float32": "float", "float64": "double"}[precision]
    with tempfile.TemporaryDirectory(prefix="persfs-cl-") as folder:
        library = Path(folder) / "lexicographic.so"
        command = [*compiler, *_FLAGS, f"-DREAL={real}", str(_SOURCE), "-o", str(library), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise UnavailableError(f"{shlex.join(command)} failed: {done.stderr.strip()}")
        # The system keeps a loaded library although its file is deleted.
        function = ctypes.CDLL(str(library)).sweep
    function.argtypes = [ctypes.c_void_p] * 5 + [ctypes.c_int] * 4
    function.restype = None
    version = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout
    return function, f"{' '.join(_FLAGS[:2])}, {version.partition(chr(10))[0]}"
