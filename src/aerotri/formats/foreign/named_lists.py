"""Lists whose first row names the columns: positions, control points or orientations, as many programs write them.

The columns are known by their names, whatever their order: Northing before Easting, ``X_acc`` or ``AccHor``, units in
brackets. Cells are separated by commas, semicolons or tabs. Longitude and latitude make the list one of EPSG:4326.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError
from aerotri.formats.assembly.parts import OrientationList, PointList, PositionList, texts
from aerotri.formats.text.tables import LONGEST_NAME, SMALLEST_POSITIVE
from aerotri.formats.text.text_lines import TextFile, all_numbers, first_lines
from aerotri.functional_model.rotation import rotation_from_angles

GEOGRAPHIC = "EPSG:4326"
MEANINGS: dict[str, tuple[str, ...]] = {
    "name": (
        "imagename", "image", "filename", "file", "photo", "photoid", "photoname", "label", "name", "id", "point",
        "pointid", "pointname", "gcp", "gcpname", "gcplabel", "target", "marker",
    ),
    "X": ("x", "xgps", "x0", "easting", "east", "e", "xeasting"),
    "Y": ("y", "ygps", "y0", "northing", "north", "n", "ynorthing"),
    "Z": (
        "z", "zgps", "z0", "height", "h", "altitude", "alt", "elevation", "elev", "ellipsoidalheight", "ellheight",
        "orthometricheight",
    ),
    "lon": ("longitude", "lon", "long", "lng"),
    "lat": ("latitude", "lat"),
    "sX": ("sx", "xacc", "accx", "xaccuracy", "accuracyx", "sigmax", "stdx", "sdx", "sx0", "sigmae", "se"),
    "sY": ("sy", "yacc", "accy", "yaccuracy", "accuracyy", "sigmay", "stdy", "sdy", "sy0", "sigman", "sn"),
    "sZ": ("sz", "zacc", "accz", "zaccuracy", "accuracyz", "sigmaz", "stdz", "sdz", "sz0", "sigmah", "sigmau"),
    "s_plan": ("acchor", "horacc", "hacc", "acch", "accuracyh", "horizontalaccuracy", "accuracyhorizontal", "sxy"),
    "s_height": ("accver", "veracc", "vacc", "accv", "accuracyv", "verticalaccuracy", "accuracyvertical", "sh"),
    "s_all": ("accuracy", "acc", "sxyz", "sigma"),
    "omega": ("omega",),
    "phi": ("phi",),
    "kappa": ("kappa",),
    "yaw": ("yaw", "heading"),
    "pitch": ("pitch",),
    "roll": ("roll",),
    "role": ("role",),
}  # fmt: skip
ELLIPSOIDAL = ("ellipsoidalheight", "ellheight")
MOST_COLUMNS = 1000
"""Columns of a list at most; chosen [C]: no program writes as many; a file of another kind on one long line would."""
NO_NUMBER = ("", "nan", "NaN", "NAN")
"""What stands where nothing is known."""


@dataclass(frozen=True, eq=False)
class _List:
    """Rows of a list: columns by their meaning, names of those without one, and how heights are called."""

    file: TextFile
    columns: dict[str, list[str]]
    unknown: tuple[str, ...]
    ellipsoidal: bool

    @property
    def rows(self) -> list[int]:
        return list(range(1, len(self.file)))

    def numbers(self, *names: str) -> np.ndarray:
        """(n, k), NaN where a cell is empty or the column is missing."""
        found = np.full((len(self.rows), len(names)), np.nan)
        for k, name in enumerate(names):
            given = [(i, word) for i, word in enumerate(self.columns.get(name, ())) if word not in NO_NUMBER]
            index = [i for i, _ in given]
            found[index, k] = self.file.values([word for _, word in given], [i + 1 for i in index], name)
        return found


def is_named_list(path: Path) -> bool:
    """Whether the first row names a column of names and at least two coordinates."""
    lines = first_lines(path, 1)
    if not lines:
        return False
    found = {meaning for meaning in map(_meaning, lines[0].split(_separator(lines[0]))) if meaning}
    return "name" in found and len(found & {"X", "Y", "Z", "lon", "lat"}) > 1


def is_named_orientations(path: Path) -> bool:
    """Whether the first row names positions and ω, φ, κ."""
    lines = first_lines(path, 1)
    found = [_meaning(word) for word in lines[0].split(_separator(lines[0]))] if lines else []
    return {"name", "X", "Y", "Z", "omega", "phi", "kappa"} <= set(found)


def _separator(header: str) -> str:
    return max(",;\t", key=header.count)


def _plain(column: str) -> str:
    """Letters and digits of a column's name, without what stands in brackets."""
    if len(column) > LONGEST_NAME:
        return ""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[][^)\]]*[)\]]", "", column.lower()))


def _meaning(column: str) -> str | None:
    plain = _plain(column)
    return next((meaning for meaning, names in MEANINGS.items() if plain in names), None)


def _read(path: Path) -> _List:
    file = TextFile(path)
    if not len(file):
        raise InputError("is empty", "the first row names the columns", path)
    words = file.words(_separator(file.lines[0]))
    header = [word.strip('"') for word in words[0]]
    if len(words[0]) > MOST_COLUMNS or any(len(word) > LONGEST_NAME for word in header):
        remedy = "the first row names the columns by short texts"
        raise file.error(0, f"the header has {len(header)} columns, the longest of {max(map(len, header))} characters",
                         remedy)  # fmt: skip
    if all_numbers(header[1:]):
        raise file.error(0, "does not begin with the names of the columns", "add a first row that names them")
    for row, line in enumerate(words):
        if len(line) != len(header):
            message = f"the row has {len(line)} cells, the header has {len(header)}"
            raise file.error(row, message, "give every row all columns; is the file cut off?")
    meanings = [_meaning(word) for word in header]
    for i, meaning in enumerate(meanings):
        if meaning is not None and meaning in meanings[:i]:
            first = header[meanings.index(meaning)]
            raise file.error(0, f"columns '{first}' and '{header[i]}' are both {meaning}", "rename one of them")
    if "name" not in meanings:
        raise file.error(0, f"no column holds names: {', '.join(header)}"[:300], "name one of them 'name'")
    columns = {
        meaning: [line[i].strip('"') for line in words[1:]] for i, meaning in enumerate(meanings) if meaning is not None
    }
    unknown = tuple(word for word, meaning in zip(header, meanings, strict=True) if meaning is None and word)
    return _List(file, columns, unknown, any(_plain(word) in ELLIPSOIDAL for word in header))


def _names(found: _List, what: str) -> np.ndarray:
    names = found.columns["name"]
    if not names:
        raise found.file.error(0, f"holds no {what}s", "give a row for each")
    found.file.check_names(names, found.rows, what)
    found.file.refuse_repeated(names, found.rows, what)
    return texts(names)


def _coordinates(found: _List) -> tuple[np.ndarray, str]:
    """(n, 3), and the CRS where the names of the columns tell it."""
    by_name = found.columns
    if "X" in by_name or "Y" in by_name or "lon" not in by_name:
        return found.numbers("X", "Y", "Z"), ""
    return found.numbers("lon", "lat", "Z"), GEOGRAPHIC


def _sigma(found: _List, may_be_zero: bool = False) -> np.ndarray:
    """(n, 3) m; the more particular column counts. 0, where it may be, stands for a coordinate without error."""
    sigma = found.numbers("sX", "sY", "sZ")
    for fallback in (found.numbers("s_plan", "s_plan", "s_height"), found.numbers("s_all", "s_all", "s_all")):
        sigma = np.where(np.isnan(sigma), fallback, sigma)
    bad = np.flatnonzero(((sigma < SMALLEST_POSITIVE) & ~((sigma == 0.0) & may_be_zero)).any(axis=1))
    if len(bad):
        size = "negative" if may_be_zero else "not greater than 0"
        raise found.file.error(int(bad[0]) + 1, f"a standard deviation is {size}", "give a small one, in m")
    return sigma


def _messages(found: _List, *used: str) -> tuple[str, ...]:
    used_now = ("name", "X", "Y", "Z", "lon", "lat", "sX", "sY", "sZ", "s_plan", "s_height", "s_all", *used)
    left = (*found.unknown, *(meaning for meaning in found.columns if meaning not in used_now))
    if "X" in found.columns:
        left += tuple(name for name in ("lon", "lat") if name in found.columns)
    return (f"{found.file.path.name}: columns not carried over: {', '.join(left)}"[:400],) if left else ()


def read_positions(path: FilePath) -> PositionList:
    """Observed positions of photographs.

    Raises
    ------
    InputError
        With the line: a coordinate that is missing or no number, a photograph there twice.
    """
    found = _read(Path(path))
    names = _names(found, "photograph")
    xyz, crs = _coordinates(found)
    partial = np.flatnonzero(np.isnan(xyz).any(axis=1))
    if len(partial):
        remedy = "positions need X, Y and Z, or longitude, latitude and height"
        raise found.file.error(int(partial[0]) + 1, "a coordinate is missing", remedy)
    angles = np.radians(found.numbers("yaw", "pitch", "roll"))
    angles[np.isnan(angles).any(axis=1)] = np.nan
    return PositionList(
        found.file.path, names, xyz, _sigma(found), angles, crs, _messages(found, "yaw", "pitch", "roll")
    )


def read_control_list(path: FilePath) -> PointList:
    """Control and check points; an empty coordinate is unknown.

    Raises
    ------
    InputError
        With the line: no coordinate at all, no number, a role that is none, a point there twice.
    """
    found = _read(Path(path))
    names = _names(found, "point")
    xyz, crs = _coordinates(found)
    nothing = np.flatnonzero(np.isnan(xyz).all(axis=1))
    if len(nothing):
        remedy = "name the columns X, Y, Z, or Easting, Northing, Height, and fill one of them"
        raise found.file.error(int(nothing[0]) + 1, "the point has no coordinates", remedy)
    roles = np.array(found.columns.get("role", ["control"] * len(names)))
    odd = np.flatnonzero((roles != "control") & (roles != "check"))
    if len(odd):
        raise found.file.error(
            int(odd[0]) + 1, f"role = '{roles[odd[0]][:60]}' is not possible", "a role is control or check"
        )
    return PointList(
        found.file.path, names, xyz, _sigma(found, may_be_zero=True), roles == "check", crs,
        heights="ellipsoidal" if found.ellipsoidal else "", messages=_messages(found, "role"),
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
        raise found.file.error(int(partial[0]) + 1, "a value is missing", "give X, Y, Z, omega, phi, kappa")
    rotation = rotation_from_angles(np.radians(values[:, 3:]))
    messages = _messages(found, "omega", "phi", "kappa")
    return OrientationList(found.file.path, names, np.full(len(names), ""), values[:, :3], rotation, messages=messages)
