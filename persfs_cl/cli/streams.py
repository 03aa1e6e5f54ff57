"""Standard streams that are closed, full or without a reader: the work is done all the same, and the status says so."""

from __future__ import annotations

import errno
import io
import os
import sys
from typing import Any, TextIO


class _Lasting(io.FileIO):
    """A stream that never raises: what cannot be written, and all after that, goes nowhere."""

    failure: OSError | None = None

    def write(self, data: Any, /) -> int:
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        return memoryview(data).nbytes


def open_streams() -> None:
    """Make standard output and error safe to write to, whatever they are.

    Those that are closed are opened on nothing first, or the next files opened would take their numbers, and receive
    what the OpenCL driver says.
    """
    if sys.stdin is None:
        _open_on_nothing(os.O_RDONLY)
    # For reading: what is printed all the same is an error.
    sys.stdout = _lasting(sys.stdout, os.O_RDONLY)
    sys.stderr = _lasting(sys.stderr, os.O_WRONLY)


def unwritten() -> str | None:
    """Why something printed did not reach standard output; None where all did, "" where the reader has left."""
    sys.stdout.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    failure = raw.failure if isinstance(raw, _Lasting) else None
    if failure is None:
        return None
    return "" if failure.errno == errno.EPIPE else str(failure.strerror)


def _lasting(stream: TextIO | None, otherwise: int) -> TextIO:
    if stream is None:
        return io.TextIOWrapper(_writer(_open_on_nothing(otherwise)), errors="backslashreplace")
    if not isinstance(stream, io.TextIOWrapper) or (os.name == "nt" and stream.isatty()):
        return stream  # no file at all, or a console of Windows
    return io.TextIOWrapper(
        _writer(stream.fileno()),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _writer(number: int) -> io.BufferedWriter:
    return io.BufferedWriter(_Lasting(number, "w", closefd=False))


def _open_on_nothing(flags: int) -> int:
    number = os.open(os.devnull, flags)
    # As standard streams are: the driver may start a linker.
    os.set_inheritable(number, True)
    return number
