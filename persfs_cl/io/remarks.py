"""What decoders of files say, on whatever way, as one error or one warning that names the file."""

from __future__ import annotations

import io
import logging
import os
import re
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from typing import IO

from persfs_cl.checks import warn
from persfs_cl.errors import InputError, PersfsError
from persfs_cl.io.files import FilePath
from persfs_cl.told import DEVELOPERS, hearing, pass_on

_LOGGERS = ("tifffile", "exifread")
_STANDARD_ERROR = 2
_WRITTEN = re.compile(r"Unexpected end of file|data corrupted at \d+|PNG warning: .*")
"""What LibRaw and libpng write there."""
_redirecting = threading.Lock()
# Harmless, or said otherwise.
_IDLE = ("Palette images with Transparency", "is not a valid ORIENTATION")


class _OfThread(threading.local):
    """Where the lines that a thread logs go, if it decodes something."""

    said: list[str] | None = None


_thread = _OfThread()


@contextmanager
def decoding(path: FilePath, failure: str = "is broken or not supported") -> Iterator[None]:
    """A block that decodes one file.

    tifffile and exifread tell of what they find by `logging`, Pillow and NumPy by warnings; both are held back, and
    said in one warning when the block has succeeded. Most decoders in C write nothing on standard error as they are
    used here: Pillow and imagecodecs give libjpeg handlers that are silent, and libtiff is not used. Others do, see
    :func:`heard_on_standard_error`.

    Parameters
    ----------
    path : path
    failure : str
        What an error says that the file is, or cannot be.

    Raises
    ------
    InputError
        Whatever a decoder raises at broken data, and where the memory does not suffice. Errors of this package pass.

    Warns
    -----
    UserWarning
        When a decoder found something odd, and read the file all the same.
    """
    said: list[str] = []
    with hearing() as heard, _logging_to(said):
        try:
            yield
        except PersfsError:
            raise
        except MemoryError as error:
            raise InputError(
                f"{path} is too large: the memory does not suffice. Reduce it to some million pixels first."
            ) from error
        except Exception as error:  # whatever a decoder raises at broken data
            reason = _sentence(str(error)) or type(error).__name__
            raise InputError(f"{path} {failure} ({reason}): save or copy it again.") from error
    pass_on(warning for warning in heard if issubclass(warning.category, DEVELOPERS))
    said += [warning.message for warning in heard if not issubclass(warning.category, DEVELOPERS)]
    remarks = [_sentence(remark) for remark in dict.fromkeys(said) if not any(idle in remark for idle in _IDLE)]
    if remarks:
        more = f", and {len(remarks) - 1} more" if len(remarks) > 1 else ""
        warn(
            f"{path} was read, but is damaged or odd ({remarks[0]}{more}): look at what came of it, or save or copy it "
            "again.",
        )


def _sentence(text: str) -> str:
    """On one line, and not too long."""
    line = " ".join(text.split()).strip(" .")
    return line if len(line) <= 200 else f"{line[:197]}..."


@contextmanager
def heard_on_standard_error() -> Iterator[None]:
    """A block, within :func:`decoding`, in which LibRaw or libpng may write on standard error what they find.

    Their lines are remarks like others. What other threads write meanwhile comes out when the block has ended.
    """
    with _redirecting:
        low, high = b"", io.StringIO()
        try:
            with _descriptor() as kept, redirect_stderr(high):  # libpng writes by way of Python
                try:
                    yield
                finally:
                    kept.seek(0)
                    low = kept.read()
        finally:
            for line in high.getvalue().splitlines(keepends=True):
                if not _is_remark(line) and sys.stderr is not None:
                    sys.stderr.write(line)
            for written in low.splitlines(keepends=True):
                if not _is_remark(written.decode("utf-8", "replace")):
                    os.write(_STANDARD_ERROR, written)


@contextmanager
def _descriptor() -> Iterator[IO[bytes]]:
    """A block in which what is written on standard error, not by way of Python, goes to a file."""
    with tempfile.TemporaryFile() as kept:
        try:
            screen = os.dup(_STANDARD_ERROR)
        except OSError:  # it is closed
            yield kept
            return
        os.dup2(kept.fileno(), _STANDARD_ERROR)
        try:
            yield kept
        finally:
            os.dup2(screen, _STANDARD_ERROR)
            os.close(screen)


def _is_remark(line: str) -> bool:
    """Whether a line is one of these; it is heard then."""
    found = _WRITTEN.search(line)
    if found is None or _thread.said is None:
        return False
    _thread.said.append(found[0])
    return True


@contextmanager
def _logging_to(said: list[str]) -> Iterator[None]:
    """A block in which this thread hears what the libraries log, and nobody else does."""
    for name in _LOGGERS:
        # It stays there: a list of filters that others shorten while a line goes through it lets some of them out.
        logging.getLogger(name).addFilter(_is_for_the_log)
    before, _thread.said = _thread.said, said
    try:
        yield
    finally:
        _thread.said = before


def _is_for_the_log(record: logging.LogRecord) -> bool:
    if _thread.said is None:
        return True
    _thread.said.append(record.getMessage())
    return False
