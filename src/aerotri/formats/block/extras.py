"""The tables of decisions and conditions of a block folder: edits and constraints."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import counted
from aerotri.formats.block.journal import Journal
from aerotri.formats.text.csv_text import is_blank
from aerotri.formats.text.table_checks import image_index, refuse_duplicates, sigma_columns
from aerotri.formats.text.tables import Columns, Table, read_table
from aerotri.observations import Control, ImagePoints, Images
from aerotri.observations.block import CONSTRAINT_KINDS, Constraints, Edits

CONSTRAINT_COLUMNS = Columns(text=("kind", "points"), numbers=("sigma",), optional_numbers=("value",))
POINTS_NEEDED = {"vertical": 2, "horizontal": 2, "height_difference": 2, "distance": 2, "plane": 4, "line": 3}
"""Points that each kind of constraint takes at least: three make any plane and two any line, so that one more is needed
for a condition."""
EXACTLY_TWO = ("height_difference", "distance")
"""Kinds between two points, which have a value."""


def edits_of(
    journal: Journal | None, images: Images, points: np.ndarray, rays: ImagePoints, control: Control
) -> Edits | None:
    """The operator's decisions in the end; None where there are none.

    Parameters
    ----------
    points : (N,) str, the names of all points.
    rays, control : what the decisions may refer to, marks set and removed.

    Raises
    ------
    InputError
        With the line: an unknown photograph or point, a ray that was not measured, a role given to what is no control
        point, the same decision twice in a table that is no journal.
    """
    if journal is None or not journal.decisions:
        return None
    table, rows = journal.table, np.array(journal.decisions)
    action = journal.actions[rows]
    named = table.text["image"].rows()[rows] != ""
    image = np.where(named, image_index(table, images, may_be_empty=True)[rows], -1)
    point = _point_index(table, points)[rows]
    for k in np.flatnonzero(named & (action != "off"))[:1].tolist():
        remedy = "leave image empty: the point has this role in all photographs"
        raise table.error(int(rows[k]), f"action {action[k]} with a photograph", remedy)
    for k in np.flatnonzero((action != "off") & ~np.isin(point, control.point))[:1].tolist():
        remedy = "only points of control.csv can become control or check points"
        what = f"point '{table.cell('point', int(rows[k]))}' is not a control or check point"
        raise table.error(int(rows[k]), what, remedy)
    measured = rays.image * np.int64(len(points)) + rays.point
    missing = named & ~np.isin(image * np.int64(len(points)) + point, measured)
    if journal.is_journal:
        # what was switched off may have been removed later
        rows, image, point, action = (part[~missing] for part in (rows, image, point, action))
    elif missing.any():
        row = int(rows[np.flatnonzero(missing)[0]])
        where = f"point '{table.cell('point', row)}' is not measured in photograph '{table.cell('image', row)}'"
        raise table.error(row, where, "write both names as in image_points, or remove the row")
    if not journal.is_journal:
        _refuse_twice(table, image, point, rows, len(points))
    reason = table.text["reason"].rows() if "reason" in table.text else np.full(table.length, "")
    return Edits(image, point, action, reason[rows]) if len(rows) else None


def _refuse_twice(table: Table, image: np.ndarray, point: np.ndarray, rows: np.ndarray, count: int) -> None:
    keys = -1 - np.arange(table.length, dtype=np.int64)
    keys[rows] = (image + 1) * count + point
    refuse_duplicates(table, keys, lambda row: _about(table, row))


def _about(table: Table, row: int) -> str:
    image = table.cell("image", row)
    point = f"a decision on point '{table.cell('point', row)}'"
    return f"{point} in photograph '{image}'" if image else point


def _refuse(table: Table, bad: np.ndarray, column: str, remedy: str) -> None:
    rows = np.flatnonzero(bad)
    if len(rows):
        row = int(rows[0])
        raise table.error(row, f"{column} = '{table.cell(column, row)[:60]}' is not possible", remedy)


def _point_index(table: Table, points: np.ndarray) -> np.ndarray:
    known = {name: i for i, name in enumerate(points.tolist())}
    column = table.text["point"]
    index = np.array([known.get(name, -1) for name in column.names.to_pylist()], dtype=np.int64)[column.index]
    unknown = np.flatnonzero((index < 0) & (table.text["point"].rows() != ""))
    if len(unknown):
        row = int(unknown[0])
        message = f"there is no point '{table.cell('point', row)}'"
        raise table.error(row, message, "name a point of image_points or control, or remove the row")
    return index


def read_constraints(path: Path | None, points: np.ndarray) -> Constraints | None:
    """Conditions between object points; None where there are none.

    Parameters
    ----------
    points : (N,) str, the names of all points.

    Raises
    ------
    InputError
        With the line: an unknown kind or point, too few or too many points for the kind, a value missing or not
        wanted, a standard deviation that is none.
    """
    if path is None or is_blank(path):
        return None
    table = read_table(path, CONSTRAINT_COLUMNS)
    if not table.length:
        return None
    table.require("kind", "points")
    kind = table.text["kind"].rows()
    _refuse(table, ~np.isin(kind, CONSTRAINT_KINDS), "kind", f"known are {', '.join(CONSTRAINT_KINDS)}")
    known = {name: i for i, name in enumerate(points.tolist())}
    members = tuple(_members(table, row, kind[row], known) for row in range(table.length))
    value = table.stack("value")[:, 0]
    _check_values(table, kind, value)
    everywhere = np.ones((table.length, 1), bool)
    sigma = sigma_columns(table, ("sigma",), everywhere, np.full(1, np.nan), "give every condition its sigma, in m")
    return Constraints(kind, members, value, sigma[:, 0])


def _members(table: Table, row: int, kind: str, known: dict[str, int]) -> np.ndarray:
    names = table.cell("points", row).split()
    needed = POINTS_NEEDED[kind]
    if len(names) < needed or (kind in EXACTLY_TWO and len(names) > needed):
        most = "" if kind in EXACTLY_TWO else " or more"
        raise table.error(
            row, f"{kind} has {counted(len(names), 'point')}", f"it needs {needed}{most}, separated by blanks"
        )
    for name in names:
        if name not in known:
            remedy = "name points of image_points or control"
            raise table.error(row, f"there is no point '{name}'", remedy)
    if len(set(names)) < len(names):
        raise table.error(row, f"{kind} names a point twice", "name every point once")
    return np.array([known[name] for name in names], dtype=np.int64)


def _check_values(table: Table, kind: np.ndarray, value: np.ndarray) -> None:
    wants = np.isin(kind, EXACTLY_TWO)
    for bad, message, remedy in (
        (wants & np.isnan(value), "has no value", "give it in metres"),
        (~wants & ~np.isnan(value), "has a value", "leave value empty for this kind"),
        ((kind == "distance") & (value <= 0.0), "is not positive", "a distance is greater than 0"),
    ):
        rows = np.flatnonzero(bad)
        if len(rows):
            row = int(rows[0])
            raise table.error(row, f"{kind[row]} {message}", remedy)
