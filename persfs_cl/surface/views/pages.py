"""Pages that need nothing else: HTML with the scripts and the numbers in it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from typing import Any

from persfs_cl.io.files import json_text

DRAWING = "text.js", "heights.js", "viewer.js"
"""Scripts that draw a relief, in their order."""

_MARKER = re.compile(r"\{\{(\w+)\}\}")


@cache
def page_file(room: str, name: str) -> str:
    """Text of a file in the folder page/ of a package."""
    return (files(room) / "page" / name).read_text(encoding="utf-8").rstrip()


def drawing_script() -> str:
    """The scripts that draw a relief."""
    return "\n".join(page_file(__package__ or "", name) for name in DRAWING)


def parts(template: str) -> Iterator[tuple[bool, str]]:
    """A template in pieces: text, and between two texts the name of what is to stand there, as ``{{name}}`` has it.

    Yields
    ------
    (bool, str)
        Whether it is a name.
    """
    for number, part in enumerate(_MARKER.split(template)):
        yield number % 2 == 1, part


def json_in_page(value: Any) -> str:
    """JSON in ASCII that is safe inside of a script element: nothing in it ends the element or begins a comment."""
    return json_text(value, indent=None).replace("<", "\\u003c")
