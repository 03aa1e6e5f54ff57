"""The way into the command ``persfs-cl``, light enough that Ctrl-C is heard while the rest is still being imported."""

from __future__ import annotations

import sys

try:
    from persfs_cl.cli.signals import answer, leave_at_once
    from persfs_cl.cli.status import INPUT_FAILED, INTERRUPTED
except KeyboardInterrupt:
    # Even these few modules take a moment, and nobody is there yet who would catch it.
    sys.stderr.write("persfs-cl: interrupted.\n")
    sys.exit(130)


def main() -> None:
    """Run the command that the command line names; ends the process with its exit status."""
    # For good: what a command has to clean up, it does while it runs, under answers of its own.
    answer(leave_at_once)
    try:
        from persfs_cl.cli.streams import open_streams, unwritten  # noqa: PLC0415  # slow, and guarded here

        open_streams()
        from persfs_cl.cli.app import app  # noqa: PLC0415

        app(prog_name="persfs-cl")
    except KeyboardInterrupt:
        sys.stderr.write("persfs-cl: interrupted.\n")
        sys.exit(INTERRUPTED)
    except SystemExit as ended:
        why = unwritten()
        if why:
            sys.stderr.write(
                f"persfs-cl: standard output cannot be written: {why}. Direct it elsewhere; files are written all the "
                "same.\n"
            )
        if why is not None and not ended.code:
            sys.exit(INPUT_FAILED)
        raise
