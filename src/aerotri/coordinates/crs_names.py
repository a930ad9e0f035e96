"""A coordinate system in words: name, code, system of the heights."""

from __future__ import annotations

from dataclasses import dataclass

from aerotri.conventions import InputError
from aerotri.coordinates.georeference import read_crs


@dataclass(frozen=True)
class CrsNames:
    """How a coordinate system is called.

    Parameters
    ----------
    name : of the system in plan; '' for local coordinates and where it is not known.
    code : as given.
    vertical : name of the system of the heights; '' where none is named.
    """

    name: str
    code: str
    vertical: str


def crs_names(crs: str) -> CrsNames:
    """The names that PROJ knows a coordinate system by.

    Parameters
    ----------
    crs : 'local', 'EPSG:n' or 'EPSG:n+m'.
    """
    if crs in ("", "local"):
        return CrsNames("", crs, "")
    try:
        whole = read_crs(crs)
    except InputError:
        return CrsNames("", crs, "")
    if whole.is_compound:
        plan, heights = whole.sub_crs_list[:2]
        return CrsNames(plan.name, crs, heights.name)
    return CrsNames(whole.name, crs, "")
