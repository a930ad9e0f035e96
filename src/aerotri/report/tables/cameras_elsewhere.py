"""Adjusted cameras in the parameters of Metashape and Pix4D as tables."""

from __future__ import annotations

from aerotri.formats.foreign.camera_units import METASHAPE, PIX4D, cameras_elsewhere
from aerotri.report.quality import printable
from aerotri.report.tables.adjustment import Column, Table
from aerotri.results.adjusted_block import AdjustedBlock

SHORT = {"focal length": "F", "principal point x": "cx", "principal point y": "cy"}
FORMS = {"px": ".3f", "mm": ".4f", "": ".6g"}


def elsewhere_tables(adjusted: AdjustedBlock) -> tuple[tuple[Table, ...], tuple[str, ...]]:
    """A table a program that can describe a camera, a row a camera; what is only near, or cannot be given, in words."""
    found = cameras_elsewhere(adjusted)
    tables: list[Table] = []
    for program in (METASHAPE, PIX4D):
        own = [one for one in found if one.program == program and one.values]
        if own:
            columns = tuple(Column(SHORT.get(name, name), unit, FORMS[unit]) for name, _, unit in own[0].values)
            rows = tuple((one.camera, *(value for _, value, _ in one.values)) for one in own)
            tables.append(Table(program, (Column("camera"), *columns), rows))
    return tuple(tables), tuple(printable(text, 1000) for one in found for text in one.said)
