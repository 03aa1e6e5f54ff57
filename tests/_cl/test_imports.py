"""The room of OpenCL builds on little: on what stands below it, and on nothing above."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import persfs_cl

BELOW = {"persfs_cl.blocks", "persfs_cl.checks", "persfs_cl.errors", "persfs_cl.masks"}
PACKAGE = Path(persfs_cl.__file__).parent


def imported(path: Path) -> Iterator[str]:
    """Modules of the package that a file imports, anywhere in it and for types too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            # A name of the package itself may be a module.
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from names if node.module == "persfs_cl" else [node.module]
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_nothing_above_is_imported() -> None:
    files = [*(PACKAGE / "_cl").rglob("*.py"), PACKAGE / "blocks.py", PACKAGE / "checks.py", PACKAGE / "masks.py"]
    found = {name for path in files for name in imported(path) if name.startswith("persfs_cl")}
    assert {name for name in found if not name.startswith("persfs_cl._cl")} == BELOW
