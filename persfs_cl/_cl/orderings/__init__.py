"""The orderings: what users type, and how it is done on a device."""

from __future__ import annotations

from collections.abc import Callable

from persfs_cl._cl.orderings.choices import checkerboard, wavefront
from persfs_cl._cl.orderings.lexicographic import Lexicographic
from persfs_cl._cl.orderings.ordering import Ordering, Setup
from persfs_cl.checks import check_choice

ORDERINGS: dict[str, Callable[[Setup], Ordering]] = {
    "wavefront": wavefront,
    "checkerboard": checkerboard,
    "lexicographic": Lexicographic.of,
}
"""By what users type, what chooses a class, and its sizes, for images and a device."""
REST_EARLY = ("wavefront",)
"""Those in which the distance from the limit is bounded where parts rest of which the changes are small."""


def ordering_for(name: str, setup: Setup) -> Ordering:
    """The ordering of that name as it suits images and a device.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    check_choice("ordering", name, tuple(ORDERINGS))
    return ORDERINGS[name](setup)
