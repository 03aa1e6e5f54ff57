"""The errors of persfs_cl: every one says what was wrong, with the value, and what to do."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from persfs_cl.wording import Spelling, at_place, brief, keyword, marked, parts, worded

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_PLAIN = (str, int, float, complex, type(None), Path)
_FEW = 16
_Same = TypeVar("_Same", bound="Worded")
_Argued = TypeVar("_Argued", bound="ArgumentError")


class Worded(Exception):  # noqa: N818  # no error by itself: warnings are such too
    """A message that keeps apart which keywords it mentions.

    It can be pickled and copied, attributes included: what is raised in a worker process reaches its parent.

    Parameters
    ----------
    message : str
        May mention keywords, see :func:`persfs_cl.wording.keyword`.
    *rest : object
        Further elements of `args`.

    Attributes
    ----------
    parts : tuple of str and Mention
        The message.
    """

    def __init__(self, message: object = "", *rest: object) -> None:
        self.parts = parts(str(message))
        super().__init__(worded(self.parts), *rest)

    def worded(self, spelling: Spelling) -> str:
        """The message, with the keywords that it mentions spelled in another way than Python's."""
        return worded(self.parts, spelling)

    def at(self: _Same, place: object) -> _Same:
        """The same, with a place before the message: an image of many, or a file."""
        return self._saying(parts(at_place(place, marked(self.parts))))

    def adding(self: _Same, remedy: str) -> _Same:
        """The same, with another sentence, which may mention keywords, after the message."""
        return self._saying((*self.parts, " ", *parts(remedy)))

    def _saying(self: _Same, text: tuple[Any, ...]) -> _Same:
        other = _restored(type(self), (worded(text), *self.args[1:]))
        other.__dict__.update(self.__dict__, parts=text)
        return other

    def __reduce__(self) -> tuple[Any, ...]:
        # Exception would call the class with the message alone, whatever else its __init__ wants.
        return _restored, (type(self), self.args), self.__dict__


def spelled(message: Warning | Exception | str, spelling: Spelling) -> str:
    """An error or a warning, ours or another's, with the keywords that it mentions spelled as its readers know them."""
    return message.worded(spelling) if isinstance(message, Worded) else str(message)


class PersfsWarning(Worded, UserWarning):
    """What persfs_cl warns of."""


class PersfsError(Worded):
    """Base class of every error that persfs_cl raises on purpose.

    All of them can be pickled and copied, attributes included: an error in a worker process reaches its parent.
    """


class ArgumentError(PersfsError):
    """An argument cannot be used.

    Attributes
    ----------
    argument : str or None
        Its name; None where no single one is to blame, as when a file cannot be read.
    value : object
        What was given for it. Pickled, it becomes its `repr`, but for a word, a number, or a few of them: an array may
        be larger than what is left of the memory, and an object may not come back.
    place : int or None
        Which image of several it is about, where that was found while they were solved together.
    """

    place: int | None = None

    def __init__(self, message: object = "", *rest: object, argument: str | None = None, value: object = None) -> None:
        super().__init__(message, *rest)
        self.argument = argument
        self.value = value

    @classmethod
    def about(cls: type[_Argued], argument: str, value: object, why: str, *, written: str | None = None) -> _Argued:
        """The error whose message begins with argument and value: `argument=value why`.

        Parameters
        ----------
        argument : str
        value : object
        why : str
            Why it cannot be used, and the remedy. A colon at its beginning follows the value at once.
        written : str, optional
            The value as the message shows it, where `repr` has too many digits.
        """
        mention = keyword(argument, value, written=written)
        return cls(f"{mention}{'' if why.startswith(':') else ' '}{why}", argument=argument, value=value)

    def __reduce__(self) -> tuple[Any, ...]:
        value = self.value if _is_plain(self.value) else brief(self.value)
        return _restored, (type(self), self.args), {**self.__dict__, "value": value}


class InputError(ArgumentError, ValueError):
    """An image, mask, depth or option cannot be used as it was given."""


class CameraError(ArgumentError, ValueError):
    """The camera is impossible, or a file does not say what the camera was."""


class DeviceError(ArgumentError):
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


def _restored(kind: type[_Same], arguments: tuple[object, ...]) -> _Same:
    """An error as it was pickled, but for its attributes, which pickle sets."""
    error = kind.__new__(kind)
    error.args = arguments
    return error


def _is_plain(value: object) -> bool:
    """Whether a value is a word, a number, or a few of them."""
    if isinstance(value, (tuple, list)):
        return len(value) <= _FEW and all(isinstance(each, _PLAIN) for each in value)
    return isinstance(value, _PLAIN)
