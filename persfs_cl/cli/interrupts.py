"""How Ctrl-C, SIGTERM and SIGHUP end a command that is at work, and what it keeps then."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from persfs_cl.cli.signals import answer, say

if TYPE_CHECKING:
    from persfs_cl.cli.signals import Handler

_TOGETHER = 1.0
"""Seconds. `timeout` sends its signal twice at once, and a closed terminal sends SIGHUP by the shell and by itself."""

_INSISTS = 0.5
"""Seconds between two interrupts in place of a dropped one: time enough for the first to end the block."""


class _Last:
    """The signal that was heard last."""

    number: int = signal.SIGINT
    time = -float("inf")


@contextmanager
def answered(handler: Handler) -> Iterator[None]:
    """Let a function answer the signals until the block ends, as :func:`persfs_cl.cli.signals.answer` does."""
    before = answer(handler)
    try:
        yield
    finally:
        for number, usual in before.items():
            signal.signal(number, usual)


@contextmanager
def raising() -> Iterator[None]:
    """Let the signals raise KeyboardInterrupt, and be sure that it ends the block.

    Python drops exceptions in the callbacks of weak references, which drawing runs by the thousand. A dropped
    KeyboardInterrupt is raised again a moment later, until it ends the block.
    """
    usual = sys.unraisablehook
    ended = threading.Event()

    def insist() -> None:
        pause = 0.01
        while not ended.wait(pause):
            _Last.time = -float("inf")
            _thread.interrupt_main(signal.Signals(_Last.number))
            pause = _INSISTS

    def again(dropped: sys.UnraisableHookArgs) -> None:
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            threading.Thread(target=insist, daemon=True).start()
        elif not interrupted:
            usual(dropped)

    interrupted = False
    sys.unraisablehook = again
    _Last.time = -float("inf")
    try:
        with answered(_interrupt):
            yield
    except KeyboardInterrupt:
        # To the end of the process: objects that were half made when it came complain when they are taken down.
        interrupted = True
        ended.set()
        raise
    finally:
        ended.set()
        if not interrupted:
            sys.unraisablehook = usual


@contextmanager
def stop_on_interrupt(what: str = "the surface as it is will be written.") -> Iterator[Callable[[], bool]]:
    """Let the signals ask for an end once there is something to keep; before that, and the second time, they interrupt.

    Parameters
    ----------
    what : str
        Happens then.

    Yields
    ------
    callable
        Whether an end was asked for. Its first call says that from now on there is something to keep.
    """
    pressed = threading.Event()
    asking = False

    def ask(number: int, frame: FrameType | None) -> None:
        if pressed.is_set():
            _interrupt(number, frame)
        elif not _is_repeated(number):
            pressed.set()
            say(f"persfs-cl: stopping; {what} Ctrl-C again to leave at once.\n")

    with ExitStack() as answers:

        def asked() -> bool:
            nonlocal asking
            if not asking:
                asking = True
                answers.enter_context(answered(ask))
            return pressed.is_set()

        yield asked


def _interrupt(number: int, _frame: FrameType | None) -> None:
    if not _is_repeated(number):
        raise KeyboardInterrupt


def _is_repeated(number: int) -> bool:
    """Whether a signal only comes along with one before. Ctrl-C never does: somebody pressed it again."""
    now = time.monotonic()
    if number != signal.SIGINT and now - _Last.time < _TOGETHER:
        return True
    _Last.number, _Last.time = number, now
    return False
