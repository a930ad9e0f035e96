"""Writing tables: CSV with every float as it is, or Parquet of the same columns."""

# pyright: reportUnknownParameterType=false
# (pyarrow has no types: what is annotated as its Table or Array is unknown to pyright)

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.arrow_compute import arrow_compute
from aerotri.formats.text.csv_text import BLANKS
from aerotri.formats.text.tables import CONTROL_CHARACTERS, LONGEST_NAME
from aerotri.spreadsheet import FORMULA, without_formula

if TYPE_CHECKING:
    import pyarrow as pa

NEEDS_QUOTES = r'[",\n\r#]'


def write_table(columns: Mapping[str, np.ndarray], path: Path) -> None:
    """Write a table, by its ending as CSV or as Parquet.

    Parameters
    ----------
    columns : (n,) str or float arrays by name; a NaN becomes an empty cell.
    path : the file.

    Raises
    ------
    InputError
        For a name that would not be read back the same; see also `check_names`.
    """
    import pyarrow as pa

    arrays = {name: _array(np.asarray(values), name) for name, values in columns.items()}
    table = pa.table(arrays)
    if path.suffix == ".parquet":
        from pyarrow import parquet

        parquet.write_table(table, path)
    else:
        _write_csv(table, path)


def check_names(names: np.ndarray, what: str, may_be_empty: bool = False) -> None:
    """Refuse names that a table would not give back: empty, surrounding blanks, control characters, over-long.

    Raises
    ------
    InputError
    """
    if not may_be_empty and (names == "").any():
        raise InputError(f"a {what} has no name", "give it one")
    # from a list: an array of fixed width ends at a NUL on its way into pyarrow
    _checked(_as_text(names.tolist(), what), what)


def _array(values: np.ndarray, name: str) -> pa.Array:
    import pyarrow as pa

    if values.dtype.kind in "UO":
        return _checked(_as_text(values, name), name)
    return pa.array(values, pa.float64(), from_pandas=True)


def _as_text(values: np.ndarray | list[str], what: str) -> pa.Array:
    import pyarrow as pa

    try:
        return pa.array(values, pa.string())
    except (pa.ArrowException, UnicodeError, TypeError) as error:
        raise InputError(f"a name in column '{what}' is no text in UTF-8", "rename it") from error


def _checked(text: pa.Array, what: str) -> pa.Array:
    compute = arrow_compute()
    odd = compute.or_(
        compute.or_(
            compute.match_substring_regex(text, CONTROL_CHARACTERS),
            compute.not_equal(compute.ascii_trim(text, characters=BLANKS), text),
        ),
        compute.greater(compute.utf8_length(text), LONGEST_NAME),
    )
    row = compute.index(odd, True).as_py()
    if row >= 0:
        raise InputError(
            f"{what} {text[row].as_py()[:60]!r} cannot be written",
            f"a name has no blanks around it, no line breaks, and {LONGEST_NAME} characters at most",
        )
    return text


def _write_csv(table: pa.Table, path: Path) -> None:
    """Quotes only in tables that need them: a name with a comma, a quote, or the sign of a comment."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    compute = arrow_compute()
    table = with_plain_texts(table)
    text = [column for column in table.columns if pa.types.is_string(column.type)]
    quoted = any(compute.any(compute.match_substring_regex(column, NEEDS_QUOTES)).as_py() for column in text)
    lone = table.num_columns == 1 and bool(text)
    options = arrow_csv.WriteOptions(include_header=False, quoting_style="needed" if quoted or lone else "none")
    header = ",".join(_header_cell(name) for name in table.column_names)
    with path.open("wb") as file:
        file.write(header.encode("utf-8") + b"\n")
        arrow_csv.write_csv(table, file, options)


def with_plain_texts(table: pa.Table) -> pa.Table:
    """The table with texts that a spreadsheet would run marked as texts; see `spreadsheet.without_formula`."""
    import pyarrow as pa

    compute = arrow_compute()
    for at, column in enumerate(table.columns):
        if pa.types.is_string(column.type) and compute.any(compute.match_substring_regex(column, FORMULA)).as_py():
            plain = [None if text is None else without_formula(text) for text in column.to_pylist()]
            table = table.set_column(at, table.column_names[at], pa.array(plain, pa.string()))
    return table


def _header_cell(name: str) -> str:
    name = without_formula(name)
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in '",#') else name
