"""Names that begin like a formula: text in every table that is written, and the same names when it is read."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from format_samples import assert_same_block
from hypothesis import given
from hypothesis import strategies as st

from aerotri.formats.block.folder import read_block, write_block
from aerotri.formats.results.adjustment import write_csv
from aerotri.spreadsheet import with_formula, without_formula

NAMES = ["=1+1", "+2b", "-3c", "@4", "'=5", "''-x", "-6", "+7.5e3", "'plain", "p1"]


@given(text=st.text(alphabet="'=+-@1.ae ", max_size=12))
def test_every_name_comes_back(text):
    written = without_formula(text)
    assert with_formula(written) == text
    assert written[:1] not in ("=", "@")


@pytest.mark.parametrize("number", ["-1.5", "+2", "-1e-7", "-99", "-.5"])
def test_numbers_stay_numbers(number):
    assert without_formula(number) == number


@pytest.mark.parametrize("tables", ["csv", "parquet"])
def test_a_block_keeps_its_names(small_block, tmp_path, tables):
    """Photographs, points, strips and grouping columns; in CSV no cell begins like a formula."""
    block = read_block(small_block())
    points = np.array([*NAMES[: len(block.points) - 1], "'@z"])
    images = replace(
        block.images,
        names=np.array(["=HYPERLINK(1)", "-b"]),
        strip=np.array(["+s", "@"]),
        columns={"=day": np.array(["-mon", "'=tue"])},
    )
    block = replace(block, points=points, images=images)
    write_block(block, tmp_path / "out", tables)
    assert_same_block(read_block(tmp_path / "out"), block)
    for path in (tmp_path / "out").glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            for cell in (cell for row in csv.reader(file) for cell in row):
                assert cell[:1] not in ("=", "@")
                assert cell[:1] not in ("+", "-") or float(cell) < np.inf


def test_tables_of_results(tmp_path):
    write_csv(tmp_path / "t.csv", {"point": np.array(NAMES), "X": np.linspace(-1.5, 3.0, len(NAMES))})
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    assert [with_formula(row[0]) for row in rows] == NAMES
    assert [row[0] for row in rows[:4]] == ["'=1+1", "'+2b", "'-3c", "'@4"]
    assert rows[0][1] == "-1.5"
