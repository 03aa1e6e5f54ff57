"""Where a link of a page leads on the site: pages are written for the repository, and its files are not all here."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

NOTEBOOK = "docs/notebooks/first-steps.ipynb"
ELSEWHERE = {
    NOTEBOOK: "notebook.md",
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "kernels/README.md": "kernels.md",
    "persfs_cl/data/README.md": "photographs.md",
}
"""Pages that stand beside what they are about, or are no Markdown, and where they are on the site."""

PICTURES = "pictures"
"""Where pictures that lie outside of docs/ go."""

_FENCE = re.compile(r"^ *```\w*\n.*?^ *```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\[\]]*)\]\((?P<target>[^)\s]+)\)")
_IMAGE = re.compile(r'(?P<before><img[^>]* src=")(?P<target>[^"]+)')
_ADDRESS = re.compile(r"[a-z]+:")


def repository() -> str | None:
    """Where the project lives, as pyproject.toml has it, the one place; None while a placeholder stands there."""
    import tomlkit

    project = tomlkit.parse((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    address = str(project["urls"]["Repository"]).rstrip("/")
    return None if "//example.org" in address else address


def source_of(page: str) -> str:
    """The file in the repository that a page of the site is made from."""
    return next((source for source, place in ELSEWHERE.items() if place == page), f"docs/{page}")


def place_of(file: str) -> str | None:
    """Where a file of the repository is on the site; None if it is not there."""
    if file in ELSEWHERE:
        return ELSEWHERE[file]
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    if file.endswith(".png"):
        return f"{PICTURES}/{posixpath.basename(file)}"
    return None


def pictures_elsewhere() -> set[str]:
    """Pictures outside of docs/ that the pages show."""
    found = set()
    for source in ELSEWHERE:
        text = (ROOT / source).read_text(encoding="utf-8")
        for target in (match["target"] for pattern in (_LINK, _IMAGE) for match in pattern.finditer(text)):
            file = _file(source, target)
            if file.endswith(".png") and not file.startswith("docs/"):
                found.add(file)
    return found


def _file(source: str, target: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), target.partition("#")[0]))


def mended(markdown: str, page: str, repository: str | None) -> str:
    """A page's text, with its links as they must be on the site.

    Parameters
    ----------
    markdown : str
    page : str
        Where the page is on the site.
    repository : str or None
        Address below which the files of the repository can be read. Where there is none, a link to a file that is not
        on the site becomes plain text.
    """
    source = source_of(page)

    def address(target: str) -> str | None:
        if target.startswith("#") or _ADDRESS.match(target):
            return target
        file = _file(source, target)
        heading = target[target.index("#") :] if "#" in target else ""
        place = place_of(file)
        if place is not None:
            return posixpath.relpath(place, posixpath.dirname(page) or ".") + heading
        return f"{repository.rstrip('/')}/{file}{heading}" if repository else None

    def link(match: re.Match[str]) -> str:
        target = address(match["target"])
        return match["text"] if target is None else f"{match['picture']}[{match['text']}]({target})"

    def image(match: re.Match[str]) -> str:
        return f"{match['before']}{address(match['target']) or match['target']}"

    return _outside_fences(markdown, lambda prose: _IMAGE.sub(image, _LINK.sub(link, prose)))


def _outside_fences(markdown: str, change: Callable[[str], str]) -> str:
    parts, end = [], 0
    for fence in _FENCE.finditer(markdown):
        parts += [change(markdown[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, change(markdown[end:])])
