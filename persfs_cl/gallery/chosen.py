"""Few of many, evenly chosen, without knowing how many there are."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

_Any = TypeVar("_Any")


def evenly_chosen(many: Iterable[_Any], most: int) -> tuple[list[_Any], int]:
    """At most so many of them, evenly spread and in their order, and how many there were.

    Never more than twice as many are kept at a time.
    """
    kept: list[_Any] = []
    step, count = 1, 0
    for count, one in enumerate(many, start=1):
        if (count - 1) % step == 0:
            kept.append(one)
        if len(kept) > 2 * most:
            kept = kept[::2]
            step *= 2
    fewer = min(len(kept), most)
    return [kept[(2 * place + 1) * len(kept) // (2 * fewer)] for place in range(fewer)], count
