"""How much of the memory the photos in work may take, and how much one of them takes."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

from persfs_cl.surface.formats import FORMATS
from persfs_cl.surface.saving import Saving

BYTES_PER_PROCESS = 500 * 2**20
"""What a process takes that has no photo in hand: Python, the libraries, the driver and its compiler."""
_BYTES_PER_PHOTO = 8 * 2**20
"""Of a photo of any size."""
_BYTES_PER_DRAWING = 64 * 2**20
"""Of one that has drawings, which have a size of their own."""
# The most that was seen over reading, preparing, solving and writing, with a third to spare: of one photo alone, of 1.4
# million pixels, under all lights, in both orders and precisions, with all maps. Without maps it is about half of that.
_BYTES_PER_PIXEL = 350
_OF_ROUNDS = 250
"""Besides, where the image is corrected and solved again: by the surface found, or by a guide."""
_OF_ENERGY = 500
"""Besides, for a scheme that minimises an energy, where the device has no memory of its own."""


def bytes_for(pixels: int, saving: Saving, *, in_rounds: bool = False, by_energy: bool = False) -> int:
    """Bytes of memory that a photo takes at most, from reading to writing.

    Parameters
    ----------
    pixels : int
    saving : Saving
        The files to be written. What is made one after the other is not held together, so that the greediest counts.
    in_rounds : bool
        Whether the light and the material take rounds, or a guide does.
    by_energy : bool
        Whether the scheme minimises an energy.
    """
    kinds = [FORMATS[file] for file in saving.files]
    drawn = any(one.kind == "picture" for one in kinds)
    per_pixel = max((one.memory for one in kinds), default=0)
    return (_BYTES_PER_DRAWING if drawn else _BYTES_PER_PHOTO) + pixels * (
        max(_BYTES_PER_PIXEL, per_pixel) + _OF_ROUNDS * in_rounds + _OF_ENERGY * by_energy
    )


class Memory(Protocol):
    """Who gives memory to photos, known by their numbers."""

    def ask(self, number: int, wanted: int, granted: Callable[[], None]) -> None:
        """Have `granted` called once there is room, by any thread."""

    def give_back(self, number: int) -> None:
        """Give back what a photo took, if it took any, and ask for it no more."""


class Room:
    """Bytes that may be taken, in the order of asking; what is larger than all of them waits for all."""

    def __init__(self, size: int) -> None:
        self._size, self._left = size, size
        self._taken: dict[int, int] = {}
        self._asking: deque[tuple[int, int, Callable[[], None]]] = deque()
        self._lock = threading.RLock()

    def ask(self, number: int, wanted: int, granted: Callable[[], None]) -> None:
        """See :class:`Memory`."""
        with self._lock:
            self._asking.append((number, min(wanted, self._size), granted))
            self._serve()

    def give_back(self, number: int) -> None:
        """See :class:`Memory`."""
        with self._lock:
            self._left += self._taken.pop(number, 0)
            self._asking = deque(one for one in self._asking if one[0] != number)
            self._serve()

    def _serve(self) -> None:
        # In this order: small ones would overtake a large one for ever.
        while self._asking and self._asking[0][1] <= self._left:
            number, wanted, granted = self._asking.popleft()
            self._left -= wanted
            self._taken[number] = self._taken.get(number, 0) + wanted
            granted()
