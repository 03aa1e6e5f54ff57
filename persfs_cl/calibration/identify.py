"""What a fit can tell: the standard errors of its numbers, and which of them the data leave open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array, Indices
from persfs_cl.calibration.least_squares import Fitted
from persfs_cl.calibration.parameters import Parameter

_CONFOUNDED = 5.0
"""How many times better a number would be known if the others were, where it is taken to be one with another."""
_NEVER = 1e4
"""In ranges: what nothing depends on is known no better than that."""
_ROUNDING = 1e-12
"""Share of the largest eigenvalue below which one is rounding errors."""


@dataclass(frozen=True, eq=False)
class Precision:
    """How well numbers are known, all at once.

    Attributes
    ----------
    errors : ndarray of float64, shape (parameters,)
        Standard errors.
    inflation : ndarray of float64, shape (parameters,)
        How many times less each would be if all others were known.
    correlation : ndarray of float64, shape (parameters, parameters)
    """

    errors: Array
    inflation: Array
    correlation: Array

    @classmethod
    def of(cls, fitted: Fitted, clusters: Indices, spread: Array, used: Sequence[int]) -> Precision:
        """Of some of the numbers of a fit, the others being known.

        The sandwich estimate, with residuals of one cluster taken together: neighbouring pixels err alike.
        """
        # In units of what is plausible, so that all numbers are of one size.
        unit = spread[list(used)]
        jacobian = fitted.jacobian[:, used] * unit
        values, vectors = np.linalg.eigh(fitted.information[np.ix_(used, used)] * np.outer(unit, unit))
        least = max(_NEVER**-2, _ROUNDING * float(values.max()))
        values = np.maximum(values, least)
        inverse = (vectors / values) @ vectors.T
        pulls = jacobian * (fitted.weights * np.nan_to_num(fitted.residuals))[:, None]
        present = fitted.weights > 0.0
        _, members = np.unique(clusters[present], return_inverse=True)
        count = int(members.max(initial=-1)) + 1
        sums = np.zeros((count, len(used)))
        np.add.at(sums, members, pulls[present])
        small = count / max(1, count - len(used)) / fitted.response**2
        sandwich = small * inverse @ (sums.T @ sums) @ inverse
        # What nothing bounds has no pull, and no spread by the sandwich.
        open_ends = np.einsum("ik,k->i", vectors**2, np.where(values <= least, 1.0 / values, 0.0))
        deviation = np.sqrt(np.diag(inverse))
        return cls(
            unit * np.sqrt(np.maximum(np.diag(sandwich), np.diag(inverse)) + open_ends),
            np.sqrt(np.einsum("ik,k->i", vectors**2, values)) * deviation,
            inverse / np.outer(deviation, deviation),
        )


def told(
    parameters: Sequence[Parameter], fitted: Fitted, clusters: Indices, *, by_surface: bool = False
) -> tuple[list[int], Array, dict[str, str]]:
    """Which numbers the data tell, their standard errors, and of the others why not.

    One is left out after the other, the last first: without it those before it may well be told.

    Parameters
    ----------
    parameters : sequence of Parameter
    fitted : Fitted
    clusters : ndarray of int, shape (n,)
        Which residuals err alike.
    by_surface : bool
        Whether all residuals are of a surface that was reconstructed. What it errs by itself, on a grid, is no noise:
        it goes into numbers that nearly do the same, however small their standard errors are.
    """
    spread = np.array([one.spread for one in parameters])
    accuracy = np.array([one.accuracy for one in parameters])
    used = list(range(len(parameters)))
    reasons: dict[str, str] = {}
    while used:
        precision = Precision.of(fitted, clusters, spread, used)
        unsure = precision.errors > accuracy[used]
        for place in reversed(range(len(used))):
            one, error = parameters[used[place]], float(precision.errors[place])
            partner = _partner(precision, place)
            tied = precision.inflation[place] > _CONFOUNDED and partner is not None
            if tied and partner is not None and (by_surface or unsure[place] or unsure[partner]):
                other = parameters[used[partner]]
                reasons[one.name] = (
                    f"{one.said} and {other.said} cannot be told apart: the photographs are nearly the same when both "
                    f"change together (correlation {precision.correlation[place, partner]:+.3f})"
                )
            elif error > one.spread:
                number = float(fitted.numbers[used[place]])
                reasons[one.name] = (
                    f"the photographs hardly depend on {one.said}: they leave it open by "
                    f"{one.uncertainty(number, error):.2g} or more, which is all that it may plausibly be"
                )
            else:
                continue
            del used[place]
            break
        else:
            return used, precision.errors, reasons
    return used, np.empty(0), reasons


def _partner(precision: Precision, place: int) -> int | None:
    """The other number that goes most with one."""
    shared = np.abs(precision.correlation[place])
    shared[place] = 0.0
    return int(shared.argmax()) if shared.size > 1 else None
