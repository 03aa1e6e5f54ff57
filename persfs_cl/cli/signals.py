"""Signals that ask a program to end: Ctrl-C, SIGTERM as schedulers send it, SIGHUP from a terminal that is closed.

Imports next to nothing, so that they are answered from the start.
"""

from __future__ import annotations

import os
import signal

from persfs_cl.cli.status import INTERRUPTED

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import Any, TypeAlias

    Handler: TypeAlias = Callable[[int, FrameType | None], None]

_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def answer(handler: Handler) -> dict[int, Any]:
    """Let a function answer the signals, but for those that are ignored: a shell starts background jobs so.

    Returns
    -------
    dict
        Signals, and what answered them before. Empty outside of the main thread, which alone may set them.
    """
    before = {}
    for number in _SIGNALS:
        usual = signal.getsignal(number)
        if usual in (signal.SIG_IGN, None):
            continue
        try:
            signal.signal(number, handler)
        except ValueError:
            break
        before[number] = usual
    return before


def leave_at_once(_number: int, _frame: FrameType | None) -> None:
    """End the process where it is: for as long as there is nothing to clean up, and nobody to catch an exception.

    An exception would be swallowed by some of the modules that are being imported, and garbled by others.
    """
    say("persfs-cl: interrupted.\n")
    os._exit(INTERRUPTED)


def say(text: str) -> None:
    """Write to standard error, from a function that may run in the middle of a print."""
    try:  # noqa: SIM105  # suppress() would have to be imported
        os.write(2, text.encode())
    except OSError:
        pass
