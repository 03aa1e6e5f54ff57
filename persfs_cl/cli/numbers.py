"""Numbers on the command line."""

from __future__ import annotations

import math
from collections.abc import Collection

import typer


def finite(value: float | None) -> float | None:
    """Refuse nan and inf, which Python takes for numbers."""
    if value is not None and not math.isfinite(value):
        raise typer.BadParameter(f"{value} is not a finite number.")
    return value


def positive(value: float | None) -> float | None:
    """Refuse what is not a finite number above 0."""
    if value is not None and not (math.isfinite(value) and value > 0):
        raise typer.BadParameter(f"{value} is not a finite number above 0.")
    return value


def finite_numbers(option: str, text: str, meaning: str, counts: Collection[int]) -> list[float]:
    """Numbers with commas between, or an error that says what they should have been."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise typer.BadParameter(f"{text!r} is not {meaning}.", param_hint=f"'{option}'")
    return numbers
