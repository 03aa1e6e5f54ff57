"""Warnings heard where they are given: in this thread, and about this image of several.

Python has one place for all that threads warn of. Whoever listens for a while, by :func:`hearing`, therefore takes a
lock, and keeps others who listen waiting. A process that is the package's own, such as a worker, calls :func:`listen`
once: from then on each thread hears its own warnings, and none waits.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

DEVELOPERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ImportWarning, ResourceWarning)
"""What is meant for those who write code, not for those who run it."""


@dataclass(frozen=True)
class Heard:
    """A warning.

    Attributes
    ----------
    warning : Warning
    category : type
    file : str
    line : int
        Where it was given.
    place : int or None
        Which image of several it is about, if :func:`concerning` told.
    """

    warning: Warning
    category: type[Warning]
    file: str
    line: int
    place: int | None = None

    @property
    def message(self) -> str:
        """As plain text."""
        return str(self.warning)


class _OfThread(threading.local):
    """What a thread is about."""

    def __init__(self) -> None:
        self.listeners: list[list[Heard]] = []
        self.place: int | None = None


class _Process:
    """What all threads share: whether each has its own warnings, and what shows those that nobody listens to."""

    # Of two threads at once that change it, the one that ends last would bring back what the other had set.
    changing = threading.RLock()
    listens = False
    show = staticmethod(warnings.showwarning)


_thread = _OfThread()


def listen() -> None:
    """Give each thread of this process its own warnings, for good.

    For processes in which nobody else listens: `warnings.showwarning` is replaced, and the filters let everything
    through but what is for developers. A warning that no :func:`hearing` waits for is shown as before.
    """
    with _Process.changing:
        _take_over()
        for category in DEVELOPERS:
            warnings.simplefilter("ignore", category)
        _Process.listens = True


@contextmanager
def hearing() -> Iterator[list[Heard]]:
    """A block whose warnings, of this thread, go to a list instead of to the user.

    Blocks within blocks hear for themselves alone. Unless the process listens, see :func:`listen`, the filters are what
    they were once the block has ended, what is for developers is heard too, and other threads that come to such a block
    wait until then.

    Yields
    ------
    list of Heard
        Grows within the block.
    """
    heard: list[Heard] = []
    if _Process.listens:
        # A `warnings.catch_warnings` in another thread may have brought back what was there before.
        if warnings.showwarning is not _route:
            listen()
        with _listener(heard):
            yield heard
    else:
        with _Process.changing, warnings.catch_warnings(), _listener(heard):
            _take_over()
            yield heard


@contextmanager
def overhearing() -> Iterator[list[Warning]]:
    """A block whose warnings go to a list too, as soon as they are shown to the user.

    For the main thread of a program that nothing else listens in: `warnings.showwarning` is replaced until the end.

    Yields
    ------
    list of Warning
        Those for users, not for developers. Grows within the block.
    """
    heard: list[Warning] = []
    usual = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *place: Any, **where: Any) -> None:
        if not issubclass(category, DEVELOPERS):
            heard.append(message if isinstance(message, Warning) else category(message))
        usual(message, category, *place, **where)

    warnings.showwarning = show
    try:
        yield heard
    finally:
        warnings.showwarning = usual


@contextmanager
def concerning(place: int) -> Iterator[None]:
    """A block whose warnings, of this thread, are about one image of several.

    Parameters
    ----------
    place : int
        Its number among them.
    """
    before, _thread.place = _thread.place, place
    try:
        yield
    finally:
        _thread.place = before


def pass_on(heard: Iterable[Heard]) -> None:
    """Warn of what a :func:`hearing` has heard, but is for others."""
    for each in heard:
        warnings.warn_explicit(each.warning, each.category, each.file, each.line)


@contextmanager
def _listener(heard: list[Heard]) -> Iterator[None]:
    _thread.listeners.append(heard)
    try:
        yield
    finally:
        _thread.listeners.pop()


def _take_over() -> None:
    if warnings.showwarning is not _route:
        _Process.show = staticmethod(warnings.showwarning)
        warnings.showwarning = _route
    warnings.simplefilter("always")


def _route(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """In place of `warnings.showwarning`."""
    if _thread.listeners:
        warning = message if isinstance(message, Warning) else category(message)
        _thread.listeners[-1].append(Heard(warning, category, filename, lineno, _thread.place))
    else:
        _Process.show(message, category, filename, lineno, file, line)
