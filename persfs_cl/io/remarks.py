"""What decoders of files say, on whatever way, as one error or one warning that names the file."""

from __future__ import annotations

import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from persfs_cl.checks import changing_warnings, warn
from persfs_cl.errors import InputError, PersfsError
from persfs_cl.io.files import FilePath

_DEVELOPERS = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ImportWarning, ResourceWarning)
# Harmless, or said otherwise.
_IDLE = ("Palette images with Transparency", "is not a valid ORIENTATION")


@contextmanager
def decoding(path: FilePath, failure: str = "is broken or not supported") -> Iterator[None]:
    """A block that decodes one file.

    tifffile tells of what it finds by `logging`, Pillow and NumPy by warnings; both are held back, and said in one
    warning when the block has succeeded. The decoders in C write nothing on standard error as they are used here:
    Pillow and imagecodecs give libjpeg and libpng handlers that are silent, and libtiff is not used.

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
    thread = threading.get_ident()
    said: list[str] = []

    def hold_back(record: logging.LogRecord) -> bool:
        if record.thread != thread:
            return True
        said.append(record.getMessage())
        return False

    logger = logging.getLogger("tifffile")
    with changing_warnings:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            logger.addFilter(hold_back)
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
            finally:
                logger.removeFilter(hold_back)
        for warning in caught:
            if issubclass(warning.category, _DEVELOPERS):
                warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
            else:
                said.append(str(warning.message))
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
