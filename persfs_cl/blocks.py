"""Images worked on by blocks of rows that stay in a processor's cache.

Over whole images the intermediate arrays of an expression would cost more than its arithmetic: memory that the system
hands out afresh, and several ways to it and back.
"""

from __future__ import annotations

from collections.abc import Iterator

_PIXELS = 2**16


def row_blocks(shape: tuple[int, ...]) -> Iterator[slice]:
    """Rows of an image of shape (height, width), some at a time."""
    height, width = shape
    step = max(1, _PIXELS // width)
    for begin in range(0, height, step):
        yield slice(begin, min(begin + step, height))
