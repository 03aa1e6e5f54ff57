"""The command, in the process of the tests."""

from __future__ import annotations

import typing
from pathlib import Path

from typer.testing import CliRunner

from persfs_cl.cli.app import app


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
