"""Whole numbers of texts from outside: thousands of digits, and digits of other scripts, are no error of Python."""

from __future__ import annotations

import pytest

from aerotri.conventions import InputError, whole_number
from aerotri.execution.choice import chosen
from aerotri.execution.threads import thread_count
from aerotri.results.head import CLOCK, now

ODD = ("9" * 5000, "²", "٣", "", "-1", "1.5")


def test_whole_number():
    assert [whole_number(text) for text in ODD] == [None] * len(ODD)
    assert (whole_number("0"), whole_number("042"), whole_number("9" * 9)) == (0, 42, 999999999)
    assert whole_number("9" * 10) is None


@pytest.mark.parametrize("text", ODD)
def test_where_they_are_read(text, monkeypatch):
    with pytest.raises(InputError, match="is not a number of processes"):
        chosen(f"processes:{text}")
    monkeypatch.setenv("AEROTRI_THREADS", text)
    assert 0 < thread_count() < 100_000
    monkeypatch.setenv(CLOCK, text)
    assert now().year > 2000
    monkeypatch.setenv(CLOCK, "9" * 11)
    assert now().year == 5138
