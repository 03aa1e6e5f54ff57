"""Safeguarded Anderson acceleration of an iteration that converges slowly, image by image.

After every few iterations, which make G of X, the next values are a mixture of those that were reached before: that of
which F = G - X is smallest, as if F were linear. The iteration assigns values instead of letting them only fall, so
that it has the scheme's own limit wherever a mixture lies. A mixture after which F is larger is taken back.

Of materials that are not Lambertian, slopes much steeper than the surface's can make assigned values rise for ever.
Until the first mixture values only fall: what comes to lie more than the width of a pixel above what they had come to
has gone astray, and begins again from there.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.anderson import DEPTH, Products

ITERATIONS = 4
"""Between two mixtures: these then cost a third of them in memory traffic."""

_FORMED = 0.3
"""Change of an iteration, in widths of a pixel at unit distance, below which the surface has taken shape: mixtures of
fronts on their way lead astray."""
_ASTRAY = 1.0
"""Rise above what was noted first, in the same widths, from which on values have gone astray."""
_GROWTH = 2.0
"""Of |F| after a mixture that is not taken back."""
_PATIENCE = 2
"""Launches without a mixture after the first that was taken back, and twice as many after each further one."""
_IN_VAIN = 16
"""Mixtures after which |F| must be smaller: rounding is reached, or nothing is gained."""
_LEAST_LEFT = 0.5
"""Of F after a mixture, whatever it promises: the equation is not linear."""
_RIDGE = 1e-8
"""Added to the diagonal of the normalised products, which are of nearly parallel differences."""
_LATEST = 5
"""Differences of which the one that shrinks least stands for what shrinks least of all."""


class Acceleration:
    """What is known of an image on its way to the limit.

    Parameters
    ----------
    rounding : float
        Spacing of the numbers about 1.
    pixel : float
        Smaller side of a pixel at unit distance.

    Attributes
    ----------
    distance : float
        Estimate of max |Z - limit|, rather too large; NaN as long as there is none, and 0 once values begin again from
        above the limit.
    gives_up : bool
        Whether mixtures help no more.
    is_astray : bool
        Whether values must begin again from what was noted first.
    is_rounding : bool
        Whether what still changes is what rounding makes of it.
    """

    def __init__(self, rounding: float, pixel: float) -> None:
        self.distance = math.nan
        self.gives_up = self.is_astray = False
        self._pixel = pixel
        self._noted = 0
        """Launches that follow each other, of which the device keeps the latest."""
        self._products = np.zeros((0, 0))
        self._last = math.inf
        self._waiting = 0
        self._patience = _PATIENCE
        self._rates: deque[float] = deque(maxlen=_LATEST)
        self.is_rounding = False
        self._rounding = rounding
        self._slowest = 0.0
        """The last of the rates of which the sum ends."""
        self._smallest = math.inf
        self._in_vain = 0

    def is_due(self, change: float) -> bool:
        """Whether a launch follows iterations of which the last changed that much."""
        if self.gives_up:
            return False
        if self._waiting:
            self._waiting -= 1
            return False
        return self._noted > 0 or change < _FORMED * self._pixel

    def weights(self, found: Products) -> NDArray[np.float64]:
        """Of the latest differences in the next mixture; none at first."""
        self._noted += 1
        if not (math.isfinite(found.squares) and found.rise <= _ASTRAY * self._pixel):
            return self._given_up()
        size = math.sqrt(found.squares)
        if self._noted <= 2:
            # What was noted first has nothing before it.
            self._last = size if self._noted == 2 else math.inf
            return np.zeros(0)
        if not size <= _GROWTH * self._last:
            return self._taken_back()
        self._last = size
        self._in_vain += 1
        if size < self._smallest:
            self._smallest, self._in_vain = size, 0
        self.gives_up = self._in_vain >= _IN_VAIN
        count = min(self._noted - 2, DEPTH)
        self._note(found, count)
        squares = np.diag(self._products)
        # Where nothing moved a difference counts for nothing.
        scale = np.divide(1.0, np.sqrt(squares), out=np.zeros(count), where=squares > 0.0)
        normal = self._products * scale[:, None] * scale + _RIDGE * np.eye(count)
        found_weights: NDArray[np.float64] = scale * np.linalg.solve(normal, scale * found.of_residual[:count])
        # With fewer differences it may not have been seen yet what shrinks slowly.
        if count == DEPTH:
            self._judge(found, found_weights)
        # Nobody could tell how far above the limit values would have to be put.
        return self._given_up() if self.gives_up and math.isnan(self.distance) else found_weights

    def _given_up(self) -> NDArray[np.float64]:
        """Begin again from what was noted first, which lies above the limit as it is, without mixtures."""
        self.gives_up = self.is_astray = True
        self.distance = 0.0
        return np.zeros(0)

    def _taken_back(self) -> NDArray[np.float64]:
        """Go on from what was noted before, and begin anew after a while."""
        self._noted, self._waiting, self._patience = 0, self._patience, 2 * self._patience
        self._products = np.zeros((0, 0))
        return np.ones(1)

    def _note(self, found: Products, count: int) -> None:
        """Products of all differences with each other, the latest first."""
        known = self._products[: count - 1, : count - 1]
        self._products = np.empty((count, count))
        self._products[1:, 1:] = known
        self._products[0] = self._products[:, 0] = found.of_steps[:count]
        moved = found.value_squares - 2.0 * found.across + found.of_steps[0]
        self._rates.append(math.sqrt(found.value_squares / moved) if moved > 0.0 else math.inf)

    def _judge(self, found: Products, weights: NDArray[np.float64]) -> None:
        """What of F the mixture does not take away is a change that shrinks at the slowest rate, at worst."""
        rate = max(self._rates)
        shrinks = rate < 1.0
        small = found.largest <= ITERATIONS * self._rounding
        # Of values that only rounding moves, differences have any rate.
        if shrinks and not (small and self._slowest):
            self._slowest = rate
        self.is_rounding = small and (not shrinks or self._in_vain >= _IN_VAIN // 4)
        share = 1.0 - float(weights @ found.of_residual[: len(weights)]) / found.squares if found.squares else 0.0
        left = found.largest * max(_LEAST_LEFT, math.sqrt(max(0.0, share)))
        known = shrinks or (self.is_rounding and self._slowest > 0.0)
        self.distance = left * self._slowest / (1.0 - self._slowest) if known else math.nan
