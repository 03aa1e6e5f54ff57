"""What was tried and not taken: that it does what it should, and that the bench tells where it cannot."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.bench import alternatives, weno
from persfs_cl.bench.accuracy import SCHEMES
from persfs_cl.bench.alternatives import NOT_SETTLED, WENO
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.choices import Surface

NAMES = (*SCHEMES, WENO)


def side_by_side(device: ps.Device, scene: ps.Scene) -> dict[str, Record]:
    if not device.has_float64:
        pytest.skip(f"{device} has no double precision.")
    with pytest.MonkeyPatch.context() as changed:
        for scheme, keywords in SCHEMES.items():
            if keywords["scheme"] == "upwind":
                # A few iterations, by what is compiled most quickly.
                changed.setitem(SCHEMES, scheme, {**keywords, "ordering": "lexicographic"})
        records = alternatives._side_by_side(Plan(device), "some", scene)
    return dict(zip(NAMES, records, strict=True))


def errors(found: dict[str, Record]) -> dict[str, float]:
    return {name: record.median or 0.0 for name, record in found.items()}


@pytest.mark.thorough
@pytest.mark.parametrize("surface", ["away", "toward"])
def test_weno_is_several_times_more_exact_on_a_smooth_surface(device: ps.Device, surface: Surface) -> None:
    found = side_by_side(device, ps.bump((64, 64), surface=surface))
    assert [record.detail for record in found.values()] == [""] * len(NAMES)
    assert 0.0 < errors(found)[WENO] <= errors(found)["second order"] / 3.0
    assert errors(found)["second order"] < errors(found)["upwind"] < errors(found)["Lax-Friedrichs"]
    assert (found[WENO].iteration or 0) > 10 * (found["second order"].iteration or 0)


@pytest.mark.thorough
def test_weno_gains_nothing_beside_a_crease(device: ps.Device) -> None:
    cap = ps.sphere_cap((48, 48))
    found = side_by_side(device, replace(cap, known_depth=np.where(cap.depth == 1.0, 1.0, np.nan)))
    assert found[WENO].detail == ""
    assert errors(found)[WENO] > errors(found)["second order"]


def test_what_did_not_settle_is_told(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(alternatives, "_MAX_ITERATIONS", 20)
    found = side_by_side(device, ps.bump((32, 32)))
    details = {name: record.detail for name, record in found.items()}
    assert details == {"Lax-Friedrichs": NOT_SETTLED, "upwind": "", "second order": "", WENO: NOT_SETTLED}
    assert found[WENO].iteration == 20


def test_only_what_is_unknown_is_solved() -> None:
    scene = ps.bump((12, 14))
    unknown = np.zeros(scene.depth.shape, dtype=bool)
    unknown[2:-2, 2:-2] = True
    unknown[5, 6] = False
    start = np.log(scene.depth) + np.where(unknown, 0.1, 0.0)
    found, iterations, settled = weno.solve(scene, unknown, start, tolerance=0.0, max_iterations=3)
    assert (iterations, settled) == (3, False)
    np.testing.assert_array_equal(found == start, ~unknown)


def test_one_sided_differences_of_a_parabola_are_exact() -> None:
    second, first, here, beyond = (0.3 * t**2 - 0.7 * t + 2.0 for t in (-2.0, -1.0, 0.0, 1.0))
    assert weno._one_sided(second, first, here, beyond) == pytest.approx(-0.7, rel=1e-13)


def test_a_kink_is_not_differentiated_across() -> None:
    """The surface bends between the pixel and what lies beyond: the derivative is that of its own side."""
    assert weno._one_sided(0.0, 1.0, 2.0, -7.0) == pytest.approx(1.0, abs=1e-6)


def test_without_numba_the_others_are_measured(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numba", None)
    # Without what it remembers of earlier calls.
    monkeypatch.setattr(weno, "_sweep", weno._sweep.__wrapped__)
    found = side_by_side(device, ps.bump((16, 16)))
    assert [name for name, record in found.items() if record.median is None] == [WENO]
    assert found[WENO].detail.startswith("skipped: numba cannot be imported")
    assert "persfs-cl[bench]" in found[WENO].detail
    assert found[WENO].workload == f"some: {WENO}"


def test_a_device_without_double_precision_is_told(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "has_float64", False)
    groups = list(alternatives.weno(Plan(device, sizes=(16, 24))))
    assert len(groups) == 7
    for records in groups:
        assert [record.workload.partition(": ")[2] for record in records] == list(NAMES)
        assert {record.detail for record in records} == {f"skipped: {device} has no double precision."}
