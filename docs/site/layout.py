"""What the style needs of a page's HTML for screens of all widths: words of code, and the titles of cells."""

from __future__ import annotations

import re

_TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
_TITLE = re.compile(r"<th\b[^>]*>(.*?)</th>", re.DOTALL)
_ROW = re.compile(r"<tr>.*?</tr>", re.DOTALL)
_CELL = re.compile(r"<td\b")
_TAG = re.compile(r"<[^>]*>")
# Code in a sentence: a block has <pre> or, from the highlighter, <span></span> before it.
_CODE = re.compile(r"(?<!<pre>)(?<!</span>)<code>([^<]*)</code>")
_HYPHENATED = re.compile(r"\S*-\S*")
_LONGEST = 32
"""Letters that a telephone has room for in one line. Longer words may break at their hyphens."""


def prepared(html: str) -> str:
    """A page in which words of code are marked, and each cell of a table has the title of its column."""
    return _CODE.sub(_with_words, _TABLE.sub(_with_titles, html))


def _with_titles(table: re.Match[str]) -> str:
    titles = [_TAG.sub("", title).replace('"', "&quot;") for title in _TITLE.findall(table[0])]

    def row(found: re.Match[str]) -> str:
        left = iter(titles)
        return _CELL.sub(lambda cell: f'{cell[0]} data-title="{next(left, "")}"', found[0])

    return _ROW.sub(row, table[0])


def _with_words(code: re.Match[str]) -> str:
    return f"<code>{_HYPHENATED.sub(_word, code[1])}</code>"


def _word(found: re.Match[str]) -> str:
    return f'<span class="word">{found[0]}</span>' if len(found[0]) <= _LONGEST else found[0]
