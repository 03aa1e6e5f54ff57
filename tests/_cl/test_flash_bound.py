"""The quadratic of kernels/schemes/upwind_flash.cl in plain NumPy: how far it is from the root, on both sides."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

Array = NDArray[np.float64]

HALVINGS = 200
NEAR_ENOUGH = 1.0 / 64.0


def excess(base: float, offset: float, slope: float, log_f: float, length: Array | float) -> Array | float:
    """2 U + ln F - ln c at U = base + l, for a Lambertian material; it rises with l."""
    square = np.maximum(0.0, (np.square(length) - offset) / slope)
    return 2.0 * (base + length) + log_f + 0.5 * np.log1p(square)


def true_length(base: float, offset: float, slope: float, log_f: float) -> float:
    """Where that is 0, by bisection; of a triangle no less than where t is 0."""
    low, high = np.sqrt(max(0.0, offset)), 1e5
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if excess(base, offset, slope, log_f, middle) > 0.0 else (middle, high)
    return float(0.5 * (low + high))


def by_quadratic(base: float, offset: float, slope: float, here: float, square: float) -> tuple[float, float, float]:
    """First root, the length with the margin, and how far it leads, as the kernel has them."""
    bend = 2.0 * slope * (1.0 + square)
    rest = max(0.0, offset + slope * square) + 2.0 * bend * (here - base)
    first_root = rest / (bend + np.sqrt(bend**2 + rest))
    moved = base + first_root - here
    return first_root, first_root + 5.0 * moved**2 * bend / (bend + np.sqrt(bend**2 + rest)), moved


@given(
    st.floats(-8.0, 0.0),  # of the spacing, whose square times a number near 1 is the slope
    st.floats(-6.0, 3.0),  # of t there, in powers of ten
    st.floats(0.0, 1.0),  # of an offset below 0: the share of slope t^2 that it takes at `here`
    st.floats(-2.0, 0.0),  # how far `here` is above its limit, in powers of ten
)
def test_the_value_lies_between_the_root_and_here(
    log_slope: float, log_t: float, share: float, log_apart: float
) -> None:
    slope, square = np.exp(log_slope), 10.0 ** (2.0 * log_t)
    offset = -0.999 * share * slope * square
    here, log_f = 0.0, -0.5 * np.log1p(square)
    # D is `here` at that t, and U of there lies below by some share.
    base = here - np.sqrt(offset + slope * square) - 0.1 * 10.0**log_apart
    root = true_length(base, offset, slope, log_f)
    assert base + root <= here
    first_root, length, moved = by_quadratic(base, offset, slope, here, square)
    rounding = 1e-13 * (1.0 + abs(base))
    # Between the l at which D is `here` and the one at which U is, and not beyond the root.
    assert np.sqrt(offset + slope * square) - rounding <= first_root <= here - base + rounding
    assert first_root <= root + rounding
    if abs(moved) <= NEAR_ENOUGH:
        assert root - rounding <= length
        # Of second order: what is left is a small share of the way.
        assert length - root <= 5.0 * moved**2 + rounding
