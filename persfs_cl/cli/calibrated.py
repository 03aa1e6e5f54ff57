"""A calibration as a file of options."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from persfs_cl.calibration.result import Calibration
from persfs_cl.cli.settings import as_toml
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS

_WIDTH = 110
_DIGITS = 6
_OPTIONS = {"exponent": "tone-exponent", "white": "white-level", "lamp_x": "lamp", "lamp_y": "lamp", "lamp_z": "lamp"}
"""Of numbers that are fitted; all others are options by their own names."""


def calibrated(calibration: Calibration, given: Mapping[str, str], photos: Sequence[Path]) -> str:
    """The text of a file for ``--config``: what was fitted, and what else the photographs were taken for.

    Parameters
    ----------
    calibration : Calibration
    given : mapping of str to str
        By the names of options, the lines of those that were given.
    photos : sequence of Path
        For the heading.
    """
    uncertain: dict[str, list[str]] = {}
    for name, error in calibration.uncertainties.items():
        uncertain.setdefault(_OPTIONS.get(name, name), []).append(f"{name} ± {error:.2g}")
    values = dict(_options(calibration))
    lines = [*_heading(calibration, photos), ""]
    lines += [line for name, line in given.items() if name not in values]
    for name, value in values.items():
        line = f"{name} = {as_toml(value)}"
        lines.append(f"{line}  # {', '.join(uncertain[name])}" if name in uncertain else line)
    return "\n".join(lines) + "\n"


def _options(calibration: Calibration) -> Iterator[tuple[str, Any]]:
    """Options and their values, of light and material those that differ from the usual ones."""
    fitted = {_OPTIONS.get(name, name) for name in calibration.values}
    for option, kinds, one in (
        ("light", LIGHTS, calibration.light),
        ("reflectance", MATERIALS, calibration.reflectance),
    ):
        yield option, next(name for name, kind in kinds.items() if kind is type(one))
        for field in fields(one):
            value, name = getattr(one, field.name), str(field.metadata.get("option", field.name)).replace("_", "-")
            if name in fitted or field.default is MISSING or value != field.default:
                yield name, _plain(value)
    if calibration.exponent != 1.0 or "tone-exponent" in fitted:
        yield "tone-exponent", _plain(calibration.exponent)
    law = calibration.preparation.vignetting
    if isinstance(law, str) and (law != "none" or "vignetting" in fitted):
        yield "vignetting", law
    if calibration.white_level is not None:
        yield "white-level", _plain(calibration.white_level)


def _plain(value: Any) -> Any:
    """Numbers with as many digits as anybody can tell."""
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def _heading(calibration: Calibration, photos: Sequence[Path]) -> Iterator[str]:
    names = ", ".join(photo.name for photo in photos)
    yield from _comment(f"Options of 'persfs-cl reconstruct' and 'batch', fitted by 'persfs-cl calibrate' to {names}.")
    for what in ("depth", "brightness"):
        before, after = getattr(calibration.before, what), getattr(calibration.after, what)
        if before is not None and after is not None:
            yield from _comment(
                f"Mean error of the {what}: {before:.3%} before, {after:.3%} after, cross-validated over "
                f"{calibration.validation}."
            )
    if not calibration.converged:
        yield from _comment("Not converged: these numbers still changed when the fit ended. Do not rely on them.")
    for name, reason in calibration.reasons.items():
        yield from _comment(f"Not told: {name}. {reason[0].upper()}{reason[1:]}.")


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ")
