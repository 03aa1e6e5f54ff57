"""How far an iteration still is from its limit, by the rate at which its changes shrink."""

from __future__ import annotations

import math
from collections.abc import Sequence

_SHARE = 0.3
"""Of the iterations, the latest, over which the rate is taken: the slowest mode comes to the fore only late."""
_FEW = 12
"""Up to so many, the rate of the last iteration alone counts too: that share of them may be of another kind."""


def distance_to_limit(changes: Sequence[float], rounding: float) -> float:
    """Estimate max |Z - limit| after some iterations.

    Changes that shrink by a factor r from each iteration to the next are a geometric series: after the change c there
    are c r / (1 - r) to come.

    Parameters
    ----------
    changes : sequence of float
        max |ΔZ| of each iteration from the start of the run.
    rounding : float
        Spacing of the numbers about 1. Where nothing changes any more, each value is within half of it of what the
        next iteration would make of it; and that, too, would have gone on.

    Returns
    -------
    float
        NaN where the changes do not shrink, or are too few to tell.
    """
    last = len(changes) - 1
    while last >= 0 and changes[last] == 0.0:
        last -= 1
    at_rest = last < len(changes) - 1
    rate = _rate(changes, last) if last > 0 else math.inf
    if rate >= 1.0:
        return 0.0 if at_rest else math.nan
    change = min(changes[last], 0.5 * rounding) if at_rest else changes[last]
    return change * rate / (1.0 - rate)


def _rate(changes: Sequence[float], last: int) -> float:
    """By which the changes shrink up to that place."""
    spans = {max(1, int(_SHARE * last))} | ({1} if last < _FEW else set())
    return max(math.exp(math.log(changes[last] / max(changes[last - span], changes[last])) / span) for span in spans)
