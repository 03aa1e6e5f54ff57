"""Mentions of keywords in messages."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies

from persfs_cl.wording import Mention, keyword, marked, parts, worded


@pytest.mark.parametrize(
    ("value", "written", "typed"),
    [
        ("upwind", "'upwind'", "upwind"),
        ("two\nlines", r"'two\nlines'", r"'two\nlines'"),
        ("\ud800", r"'\ud800'", r"'\ud800'"),
        ("x" * 200, f"'{'x' * 78}…", f"{'x' * 79}…"),
        (1e-5, "1e-05", "1e-05"),
        (Fraction(1, 2), "Fraction(1, 2)", "1/2"),
        (np.float64(1.5), repr(np.float64(1.5)), "1.5"),
        ((3, 4.5), "(3, 4.5)", "3,4.5"),
        ([1, "a"], "[1, 'a']", ""),
        (True, "True", ""),
        (None, "None", ""),
        pytest.param(10**5000, "<int>", "<int>", id="many digits"),
    ],
)
def test_a_value_is_told_in_python_and_in_a_shell(value: Any, written: str, typed: str) -> None:
    assert parts(keyword("name", value)) == (Mention("name", written, typed, type(value).__name__),)
    assert worded(parts(f"a {keyword('name', value)}.")) == f"a name={written}."


@settings(max_examples=30)
@given(strategies.lists(strategies.text() | strategies.tuples(strategies.text("abc", min_size=1), strategies.text())))
def test_a_text_comes_apart_as_it_was_put_together(pieces: list[str | tuple[str, str]]) -> None:
    text = "".join(piece if isinstance(piece, str) else keyword(*piece) for piece in pieces)
    plain = "".join(piece if isinstance(piece, str) else str(*parts(keyword(*piece))) for piece in pieces)
    assert worded(parts(text)) == plain
    mentions = [piece.keyword for piece in parts(text) if isinstance(piece, Mention)]
    assert mentions == [piece[0] for piece in pieces if not isinstance(piece, str)]


def test_a_message_in_another_keeps_its_keywords() -> None:
    text = f"{keyword('width', 3.0)} is too small for {keyword('base')}."
    assert parts(marked(parts(text))) == parts(text)
    assert marked(parts(text)) == text
