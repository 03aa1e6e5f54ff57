"""The command, in the process of the tests, and what is often given to it."""

from __future__ import annotations

import json
import typing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from typer.testing import CliRunner

import persfs_cl as ps
from persfs_cl.cli.app import app
from persfs_cl.io.account import ACCOUNT
from persfs_cl.io.export import write_grey

FILES = {
    "camera.json",
    "depth.npy",
    "depth.tiff",
    "depth.png",
    "normals.png",
    "relief.png",
    "mesh.ply",
    "rendered.png",
    "comparison.png",
    "confidence.png",
    "convergence.png",
    "preview.jpg",
    "photo.jpg",
    "relief.js",
    "report.json",
    "solution.npz",
    "index.html",
}
HEIGHT, WIDTH = 24, 30
SCENE = ps.bump((HEIGHT, WIDTH))
FOCAL = ("--focal-length", str(WIDTH))


class Outcome(typing.NamedTuple):
    status: int
    stdout: str
    stderr: str


def run(*arguments: str | Path) -> Outcome:
    """The command in this process; line breaks and frames of messages are undone."""
    result = CliRunner(env={"COLUMNS": "500", "TERM": "dumb"}).invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return Outcome(result.exit_code, result.stdout, " ".join(result.stderr.replace("│", " ").split()))


def strict(path: Path) -> dict[str, Any]:
    """A JSON file, with Python's NaN and Infinity refused."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{path} holds {name}")

    loaded: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    return loaded


def names(folder: Path) -> set[str]:
    """What a user sees in a folder: not the account of the run."""
    return {path.name for path in folder.iterdir()} - {ACCOUNT}


def png(path: Path, image: NDArray[np.floating]) -> None:
    write_grey(path, image, encoding="linear")
