"""The numbers that several photographs tell together: those that they do not tell are left out one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.calibration.evidence import BySurface, Evidence
from persfs_cl.calibration.identify import told
from persfs_cl.calibration.least_squares import Fitted, fit
from persfs_cl.calibration.parameters import Assumed, Parameter
from persfs_cl.errors import InputError
from persfs_cl.wording import keyword

Progress = Callable[[int, float], object]

_BOUNDS = ("least", "most", "spread")
_LEVELS = ("gain", "white")
"""Of which a first value can be read off the brightness."""


@dataclass(frozen=True, eq=False)
class Found:
    """What a search has come to.

    Attributes
    ----------
    parameters : list of Parameter
        Those that are told.
    fitted : Fitted
        Of these.
    errors : list of float
        Their standard errors, as users know them.
    reasons : dict
        By the names of the others, why they are not told.
    """

    parameters: list[Parameter]
    fitted: Fitted
    errors: list[float]
    reasons: dict[str, str]


class Search:
    """Photographs, and the numbers that are sought of them.

    Parameters
    ----------
    evidence : sequence of Evidence
        One a photograph.
    parameters : sequence of Parameter
    start : Assumed
    """

    def __init__(self, evidence: Sequence[Evidence], parameters: Sequence[Parameter], start: Assumed) -> None:
        self.evidence, self._parameters, self.start = evidence, list(parameters), start
        sizes = [len(one.places) for one in evidence]
        self.photographs: Indices = np.repeat(np.arange(len(sizes)), sizes)
        clusters = [one.clusters for one in evidence]
        before = np.cumsum([0, *(int(own.max(initial=-1)) + 1 for own in clusters)])
        self._clusters: Indices = np.concatenate(
            [own + begin for own, begin in zip(clusters, before[:-1], strict=True)]
        )
        if self.photographs.size <= len(self._parameters):
            raise InputError(
                f"{keyword('truth')} has {self.photographs.size} known depths that can be used, and "
                f"{len(self._parameters)} numbers are sought ({', '.join(one.name for one in self._parameters)}): give "
                f"more points, or seek less by {keyword('fit')}.",
                argument="truth",
            )

    def assumed(self, parameters: Sequence[Parameter], numbers: Array) -> Assumed:
        """What some numbers mean; all others are as at the start."""
        found = self.start
        for parameter, number in zip(parameters, numbers, strict=True):
            found = parameter.write(found, float(number))
        return found

    def first(self, parameters: Sequence[Parameter]) -> Array:
        """Where a search begins: at the start, with gain and white level by the brightness."""
        numbers = []
        for parameter in parameters:
            if parameter.name in _LEVELS:
                unit = parameter.write(self.start, 0.0)
                level = float(np.median([one.level(unit) for one in self.evidence]))
                # Written so that NaN is refused too.
                if not level > 0.0:
                    raise InputError(
                        f"{keyword('light', self.start.light)} does not reach the surface that is known: give the "
                        "place of the lamp in the unit of its depth.",
                        argument="light",
                    )
                numbers.append(math.log(level))
            else:
                numbers.append(parameter.read(self.start))
        return np.array(numbers, dtype=np.float64)

    def found(self, callback: Progress | None = None) -> Found:
        """Fit, leave out what is not told, and fit again.

        Raises
        ------
        InputError
            When there is no photograph under what is assumed at the start.
        """
        count = 0

        def counted(_step: int, residual: float) -> None:
            nonlocal count
            count += 1
            if callback is not None:
                callback(count, residual)

        parameters = self._parameters
        reasons: dict[str, str] = {}
        begin: dict[str, float] = {}
        while parameters:
            start = self.first(parameters)
            fitted = self._fit(parameters, start, begin, counted)
            kept, errors, more = told(parameters, fitted, self._clusters, by_surface=self._by_surface)
            reasons |= more
            if len(kept) == len(parameters):
                uncertain = [
                    one.uncertainty(float(number), float(error))
                    for one, number, error in zip(parameters, fitted.numbers, errors, strict=True)
                ]
                return Found(parameters, fitted, uncertain, reasons)
            begin = {one.name: float(number) for one, number in zip(parameters, fitted.numbers, strict=True)}
            parameters = [parameters[place] for place in kept]
        nothing = np.zeros(self.photographs.size)
        return Found(
            [], Fitted(np.empty(0), nothing, np.zeros((nothing.size, 0)), nothing, 1.0, converged=True), [], reasons
        )

    def without(self, found: Found, left_out: Mask) -> Assumed:
        """What is found without a part of the data.

        Where residuals are dear, by one step from where all together have led: it is small.
        """
        parameters, fitted = found.parameters, found.fitted
        if not parameters:
            return self.start
        start = self.first(parameters)
        least, most, spread = (np.array([getattr(one, name) for one in parameters]) for name in _BOUNDS)
        numbers = np.clip(fitted.step((~left_out).astype(np.float64), start, spread), least, most)
        if self._fineness < 1.0:
            begin = {one.name: float(number) for one, number in zip(parameters, numbers, strict=True)}
            numbers = self._fit(parameters, start, begin, None, left_out).numbers
        return self.assumed(parameters, numbers)

    @property
    def _by_surface(self) -> bool:
        return all(isinstance(one, BySurface) for one in self.evidence)

    @property
    def _fineness(self) -> float:
        return max(one.fineness for one in self.evidence)

    def _fit(
        self,
        parameters: Sequence[Parameter],
        start: Array,
        begin: dict[str, float],
        callback: Progress | None,
        left_out: Mask | None = None,
    ) -> Fitted:
        def residuals(numbers: Array) -> Array:
            assumed = self.assumed(parameters, numbers)
            found = np.concatenate([one.residuals(assumed) for one in self.evidence])
            return found if left_out is None else np.where(left_out, np.nan, found)

        from_there = np.array(
            [begin.get(one.name, float(number)) for one, number in zip(parameters, start, strict=True)]
        )
        return fit(residuals, self.photographs, parameters, from_there, start, self._fineness, callback)
