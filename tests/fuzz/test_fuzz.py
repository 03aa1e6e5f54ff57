"""The short form: a few hundred cases of fixed seeds. ``make fuzz`` goes on for as long as one likes."""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzz.cases import KINDS, Setting, run
from fuzz.generate_calls import FEW
from fuzz.invariants import Violation, attempt
from fuzz.worker import Worker
from persfs_cl.errors import InputError

_SEEDS = 25
"""Cases of a test."""
_BLOCKS = {
    "image": 6,
    "exif": 4,
    "array": 4,
    "points": 4,
    "reconstruct": 2,
    "batch": 1,
    "render": 2,
    "compare": 2,
    "invalid": 8,
}


# Each further call of the whole compiles programs of its own.
@pytest.mark.quick_where(holds=lambda given: given["kind"] != "reconstruct" or given["first"] == 0)
@pytest.mark.parametrize(
    ("kind", "first"),
    [(kind, _SEEDS * block) for kind, blocks in _BLOCKS.items() for block in range(blocks)],
)
def test_nothing_breaks(kind: str, first: int, tmp_path: Path) -> None:
    setting = Setting(tmp_path, FEW, brief=True)
    failures = []
    for seed in range(first, first + _SEEDS):
        try:
            run(kind, seed, setting)
        except Violation as violation:
            failures.append(f"{kind}:{seed} {violation}")
    assert not failures, f"{len(failures)} of {_SEEDS} cases failed:\n" + "\n".join(failures)


def test_every_kind_has_cases() -> None:
    # Pictures of a result take seconds.
    assert set(KINDS) - set(_BLOCKS) == {"save"}


def _raising(error: Exception) -> None:
    raise error


def _warning(category: type[Warning]) -> None:
    warnings.warn("something", category, stacklevel=1)


@pytest.mark.parametrize(
    ("call", "group"),
    [
        (lambda: _raising(TypeError("x")), "call: TypeError"),
        (lambda: _raising(InputError("no name")), "call: a message that does not name the file"),
        (lambda: _raising(InputError("")), "call: an error without a message"),
        (lambda: _warning(RuntimeWarning), "call: a warning leaks: RuntimeWarning"),
        (lambda: np.log(np.zeros(1)), "call: a warning leaks: RuntimeWarning"),
        (lambda: sys.stderr.write("printed"), "call: it prints 'printed'"),
        (lambda: os.write(1, b"from C"), "call: it prints 'from C'"),
        (lambda: logging.getLogger("a library").warning("logged"), "call: it prints 'logged'"),
    ],
)
def test_what_may_not_be_is_found(call: Callable[[], Any], group: str) -> None:
    with pytest.raises(Violation) as found:
        attempt(call, "call", naming="case.png")
    assert found.value.group.startswith(group)


def test_what_may_be_is_let_through() -> None:
    assert attempt(lambda: 3, "call") == (3, "accepted")
    assert attempt(lambda: _raising(InputError("case.png is broken")), "call", naming="case.png") == (
        None,
        "InputError",
    )
    assert attempt(lambda: _warning(UserWarning), "call") == (None, "accepted")


def _hard_case(kind: str, _seed: int, _setting: Setting) -> list[str]:
    if kind == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    while kind == "hang":
        time.sleep(1)
    return [kind]


@pytest.mark.thorough
def test_a_crash_and_a_hang_are_reported_and_end_no_others() -> None:
    worker = Worker(_hard_case, seconds=4.0)
    try:
        told = [worker.run(kind, 0) for kind in ("crash", "hang", "good")]
    finally:
        worker.close()
    groups = [violation and violation.group for _, violation in told]
    assert groups == ["crash: the process ended by SIGSEGV", "hang: no end after 4 s", None]
    assert told[-1][0] == ["good"]
