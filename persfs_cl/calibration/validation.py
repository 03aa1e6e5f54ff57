"""How far photographs are from being explained, before a fit and after it, by parts that the fit has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Indices
from persfs_cl.calibration.evidence import BySurface, Evidence
from persfs_cl.calibration.parameters import Assumed
from persfs_cl.calibration.result import CalibrationErrors
from persfs_cl.calibration.search import Found, Search
from persfs_cl.errors import InputError
from persfs_cl.shading.model import Light

_FOLDS = 5


def validated(
    search: Search, found: Found, device: int | str | Device | None
) -> tuple[CalibrationErrors, CalibrationErrors, str]:
    """Errors at the start and after the fit, and what the parts were.

    Parameters
    ----------
    search : Search
    found : Found
        What it has come to.
    device : optional
        As for :func:`persfs_cl.reconstruct`.
    """
    evidence = search.evidence
    several = len(evidence) > 1
    folds = [np.full(len(one.places), number) if several else one.folds(_FOLDS) for number, one in enumerate(evidence)]
    together = np.concatenate(folds)
    values = [search.without(found, together == fold) for fold in range(len(evidence) if several else _FOLDS)]
    before: dict[str, list[Array]] = {}
    after: dict[str, list[Array]] = {}
    for one, own in zip(evidence, folds, strict=True):
        for what, measured, parts in _measures(search.start.light, one, own, device, _FOLDS if not several else None):
            before.setdefault(what, []).append(_errors(measured, search.start))
            if not found.parameters:
                after.setdefault(what, []).append(before[what][-1])
                continue
            errors = np.full(len(measured.places), np.nan)
            for fold in np.unique(parts):
                held_out = parts == fold
                errors[held_out] = _errors(measured, values[fold])[held_out]
            after.setdefault(what, []).append(errors)
    names = f"{len(evidence)} photographs" if several else f"{_FOLDS} folds"
    return _means(before), _means(after), names


def _measures(
    light: Light, one: Evidence, own: Indices, device: int | str | Device | None, folds: int | None
) -> list[tuple[str, Evidence, Indices]]:
    """What is measured of a photograph, by which residuals, and in which part each of these is."""
    if isinstance(one, BySurface):
        return [("depth", one, own)]
    measures: list[tuple[str, Evidence, Indices]] = [("brightness", one, own)]
    if light.determines_depth:
        surface = BySurface(one.pair, device)
        parts = np.full(len(surface.places), own[0]) if folds is None else surface.folds(folds)
        measures.append(("depth", surface, parts))
    return measures


def _errors(measured: Evidence, assumed: Assumed) -> Array:
    """Errors, NaN where nothing comes of what is assumed, as where a fit begins in another unit of depth."""
    try:
        return measured.errors(assumed)
    except InputError:
        return np.full(len(measured.places), np.nan)


def _means(errors: Mapping[str, Sequence[Array]]) -> CalibrationErrors:
    means: dict[str, float | None] = {}
    for what, parts in errors.items():
        values = np.concatenate(parts)
        means[what] = float(np.nanmean(values)) if np.isfinite(values).any() else None
    return CalibrationErrors(**means)
