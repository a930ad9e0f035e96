"""Checks that several tables share: known images, nothing twice, three values or none, positive standard deviations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerotri.conventions import InputError
from aerotri.formats.text.sigmas import REMEDY as SIGMA_REMEDY
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.formats.text.tables import SMALLEST_POSITIVE, Table
from aerotri.observations import Images
from aerotri.observations.names import SHOWN_NEAR, near_names


def refuse_duplicates(table: Table, keys: np.ndarray, name: Callable[[int], str]) -> None:
    """Refuse a table that says the same thing twice.

    Parameters
    ----------
    keys : (n,) int, equal where rows say the same.
    name : words for what a row (from 0) is about.

    Raises
    ------
    InputError
        At the second of the two rows, naming the line of the first.
    """
    ordered = np.sort(keys)
    if not (ordered[1:] == ordered[:-1]).any():
        return
    repeated = np.ones(len(keys), bool)
    repeated[np.unique(keys, return_index=True)[1]] = False
    row = int(np.flatnonzero(repeated)[0])
    earlier = int(np.flatnonzero(keys == keys[row])[0])
    line = None if table.source is None else table.source.line_of_row(earlier)
    first = f"row {earlier + 1}" if line is None else f"line {line}"
    raise table.error(row, f"{name(row)} is there twice, first in {first}", "keep one of the rows")


def three_or_none(table: Table, columns: tuple[str, str, str]) -> np.ndarray:
    """(n, 3) of three number columns that are given together or not at all; NaN where not.

    Raises
    ------
    InputError
        When a row gives one or two of them, or the table has some of the columns only.
    """
    there = [column for column in columns if column in table.numbers]
    if there and len(there) < 3:
        missing = next(column for column in columns if column not in there)
        line = None if table.source is None else table.source.first_line - 1
        remedy = f"give {', '.join(columns)}, or none of them"
        raise InputError(f"column '{missing}' is missing beside '{there[0]}'", remedy, table.path, line)
    values = table.stack(*columns)
    empty = np.isnan(values)
    partial = np.flatnonzero(empty.any(axis=1) & ~empty.all(axis=1))
    if len(partial):
        row = int(partial[0])
        column = columns[int(np.flatnonzero(empty[row])[0])]
        raise table.error(row, f"{column} is empty", f"give {', '.join(columns)}, or none of them")
    return values


def sigma_columns(
    table: Table, columns: tuple[str, ...], wanted: np.ndarray, default: np.ndarray, remedy: str,
    may_be_zero: bool = False, on_ground: bool = False,
) -> np.ndarray:  # fmt: skip
    """(n, k) standard deviations, by default where the table gives none, NaN where no value is wanted.

    Parameters
    ----------
    columns : k names.
    wanted : (n, k) bool, where there is an observation.
    default : (k,), NaN where there is no default.
    remedy : what to do where a standard deviation is missing.
    may_be_zero : 0 stands for a value without error.
    on_ground : they are of coordinates on the ground, m, which have bounds of their own.

    Raises
    ------
    InputError
        For a standard deviation that is not positive, or missing without a default.
    """
    given = table.stack(*columns)
    if on_ground:
        absurd = np.argwhere(impossible_sigmas(given) & (given > 0.0))
        if len(absurd):
            row, k = absurd[0].tolist()
            raise table.error(row, f"{columns[k]} {why_impossible(float(given[row, k]))}", SIGMA_REMEDY)
    for k, column in enumerate(columns):
        bad = np.flatnonzero((given[:, k] < SMALLEST_POSITIVE) & ~((given[:, k] == 0.0) & may_be_zero))
        if len(bad):
            row = int(bad[0])
            raise table.error(
                row,
                f"{column} = {given[row, k]:g} is not a standard deviation",
                "give 0 for a coordinate without error, else the standard deviation" if may_be_zero else
                "give a standard deviation greater than 0",
            )  # fmt: skip
    sigma = np.where(np.isnan(given), default, given)
    missing = np.argwhere(np.isnan(sigma) & wanted)
    if len(missing):
        row, k = missing[0].tolist()
        raise table.error(row, f"{columns[k]} is not given", remedy)
    return np.where(wanted, sigma, np.nan)


def image_index(table: Table, images: Images, may_be_empty: bool = False) -> np.ndarray:
    """(n,) index of the images a table names; −1 for an empty cell where there may be some.

    Raises
    ------
    InputError
        At a name that images.csv does not have.
    """
    known = {name: i for i, name in enumerate(images.names.tolist())}
    column = table.text["image"]
    names = column.names.to_pylist()
    index = np.array([known.get(name, -1) for name in names], dtype=np.int64)[column.index]
    empty = names.index("") if may_be_empty and "" in names else -1
    unknown = np.flatnonzero((index < 0) & (column.index != empty))
    if len(unknown):
        row = int(unknown[0])
        name = table.cell("image", row)
        near = near_names([name], known)[name][:SHOWN_NEAR]
        remedy = "add it there, or remove its rows"
        if near:
            remedy = f"write it as there: {', '.join(repr(other) for other in near)}"
        raise table.error(row, f"photograph '{name}' is not in the table images", remedy)
    return index
