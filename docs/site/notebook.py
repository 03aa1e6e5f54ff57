"""A notebook as a page of the site."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

_FENCE = "```"


def markdown_of(source: Path) -> str:
    """A notebook as a page: its texts, its code, and what came out, which must all be in the file."""
    cells = json.loads(source.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join(part for cell in cells for part in _parts(cell)) + "\n"


def _parts(cell: dict[str, Any]) -> list[str]:
    text = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return [text]
    return [f"{_FENCE}python\n{text}\n{_FENCE}", *map(_shown, cell["outputs"])]


def _shown(output: dict[str, Any]) -> str:
    if output["output_type"] == "stream":
        return f"{_FENCE}text\n{''.join(output['text']).rstrip()}\n{_FENCE}"
    data = output["data"]
    if "text/html" in data:
        # In one line: an empty one would end the HTML and begin Markdown.
        return "".join(data["text/html"]).replace("\n", "&#10;")
    if "image/png" in data:
        return f'<img alt="" src="data:image/png;base64,{"".join(data["image/png"]).strip()}">'
    return f"{_FENCE}text\n{''.join(data['text/plain'])}\n{_FENCE}"
