"""What changed between two results of a block, against σ."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from aerotri.conventions import FilePath, InputError
from aerotri.public.adjustment import Adjustment
from aerotri.public.progress import ProgressLike, stage_report
from aerotri.public.table import Table

if TYPE_CHECKING:
    from aerotri.results.adjusted_block import AdjustedBlock
    from aerotri.statistics.comparison import Comparison, Differences

MOST_NAMED = 5
"""Largest changes that a summary lists by name; chosen [C]: it is read at a glance, all of them are in the tables."""
ANGLES = ("omega", "phi", "kappa")


@dataclass(frozen=True, eq=False, repr=False)
class ResultChanges:
    """Two results side by side: second − first, and over the σ of the second.

    Parameters
    ----------
    record : what was compared, as arrays. first, second : the results.
    """

    record: Comparison
    first: AdjustedBlock
    second: AdjustedBlock

    @property
    def images(self) -> Table:
        """Orientation of the photographs in common: second − first, m and °, and the largest |Δ|/σ."""
        return _differences("photographs", "image", self.record.orientations)

    @property
    def points(self) -> Table:
        """Coordinates of the points in common: second − first, m, and the largest |Δ|/σ."""
        return _differences("points", "point", self.record.points)

    def summary(self, top: int = MOST_NAMED) -> dict[str, Any]:
        """All that changed as plain values; angles in degrees.

        Parameters
        ----------
        top : how many photographs, points and rays are named.

        Raises
        ------
        InputError
            For a negative number.
        """
        from aerotri.formats.results.run_comparison import comparison_json

        refuse_negative(top)
        return comparison_json(self.record, top)

    def _repr_html_(self) -> str:
        """The tables of the command, as a notebook shows them."""
        from aerotri.formats.results.run_comparison import SIGMA_NOTE
        from aerotri.report.tables.comparison import comparison_tables

        notes = "".join(f"<p>{escape(note)}</p>" for note in (SIGMA_NOTE, *self.record.notes))
        return f"<div>{notes}{''.join(map(_html, comparison_tables(self.record, MOST_NAMED)))}</div>"


def changes(
    first: Adjustment | FilePath, second: Adjustment | FilePath, progress: ProgressLike = None
) -> ResultChanges:
    """What changed from one result to another of the same block.

    Parameters
    ----------
    first, second : results, or the folders of them; they need not have converged.
    progress : see `aerotri.adjust`.

    Returns
    -------
    ResultChanges

    Raises
    ------
    InputError
        Where a folder holds no result that can be read; the message names it.

    Examples
    --------
    >>> import aerotri
    >>> block = aerotri.simulate(aerotri.example_flight(), seed=1).block
    >>> found = changes(aerotri.adjust(block), aerotri.adjust(block, parameters="brown:K1"))
    >>> len(found.images)
    12
    """
    from aerotri.statistics.comparison import compare

    with stage_report(progress) as report:
        runs = [_adjusted(source, report.stage) for source in (first, second)]
    return ResultChanges(compare(*runs), *runs)


def _adjusted(source: Adjustment | FilePath, tell: Any) -> AdjustedBlock:
    """The adjusted block of a result; a folder's is linearised and factorised at its solution."""
    from aerotri.compiled import compilation_notice
    from aerotri.opening import open_result
    from aerotri.public.saving import RECORD

    if isinstance(source, Adjustment):
        return source.adjusted
    folder, remedy = Path(source), "give the folder that `aerotri adjust` wrote"
    if not folder.is_dir():
        raise InputError(f"'{folder}' is no folder", remedy)
    if not (folder / RECORD).is_file():
        raise InputError(f"'{folder}' holds no {RECORD}", remedy)
    tell(compilation_notice() or f"reading {folder}", None)
    try:
        return open_result(folder).result
    except InputError as error:
        # both folders have files of the same names
        place = "" if error.file is None else f"{Path(error.file).name}: "
        raise InputError(f"result '{folder}': {place}{error.message}", error.remedy) from None


def refuse_negative(top: int) -> None:
    """Fewer than none cannot be named.

    Raises
    ------
    InputError
    """
    if top < 0:
        raise InputError(f"--top {top} is less than nothing", "give how many things to name, 0 or more")


def _differences(name: str, what: str, found: Differences) -> Table:
    columns: dict[str, Any] = {what: found.names.astype(str).tolist()}
    for k, element in enumerate(found.elements):
        columns[f"d{element}"] = np.degrees(found.delta[:, k]) if element in ANGLES else found.delta[:, k]
    columns["largest"] = np.nan_to_num(found.ratio).max(axis=1, initial=0.0)
    units = {f"d{element}": "°" if element in ANGLES else "m" for element in found.elements} | {"largest": "σ"}
    return Table(name, pa.table(columns), units)


def _html(table: Any) -> str:
    head = "".join(f"<th>{escape(column.name)}</th>" for column in table.columns)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.texts)
    return f"<table><caption>{escape(table.title)}</caption><tr>{head}</tr>{rows}</table>"
