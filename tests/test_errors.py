"""Errors reach a parent process whole, and know what they are about."""

from __future__ import annotations

import copy
import importlib
import pickle
import pkgutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.checks import warn
from persfs_cl.errors import PersfsError, PersfsWarning, Worded
from persfs_cl.wording import Mention, brief, keyword


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


def typed(mention: Mention) -> str:
    return f"<{mention.keyword} {mention.typed}>"


def test_an_error_knows_its_argument_and_can_be_worded_otherwise() -> None:
    other = keyword("boundary", "wall")
    error = ps.InputError.about("scheme", "upwind", f"with {other} fails: give {keyword('known_depth')}.")
    assert (error.argument, error.value) == ("scheme", "upwind")
    assert str(error) == "scheme='upwind' with boundary='wall' fails: give known_depth."
    assert error.worded(typed) == "<scheme upwind> with <boundary wall> fails: give <known_depth >."
    assert (ps.CameraError("no").argument, ps.CameraError("no").value) == (None, None)


def test_places_and_remedies_leave_the_rest_as_it_was() -> None:
    error = ps.CameraError.about("principal_point", (3, 4.5), "is odd.")
    found = error.at(Path("scheme='upwind'.png")).at("images[3]").adding(f"Give {keyword('fov')}.")
    assert type(found) is ps.CameraError
    assert str(found) == "images[3]: scheme='upwind'.png: principal_point=(3, 4.5) is odd. Give fov."
    assert found.worded(typed) == "images[3]: scheme='upwind'.png: <principal_point 3,4.5> is odd. Give <fov >."
    assert (found.argument, found.value) == ("principal_point", (3, 4.5))
    assert str(error) == "principal_point=(3, 4.5) is odd.", "the other is another"
    restored = pickle.loads(pickle.dumps(found))
    assert (restored.worded(typed), restored.value) == (found.worded(typed), found.value)


class OddError(Exception):
    """Pickled, but not restored: it wants two arguments, and keeps one."""

    def __init__(self, one: object, _other: object) -> None:
        super().__init__(one)


@pytest.mark.parametrize(
    "value", [lambda: None, OddError(1, 2), np.ones((2000, 2000))], ids=["function", "odd", "array"]
)
def test_a_value_that_is_more_than_a_word_or_a_number_is_told_of_when_pickled(value: object) -> None:
    error = ps.InputError.about("callback", value, "cannot be used.")
    assert error.value is value
    pickled = pickle.dumps(error)
    assert len(pickled) < 2000
    assert pickle.loads(pickled).value == brief(value)


def test_marks_in_the_words_of_a_value_mark_nothing() -> None:
    class Marked:
        def __repr__(self) -> str:
            return "\ud800a\ud801b\ud802"

    error = ps.InputError.about("surface", Marked(), "is unknown.")
    assert str(error) == "surface=\\ud800a\\ud801b\\ud802 is unknown."
    assert str(ps.InputError()) == ""


def test_the_functions_of_the_package_name_the_argument() -> None:
    with pytest.raises(ps.InputError) as raised:
        ps.compare([1.0], [1.0, 2.0], align=3)  # type: ignore[arg-type]
    assert (raised.value.argument, raised.value.value) == ("align", 3)


def test_warnings_can_be_worded_too() -> None:
    with pytest.warns(UserWarning, match="^scheme='upwind' is odd$") as warned:
        warn(f"{keyword('scheme', 'upwind')} is odd")
    (message,) = (warning.message for warning in warned)
    assert isinstance(message, PersfsWarning)
    assert message.worded(typed) == "<scheme upwind> is odd"
    restored: Worded = pickle.loads(pickle.dumps(message))
    assert restored.parts == message.parts
    assert warned[0].filename == __file__
