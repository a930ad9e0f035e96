"""A coordinate system as a text that PROJ reads: by its codes where it has some, else by its definition (WKT).

'EPSG:n', or 'EPSG:n+m' with a system of heights; WKT where a part has no code; '' where none is stated, which is not
the same as a system without a code. Two texts mean one system when their definitions agree.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from aerotri.conventions import FilePath, InputError

if TYPE_CHECKING:
    from pyproj import CRS

LOCAL = "Engineering CRS"
"""What PROJ calls local coordinates."""
LONGEST = 40
"""Characters of a text that is shown as it is: a code such as ESRI:102013, no definition."""


def crs_text(crs: CRS | None) -> str:
    """The text of a system; '' of None, and of local coordinates under a name of their own (LOCAL_CS, ENGCRS)."""
    if crs is None or crs.type_name == LOCAL:
        return ""
    codes = [_code(part) for part in _parts(crs)]
    return crs.to_wkt() if None in codes else "EPSG:" + "+".join(map(str, codes))


def plan_of(text: str) -> str:
    """The system of X and Y alone: 'EPSG:25832' of 'EPSG:25832+7837'."""
    if _has_codes(text):
        return text.partition("+")[0]
    return _text_of_part(text, 0)


def heights_of(text: str) -> str:
    """The system of the heights: '7837' of 'EPSG:25832+7837', WKT where it has no code, '' where none is stated."""
    if _has_codes(text):
        return text.partition("+")[2]
    return _text_of_part(text, 1).removeprefix("EPSG:")


def same_system(one: str, other: str) -> bool:
    """Whether two texts mean one system, the order of its axes aside."""
    if one.upper() == other.upper():
        return True
    first, second = _system(one), _system(other)
    return first is not None and second is not None and _are_alike(first, second)


def system_in_words(text: str) -> str:
    """'EPSG:25832'; name and projection of a system without a code."""
    system = None if _has_codes(text) else _system(text)
    if system is None:
        return text[:LONGEST]
    operation = system.coordinate_operation
    projection = f", {operation.method_name}" if operation is not None else ""
    name = text if len(text) <= LONGEST else "a CRS without an EPSG code"
    return f"{name} ('{system.name}'{projection})"


def refuse_other_system(own: str, wanted: str, of_wanted: str, path: FilePath) -> None:
    """Refuse a file that lies in another system; where one of both states none, nothing is refused.

    Parameters
    ----------
    own : of the file. of_wanted : what is in the other one, in words.

    Raises
    ------
    InputError
    """
    if own and wanted and not same_system(own, wanted):
        message = f"is in {system_in_words(own)}, {of_wanted} in {system_in_words(wanted)}"
        raise InputError(message, "bring it into one CRS", path)


def height_system(heights: str) -> str:
    """What PROJ reads of heights as `heights_of` gives them."""
    return f"EPSG:{heights}" if heights.isdigit() else heights


def with_heights(text: str, heights: str) -> str:
    """A system with another system of heights, where both have codes; else as it is."""
    plan = plan_of(text)
    return f"{plan}+{heights}" if _has_codes(plan) and heights.isdigit() else text


def is_known_system(text: str) -> bool:
    """Whether PROJ knows a system by this text."""
    return _system(text) is not None


def _has_codes(text: str) -> bool:
    return text[:5].upper() == "EPSG:" or not text


def _code(crs: CRS) -> int | None:
    """The EPSG code of a system: the one that it states, else what PROJ finds, else what GDAL takes it for.

    PROJ finds a code by the exact definition only; files have axes in another order, and other programs' names.
    """
    from rasterio.crs import CRS as GdalCrs
    from rasterio.errors import CRSError

    stated = crs.to_json_dict().get("id", {})
    if stated.get("authority") == "EPSG":
        return int(stated["code"])
    code = crs.to_epsg()
    if code is not None:
        return code
    try:
        return GdalCrs.from_wkt(crs.to_wkt()).to_epsg()
    except CRSError:
        return None


def _are_alike(first: CRS, second: CRS) -> bool:
    """Whether two definitions put the same numbers at the same places, whatever their names and the order of axes."""
    if first.equals(second, ignore_axis_order=True):
        return True
    if not (first.is_projected and second.is_projected) or first.is_compound or second.is_compound:
        return False
    one, other = first.geodetic_crs, second.geodetic_crs
    if one is None or other is None or not one.equals(other, ignore_axis_order=True):
        return False
    return _projection(first) == _projection(second)


def _projection(crs: CRS) -> tuple[str, list[tuple[str, float]], list[str]]:
    operation = crs.coordinate_operation
    values = (
        []
        if operation is None
        else [(p.name.lower(), float(p.value) * p.unit_conversion_factor) for p in operation.params]
    )
    method = "" if operation is None else operation.method_name
    return method, sorted((name, round(value, 9)) for name, value in values), sorted(a.unit_name for a in crs.axis_info)


def _text_of_part(text: str, number: int) -> str:
    system = _system(text)
    parts = [] if system is None else _parts(system)
    return crs_text(parts[number]) if number < len(parts) else "" if number else text


def _parts(crs: CRS) -> list[CRS]:
    return list(crs.sub_crs_list) if crs.is_compound else [crs]


@cache
def _system(text: str) -> CRS | None:
    """What PROJ makes of a text, None where it knows no such system."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        return CRS.from_user_input(text) if text else None
    except CRSError:
        return None
