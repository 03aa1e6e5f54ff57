"""The handbook: every page is listed, every public name documented, every link mended; and the site can be built."""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import tomlkit
import typer
from test_docstrings import FACES
from test_readme import PAGES

import persfs_cl
from persfs_cl.cli.app import app
from persfs_cl.page import marked

ROOT = Path(__file__).resolve().parent.parent


def load(name: str) -> ModuleType:
    """A module of docs/site/, which MkDocs finds by itself."""
    spec = importlib.util.spec_from_file_location(f"site_{name}", ROOT / "docs" / "site" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Where dataclasses look for the module of their annotations.
    sys.modules[module.__name__] = module
    spec.loader.exec_module(module)
    return module


LINKS = load("links")


def test_the_menu_lists_every_page_once() -> None:
    _, _, menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")
    listed = re.findall(r"[\w/-]+\.md$", menu, re.MULTILINE)
    docs = ROOT / "docs"
    there = [page.relative_to(docs).as_posix() for page in docs.rglob("*.md")]
    assert sorted(listed) == sorted([*there, *LINKS.ELSEWHERE.values()])


def public() -> list[str]:
    """Public names, each where it is found first."""
    found: dict[str, str] = {}
    for face in FACES:
        for name in face.__all__:
            found.setdefault(name, f"{face.__name__}.{name}")
    return sorted(found.values())


def test_the_reference_has_every_public_name_once() -> None:
    pages = (ROOT / "docs" / "reference").glob("*.md")
    found = [name for page in pages for name in re.findall(r"^::: ([\w.]+)$", page.read_text(), re.MULTILINE)]
    assert sorted(found) == public()


def test_the_list_of_names_is_whole() -> None:
    text = (ROOT / "docs" / "reference" / "index.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\[`(\w+)`\]\[persfs_cl\.\1\]", text)) == sorted(persfs_cl.__all__)


@pytest.mark.parametrize(
    "page", ["calibrate", "choosing", "first-photo", "gallery", "gpu", "guided", "troubleshooting"]
)
def test_options_that_a_page_names_exist(page: str) -> None:
    commands: Any = typer.main.get_command(app)
    context = typer.Context(commands)
    options = {
        option
        for name in commands.list_commands(context)
        for parameter in commands.get_command(context, name).params
        for option in (*parameter.opts, *parameter.secondary_opts)
    }
    named = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")))
    assert named
    assert not named - options


def commands_on(page: Path) -> list[list[str]]:
    """The arguments of each call of the command that stands in a block of code."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    found = []
    for line in re.findall(r"^(?: {4}|\$ )?persfs-cl (.*)$", text, re.MULTILINE):
        words = shlex.shlex(line, posix=True, punctuation_chars=True)
        words.whitespace_split = True
        # Up to what is for the shell.
        found.append(list(itertools.takewhile(lambda word: word[0] not in "|&;<>", words)))
    return found


@pytest.mark.parametrize("page", [page for page in PAGES if commands_on(page)], ids=lambda page: page.name)
def test_commands_on_pages_can_be_parsed(page: Path) -> None:
    group: Any = typer.main.get_command(app)
    for name, *arguments in commands_on(page):
        if not name.startswith("-"):
            command = group.get_command(typer.Context(group), name)
            assert command is not None, f"{page.name} names {name}, which is no command"
            command.make_parser(typer.Context(command)).parse_args(arguments)


MENDED = {
    # A page that stands elsewhere, and its place; one of docs/; a picture of either.
    ("index.md", "[a](docs/batch.md#memory)"): "[a](batch.md#memory)",
    ("index.md", "[a](CHANGELOG.md) [b](#devices)"): "[a](changelog.md) [b](#devices)",
    ("index.md", "![a](docs/paper/figure2.png)"): "![a](paper/figure2.png)",
    ("index.md", '<img src="persfs_cl/data/coin.png" width="9">'): '<img src="pictures/coin.png" width="9">',
    ("photographs.md", "[a](../../docs/paper.md)"): "[a](paper.md)",
    ("reference/cameras.md", "[a](../../README.md#conventions)"): "[a](../index.md#conventions)",
    ("batch.md", "[two\nlines](../kernels/README.md)"): "[two\nlines](kernels.md)",
    ("batch.md", "[a](https://example.org/x.md)"): "[a](https://example.org/x.md)",
    # What is not on the site.
    ("batch.md", "of [`it`](../LICENSE), here"): "of [`it`](https://host/x/LICENSE), here",
    # Code is no prose.
    ("batch.md", "```python\nf = [a](b.py)\n```"): "```python\nf = [a](b.py)\n```",
}


@pytest.mark.parametrize(("page", "text"), MENDED)
def test_links_are_mended(page: str, text: str) -> None:
    assert LINKS.mended(text, page, "https://host/x/") == MENDED[page, text]


def test_without_a_repository_links_to_its_files_are_text() -> None:
    assert LINKS.mended("of [`it`](../LICENSE), [a](guided.md)", "batch.md", None) == "of `it`, [a](guided.md)"


def test_options_break_at_no_hyphen_and_cells_have_titles() -> None:
    prepared = load("layout").prepared
    long, block = f"<code>-{'a' * 40}</code>", "<pre><span></span><code>a --b</code></pre>"
    assert prepared("<p><code>--a-b 1</code>") == '<p><code><span class="word">--a-b</span> 1</code>'
    assert prepared(long + block) == long + block
    table = "<table><tr><th>a <b>b</b></th><th>c</th></tr><tr><td>1</td><td>2</td></tr></table>"
    titled = table.replace("<td>1", '<td data-title="a b">1').replace("<td>2", '<td data-title="c">2')
    assert prepared(table) == titled


def test_where_the_project_lives_stands_in_one_place() -> None:
    urls = tomlkit.parse((ROOT / "pyproject.toml").read_text(encoding="utf-8")).unwrap()["project"]["urls"]
    assert {"Homepage", "Repository", "Issues"} <= {*urls}
    known = None if "//example.org" in urls["Repository"] else urls["Repository"].rstrip("/")
    assert LINKS.repository() == known
    pages = [page for room in (ROOT, ROOT / "docs", ROOT / ".github") for page in room.glob("*.md")]
    for file in [*pages, ROOT / "CITATION.cff", ROOT / "mkdocs.yml"]:
        text = file.read_text(encoding="utf-8")
        assert not [url for url in urls.values() if url in text], f"{file.name} names it too"


NOTEBOOK = ROOT / LINKS.NOTEBOOK


def outputs(notebook: Path) -> list[dict[str, Any]]:
    """What the cells show, in their order."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    return [output for cell in cells if cell["cell_type"] == "code" for output in cell["outputs"]]


def printed(notebook: Path) -> list[str]:
    """What the cells print."""
    return ["".join(output["text"]) for output in outputs(notebook) if output["output_type"] == "stream"]


def kinds(notebook: Path) -> list[list[str]]:
    """How each thing is shown that is not printed."""
    return [sorted(output["data"]) for output in outputs(notebook) if output["output_type"] != "stream"]


def test_the_notebook_holds_what_it_shows_and_nothing_of_a_machine() -> None:
    assert printed(NOTEBOOK)
    # Two surfaces, each for front ends of both kinds.
    assert kinds(NOTEBOOK).count(["image/png", "text/html", "text/plain"]) == 2
    text = NOTEBOOK.read_text(encoding="utf-8")
    assert not re.search(r"/(home|root|tmp|work|Users)/| at 0x[0-9a-f]|C:", text)
    assert len(text) < 600_000


def test_the_notebook_becomes_a_page() -> None:
    page = load("notebook").markdown_of(NOTEBOOK)
    assert page.startswith("# ")
    for text in printed(NOTEBOOK):
        assert f"```text\n{text}```" in page
    assert page.count("<iframe ") == 2
    # An empty line would end the HTML.
    assert not [line for line in page.splitlines() if "<iframe " in line and "</iframe>" not in line]
    links = re.findall(r"\]\(([^)#]+\.md)", re.sub(r"<div .*</div>", "", page))
    assert links
    for link in links:
        assert (NOTEBOOK.parent / link).exists(), link


@pytest.mark.thorough
def test_the_notebook_runs_and_shows_the_same(tmp_path: Path) -> None:
    for module in ("nbclient", "ipykernel"):
        pytest.importorskip(module, reason=f"{module} is not installed: the extra [docs] has it")
    again = tmp_path / "again.ipynb"
    command = [sys.executable, str(ROOT / "docs" / "site" / "run_notebook.py"), str(NOTEBOOK), str(again)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert printed(again) == printed(NOTEBOOK)
    assert kinds(again) == kinds(NOTEBOOK)


GALLERY = load("gallery")
ENTRIES = {entry.name: entry for entry in GALLERY.entries(GALLERY.PAGE.read_text(encoding="utf-8"))}


def test_the_gallery_has_a_dozen_subjects_and_small_pictures() -> None:
    page = GALLERY.PAGE.read_text(encoding="utf-8")
    assert len(ENTRIES) >= 12
    assert len(ENTRIES) == len(re.findall("^## ", page, re.MULTILINE)), "an entry without commands or picture"
    assert {*ENTRIES} == {*marked(page)}
    assert all(marked(page).values()), "an entry without figures"
    pictures = {file.stem: file.stat().st_size for file in (ROOT / "docs" / "gallery").iterdir()}
    assert {*pictures} == {*ENTRIES}
    assert sum(pictures.values()) < 1_500_000


@pytest.mark.parametrize("name", ENTRIES)
def test_commands_of_the_gallery_can_be_parsed(name: str) -> None:
    commands = ENTRIES[name].commands
    subprocess.run(["bash", "-n"], input=commands, text=True, check=True)
    for program in re.findall(r"^python << 'END'\n(.*?)^END$", commands, re.MULTILINE | re.DOTALL):
        compile(program, name, "exec")
    assert re.search(r"persfs-cl reconstruct .* -o result ", commands)


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["coin", "inscription", "rabbit", "torch"])
def test_commands_of_the_gallery_give_the_figures_of_the_page(name: str, tmp_path: Path) -> None:
    assert GALLERY.make(ENTRIES[name], tmp_path) == marked(GALLERY.PAGE.read_text(encoding="utf-8"))[name]
    assert GALLERY.picture(tmp_path).shape[0] == 300


@pytest.mark.thorough
def test_the_site_is_built_without_warnings_and_reads_nothing_from_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs", reason="MkDocs is not installed: the extra [docs] has it")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    nowhere = "http://127.0.0.1:9"
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "http_proxy": nowhere, "https_proxy": nowhere}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr

    pages = {page: page.read_text(encoding="utf-8") for page in (tmp_path / "site").rglob("*.html")}
    assert len(pages) > 20
    for page, html in pages.items():
        fetched = re.findall(r'<(?:script|img|iframe)[^>]* src="([^"]+)"|<link[^>]* href="([^"]+)"', html)
        for target in (source or sheet for source, sheet in fetched):
            assert not re.match(r"(\w+:)?//", target), f"{page.name} reads {target}"
            # The page of errors is for a server, and begins at its root. A notebook's pictures lie in the page.
            if page.name != "404.html" and not target.startswith("data:"):
                assert (page.parent / target.partition("?")[0]).exists(), f"{page.name} lacks {target}"

    reference = "".join(html for page, html in pages.items() if page.parent.name == "reference")
    assert not [name for name in public() if f'id="{name}"' not in reference], "have no anchor"
    # Roles that nobody has turned into links.
    assert not re.search(r":(?:func|class|meth|attr|data|mod):", reference)
