"""The way into the command ``persfs-cl``, light enough that Ctrl-C is heard while the rest is still being imported."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command that the command line names; ends the process with its exit status."""
    try:
        from persfs_cl.cli.app import app  # noqa: PLC0415  # slow, and guarded here

        app(prog_name="persfs-cl")
    except KeyboardInterrupt:
        sys.stderr.write("persfs-cl: interrupted.\n")
        sys.exit(130)
