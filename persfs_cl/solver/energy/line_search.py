"""How far to go in a direction: to about where the energy is least along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from persfs_cl._cl.energy import Descent, Sums

_NEAR = 1.5
"""Length by which the least along a parabola may be off: to go there would gain little."""
_TRIALS = 6
_SHORTEST, _SHORTER, _LONGER = 0.1, 0.5, 3.0
"""Bounds of the next length, as shares of one where the energy is higher, and of one where it is lower."""


@dataclass(frozen=True)
class Reached:
    """A place along a direction whose energy is not higher.

    Attributes
    ----------
    length : float
        How far along; 0 where no trial is lower. Then the surface is as it was, but for the descent's terms.
    change : float
        Largest of Z; where no trial is lower, that of the first.
    sums : Sums
        There; the descent's terms are those of this place.
    """

    length: float
    change: float
    sums: Sums


def search(descent: Descent, here: Sums, slope: float, white: float, length: float) -> Reached:
    """Go in the direction that was chosen, to about the least energy.

    Through the energy and its slope here and the energy of a trial goes a parabola; its lowest point is the next trial,
    unless it is near.

    Parameters
    ----------
    descent : Descent
    here : Sums
        Of the surface as it is.
    slope : float
        Fall of the energy along the direction.
    white : float
        Level of ln albedo.
    length : float
        To try first.

    Returns
    -------
    Reached
    """
    best: Reached | None = None
    first = 0.0
    for trial in range(_TRIALS):
        change = descent.move(length)
        first = first if trial else change
        found = Reached(length, change, descent.linearise(white))
        if best is not None and not found.sums.energy <= best.sums.energy:
            descent.go_back()
            break
        bend = (found.sums.energy - here.energy + length * slope) / length**2
        lowest = 0.5 * slope / bend if bend > 0.0 else math.inf
        if found.sums.energy <= here.energy:
            if best is not None or length / _NEAR <= lowest <= length * _NEAR:
                return found
            best = found
            length = min(max(lowest, _SHORTEST * length), _LONGER * length)
        else:
            length = min(max(lowest, _SHORTEST * length), _SHORTER * length)
        descent.go_back()
    if best is None:
        return Reached(0.0, first, here)
    change = descent.move(best.length)
    return Reached(best.length, change, descent.linearise(white))
