"""A coordinate system in words: name, code, system of the heights."""

from __future__ import annotations

from dataclasses import dataclass

HEIGHTS_NOT_NAMED = "system not named"
"""Heights then count from what those of control points and positions do; the computation takes them for ellipsoidal."""


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


def heights_in_words(crs: str) -> str:
    """What heights count from: the one wording of it, on the screen, in files and (translated) on pages.

    Parameters
    ----------
    crs : see `crs_names`. '' of local coordinates and of a system that is not known.
    """
    names = crs_names(crs)
    return (names.vertical or HEIGHTS_NOT_NAMED) if names.name else ""
