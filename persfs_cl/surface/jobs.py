"""Files made several at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TypeVar

from persfs_cl.blocks import usable_cores

_Result = TypeVar("_Result")

_LARGE = 2**20
"""Pixels from which on threads are worth it: of a smaller surface almost all time goes into drawing, which Python lets
only one thread do at a time."""


def threads_for(pixels: int) -> int:
    """How many threads are worth it for the files of a surface of so many pixels that has the processor for itself."""
    return usable_cores() if pixels >= _LARGE else 1


class Jobs:
    """What is to be done, by some threads at once, or by the caller where there is but one.

    A context: when it ends early, nothing more is begun, and what is at work ends first.

    Parameters
    ----------
    threads : int
    """

    def __init__(self, threads: int) -> None:
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def __enter__(self) -> Jobs:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def add(self, job: Callable[[], _Result]) -> Callable[[], _Result]:
        """Have something done.

        Returns
        -------
        callable
            Waits for its result, or raises its error. With one thread it does the job, only then.
        """
        return job if self._pool is None else self._pool.submit(job).result
