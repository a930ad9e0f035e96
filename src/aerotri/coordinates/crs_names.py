"""A coordinate system in words: name, code, system of the heights."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CrsNames:
    """How a coordinate system is called.

    Parameters
    ----------
    name : of the system in plan; '' for local coordinates and where it is not known.
    code : as given, '' of a system without one.
    vertical : name of the system of the heights; '' where none is named.
    """

    name: str
    code: str
    vertical: str


def crs_names(crs: str) -> CrsNames:
    """The names that PROJ knows a coordinate system by.

    Parameters
    ----------
    crs : 'local', or see `crs_text`.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if crs in ("", "local"):
        return CrsNames("", crs, "")
    try:
        whole = CRS.from_user_input(crs)
    except CRSError:
        return CrsNames("", crs, "")
    code = crs if crs.upper().startswith("EPSG:") else ""
    if whole.is_compound:
        plan, heights = whole.sub_crs_list[:2]
        return CrsNames(plan.name, code, heights.name)
    return CrsNames(whole.name, code, "")
