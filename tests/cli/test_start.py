"""Help, version, and how the command starts."""

from __future__ import annotations

import inspect
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from command import run
from typer.testing import CliRunner

import persfs_cl as ps
from persfs_cl.cli.app import app
from persfs_cl.cli.reconstruct import reconstruct


def test_help_and_version() -> None:
    assert run("--version") == (0, f"persfs-cl {ps.__version__}\n", "")
    said = run("--version", "--verbose")
    assert (said.status, said.stderr) == (0, "")
    assert said.stdout.startswith(f"persfs-cl {ps.__version__}, Python {platform.python_version()}")
    assert f"numpy {np.__version__}" in said.stdout.splitlines()
    assert any(line.startswith("rawpy ") and line.endswith(" [raw]") for line in said.stdout.splitlines())
    assert f"device 0: {ps.devices()[0].name}; " in said.stdout
    assert "'--verbose': goes with --version" in run("--verbose").stderr
    overview = run("--help")
    assert overview.status == 0
    for name in ("reconstruct", "render", "compare", "devices", "demo"):
        assert name in overview.stdout
        assert run(name, "-h").status == 0
    assert run().status == 2
    assert run("reconstrct").status == 2
    details = run("reconstruct", "--help").stdout
    for name in inspect.signature(reconstruct).parameters:
        assert name in ("photo", "ctx") or f"--{ {'offset': 'lamp'}.get(name, name).replace('_', '-') }" in details
    for text in ("Camera", "Light", "Solver", "DEGREES", "persfs-cl reconstruct photo.jpg", "STOPPED"):
        assert text in details


COMMANDS: Any = typer.main.get_command(app)


@pytest.mark.parametrize("name", COMMANDS.list_commands(typer.Context(COMMANDS)))
def test_help_fits_80_columns(name: str) -> None:
    shown = CliRunner(env={"COLUMNS": "80", "TERM": "dumb"}).invoke(app, [name, "--help"]).stdout
    assert "…" not in shown
    assert "<bool>" not in shown.lower(), "flags take no value"
    assert all(len(line) <= 80 for line in shown.splitlines())
    for parameter in COMMANDS.get_command(typer.Context(COMMANDS), name).params:
        if parameter.param_type_name == "option":
            for option in (max(parameter.opts, key=len), *parameter.secondary_opts):
                assert re.search(rf"(?<![\w-]){option}(?![\w-])", shown), option


def test_help_lists_long_choices_once() -> None:
    shown = " ".join(run("reconstruct", "--help").stdout.replace("│", " ").split())
    assert "Order of the pixels in a sweep. One of wavefront, checkerboard, lexicographic." in shown
    assert shown.count("lexicographic") == 1
    # Where the help names all of them, it does so once.
    assert "One of lambertian" not in shown
    assert "saves a third to two thirds. On by default: --no-acceleration turns it off." in shown


def test_module_starts_without_what_help_does_not_need() -> None:
    heavy = ("PIL", "imageio", "matplotlib", "tifffile", "trimesh")
    script = f"""
import atexit, sys
atexit.register(lambda: print("loaded:", *{heavy!r} & sys.modules.keys()))
sys.argv = ["persfs-cl", "--help"]
from persfs_cl.cli import main
main()
""".replace(repr(heavy), repr(set(heavy)))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "Usage: persfs-cl" in done.stdout
    assert done.stdout.splitlines()[-1].strip() == "loaded:"


def test_module_as_a_command(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "persfs_cl", "reconstruct", "missing.png", "-o", "out", "--focal-length=3"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "missing.png does not exist" in done.stderr


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        pytest.param("persfs-cl recon", ["reconstruct"], marks=pytest.mark.thorough),
        pytest.param("persfs-cl reconstruct --hei", [], marks=pytest.mark.thorough),
        pytest.param("persfs-cl reconstruct --despe", ["--despeckle"], marks=pytest.mark.thorough),
        ("persfs-cl reconstruct --highlights ", ["keep", "mask", "fill"]),
        pytest.param("persfs-cl reconstruct --ordering w", ["wavefront"], marks=pytest.mark.thorough),
    ],
)
def test_completion(line: str, offered: list[str]) -> None:
    settings = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1), "_PERSFS_CL_COMPLETE": "complete_bash"}
    command = [sys.executable, "-c", "from persfs_cl.cli import main; main()"]
    done = subprocess.run(command, env={**os.environ, **settings}, capture_output=True, text=True, check=False)
    assert done.stdout.split() == offered, done.stderr
