"""Systems of heights: which one heights are in once they count in metres, and their names."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from aerotri.crs_text import height_system

if TYPE_CHECKING:
    from pyproj import CRS


@cache
def metric_height_system(code: str) -> str:
    """EPSG code of the system in metres on the datum of another one: '6360' (NAVD88 in feet) → '5703'.

    The code itself where it counts in metres, is not known, or its datum has no system in metres.
    """
    from pyproj import CRS
    from pyproj.database import query_crs_info
    from pyproj.enums import PJType

    own = _vertical(code)
    if own is None or own.axis_info[0].unit_conversion_factor == 1.0:
        return code
    for one in query_crs_info(auth_name="EPSG", pj_types=PJType.VERTICAL_CRS):
        other = CRS.from_epsg(one.code)
        axis = other.axis_info[0]
        is_metric = axis.unit_conversion_factor == 1.0 and axis.direction == own.axis_info[0].direction
        if is_metric and _datum(other) == _datum(own):
            return one.code
    return code


def height_system_in_words(code: str) -> str:
    """'EPSG:5703 (NAVD88 height)'."""
    known = _vertical(code)
    if not code.isdigit():
        return "a system of heights without an EPSG code" + ("" if known is None else f" ('{known.name}')")
    return f"EPSG:{code}" if known is None else f"EPSG:{code} ({known.name})"


def _vertical(code: str) -> CRS | None:
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        found = CRS.from_user_input(height_system(code))
    except CRSError:
        return None
    return found if found.is_vertical else None


def _datum(system: CRS) -> str:
    """Its name, or that of the ensemble of its realisations."""
    content = system.to_json_dict()
    return str((content.get("datum") or content.get("datum_ensemble") or {"name": system.name})["name"])
