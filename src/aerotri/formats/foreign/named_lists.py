"""Lists whose columns are known by their names: positions, control points or orientations, as many programs write them.

The names stand in the first row, in a comment above the rows (Metashape), or are stated by the user (``PNEZD``). Their
order does not matter, and units in brackets are brought to metres and degrees. Cells are separated by commas,
semicolons, tabs or blanks; where commas do not separate, they may stand in numbers. Longitude and latitude make the
list one of EPSG:4326, unless a comment or a column names its coordinate system.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.georeference import is_projected
from aerotri.coordinates.stated_systems import StatedSystem, geographic_of
from aerotri.crs_text import plan_of
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, texts
from aerotri.formats.foreign.list_header import Header, cells, check_header, header_of, plain_number, rows_below
from aerotri.formats.foreign.list_systems import (
    exchange_in_words,
    in_words,
    one_system,
    order_of_axes,
    refuse_unknown_heights,
    systems_of_comments,
)
from aerotri.formats.text.list_columns import IN_DEGREES, ListColumn
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.sigmas import REMEDY, impossible_sigmas, why_impossible
from aerotri.formats.text.text_lines import TextFile
from aerotri.functional_model.rotation import rotation_from_angles

GEOGRAPHIC = "EPSG:4326"
NO_NUMBER = ("", "nan", "-", "--", "n/a", "#n/a", "none", "null")
"""What stands where nothing is known, in small letters."""
MOST_NAMED = 30
"""Columns that are named where they are not carried over [C]."""
TEXTS = ("name", "role", "crs")
"""Meanings of columns that hold no numbers."""
SIGMAS = ("sX", "sY", "sZ", "s_plan", "s_height", "s_all")


@dataclass(frozen=True, eq=False)
class _List:
    """Rows of a list: columns by their meaning with factors, the coordinate system, and what to say of the list."""

    file: TextFile
    rows: list[int]
    columns: dict[str, list[str]]
    header: tuple[ListColumn, ...]
    system: StatedSystem
    notes: tuple[str, ...]

    def numbers(self, *names: str) -> np.ndarray:
        """(n, k) in metres or degrees, NaN where a cell is empty or the column is missing."""
        found = np.full((len(self.rows), len(names)), np.nan)
        for k, name in enumerate(names):
            given = [(i, word) for i, word in enumerate(self.columns.get(name, ())) if word.lower() not in NO_NUMBER]
            index = [i for i, _ in given]
            values = self.file.values([word for _, word in given], [self.rows[i] for i in index], name)
            factor = self._factor(name)
            if np.isnan(factor):
                refuse_unknown_heights(self.file, self.system, values)
            found[index, k] = values * factor
        return found

    def _factor(self, name: str) -> float:
        column = next((column for column in self.header if column.meaning == name), None)
        if column is not None and column.unit and np.isfinite(column.factor):
            return column.factor
        # a σ without a unit of its own counts as its coordinate does, beside degrees in metres
        if name in ("sZ", "s_height"):
            return self._factor(self.heights)
        if name in ("sX", "sY", "s_plan", "s_all"):
            return self._factor("Y" if name == "sY" else "X") if {"X", "Y"} & set(self.columns) else 1.0
        if name in ("X", "Y"):
            return self.system.plan_to_metre
        return self.system.height_to_metre if name in ("Z", "h_ell") else 1.0

    @property
    def is_plane(self) -> bool:
        """Whether X and Y are used, not longitude and latitude."""
        return bool({"X", "Y"} & set(self.columns)) or not {"lon", "lat"} <= set(self.columns)

    @property
    def heights(self) -> str:
        """The column of heights that is used: with longitude and latitude the ellipsoidal one, if there are two."""
        return "h_ell" if "h_ell" in self.columns and ("Z" not in self.columns or not self.is_plane) else "Z"


def _read(path: Path, columns: str = "") -> _List:
    everything = TextFile(path, comments=False, any_letters=True, keep_tabs=True)
    if not len(everything):
        raise InputError("is empty", "the first row names the columns", path)
    header = header_of(everything.lines, columns)
    if header is None:
        raise everything.error(0, "does not begin with the names of the columns",
                               "add a first row that names them, or state them with --columns")  # fmt: skip
    header, rows = rows_below(everything, header)
    check_header(everything, header)
    words = {row: _without_surplus(everything, row, header) for row in rows}
    rows = [row for row in rows if any(words[row])]
    for row in rows:
        if len(words[row]) != len(header.columns):
            message = f"the row has {len(words[row])} cells, the header has {len(header.columns)}"
            raise everything.error(row, message, "give every row all columns; is the file cut off?")
    by_meaning = {
        column.meaning: [words[row][i] for row in rows] for i, column in enumerate(header.columns) if column.meaning
    }
    for name in by_meaning.keys() - set(TEXTS):
        by_meaning[name] = [plain_number(word, header.separator != ",") for word in by_meaning[name]]
    system, notes = _system(everything, header, by_meaning)
    above = [line for line in everything.lines[: header.line or 0] if not line.startswith("#")]
    titles = (left_behind(f"{path.name}: '{line[:60]}' above the names of the columns is not used") for line in above)
    return _List(everything, rows, by_meaning, header.columns, system, (*everything.notes, *titles, *notes))


def _without_surplus(file: TextFile, row: int, header: Header) -> list[str]:
    """The cells of a row without empty ones behind the last column."""
    words = cells(file.lines[row], header.separator)
    while len(words) > len(header.columns) and not words[-1]:
        words.pop()
    return words


def _system(file: TextFile, header: Header, columns: dict[str, list[str]]) -> tuple[StatedSystem, tuple[str, ...]]:
    """The coordinate system that comments or a column name, and what to say of it and of the columns."""
    stated, notes = systems_of_comments(file, header.line)
    of_column = sorted(set(columns.get("crs", ())) - {""})
    stated += [(header.line or 0, text if not text.isdigit() else f"EPSG:{text}") for text in of_column]
    system = one_system(file, stated)
    if system is None:
        geographic = not {"X", "Y"} & header.meanings and "lon" in header.meanings
        system = StatedSystem(GEOGRAPHIC if geographic else "")
    return system, (*in_words(system, file.path), *notes, *_notes(header, file.path.name))


def _notes(header: Header, name: str) -> tuple[str, ...]:
    said = []
    for column in header.columns:
        if column.unit and np.isnan(column.factor):
            said.append(left_behind(f"{name}: what stands in brackets in '{column.name}' is not used"))
        elif column.unit and column.factor != 1.0:
            unit = "degrees" if column.meaning in IN_DEGREES else "metres"
            said.append(taken(f"{name}: column '{column.name}' was brought to {unit}"))
    return tuple(said)


def _names(found: _List, what: str) -> np.ndarray:
    names = found.columns["name"]
    if not names:
        raise found.file.error(len(found.file), f"holds no {what}s", "give a row for each")
    found.file.check_names(names, found.rows, what)
    found.file.refuse_repeated(names, found.rows, what)
    return texts(names)


def _coordinates(found: _List) -> tuple[np.ndarray, str, str]:
    """(n, 3), the CRS where it is told, and 'ellipsoidal' where the heights are called so.

    Heights above the ellipsoid are not those of the system of heights that is named.
    """
    names, crs = ("X", "Y") if found.is_plane else ("lon", "lat"), found.system.crs
    if not found.is_plane and crs and is_projected(plan_of(crs)):
        crs = geographic_of(crs)
    xyz = found.numbers(*names, found.heights)
    return (xyz, plan_of(crs), "ellipsoidal") if found.heights == "h_ell" else (xyz, crs, "")


def _sigma(found: _List, may_be_zero: bool = False) -> tuple[np.ndarray, tuple[str, ...]]:
    """(n, 3) m; the more particular column counts. 0, where it may be, stands for a coordinate without error."""
    said: tuple[str, ...] = ()
    if [name for name in SIGMAS if name in found.columns] == ["sX"]:
        # Metashape names the one accuracy after the first axis
        said = (assumed(f"{found.file.path.name}: the accuracy of X is the only one, and counts for Y and Z too"),)
        sigma = np.repeat(found.numbers("sX"), 3, axis=1)
    else:
        sigma = found.numbers("sX", "sY", "sZ")
        for fallback in (found.numbers("s_plan", "s_plan", "s_height"), found.numbers("s_all", "s_all", "s_all")):
            sigma = np.where(np.isnan(sigma), fallback, sigma)
    bad = np.argwhere(impossible_sigmas(sigma, may_be_zero))
    if len(bad):
        row, k = bad[0].tolist()
        why = why_impossible(float(sigma[row, k]), may_be_zero)
        raise found.file.error(found.rows[row], f"a standard deviation {why}", REMEDY)
    return sigma, said


def _messages(found: _List, *used: str) -> tuple[str, ...]:
    """What was read in another way than it stands there, and the columns that were not."""
    used_now = {"name", "X", "Y", "crs", found.heights, *SIGMAS, *used}
    used_now |= set() if found.is_plane else {"lon", "lat"}
    left = [column.name for column in found.header if column.name and column.meaning not in used_now]
    shown = ", ".join(name[:40] for name in left[:MOST_NAMED])
    more = f" and {len(left) - MOST_NAMED} more" if len(left) > MOST_NAMED else ""
    said = left_behind(f"{found.file.path.name}: columns not carried over: {shown}{more}")
    return (*found.notes, *((said,) if left else ()))


def _exchange(found: _List, exchanged: bool) -> tuple[str, ...]:
    axes = ("X", "Y") if found.is_plane else ("lon", "lat")
    names = [column.name for axis in axes for column in found.header if column.meaning == axis]
    return exchange_in_words(exchanged, found.file.path, [f"'{name}'" for name in names])


def read_positions(path: FilePath, columns: str = "", exchanged: bool = False) -> PositionList:
    """Observed positions of photographs.

    Parameters
    ----------
    columns : see `stated_columns`; '' where the list names them. exchanged : whether X and Y are to change places.

    Raises
    ------
    InputError
        With the line: a coordinate that is missing or no number, a photograph there twice.
    """
    found = _read(Path(path), columns)
    names = _names(found, "photograph")
    xyz, crs, heights = _coordinates(found)
    partial = np.flatnonzero(np.isnan(xyz).any(axis=1))
    if len(partial):
        remedy = "positions need X, Y and Z, or longitude, latitude and height"
        raise found.file.error(found.rows[partial[0]], "a coordinate is missing", remedy)
    angles = np.radians(found.numbers("yaw", "pitch", "roll"))
    angles[np.isnan(angles).any(axis=1)] = np.nan
    sigma, said = _sigma(found)
    messages = (*_exchange(found, exchanged), *_messages(found, "yaw", "pitch", "roll"), *said)
    order = order_of_axes(exchanged)
    return PositionList(found.file.path, names, xyz[:, order], sigma[:, order], angles, crs, messages, heights)


def read_control_list(path: FilePath, columns: str = "", exchanged: bool = False) -> PointList:
    """Control and check points; an empty coordinate is unknown.

    Parameters
    ----------
    columns : see `stated_columns`; '' where the list names them. exchanged : whether X and Y are to change places.

    Raises
    ------
    InputError
        With the line: no coordinate at all, no number, a role that is none, a point there twice.
    """
    found = _read(Path(path), columns)
    names = _names(found, "point")
    xyz, crs, heights = _coordinates(found)
    nothing = np.flatnonzero(np.isnan(xyz).all(axis=1))
    if len(nothing):
        remedy = "name the columns X, Y, Z, or Easting, Northing, Height, and fill one of them"
        raise found.file.error(found.rows[nothing[0]], "the point has no coordinates", remedy)
    roles = np.array(found.columns.get("role", ["control"] * len(names)))
    odd = np.flatnonzero((roles != "control") & (roles != "check"))
    if len(odd):
        raise found.file.error(
            found.rows[odd[0]], f"role = '{roles[odd[0]][:60]}' is not possible", "a role is control or check"
        )
    sigma, said = _sigma(found, may_be_zero=True)
    order = order_of_axes(exchanged)
    return PointList(
        found.file.path, names, xyz[:, order], sigma[:, order], roles == "check", crs, heights=heights,
        messages=(*_exchange(found, exchanged), *_messages(found, "role"), *said),
    )  # fmt: skip


def read_named_orientations(path: FilePath) -> OrientationList:
    """Positions and ω, φ, κ in degrees, R = Rx·Ry·Rz.

    Raises
    ------
    InputError
        With the line: a value that is missing or no number, a photograph there twice.
    """
    found = _read(Path(path))
    names = _names(found, "photograph")
    values = found.numbers("X", "Y", "Z", "omega", "phi", "kappa")
    partial = np.flatnonzero(np.isnan(values).any(axis=1))
    if len(partial):
        raise found.file.error(found.rows[partial[0]], "a value is missing", "give X, Y, Z, omega, phi, kappa")
    rotation = rotation_from_angles(np.radians(values[:, 3:]))
    messages = _messages(found, "omega", "phi", "kappa")
    return OrientationList(
        found.file.path, names, np.full(len(names), ""), values[:, :3], rotation, messages=messages,
        crs=found.system.crs,
    )  # fmt: skip
