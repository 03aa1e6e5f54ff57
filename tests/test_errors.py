"""Errors reach a parent process whole."""

from __future__ import annotations

import copy
import importlib
import pickle
import pkgutil
from collections.abc import Callable

import pytest

import persfs_cl as ps
from persfs_cl.errors import PersfsError


def kinds() -> list[type[PersfsError]]:
    """Every error of the package, wherever it is defined."""
    for module in pkgutil.walk_packages(ps.__path__, "persfs_cl."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    found = [PersfsError]
    for kind in found:
        found += [child for child in kind.__subclasses__() if child.__module__.startswith("persfs_cl.")]
    return found


def example(kind: type[PersfsError]) -> PersfsError:
    if kind is ps.ConvergenceError:
        with pytest.raises(ps.ConvergenceError) as raised:
            ps.reconstruct(ps.bump((9, 9)).image, ps.Camera(9.0), max_iterations=1, tolerance=0, throw=True)
        return raised.value
    return kind("message", 2)


def test_what_is_wrong_with_a_value_is_a_value_error_too() -> None:
    for wrong in (lambda: ps.Camera(focal_length=-1.0), lambda: ps.ParallelLight(p0=float("nan"))):
        with pytest.raises(ValueError, match=r"focal_length=-1\.0|p0=nan") as raised:
            wrong()
        assert isinstance(raised.value, PersfsError)


@pytest.mark.parametrize("restored", [lambda error: pickle.loads(pickle.dumps(error)), copy.copy, copy.deepcopy])
def test_every_error_survives_pickling_and_copying(restored: Callable[[PersfsError], PersfsError]) -> None:
    assert {ps.ConvergenceError, ps.InputError, ps.KernelBuildError} < set(kinds())
    for kind in kinds():
        error = example(kind)
        error.__dict__["note"] = "remembered"
        other = restored(error)
        assert type(other) is kind
        assert other is not error
        assert (other.args, str(other)) == (error.args, str(error))
        assert vars(other).keys() == vars(error).keys()
        assert vars(other)["note"] == "remembered"
        if isinstance(error, ps.ConvergenceError) and isinstance(other, ps.ConvergenceError):
            assert (other.solution.depth == error.solution.depth).all()
            assert other.solution.device is error.solution.device
