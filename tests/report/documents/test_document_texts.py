"""Texts of documents: the same keys and placeholders in every language, all that is used is there; numbers."""

from __future__ import annotations

import re
import string
from pathlib import Path

import pytest

import aerotri.report.documents as documents
from aerotri import InputError
from aerotri.report.documents.calibration import months_later
from aerotri.report.documents.words import Words, breakable, languages, texts_of

FOLDER = Path(documents.__file__).parent


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


def test_languages_have_the_same_texts():
    assert {"de", "en"} <= set(languages())
    english = texts_of("en")
    for language in languages():
        texts = texts_of(language)
        assert set(texts) == set(english)
        for key, text in texts.items():
            assert text, key
            assert placeholders(text) == placeholders(english[key]), key


def test_keys_that_are_named_are_there():
    """Keys in the source; those with a part that is filled in begin as some key does."""
    found = [key for file in FOLDER.glob("*.py") for key in re.findall(r'words\(f?"([a-z_0-9.{}]+)', file.read_text())]
    assert len(found) > 100
    for key in found:
        start = key.partition("{")[0]
        assert key in texts_of("en") or ("{" in key and any(one.startswith(start) for one in texts_of("en"))), key


def test_no_text_is_left_over():
    """Every text is named, or its section is filled in somewhere."""
    files = [*FOLDER.glob("*.py"), FOLDER.parent / "head.py"]
    source = "".join(file.read_text() for file in files).replace("'", '"')
    for key in texts_of("en"):
        section = key.partition(".")[0]
        known = (f'"{key}"', f'"{section}.{{', f'term("{section}"', f'"{key.rstrip("0123456789")}{{')
        assert any(one in source for one in known), key


def test_unknown_language():
    with pytest.raises(InputError, match=r"no texts in '\.\./en'"):
        Words("../en")


@pytest.mark.parametrize(
    ("language", "texts"),
    [("en", ("−1\u2009234.50", "0.00", "8\u2009308 ± 20", "−6.03·10⁻⁶", "2026-05-12", "+0.5")),
     ("de", ("−1\u2009234,50", "0,00", "8\u2009308 ± 20", "−6,03·10⁻⁶", "12.05.2026", "+0,5"))],
)  # fmt: skip
def test_numbers(language, texts):
    words = Words(language)
    assert (
        words.number(-1234.5, 2), words.number(-0.001, 2), words.with_sigma(8308.4, 20.1),
        words.scientific(-6.0252e-6, 2), words.date("2026-05-12"), words.number(0.5, 1, signed=True),
    ) == texts  # fmt: skip
    assert words.number(None, 1) == words.number(float("nan"), 2) == "–"


def test_long_words_can_be_broken():
    assert "\u200b" in breakable("x" * 40)
    assert breakable("x" * 40).replace("\u200b", "") == "x" * 40
    assert breakable("a\x1b[2J\nb") == "a [2J b"


@pytest.mark.parametrize(("day", "later"), [("2026-05-12", "2028-05-12"), ("2024-02-29", "2026-02-28")])
def test_months_later(day, later):
    assert months_later(day, 24) == later
