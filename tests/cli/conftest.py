"""What several tests of the command begin with."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from command import SCENE

from persfs_cl.io.export import write_grey


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """The image of a smooth bump whose frame has depth 1, what the solver assumes."""
    path = tmp_path / "photo.png"
    write_grey(path, SCENE.image, 16)
    return path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out pictures and previews, which take far longer than the rest."""
    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])
    monkeypatch.setattr("persfs_cl.pipeline.results.write_preview", lambda *_arguments, **_keywords: [])


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Python's own answer to Ctrl-C, which a test run in the background of a shell lacks; the usual ones to others."""
    previous = {signal.SIGINT: signal.signal(signal.SIGINT, signal.default_int_handler)}
    previous |= {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, answer in previous.items():
        signal.signal(number, answer)
