"""The fit by itself, on residuals that cost nothing."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from persfs_cl.calibration.identify import told
from persfs_cl.calibration.least_squares import fit
from persfs_cl.calibration.parameters import Parameter
from persfs_cl.errors import InputError

Values = NDArray[np.float64]
COUNT = 400
TIMES = np.linspace(0.0, 1.0, COUNT)
ALONE = np.arange(COUNT)
TOGETHER = np.zeros(COUNT, int)


def parameter(name: str, *, accuracy: float = 1e-3, most: float = 1e3) -> Parameter:
    return Parameter(
        name,
        f"the {name}",
        lambda _assumed: 0.0,
        lambda assumed, _number: assumed,
        float,
        10.0,
        accuracy,
        -1e3,
        most,
        1e-3,
    )


LINE = [parameter("height"), parameter("slope")]


def noise(seed: int, size: float = 0.01) -> Values:
    return size * np.random.default_rng(seed).normal(size=COUNT)


def test_outliers_on_one_side_do_not_count() -> None:
    measured = 2.0 + 3.0 * TIMES + noise(0)
    measured[::4] += 1.0
    measured[7] = np.nan
    found = fit(
        lambda numbers: numbers[0] + numbers[1] * TIMES - measured, TOGETHER, LINE, np.zeros(2), np.zeros(2), 1.0
    )
    np.testing.assert_allclose(found.numbers, (2.0, 3.0), atol=0.005)
    assert (found.weights[::4] == 0.0).all()
    assert found.weights[7] == 0.0


def test_where_numbers_are_impossible_it_does_not_go() -> None:
    def residuals(numbers: Values) -> Values:
        if numbers[0] <= 0.0:
            raise InputError("not there")
        return np.asarray(np.log(numbers[0]) * np.ones(COUNT) - np.log(0.5) + noise(1))

    found = fit(residuals, TOGETHER, LINE[:1], np.array([5.0]), np.array([5.0]), 1.0)
    assert found.numbers[0] == pytest.approx(0.5, rel=0.01)
    with pytest.raises(InputError, match="not there"):
        fit(residuals, TOGETHER, LINE[:1], np.array([-5.0]), np.array([5.0]), 1.0)


def test_standard_errors_are_those_of_least_squares() -> None:
    def errors(seed: int) -> tuple[Values, Values]:
        measured = 2.0 + 3.0 * TIMES + noise(seed)
        found = fit(
            lambda numbers: numbers[0] + numbers[1] * TIMES - measured, TOGETHER, LINE, np.zeros(2), np.zeros(2), 1.0
        )
        kept, said, reasons = told([parameter("height", accuracy=0.1), parameter("slope", accuracy=0.1)], found, ALONE)
        assert (kept, reasons) == ([0, 1], {})
        return found.numbers, said

    runs = [errors(seed) for seed in range(40)]
    design = np.stack([np.ones(COUNT), TIMES], axis=1)
    exact = 0.01 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    np.testing.assert_allclose(np.mean([said for _, said in runs], axis=0), exact, rtol=0.1)
    np.testing.assert_allclose(np.std([numbers for numbers, _ in runs], axis=0), exact, rtol=0.3)


def test_what_errs_together_counts_as_one() -> None:
    blocks = ALONE // 40
    common = np.random.default_rng(0).normal(scale=0.05, size=10)[blocks]
    found = fit(lambda numbers: numbers[0] - 2.0 - common - noise(0), TOGETHER, LINE[:1], np.zeros(1), np.zeros(1), 1.0)
    single, joint = (told(LINE[:1], found, clusters)[1][0] for clusters in (ALONE, blocks))
    assert 4.0 < joint / single < 9.0


def test_numbers_that_go_together_are_not_told_apart() -> None:
    measured = 2.0 + noise(0)
    parameters = [parameter("height"), parameter("offset"), parameter("slope", accuracy=0.1)]
    found = fit(
        lambda numbers: numbers[0] + numbers[1] + numbers[2] * TIMES - measured,
        TOGETHER,
        parameters,
        np.zeros(3),
        np.zeros(3),
        1.0,
    )
    kept, errors, reasons = told(parameters, found, ALONE)
    assert kept == [0, 2]
    assert errors.shape == (2,)
    assert reasons.keys() == {"offset"}
    assert reasons["offset"].startswith("the offset and the height cannot be told apart")


def test_what_nothing_depends_on_is_not_told() -> None:
    found = fit(lambda numbers: numbers[0] - 2.0 - noise(0), TOGETHER, LINE, np.zeros(2), np.zeros(2), 1.0)
    kept, _, reasons = told(LINE, found, ALONE)
    assert kept == [0]
    assert reasons["slope"].startswith("the photographs hardly depend on the slope: they leave it open by")
    assert found.numbers[1] == 0.0
