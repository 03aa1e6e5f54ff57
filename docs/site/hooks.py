"""What MkDocs calls while it builds the site: pages from outside of docs/, and links as they must be here."""

from __future__ import annotations

from layout import prepared
from links import ELSEWHERE, NOTEBOOK, ROOT, mended, pictures_elsewhere, place_of, repository
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from notebook import markdown_of


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Name the repository in the header, once it is known."""
    config.repo_url = repository()
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that stand elsewhere, and the pictures that they show."""
    for source in sorted({*ELSEWHERE, *pictures_elsewhere()}):
        place = place_of(source)
        if place is None:
            raise ValueError(f"{source} has no place on the site: docs/site/links.py gives it one.")
        if source == NOTEBOOK:
            files.append(File.generated(config, place, content=markdown_of(ROOT / source)))
        else:
            files.append(File.generated(config, place, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Mend the links."""
    address = repository()
    return mended(markdown, page.file.src_uri, address and f"{address}/blob/main")


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Prepare it for screens of all widths."""
    return prepared(html)
