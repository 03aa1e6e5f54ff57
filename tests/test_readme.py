"""Pages as a reader takes them: examples run as they stand, and print what the page says; links lead somewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted(
    [*ROOT.glob("*.md"), *(page for room in ("docs", "kernels", "persfs_cl") for page in (ROOT / room).rglob("*.md"))]
)

SHELL = ("bash", "console")
# Commands that install the project or call these very tests: they are not run here.
NOT_RUN = ("make ", "pip ")

# A fence may be indented, as part of a list.
FENCE = re.compile(r"^(?P<indent> *)```(?P<language>\w*)\n(?P<text>.*?)^(?P=indent)```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r'\]\(([^)\s]+)\)|<img[^>]* src="([^"]+)"')
PATH_IN_CODE = re.compile(r"`((?:docs|kernels|persfs_cl|tests)/[\w./]*)`")


@dataclass(frozen=True)
class Example:
    """A fenced block that can be run, and the `text` block right after it, which is what it prints."""

    page: str
    line: int
    language: str
    text: str
    output: str | None


def examples(page: str) -> list[Example]:
    markdown = (ROOT / page).read_text(encoding="utf-8")
    found: list[Example] = []
    fences = list(FENCE.finditer(markdown))
    for fence, following in zip(fences, [*fences[1:], None], strict=True):
        language = fence["language"]
        if language == "text":
            continue
        output = None
        if following and following["language"] == "text" and not markdown[fence.end() : following.start()].strip():
            output = textwrap.dedent(following["text"])
        line = markdown.count("\n", 0, fence.start()) + 1
        found.append(Example(page, line, language, textwrap.dedent(fence["text"]), output))
    return found


def typed_lines(example: Example) -> list[str]:
    """The commands of a shell block; a console block also shows prompts, and what the commands print."""
    lines = [line for line in example.text.splitlines() if line.strip()]
    if example.language == "console":
        return [line[2:] for line in lines if line.startswith(("$ ", "> "))]
    return lines


README = examples("README.md")
PAGES_THAT_RUN = ("first-photo", "gpu", "choosing", "calibrate", "guided", "accuracy")
EXAMPLES = [*README, *(each for page in PAGES_THAT_RUN for each in examples(f"docs/{page}.md"))]


def test_readme_has_examples_of_both_kinds_and_output() -> None:
    assert {"python", "bash"} <= {example.language for example in README}
    assert {example.language for example in EXAMPLES} <= {"python", *SHELL}, "a language that no test runs"
    assert any(example.output for example in README)


def is_quick(example: Example) -> bool:
    """Whether an example is run by the quick tests.

    Those of other pages use again what those of README use, and compile more kernels. Of README three start several
    processes that have tests of their own, in tests/cli and tests/pipeline: with a configuration, and with some
    photographs, by the command and by the library.
    """
    return example.page == "README.md" and not re.search(r"--config|persfs-cl batch|ps\.batch", example.text)


@pytest.mark.quick_where(holds=lambda given: is_quick(given["example"]))
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: f"{example.page}, line {example.line}")
def test_example_runs_as_written(example: Example, tmp_path: Path) -> None:
    scripts = Path(sys.executable).parent
    assert (scripts / "persfs-cl").exists(), f"persfs-cl is not installed beside {sys.executable}"
    if example.language == "python":
        command = [sys.executable, "-c", example.text]
    else:
        lines = typed_lines(example)
        runnable = [line for line in lines if not line.startswith(NOT_RUN)]
        if not runnable:
            pytest.skip(f"not run: {'; '.join(line.partition('#')[0].strip() for line in lines)}")
        command = ["bash", "-euo", "pipefail", "-c", "\n".join(runnable)]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{example.page}, line {example.line}:\n{done.stdout}\n{done.stderr}"
    if example.output is not None:
        assert done.stdout == example.output


def prose_of(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def headings(page: Path) -> set[str]:
    """Their anchors, as GitHub makes them."""
    titles = re.findall(r"^#+ (.+)$", prose_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page: Path) -> None:
    prose = prose_of(page)
    for target in (inline or image for inline, image in LINK.findall(prose)):
        if target.startswith(("http://", "https://")):
            continue
        file, _, heading = target.partition("#")
        linked = page.parent / file if file else page
        assert linked.exists(), f"{page.name} links to {target}, which does not exist"
        assert not heading or heading in headings(linked), f"{page.name} links to {target}, where no such heading is"
    for path in PATH_IN_CODE.findall(prose):
        assert (ROOT / path).exists(), f"{page.name} names {path}, which does not exist"


IMPORT = re.compile(r"from (persfs_cl[\w.]*) import ([\w, ]+)")


def test_what_pages_import_is_there() -> None:
    """In examples that are not run too: some take minutes, or want a tool."""
    named = [(page, *found) for page in PAGES for found in IMPORT.findall(page.read_text(encoding="utf-8"))]
    assert named
    for page, module, names in named:
        for name in names.split(","):
            assert hasattr(import_module(module), name.strip()), f"{page.name} imports {name} from {module}"


@pytest.mark.parametrize("name", ["demo.webp", "walls.png", "guide.png", "guided.png", "guided-counts.png"])
def test_the_pictures_are_small(name: str) -> None:
    assert (ROOT / "docs" / name).stat().st_size < 400_000
