"""What decoders of files say, on whatever way, as one error or one warning that names the file."""

from __future__ import annotations

import logging
import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from persfs_cl.checks import warn
from persfs_cl.errors import InputError, PersfsError
from persfs_cl.io.files import FilePath
from persfs_cl.told import DEVELOPERS, hearing, pass_on

_LOGGERS = ("tifffile", "exifread")
_STANDARD_ERROR = 2
_LIBRAW = re.compile(rb"Unexpected end of file|data corrupted at \d+")
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
    used here: Pillow and imagecodecs give libjpeg and libpng handlers that are silent, and libtiff is not used. LibRaw
    does, see :func:`heard_on_standard_error`.

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
    """A block, within :func:`decoding`, in which LibRaw may write on standard error what it finds.

    Its lines are remarks like others. What other threads write meanwhile comes out when the block has ended.
    """
    with _redirecting:
        try:
            screen = os.dup(_STANDARD_ERROR)
        except OSError:  # it is closed
            yield
            return
        with tempfile.TemporaryFile() as kept:
            os.dup2(kept.fileno(), _STANDARD_ERROR)
            try:
                yield
            finally:
                os.dup2(screen, _STANDARD_ERROR)
                os.close(screen)
                kept.seek(0)
                for line in kept:
                    found = _LIBRAW.search(line)
                    if found and _thread.said is not None:
                        _thread.said.append(found[0].decode("ascii"))
                    else:
                        os.write(_STANDARD_ERROR, line)


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
