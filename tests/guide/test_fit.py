"""How far a surface may be from its guide."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from persfs_cl.guide.fit import Fitted
from persfs_cl.guide.guide import Guide

NOISE = 0.01
GUIDE = Guide.of(np.ones((8, 8)), np.ones((24, 24), bool), "depth", "fixed")
HELD = replace(Fitted.as_given(GUIDE, 24.0, NOISE), held=True)


def tolerances(fitted: Fitted, difference: float) -> list[float]:
    return [fitted.tolerance(number, difference) / NOISE for number in range(fitted.rounds)]


def test_the_tolerance_shrinks_as_far_as_guide_and_photograph_differ() -> None:
    assert tolerances(HELD, 0.1 * NOISE) == [1.0, 1.0, 1.0]
    assert tolerances(HELD, 0.6 * NOISE) == pytest.approx([1.0, 0.5, 0.5])
    assert tolerances(HELD, 3.0 * NOISE) == [1.0, 0.5, 0.25]
    assert tolerances(replace(HELD, held=False), 0.1 * NOISE)[-1] == 0.125


def test_a_distortion_beyond_the_noise_widens_it_gradually() -> None:
    last = [tolerances(replace(HELD, distortion=share * NOISE), 3.0 * NOISE)[-1] for share in (1.0, 1.01, 10.0)]
    assert last[0] == 0.25
    assert last[1] == pytest.approx(0.25, abs=0.05)
    assert last[2] == pytest.approx(15.0, rel=0.01)
