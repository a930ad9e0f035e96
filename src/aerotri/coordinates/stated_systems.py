"""Coordinate systems as lists and programs name them, brought to one that counts in metres or degrees.

A first line such as ``EPSG:32632+5783``, ``WGS84 UTM 32N``, a PROJ string, WKT or the name of a system. A unit that is
no metre is taken off the system and becomes a factor: feet are never taken for metres.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import crs_text, heights_of, plan_of, system_in_words

if TYPE_CHECKING:
    from pyproj import CRS

LOCAL_NAMES = re.compile(
    r"local(?: coordinates)?(?: \((?:m|metres?|meters?)\))?|\+proj=local(?: \+units=m)?|arbitrary|none|lsr",
    re.IGNORECASE,
)
LOCAL_WKT = re.compile(r"(?:local_cs|engcrs|engineeringcrs)\[", re.IGNORECASE)
UNIT_WKT = re.compile(r'UNIT\["[^"]*",\s*([^,\]]*)')
NOT_USED = re.compile(r"\+(?:geoidgrids|nadgrids|geoid_crs|pm=(?!0|greenwich)|axis=(?!enu)|proj=pipeline)[^ ]*")
UTM = re.compile(
    r"(?:(?P<datum>WGS\s?84|ETRS\s?89|NAD\s?83|ED\s?50)\s*/?\s*)?UTM\s*(?:zone)?\s*(?P<zone>\d{1,2})\s*(?P<half>[NS])",
    re.IGNORECASE,
)
CODES = re.compile(r"EPSG:\s*(\d{1,6})(?:\s*\+\s*(?:EPSG:)?\s*(\d{1,6}))?", re.IGNORECASE)
AUTHORITY = re.compile(r'(?:AUTHORITY|ID)\["EPSG",\s*"?(\d{1,6})"?\]\s*\]\s*$')
UNIT_IN_NAME = re.compile(r"\s*\((?:ftUS|ft|US survey foot|foot)\)$")
REMEDY = "write it as EPSG:n, or EPSG:n+m with m the system of the heights; or remove the line, and state it: --crs"
SMALLEST_UNIT, LARGEST_UNIT = 1e-9, 1e9
"""Metres of a unit of lengths, between these [C]."""
LONGEST = 20_000
"""Characters of a definition at most [C]."""


@dataclass(frozen=True)
class StatedSystem:
    """A coordinate system in metres or degrees, and what brings the numbers of a list into it.

    Parameters
    ----------
    crs : text as in `crs_text`, '' for local coordinates.
    plan_to_metre, height_to_metre : factors of X and Y, and of the heights; NaN where X and Y count in feet, and
        nothing says what the heights count in.
    note : what was understood, where that is not plain; '' otherwise.
    """

    crs: str
    plan_to_metre: float = 1.0
    height_to_metre: float = 1.0
    note: str = ""

    @property
    def to_metre(self) -> np.ndarray:
        """(3,) what X, Y, Z of a list are multiplied with."""
        return np.array([self.plan_to_metre, self.plan_to_metre, self.height_to_metre])


def stated_system(text: str) -> StatedSystem | None:
    """What a text means as a coordinate system; None where it is none that is known here.

    Raises
    ------
    InputError
        Where it is understood, but states something that cannot be taken into account.
    """
    plain = text.strip().strip("'\"").rstrip(",; ").strip()
    if not plain or len(plain) > LONGEST:
        return None
    if LOCAL_NAMES.fullmatch(plain):
        return StatedSystem("")
    if LOCAL_WKT.match(plain):
        factor = _metres(found[1], plain) if (found := UNIT_WKT.search(plain)) else 1.0
        note = f"local coordinates of a unit of {factor:.7g} m, brought to metres" if factor != 1.0 else ""
        return StatedSystem("", factor, factor, note)
    utm, codes = UTM.fullmatch(plain), CODES.fullmatch(plain)
    if utm is not None:
        plain = f"{_datum(utm['datum'])} / UTM zone {int(utm['zone'])}{utm['half'].upper()}"
    elif codes is not None:
        plain = "+".join(f"EPSG:{int(code)}" for code in codes.groups() if code)
    left = NOT_USED.search(plain)
    if left is not None:
        raise InputError(f"the coordinate system '{plain[:120]}' states {left[0]}, which is not used", REMEDY)
    system = _read(plain) or _of_damaged(plain)
    return None if system is None else _in_metres(_without_shift(system, text), text)


def _metres(stated: str | float, text: str) -> float:
    """Metres in the unit that the system in a text states.

    Raises
    ------
    InputError
        When it is no number greater than 0.
    """
    try:
        factor = float(stated)
    except ValueError:
        factor = float("nan")
    if not SMALLEST_UNIT < factor < LARGEST_UNIT:
        raise InputError(f"the coordinate system '{text[:80]}' states a unit of '{str(stated)[:20]}' m", REMEDY)
    return factor


def geographic_of(crs: str) -> str:
    """The system of longitude and latitude below another one, with the same system of heights."""
    from pyproj import CRS

    below = CRS.from_user_input(plan_of(crs)).geodetic_crs
    found, heights = crs_text(None if below is None else below.to_2d()), heights_of(crs)
    return f"{found}+{heights}" if heights.isdigit() and found.startswith("EPSG:") else found


def _datum(name: str | None) -> str:
    plain = (name or "WGS84").upper().replace(" ", "")
    return {"WGS84": "WGS 84"}.get(plain, plain)


def _read(text: str) -> CRS | None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text)
    except CRSError:
        return None


def _of_damaged(text: str) -> CRS | None:
    """The system of a shortened definition: by the code at its end, else by its name."""
    code = AUTHORITY.search(text)
    if code is not None and "[" in text:
        return _read(f"EPSG:{code[1]}")
    name = re.match(r'[A-Z_]+\["([^"]+)"', text)
    return None if name is None else _read(name[1])


def _without_shift(system: CRS, text: str) -> CRS:
    """The system below a shift to WGS 84.

    Raises
    ------
    InputError
        When the shift is not zero.
    """
    if system.source_crs is None or not system.is_bound:
        return system
    if system.source_crs.to_epsg() is not None:
        # the shift to WGS 84 beside a known system is one of several, and not needed to know which system it is
        return system.source_crs
    operation = system.coordinate_operation
    if operation is None or any(float(value) for value in operation.towgs84):
        raise InputError(f"the coordinate system '{text[:80]}' states a shift of the datum, which is not used", REMEDY)
    return system.source_crs


def _in_metres(system: CRS, text: str) -> StatedSystem:
    parts = list(system.sub_crs_list) if system.is_compound else [system]
    axes = parts[0].axis_info
    if system.is_geocentric:
        message = f"the coordinates are earth-centred ('{system.name}')"
        raise InputError(message, "transform them to a system with X, Y and heights, such as UTM")
    plan = 1.0 if parts[0].is_geographic else _metres(axes[0].unit_conversion_factor, text)
    heights = axes[2:] or (parts[1].axis_info if len(parts) > 1 else [])
    height = _metres(heights[0].unit_conversion_factor, text) if heights else 1.0 if plan == 1.0 else float("nan")
    flat = parts[0].to_2d() if len(axes) == 3 and len(parts) == 1 else parts[0]
    found = crs_text(flat if plan == 1.0 else _metric(flat))
    if len(parts) > 1:
        vertical = crs_text(parts[1] if height == 1.0 else _metric(parts[1])).removeprefix("EPSG:")
        if not vertical.isdigit() or not parts[1].is_vertical or not found.startswith("EPSG:"):
            raise InputError(f"the system of the heights or that of X and Y in '{text[:80]}' has no EPSG code", REMEDY)
        found = f"{found}+{vertical}"
    units = [
        f"{what} in {axis.unit_name}"
        for what, axis, factor in (("X and Y", axes[0], plan), ("heights", (heights or axes)[0], height))
        if factor != 1.0 and np.isfinite(factor)
    ]
    said = f"{' and '.join(units)}, brought to metres; the system is {system_in_words(found)}" if units else ""
    return StatedSystem(found, plan, height, said)


def _metric(system: CRS) -> CRS:
    """The same system counting in metres: the one of the same name, else its definition with another unit."""
    named = _read(UNIT_IN_NAME.sub("", system.name)) if UNIT_IN_NAME.search(system.name) else None
    if named is not None and all(axis.unit_name == "metre" for axis in named.axis_info):
        return named
    from pyproj import CRS

    definition: dict[str, Any] = system.to_json_dict()
    definition.pop("id", None)
    for axis in definition["coordinate_system"]["axis"]:
        axis["unit"] = "metre"
    return CRS.from_json_dict(definition)
