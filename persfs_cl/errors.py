"""The errors of persfs_cl: every one says what was wrong, with the value, and what to do."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class PersfsError(Exception):
    """Base class of every error that persfs_cl raises on purpose.

    All of them can be pickled and copied, attributes included: an error in a worker process reaches its parent.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        # Exception would call the class with the message alone, whatever else its __init__ wants.
        return _restored, (type(self), self.args), self.__dict__


class InputError(PersfsError, ValueError):
    """An image, mask, depth or option cannot be used as it was given."""


class CameraError(PersfsError, ValueError):
    """The camera is impossible, or a file does not say what the camera was."""


class DeviceError(PersfsError):
    """No OpenCL device fits the request, or the chosen one lacks what was asked of it."""


class KernelBuildError(PersfsError):
    """A kernel did not compile; the message holds the compiler's log with file names and lines."""


class UnavailableError(PersfsError):
    """Something optional cannot be had here; the message says why, and what would bring it."""


class Unfinished(Protocol):
    """What a :class:`persfs_cl.Solution` holds; by this name, because errors are below all that raise them."""

    @property
    def depth(self) -> NDArray[np.float64]:
        """As far as it had come; NaN where nothing was known yet."""

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Pixels that have a depth."""

    @property
    def iterations(self) -> int:
        """How many were done."""

    @property
    def changes(self) -> NDArray[np.float64]:
        """The largest change of each iteration."""

    @property
    def status(self) -> enum.Enum:
        """Why it ended."""

    @property
    def parameters(self) -> Mapping[str, Any]:
        """The keywords, with "auto" resolved."""

    @property
    def device(self) -> Any:
        """The :class:`persfs_cl.Device`."""

    def save(self, path: str) -> list[Path]:
        """Write it to a file or a folder."""


class ConvergenceError(PersfsError):
    """The iteration ended before the tolerance was met, and ``throw=True`` was given.

    Attributes
    ----------
    solution : Solution
        The surface as far as it had come.
    """

    def __init__(self, message: str, solution: Unfinished) -> None:
        super().__init__(message)
        self.solution = solution


def _restored(kind: type[PersfsError], arguments: tuple[object, ...]) -> PersfsError:
    """An error as it was pickled, but for its attributes, which pickle sets."""
    error = kind.__new__(kind)
    error.args = arguments
    return error
