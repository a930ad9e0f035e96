"""Lists whose columns are known by their names: positions, control points or orientations, as many programs write them.

The names stand in the first row, in a comment above the rows (Metashape), or are stated by the user (``PNEZD``). Their
order does not matter, and units in brackets are brought to metres and degrees. Cells are separated by commas,
semicolons, tabs or blanks; where commas do not separate, they may stand in numbers. Longitude and latitude make the
list one of EPSG:4326, unless a comment or a column names its coordinate system.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.coordinates.georeference import is_projected
from aerotri.coordinates.stated_systems import REMEDY, StatedSystem, geographic_of, stated_system
from aerotri.crs_text import plan_of
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, texts
from aerotri.formats.text.list_columns import ListColumn, is_unit, list_column, looks_like_unit
from aerotri.formats.text.tables import LONGEST_NAME, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines
from aerotri.functional_model.rotation import rotation_from_angles

GEOGRAPHIC = "EPSG:4326"
MOST_COLUMNS = 1000
"""Columns of a list at most; chosen [C]: no program writes as many; a file of another kind on one long line would."""
NO_NUMBER = ("", "nan", "-", "--", "n/a", "#n/a", "none", "null")
"""What stands where nothing is known, in small letters."""
OF_SYSTEM = re.compile(
    r"#\s*(?:(?:coordinate|reference|horizontal|koordinaten)\s*(?:reference\s*)?system|(?:horizontal\s*)?crs|srs|projection)"
    r"(?:\s*\([^)]*\))?\s*[:=,]?\s+?(.+)|#\s*(EPSG[:,].+)",
    re.IGNORECASE,
)
ABOUT_SYSTEM = re.compile(r"epsg|\bcrs\b|system|datum|units?\b|feet|height", re.IGNORECASE)
"""Comments that may be about the system of the coordinates: where they are not understood, they are named."""
NAME_ORDER = ("label", "name", "imagename", "image", "photo", "filename", "punkt", "point", "gcp", "marker", "target")
"""Of several columns of names the one whose name begins so is taken; cameras and numbers come last."""
OF_TOTALS = re.compile(r"#?\s*\"?total\s+error", re.IGNORECASE)
LETTERS = {"P": "name", "N": "Y", "E": "X", "Z": "Z", "X": "X", "Y": "Y", "H": "Z", "D": "", "-": ""}
"""Letters of --columns: point, northing, easting, height, description."""
COORDINATES = ("X", "Y", "Z", "lon", "lat")
MOST_NAMED = 30
"""Columns that are named where they are not carried over [C]."""
SIGMAS = ("sX", "sY", "sZ", "s_plan", "s_height", "s_all")
SEPARATORS = ",;\t|"


@dataclass(frozen=True, eq=False)
class _Header:
    """The names of the columns: what they hold, what separates the cells, and the line they stand in (None: stated)."""

    columns: tuple[ListColumn, ...]
    separator: str | None
    line: int | None

    @property
    def meanings(self) -> set[str]:
        return {column.meaning for column in self.columns if column.meaning}


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
            found[index, k] = values * self._factor(name)
        return found

    def _factor(self, name: str) -> float:
        column = next((column for column in self.header if column.meaning == name), None)
        if column is not None and column.unit and np.isfinite(column.factor):
            return column.factor
        axis = {"sX": "X", "sY": "Y", "s_plan": "X", "s_all": "X", "sZ": "Z", "s_height": "Z"}.get(name)
        if axis is not None:
            # a σ without a unit of its own counts as its coordinate does
            return self._factor(axis) if {"X", "Y"} & set(self.columns) else 1.0
        if name in ("X", "Y"):
            return self.system.plan_to_metre
        return self.system.height_to_metre if name in ("Z", "h_ell") else 1.0

    @property
    def is_plane(self) -> bool:
        """Whether X and Y are used, not longitude and latitude."""
        return bool({"X", "Y"} & set(self.columns)) or not {"lon", "lat"} <= set(self.columns)


def is_named_list(path: Path, columns: str = "") -> bool:
    """Whether the columns have names, or are stated, among them one of names and at least two coordinates."""
    header = _header(first_lines(path, 40, comments=False), columns)
    return header is not None and "name" in header.meanings


def is_named_orientations(path: Path) -> bool:
    """Whether positions and ω, φ, κ are among the names of the columns."""
    header = _header(first_lines(path, 40, comments=False))
    return header is not None and {"name", "X", "Y", "Z", "omega", "phi", "kappa"} <= header.meanings


def has_attitudes(path: Path) -> bool:
    """Whether positions, yaw, pitch and roll are among the names of the columns: a list of photographs."""
    header = _header(first_lines(path, 40, comments=False))
    return header is not None and {"name", "yaw", "pitch", "roll"} <= header.meanings


def is_named(path: Path) -> bool:
    """Whether the columns of a list have names, so that they are not known by their number."""
    return _header(first_lines(path, 40, comments=False)) is not None


def stated_columns(text: str) -> tuple[ListColumn, ...]:
    """The columns that the user states: letters such as PNEZD, or names separated by commas; - for one left out.

    Raises
    ------
    InputError
        When one of them is not known, or there is no name or no coordinate.
    """
    if not text:
        return ()
    letters = "," not in text and all(letter in LETTERS for letter in text.upper())
    found = tuple(
        ListColumn(word, LETTERS[word.upper()]) if letters else list_column(word.strip() if word.strip() != "-" else "")
        for word in (text if letters else text.split(","))
    )
    odd = [column.name for column in found if not letters and column.name and not column.meaning]
    meanings = {column.meaning for column in found}
    if odd or "name" not in meanings or len(meanings & set(COORDINATES)) < 2:
        what = f"'{odd[0][:40]}' is no column" if odd else "no name, or no two coordinates"
        raise InputError(
            f"--columns '{text[:80]}': {what}", "write letters such as PNEZD, or names: --columns name,X,Y,Z,sX,sY,sZ"
        )
    return found


def _header(lines: Sequence[str], columns: str = "") -> _Header | None:
    """The names of the columns; None where nothing names two coordinates."""
    data = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    if columns:
        first = lines[data] if data < len(lines) else ""
        return _Header(stated_columns(columns), _separator(first), None)
    for number in ([data] if data < len(lines) else []) + list(range(data - 1, -1, -1)):
        line = lines[number].lstrip("# ")
        separator = _separator(line)
        found = tuple(map(list_column, cells(line, separator)[: MOST_COLUMNS + 1]))
        if sum(column.meaning in COORDINATES for column in found) > 1:
            return _Header(_with_one_name(found), separator, number)
    return None


def _with_one_name(columns: tuple[ListColumn, ...]) -> tuple[ListColumn, ...]:
    """The columns with the best one of names alone."""
    named = [i for i, column in enumerate(columns) if column.meaning == "name"]
    if len(named) < 2:
        return columns

    def rank(i: int) -> int:
        plain = re.sub(r"[^a-z]", "", columns[i].name.lower())
        return next((k for k, word in enumerate(NAME_ORDER) if plain.startswith(word)), len(NAME_ORDER))

    best = min(named, key=rank)
    return tuple(
        replace(column, meaning="") if i in named and i != best else column for i, column in enumerate(columns)
    )


def _separator(line: str) -> str | None:
    most = max(SEPARATORS, key=line.count)
    return most if most in line else None


def cells(line: str, separator: str | None) -> list[str]:
    """The cells of a line, quotes taken off; separated by blanks where there is no separator."""
    if separator is None and '"' not in line:
        return line.split()
    try:
        words = next(csv.reader([line], delimiter=separator or " ", skipinitialspace=True), [])
    except csv.Error:
        # a cell longer than any name or number
        return [line[:LONGEST_NAME]]
    return [word.strip().replace("\u2212", "-") for word in words if separator is not None or word]


def _read(path: Path, columns: str = "") -> _List:
    everything = TextFile(path, comments=False, any_letters=True, keep_tabs=True)
    if not len(everything):
        raise InputError("is empty", "the first row names the columns", path)
    header = _header(everything.lines, columns)
    if header is None:
        raise everything.error(0, "does not begin with the names of the columns",
                               "add a first row that names them, or state them with --columns")  # fmt: skip
    header, rows = _rows_below(everything, header)
    _check_header(everything, header)
    words = {row: _without_surplus(everything, row, header) for row in rows}
    rows = [row for row in rows if any(words[row])]
    for row in rows:
        if len(words[row]) != len(header.columns):
            message = f"the row has {len(words[row])} cells, the header has {len(header.columns)}"
            raise everything.error(row, message, "give every row all columns; is the file cut off?")
    if header.separator != ",":
        words = _with_points(words)
    by_meaning = {
        column.meaning: [words[row][i] for row in rows] for i, column in enumerate(header.columns) if column.meaning
    }
    system, notes = _system(everything, header, by_meaning)
    return _List(everything, rows, by_meaning, header.columns, system, (*everything.notes, *notes))


def _check_header(file: TextFile, header: _Header) -> None:
    row, columns = header.line or 0, header.columns
    if len(columns) > MOST_COLUMNS or any(len(column.name) > LONGEST_NAME for column in columns):
        longest = max(len(column.name) for column in columns)
        message = f"the header has {len(columns)} columns, the longest of {longest} characters"
        raise file.error(row, message, "the first row names the columns by short texts")
    if "name" not in header.meanings:
        names = ", ".join(column.name for column in columns)
        raise file.error(row, f"no column holds names: {names}"[:300], "name one of them 'name'")
    seen: dict[str, str] = {}
    for column in columns:
        if column.meaning in seen:
            message = f"columns '{seen[column.meaning]}' and '{column.name}' are both {column.meaning}"
            raise file.error(row, message, "rename one of them")
        if column.meaning:
            seen[column.meaning] = column.name
        if np.isnan(column.factor) and (is_unit(column.unit) or looks_like_unit(column.unit)):
            message = f"column '{column.name}' cannot be in '{column.unit}'"
            raise file.error(row, message, "write units such as (m), (ft), (US survey ft), (deg), (gon)")
    if not {"X", "Y"} & header.meanings and len({"lon", "lat"} & header.meanings) == 1:
        raise file.error(row, "there is no longitude, or no latitude", "name both, or X and Y")


def _rows_below(file: TextFile, header: _Header) -> tuple[_Header, list[int]]:
    """Rows that hold data: below the header, no comments, no sums; and the header with the units of one passed over.

    Raises
    ------
    InputError
        When a row that begins with # is like the others: a point may be called so.
    """
    rows = []
    for row in range(0 if header.line is None else header.line + 1, len(file)):
        line = file.lines[row]
        if OF_TOTALS.match(line):
            continue
        words = cells(line, header.separator)
        if not line.startswith("#"):
            rows.append(row)
        elif len(words) == len(header.columns) and sum(map(_is_number, words)) > 1:
            raise file.error(row, f"'{words[0][:40]}' begins with #, as comments do", "is it a point? rename it")
    if header.line is not None or not rows:
        return header, rows
    words = cells(file.lines[rows[0]], header.separator)
    if any(map(_is_number, words)):
        return header, rows
    # the user stated the columns of a list that has names of its own
    return replace(header, columns=_agreed(file, rows[0], header.columns, words)), rows[1:]


def _agreed(file: TextFile, row: int, stated: tuple[ListColumn, ...], words: list[str]) -> tuple[ListColumn, ...]:
    """Stated columns with the units that the list has for them.

    Raises
    ------
    InputError
        When the list calls a coordinate otherwise.
    """
    found = []
    for column, own in zip(stated, map(list_column, words), strict=False):
        if column.meaning != own.meaning and {column.meaning, own.meaning} <= set(COORDINATES):
            message = f"column '{own.name[:40]}' is stated as {column.meaning}"
            raise file.error(row, message, "leave --columns out: the list names its columns")
        found.append(replace(column, name=own.name, unit=own.unit, factor=own.factor) if own.unit else column)
    return (*found, *stated[len(found) :])


def _without_surplus(file: TextFile, row: int, header: _Header) -> list[str]:
    """The cells of a row without empty ones behind the last column."""
    words = cells(file.lines[row], header.separator)
    while len(words) > len(header.columns) and not words[-1]:
        words.pop()
    return words


def _is_number(word: str) -> bool:
    return all_numbers([word.replace(",", ".", 1)])


def _with_points(words: dict[int, list[str]]) -> dict[int, list[str]]:
    """Numbers with a decimal comma as such with a point."""
    comma = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
    return {
        row: [word.replace(",", ".") if comma.fullmatch(word) else word for word in line] for row, line in words.items()
    }


def _system(
    file: TextFile, header: _Header, columns: dict[str, list[str]]
) -> tuple[StatedSystem, tuple[str, ...]]:  # fmt: skip
    """The coordinate system that comments or a column name, and what to say of it."""
    of_column = sorted(set(columns.get("crs", ())) - {""})
    stated, notes = _of_comments(file, header.line)
    stated += [(header.line or 0, text if not text.isdigit() else f"EPSG:{text}") for text in of_column]
    system = _one_system(file, stated)
    if system is None:
        geographic = not {"X", "Y"} & header.meanings and "lon" in header.meanings
        return StatedSystem(GEOGRAPHIC if geographic else ""), (*notes, *_notes(header, file.path.name))
    said = (f"{file.path.name}: {system.note}",) if system.note else ()
    return system, (*said, *notes, *_notes(header, file.path.name))


def system_above(path: Path) -> tuple[StatedSystem, tuple[str, ...]]:
    """The coordinate system that comments of a list without names state, and what to say of it.

    Raises
    ------
    InputError
    """
    file = TextFile(path, comments=False, any_letters=True)
    stated, notes = _of_comments(file, None)
    system = _one_system(file, stated) or StatedSystem("")
    return system, (*notes, *((f"{path.name}: {system.note}",) if system.note else ()))


def _of_comments(file: TextFile, header_line: int | None) -> tuple[list[tuple[int, str]], tuple[str, ...]]:
    """Rows and texts of comments that name a system, and sentences on those that may and are not understood."""
    stated, notes = [], []
    for row, line in enumerate(file.lines):
        if not line.startswith("#") or row == header_line or OF_TOTALS.match(line):
            continue
        found = OF_SYSTEM.match(line)
        if found is not None:
            stated.append((row, found[1] or found[2].replace(",", ":")))
        elif ABOUT_SYSTEM.search(line):
            notes.append(f"{file.path.name}:{file.numbers[row]}: '{line[:60]}' is not used")
    return stated, tuple(notes)


def _one_system(file: TextFile, stated: list[tuple[int, str]]) -> StatedSystem | None:
    """The one system that all texts mean; None where there are none.

    Raises
    ------
    InputError
        When one is not known, or two are not the same.
    """
    found: StatedSystem | None = None
    for row, text in stated:
        try:
            system = stated_system(text)
        except InputError as error:
            raise file.error(row, error.message, error.remedy) from error
        if system is None:
            raise file.error(row, f"the coordinate system '{text[:80]}' is not known", REMEDY)
        if found is not None and (found.crs, found.plan_to_metre) != (system.crs, system.plan_to_metre):
            raise file.error(
                row, f"names several coordinate systems: '{text[:60]}' is another one", "leave one of them"
            )
        found = system
    return found


def _notes(header: _Header, name: str) -> tuple[str, ...]:
    said = []
    for column in header.columns:
        if column.unit and np.isnan(column.factor):
            said.append(f"{name}: what stands in brackets in '{column.name}' is not used")
        elif column.unit and column.factor != 1.0:
            said.append(f"{name}: column '{column.name}' was brought to {_metric(column)}")
    return tuple(said)


def _metric(column: ListColumn) -> str:
    return "degrees" if column.meaning in ("lon", "lat", "omega", "phi", "kappa", "yaw", "pitch", "roll") else "metres"


def _kind_of_heights(found: _List) -> str:
    return "ellipsoidal" if _height_column(found) == "h_ell" else ""


def _names(found: _List, what: str) -> np.ndarray:
    names = found.columns["name"]
    if not names:
        raise found.file.error(len(found.file), f"holds no {what}s", "give a row for each")
    found.file.check_names(names, found.rows, what)
    found.file.refuse_repeated(names, found.rows, what)
    return texts(names)


def _coordinates(found: _List) -> tuple[np.ndarray, str]:
    """(n, 3), and the CRS where a comment or the names of the columns tell it."""
    given, crs = found.columns, found.system.crs
    height = _height_column(found)
    if found.is_plane:
        # ellipsoidal heights are not those of the system of heights that is named
        return found.numbers("X", "Y", height), plan_of(crs) if height == "h_ell" else crs
    if crs and is_projected(plan_of(crs)):
        crs = geographic_of(crs)
    elif not crs and {"X", "Y"} & set(given):
        crs = GEOGRAPHIC
    return found.numbers("lon", "lat", height), plan_of(crs) if height == "h_ell" else crs


def _height_column(found: _List) -> str:
    """The column of heights that is used: with longitude and latitude the ellipsoidal one, if there are two."""
    given = found.columns
    return "h_ell" if "h_ell" in given and ("Z" not in given or not found.is_plane) else "Z"


def _sigma(found: _List, may_be_zero: bool = False) -> tuple[np.ndarray, tuple[str, ...]]:
    """(n, 3) m; the more particular column counts. 0, where it may be, stands for a coordinate without error."""
    said: tuple[str, ...] = ()
    given = [name for name in SIGMAS if name in found.columns]
    if given == ["sX"]:
        # Metashape names the one accuracy after the first axis
        found = replace(found, columns={**found.columns, "s_all": found.columns["sX"]})
        said = (f"{found.file.path.name}: the accuracy of X is the only one, and counts for Y and Z too",)
        sigma = np.repeat(found.numbers("sX"), 3, axis=1)
    else:
        sigma = found.numbers("sX", "sY", "sZ")
        for fallback in (found.numbers("s_plan", "s_plan", "s_height"), found.numbers("s_all", "s_all", "s_all")):
            sigma = np.where(np.isnan(sigma), fallback, sigma)
    bad = np.flatnonzero(((sigma < SMALLEST_POSITIVE) & ~((sigma == 0.0) & may_be_zero)).any(axis=1))
    if len(bad):
        size = "negative" if may_be_zero else "not greater than 0"
        raise found.file.error(found.rows[bad[0]], f"a standard deviation is {size}", "give a small one, in m")
    return sigma, said


def _messages(found: _List, *used: str) -> tuple[str, ...]:
    """What was read in another way than it stands there, and the columns that were not."""
    used_now = {"name", "X", "Y", "crs", _height_column(found), *SIGMAS, *used}
    used_now |= set() if found.is_plane else {"lon", "lat"}
    left = [column.name for column in found.header if column.name and column.meaning not in used_now]
    shown = ", ".join(name[:40] for name in left[:MOST_NAMED])
    more = f" and {len(left) - MOST_NAMED} more" if len(left) > MOST_NAMED else ""
    said = f"{found.file.path.name}: columns not carried over: {shown}{more}"
    return (*found.notes, *((said,) if left else ()))


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
    xyz, crs = _coordinates(found)
    partial = np.flatnonzero(np.isnan(xyz).any(axis=1))
    if len(partial):
        remedy = "positions need X, Y and Z, or longitude, latitude and height"
        raise found.file.error(found.rows[partial[0]], "a coordinate is missing", remedy)
    angles = np.radians(found.numbers("yaw", "pitch", "roll"))
    angles[np.isnan(angles).any(axis=1)] = np.nan
    sigma, said = _sigma(found)
    messages = (*_messages(found, "yaw", "pitch", "roll"), *said)
    order = [1, 0, 2] if exchanged else [0, 1, 2]
    heights = _kind_of_heights(found)
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
    xyz, crs = _coordinates(found)
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
    order = [1, 0, 2] if exchanged else [0, 1, 2]
    return PointList(
        found.file.path, names, xyz[:, order], sigma[:, order], roles == "check", crs, heights=_kind_of_heights(found),
        messages=(*_messages(found, "role"), *said),
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
