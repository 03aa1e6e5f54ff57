"""Exit statuses that several commands have; those of wrong options and of no device are the framework's and errors'."""

from __future__ import annotations

INPUT_FAILED = 1
"""Something that was asked for could not be done."""
INTERRUPTED = 130
"""After any signal that ends. Shells have 128 + SIGINT for Ctrl-C; scripts need not tell who asked for the end."""
