"""Shares of the photographs of a batch, which runs do beside each other."""

from __future__ import annotations

import zlib
from typing import Any

from persfs_cl.checks import as_whole_number
from persfs_cl.errors import InputError

Shard = tuple[int, int]
"""Number, from 1, and how many there are."""


def is_in(shard: Shard | None, name: str) -> bool:
    """Whether a photo belongs to a share: by its name alone, so that more photos change nothing for the others."""
    return shard is None or zlib.crc32(name.encode("utf-8", "surrogateescape")) % shard[1] == shard[0] - 1


def as_shard(given: Any) -> Shard | None:
    """A share: its number, from 1, and how many there are.

    Raises
    ------
    InputError
        When it is none.
    """
    if given is None:
        return None
    try:
        number, count = given
    except (TypeError, ValueError):
        raise InputError.about(
            "shard", given, "is no share: give two numbers, (2, 8) for the second of eight."
        ) from None
    number, count = (as_whole_number("shard", each, least=0) for each in (number, count))
    if not 1 <= number <= count:
        raise InputError(
            f"there is no share {number}/{count}: the first number is from 1 to the second, as in 2/8.",
            argument="shard",
            value=given,
        )
    return number, count
