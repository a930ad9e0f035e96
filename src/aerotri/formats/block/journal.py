"""edits.csv as a journal: rows are only ever added, a later one overrules an earlier one, `undo` takes one back.

A table with a column `time` is a journal. What it says in the end is what the block is: marks set, moved and removed
change the image points; rays and control points are switched.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import mm_from_px
from aerotri.formats.text.csv_text import is_blank
from aerotri.formats.text.table_checks import image_index
from aerotri.formats.text.tables import Columns, Table, read_table
from aerotri.functional_model.interior import FiducialFit, mm_from_scan
from aerotri.observations import Camera, Control, ImagePoints, Images
from aerotri.observations.block import EDIT_ACTIONS

MARK, REMOVE, ON, UNDO = "mark", "remove", "on", "undo"
NEW_CONTROL, NEW_CHECK = "new_control", "new_check"
GIVEN = (NEW_CONTROL, NEW_CHECK)
"""Actions that give a point coordinates, as a row of control.csv does."""
ACTIONS = (*EDIT_ACTIONS, ON, MARK, REMOVE, *GIVEN, UNDO)
EDIT_COLUMNS = Columns(
    text=("image", "point", "action"), optional_text=("time", "reason"),
    optional_numbers=("column", "row", "old_column", "old_row", "X", "Y", "Z", "sX", "sY", "sZ"),
)  # fmt: skip
OUTSIDE = 0.05
"""Part of the format by which a mark may lie outside of it, as an image point may."""


@dataclass(frozen=True, eq=False)
class Journal:
    """The rows of edits.csv.

    Parameters
    ----------
    table : as read. actions : (n,) str. is_journal : whether later rows may overrule earlier ones.
    decisions : rows that switch rays and points in the end. marks : rows that set, move or remove marks in the end.
    given : rows that make control and check points in the end.
    """

    table: Table
    actions: np.ndarray
    is_journal: bool
    decisions: tuple[int, ...]
    marks: tuple[int, ...]
    given: tuple[int, ...] = ()


def read_journal(path: Path | None) -> Journal | None:
    """The decisions and marks of edits.csv; None where there are none.

    Raises
    ------
    InputError
        With the line: an unknown action, a row without a point, `undo` where there is nothing to take back.
    """
    if path is None or is_blank(path):
        return None
    table = read_table(path, EDIT_COLUMNS)
    if not table.length:
        return None
    table.require("action")
    actions, journal = table.text["action"].rows(), "time" in table.text
    for row in np.flatnonzero(~np.isin(actions, ACTIONS)).tolist():
        raise table.error(row, f"action = '{actions[row][:60]}' is not possible", f"an action is {', '.join(ACTIONS)}")
    points, images = table.text["point"].rows(), table.text["image"].rows()
    for row in np.flatnonzero((points == "") & (actions != UNDO)).tolist():
        raise table.error(row, "point is empty", "give every row a value of point")
    standing = standing_rows(actions.tolist())
    if standing is None:
        row = int(np.flatnonzero(actions == UNDO)[0])
        raise table.error(row, "undo takes nothing back", "remove the row")
    marks = [row for row in standing if actions[row] in (MARK, REMOVE)]
    given = [row for row in standing if actions[row] in GIVEN]
    decisions = [row for row in standing if actions[row] not in (MARK, REMOVE, *GIVEN)]
    keys = list(zip(images.tolist(), points.tolist(), strict=True))
    if journal:
        marks, decisions, given = _last(marks, keys), _last(decisions, keys), _last(given, keys)
    switches = tuple(row for row in decisions if actions[row] != ON)
    return Journal(table, actions, journal, switches, tuple(marks), tuple(given))


def standing_rows(actions: Sequence[str]) -> list[int] | None:
    """Rows that were not taken back; None where `undo` has nothing to take back."""
    standing: list[int] = []
    for row, action in enumerate(actions):
        if action != UNDO:
            standing.append(row)
        elif standing:
            standing.pop()
        else:
            return None
    return standing


def _last(rows: Iterable[int], keys: Sequence[Hashable]) -> list[int]:
    """Of the rows about one thing the last."""
    last: Mapping[Hashable, int] = {keys[row]: row for row in rows}
    return sorted(last.values())


def with_given(control: Control, names: np.ndarray, journal: Journal | None) -> tuple[Control, np.ndarray]:
    """Control and check points with those that the journal makes, and the names of all points.

    Parameters
    ----------
    names : (N,) str of all points.

    Raises
    ------
    InputError
        With the line: a coordinate or a standard deviation is missing, or is none.
    """
    if journal is None or not journal.given:
        return control, names
    table, rows = journal.table, np.array(journal.given)
    row_of = {name: k for k, name in enumerate(names.tolist())}
    more: list[str] = []
    for name in (table.cell("point", row) for row in journal.given):
        if name not in row_of:
            row_of[name] = len(row_of)
            more.append(name)
    xyz, sigma = table.stack("X", "Y", "Z")[rows], table.stack("sX", "sY", "sZ")[rows]
    for k in np.flatnonzero(~np.isfinite(xyz).all(axis=1) | ~(sigma >= 0.0).all(axis=1)).tolist():
        raise table.error(int(rows[k]), "X, Y, Z or their σ are missing", "give all six, in m")
    point = np.array([row_of[table.cell("point", row)] for row in journal.given], dtype=np.int64)
    keep = ~np.isin(control.point, point)
    made = Control(
        np.concatenate([control.point[keep], point]), np.concatenate([control.xyz[keep], xyz]),
        np.concatenate([control.sigma[keep], sigma]),
        np.concatenate([control.is_check[keep], journal.actions[rows] == NEW_CHECK]),
    )  # fmt: skip
    return made, np.concatenate([names, np.array(more, dtype=str)]) if more else names


def with_marks(
    rays: ImagePoints, names: np.ndarray, control: Control, journal: Journal | None, images: Images,
    cameras: tuple[Camera, ...], fits: Mapping[int, FiducialFit], sigma_mm: float,
) -> tuple[ImagePoints, np.ndarray]:  # fmt: skip
    """The rays with marks set, moved and removed, and the names of all points.

    Parameters
    ----------
    names : (N,) str of all points. control : its rays say how exact marks are.
    fits : interior orientation of scanned photographs by index. sigma_mm : σ where no ray tells one.

    Raises
    ------
    InputError
        With the line: a photograph that is not there, a mark without a position, or outside of the photograph.
    """
    if journal is None or not journal.marks:
        return rays, names
    table = journal.table
    image = image_index(table, images, may_be_empty=True)
    row_of = {name: k for k, name in enumerate(names.tolist())}
    measured = {key: k for k, key in enumerate(zip(rays.image.tolist(), rays.point.tolist(), strict=True))}
    xy, gone, added, more = rays.xy.copy(), set[int](), dict[tuple[int, int], np.ndarray](), list[str]()
    for row in journal.marks:
        if image[row] < 0:
            raise table.error(row, "a mark without a photograph", "name the photograph")
        name = table.cell("point", row)
        if name not in row_of:
            row_of[name] = len(row_of)
            more.append(name)
        key = int(image[row]), row_of[name]
        if journal.actions[row] == REMOVE:
            gone |= {measured[key]} if key in measured else set()
            continue
        place = _place(table, row, key[0], images, cameras, fits)
        if key in measured:
            xy[measured[key]] = place
        else:
            added[key] = place
    keep = np.array([k not in gone for k in range(len(rays))], dtype=bool)
    sigma = np.tile(_usual_sigma(rays, control, sigma_mm), (len(added), 1))
    keys = np.array(list(added), dtype=np.int64).reshape(-1, 2)
    return ImagePoints(
        np.concatenate([rays.image[keep], keys[:, 0]]), np.concatenate([rays.point[keep], keys[:, 1]]),
        np.concatenate([xy[keep], np.array(list(added.values())).reshape(-1, 2)]),
        np.concatenate([rays.sigma[keep], sigma]),
    ), np.concatenate([names, np.array(more, dtype=str)]) if more else names  # fmt: skip


def _usual_sigma(rays: ImagePoints, control: Control, sigma_mm: float) -> np.ndarray:
    """(2,) mm, median σ of the rays of control and check points; of all rays where these are not measured."""
    own = np.isin(rays.point, control.point)
    known = rays.sigma[own] if own.any() else rays.sigma
    return np.median(known, axis=0) if len(known) else np.full(2, sigma_mm)


def _place(
    table: Table, row: int, image: int, images: Images, cameras: tuple[Camera, ...], fits: Mapping[int, FiducialFit]
) -> np.ndarray:
    """(2,) mm of a mark."""
    px = table.stack("column", "row")[row]
    if np.isnan(px).any():
        raise table.error(row, "a mark without column and row", "give both, in pixels")
    camera, fit = cameras[images.camera[image]], fits.get(image)
    if fit is not None:
        return mm_from_scan(fit, px[None])[0]
    size = np.array(camera.size_px, dtype=float)
    if (px < -OUTSIDE * size).any() or (px > (1.0 + OUTSIDE) * size).any():
        where = f"column {px[0]:g}, row {px[1]:g}"
        raise table.error(row, f"{where} lies outside of the photograph", f"it has {size[0]:g} × {size[1]:g} pixels")
    return mm_from_px(px[None], camera.size_px, camera.pixel_mm)[0]
