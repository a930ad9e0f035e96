"""Texts and numbers of documents in one language: a file of `texts/` for each, all with the same keys."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.report.quality import printable

NO_VALUE = "–"
LONG_WORD, PIECE = 24, 8
"""Characters from which a word of the user may be broken, and into pieces of how many."""
NO_KEY = re.compile(r"[^A-Za-z0-9]+")
MONTH_DAY = re.compile(r"([0-9]{4})-([0-9]{2})-([0-9]{2})")


def languages() -> tuple[str, ...]:
    """Languages that there are texts in, by their codes."""
    names = (one.name for one in files("aerotri.report.documents").joinpath("texts").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


@cache
def texts_of(language: str) -> Mapping[str, str]:
    """All texts of a language by their keys, 'section.key'.

    Raises
    ------
    InputError
        When there is no such language.
    """
    if language not in languages():
        raise InputError(f"there are no texts in '{language}'", f"use {', '.join(languages())}")
    file = files("aerotri.report.documents").joinpath("texts", f"{language}.toml")
    return dict(_flat(tomllib.loads(file.read_text(encoding="utf-8")), ""))


def _flat(table: Mapping[str, Any], before: str) -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    for key, value in table.items():
        found += _flat(value, f"{before}{key}.") if isinstance(value, dict) else [(before + key, str(value))]
    return found


class Words:
    """Texts and numbers of one language.

    Parameters
    ----------
    language : one of `languages()`.

    Raises
    ------
    InputError
        When there is no such language.
    """

    def __init__(self, language: str) -> None:
        self.language = language
        self._texts = texts_of(language)

    def __call__(self, key: str, **values: object) -> str:
        """The text of a key, its placeholders filled in."""
        return self._texts[key].format(**values)

    def term(self, section: str, word: str) -> str:
        """The translation of a word of the program, itself where there is none."""
        return self._texts.get(f"{section}.{NO_KEY.sub('_', word)}", breakable(word))

    def number(self, value: float | None, digits: int, signed: bool = False) -> str:
        """A number with so many decimals; '–' where it is not known."""
        if value is None or not np.isfinite(value):
            return NO_VALUE
        text = f"{value:{'+' if signed else ''},.{digits}f}"
        text = text.lstrip("+-") if float(text.replace(",", "")) == 0.0 else text
        return self._localised(text)

    def whole(self, value: float) -> str:
        """A count."""
        return self.number(value, 0)

    def plain(self, value: float | None, digits: int = 4) -> str:
        """A number with so many digits that count."""
        if value is None or not np.isfinite(value):
            return NO_VALUE
        return self.number(value, decimals(value, digits)) if 1e-4 <= abs(value) < 1e9 or not value else (
            self.scientific(value, digits - 1))  # fmt: skip

    def short(self, value: float) -> str:
        """A value that was stated, without zeros at its end."""
        return self._localised(f"{value:.9g}")

    def scientific(self, value: float | None, digits: int) -> str:
        """Such as '−6.0252·10⁻⁶'."""
        if value is None or not np.isfinite(value):
            return NO_VALUE
        if value == 0.0:
            return "0"
        mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
        power = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return self._localised(mantissa) + (f"·10{power}" if int(exponent) else "")

    def with_sigma(self, value: float, sigma: float | None) -> str:
        """'8 308 ± 20', both to two digits of σ; the value alone where there is no σ."""
        if sigma is None or not np.isfinite(sigma) or sigma <= 0.0:
            return self.plain(value)
        digits = max(0, decimals(sigma, 2))
        return f"{self.number(value, digits)} ± {self.number(sigma, digits)}"

    def date(self, day: str) -> str:
        """A day, given as YYYY-MM-DD, as the language writes it."""
        found = MONTH_DAY.match(day)
        if found is None:
            return breakable(day)
        year, month, of_month = found.groups()
        return self("numbers.date", year=year, month=month, day=of_month)

    def _localised(self, text: str) -> str:
        whole, point, rest = text.partition(".")
        whole = whole.replace(",", self("numbers.thousands")).replace("-", "−")
        return whole + (self("numbers.decimal") + rest if point else "")


def decimals(value: float, digits: int) -> int:
    """Decimals that show so many digits of a value; none before the point are rounded."""
    return max(0, digits - 1 - int(np.floor(np.log10(abs(value))))) if value and np.isfinite(value) else 0


def breakable(text: object, longest: int = 1000) -> str:
    """A text of the user: printable, and its long words may be broken over lines."""
    words = printable(text, longest).split(" ")
    return " ".join(
        "\u200b".join(word[i : i + PIECE] for i in range(0, len(word), PIECE)) if len(word) > LONG_WORD else word
        for word in words
    )
