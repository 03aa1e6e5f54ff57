"""What is public has an example in its docstring, and every example runs and prints what it says."""

from __future__ import annotations

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import persfs_cl
import persfs_cl.io
import persfs_cl.scenes
import persfs_cl.surface.plots
from persfs_cl.shading.model import Light

FACES: tuple[ModuleType, ...] = (persfs_cl, persfs_cl.io, persfs_cl.scenes, persfs_cl.surface.plots)
"""Modules whose names users may use."""


def public() -> Iterator[tuple[str, Any]]:
    """Every function and class that is public, and the methods of the classes, each once."""
    seen = set()
    for face in FACES:
        for name in face.__all__:
            value = getattr(face, name)
            # An error is nothing that users call.
            if name in seen or not callable(value) or (inspect.isclass(value) and issubclass(value, BaseException)):
                continue
            seen.add(name)
            yield name, value
            if inspect.isclass(value):
                yield from ((f"{name}.{method}", getattr(value, method)) for method in methods(value))


def methods(kind: type) -> list[str]:
    """Public methods that a class or one of its bases in this package defines.

    What only the solver asks of a light is not among them.
    """
    bases = [base for base in inspect.getmro(kind) if base.__module__.startswith("persfs_cl.")]
    return sorted(
        name
        for base in bases
        for name, value in vars(base).items()
        if not name.startswith("_")
        and name not in vars(Light)
        and inspect.isfunction(getattr(value, "__func__", value))
    )


PUBLIC = dict(public())


def examples(name: str) -> list[doctest.DocTest]:
    found = doctest.DocTestFinder(recurse=False).find(PUBLIC[name], name, globs={})
    return [test for test in found if test.examples]


def test_what_is_public_is_found() -> None:
    assert {"Camera", "Camera.from_fov", "Solution.save", "bump", "read_points", "stanford_bunny", "depth_picture"} <= {
        *PUBLIC
    }


@pytest.mark.parametrize("name", PUBLIC)
def test_example(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tests = examples(name)
    assert tests, f"{name} has no example in its docstring"
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    for test in tests:
        doctest.DocTestRunner().run(test, out=said.append)
    assert not said, "".join(said)
    assert list(tmp_path.iterdir()) == [], "the example leaves files behind"
