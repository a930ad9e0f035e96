"""Accuracy by check points, as a standard asks for it."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath, InputError
from aerotri.public.adjustment import Adjustment
from aerotri.public.folders import refuse_foreign_folder
from aerotri.public.table import Table
from aerotri.public.used_arguments import used_arguments

if TYPE_CHECKING:
    from aerotri.results.accuracy import AccuracyRecord, Met
    from aerotri.results.adjusted_block import AdjustedBlock

ACCURACY_NAMES = ("accuracy.json", "accuracy.html")


@dataclass(frozen=True, eq=False, repr=False)
class Accuracy:
    """The accuracy of a block by its check points, and every requirement of the standard.

    Parameters
    ----------
    record : what was found. settings : every argument that was used, as accuracy.json has them.
    """

    record: AccuracyRecord
    settings: list[dict[str, Any]] = field(default_factory=list)

    @property
    def met(self) -> Met:
        """All that is required taken together: 'met', 'not met' or 'cannot be said'."""
        return self.record.met

    @property
    def rmse_h(self) -> float:
        """m, RMSE_H with the survey error of the check points; NaN without check points."""
        return self.record.rmse_h

    @property
    def rmse_v(self) -> float:
        """m, RMSE_V outside vegetation (NVA), likewise."""
        return self.record.nva

    @property
    def vva(self) -> float:
        """m, RMSE_V in vegetation, likewise."""
        return self.record.vva

    @property
    def rmse_3d(self) -> float:
        """m, RMSE_3D, likewise."""
        return self.record.rmse_3d

    @property
    def requirements(self) -> Table:
        """A row a requirement: what is asked, what was found, whether it is met."""
        names = ("name", "source", "weight", "asked", "found", "met", "says")
        rows = self.record.requirements
        return Table.of("requirements", {name: [getattr(one, name) for one in rows] for name in names})

    @property
    def statements(self) -> tuple[str, ...]:
        """The sentences to report, in the words of the standard."""
        return self.record.statements

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the numbers has to know."""
        return self.record.warnings

    @property
    def content(self) -> dict[str, Any]:
        """The content of accuracy.json."""
        from aerotri.formats.results.accuracy import accuracy_json

        return accuracy_json(self.record) | {"settings": self.settings}

    def html(self) -> str:
        """The page as text."""
        from aerotri.report.pages.accuracy import accuracy_html

        return accuracy_html(self.record)

    def save(self, out: FilePath) -> Path:
        """Write accuracy.json and accuracy.html into a folder.

        Raises
        ------
        InputError
            When the folder holds other files, or cannot be written to.
        """
        from aerotri.formats.files.atomic import atomic_folder
        from aerotri.formats.results.json_text import write_json
        from aerotri.report.pages.accuracy import write_accuracy_page

        target = Path(out)
        refuse_foreign_folder(target, ACCURACY_NAMES[0])
        with atomic_folder(target, own=ACCURACY_NAMES) as folder:
            write_json(folder / "accuracy.json", self.content)
            write_accuracy_page(self.record, folder / "accuracy.html")
        return target

    def summary(self) -> str:
        """The outcome in lines, as the command prints it."""
        from aerotri.report.tables.accuracy import accuracy_lines

        return "\n".join(accuracy_lines(self.record))

    def __repr__(self) -> str:
        return f"<aerotri accuracy of {self.record.block!r}: {self.met}>"

    def _repr_html_(self) -> str:
        return f"<div>{self.requirements.html()}{''.join(f'<p>{escape(one)}</p>' for one in self.statements)}</div>"


def accuracy(
    result: Adjustment | FilePath,
    *,
    class_horizontal: float | None = None,
    class_vertical: float | None = None,
    vegetated: Sequence[str] | FilePath = (),
    project_area: float | None = None,
) -> Accuracy:
    """The accuracy of a result by its check points, as the ASPRS standard asks for it.

    RMSE are those of the differences at the check points with the survey error of the check points included:
    RMSE = √(fit² + survey²), by coordinate. Every requirement stands beside what was found, and whether it is met.

    Parameters
    ----------
    result : of an adjustment, or the folder of one.
    class_horizontal, class_vertical : m, the largest RMSE_H and RMSE_V allowed; None where nothing is asked for.
    vegetated : names of check points in vegetation, or a file with one name a line.
    project_area : m², where it is not that within the outermost ground points.

    Returns
    -------
    Accuracy

    Raises
    ------
    InputError
        When the folder holds no result, a class is not positive, or a name is no check point.

    References
    ----------
    ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2, version 2 (2024); National Standard for
    Spatial Data Accuracy, FGDC-STD-007.3-1998 (places of check points).

    Examples
    --------
    >>> import aerotri
    >>> result = aerotri.adjust(aerotri.simulate(aerotri.example_flight(), seed=1).block)
    >>> aerotri.accuracy(result, class_horizontal=0.2, class_vertical=0.3).met
    'not met'
    """
    from aerotri.diagnosis.accuracy import accuracy_of
    from aerotri.public.results import open_result
    from aerotri.results.accuracy import Asked

    asked = {"class_horizontal": class_horizontal, "class_vertical": class_vertical, "project_area": project_area}
    for name, value in asked.items():
        if value is not None and not (value > 0.0 and math.isfinite(value)):
            raise InputError(f"{name.replace('_', ' ')} {value:g} is not possible", "give a number above 0")
    if not isinstance(result, Adjustment):
        result = open_result(result)
    if result.status != "converged":
        raise InputError(f"the adjustment ended '{result.status}'", "give the result of a converged one")
    names = _vegetated(result.adjusted, vegetated)
    used = used_arguments(accuracy, {**asked, "vegetated": vegetated}, UNITS)
    return Accuracy(accuracy_of(result.adjusted, names, Asked(class_horizontal, class_vertical, project_area)), used)


UNITS = {"class_horizontal": "m", "class_vertical": "m", "project_area": "m²"}


def _vegetated(adjusted: AdjustedBlock, given: Sequence[str] | FilePath) -> tuple[str, ...]:
    """Names of check points; given as such, or in a file."""
    from aerotri.formats.text.name_list import read_point_names

    known = set(adjusted.block.points[adjusted.check.point].astype(str).tolist())
    if isinstance(given, str | os.PathLike):
        return read_point_names(Path(given), known, "check point")
    unknown = [name for name in given if name not in known]
    if unknown:
        raise InputError(f"'{unknown[0]}' is no check point of the result", "name check points of the result")
    return tuple(given)
