"""The coordinate system of vector files, and their coordinates in that of a surface."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from aerotri.conventions import InputError
from aerotri.crs_text import same_system, system_in_words

LON_LAT = "OGC:CRS84"
"""Longitude and latitude on WGS 84: what GeoJSON has by RFC 7946."""
CODE = re.compile(r"(EPSG|OGC|ESRI)(?::[\w.]*)?:+(\w+)$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class VectorSystem:
    """How the coordinates of a file become those of a surface.

    Parameters
    ----------
    transformer : pyproj's; None where they are the same. note : what was done or taken for granted, '' where nothing.
    """

    transformer: Any = None
    note: str = ""

    def with_note(self, note: str) -> VectorSystem:
        """The same, with another sentence behind its own; '' adds none."""
        return replace(self, note="; ".join(text for text in (self.note, note) if text))

    def place(self, xy: np.ndarray, path: Path | None = None) -> np.ndarray:
        """(n, 2) in the system of the surface.

        Raises
        ------
        InputError
            Where that system does not reach.
        """
        if self.transformer is None:
            return xy
        found = np.column_stack(self.transformer.transform(xy[:, 0], xy[:, 1]))
        if not np.isfinite(found).all():
            raise InputError("lies outside the range of the surface's CRS", "check the CRS of both", path)
        return found


def vector_system(own: str | None, crs: str, name: str) -> VectorSystem:
    """From the CRS that a file names to that of the surface.

    Parameters
    ----------
    own : as 'EPSG:25832', None where the file does not say. crs : of the surface, see `crs_text`, '' where it has none.
    name : of the file, for the note.
    """
    if own is None or (crs and same_system(own, crs)):
        return VectorSystem()
    words = system_in_words(own)
    if not crs:
        return VectorSystem(None, f"{name} is in {words}; the surface has no CRS, its coordinates are taken for these")
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    try:
        transformer = Transformer.from_crs(own, crs, always_xy=True)
    except ProjError:
        message = f"{name}: PROJ knows no way from {words} to {system_in_words(crs)}"
        raise InputError(message, "bring it into one CRS") from None
    return VectorSystem(transformer, f"{name} was brought from {words} to {system_in_words(crs)}")


def vector_system_or_note(own: str | None, crs: str, name: str) -> VectorSystem:
    """As `vector_system`; a file that names no CRS is told, where the surface has one."""
    if own is None and crs:
        return VectorSystem(None, f"{name} names no CRS: taken for {system_in_words(crs)}")
    return vector_system(own, crs, name)


def system_of_geojson(content: Mapping[str, Any], xy: np.ndarray, crs: str, name: str) -> VectorSystem:
    """Of GeoJSON: the old member "crs" where it has one, else longitude and latitude.

    Coordinates that can be no longitudes and latitudes, in a file that names no CRS, are those of the surface.

    Parameters
    ----------
    xy : (n, 2) all its coordinates.
    """
    own = stated_crs(content)
    if own is not None:
        return vector_system(own, crs, name)
    if not crs:
        return VectorSystem()
    words = system_in_words(crs)
    if "crs" not in content and len(xy) and np.all(np.abs(xy) <= [180.0, 90.0]):
        found = vector_system(LON_LAT, crs, name)
        note = f"{name} was brought from longitude and latitude, which GeoJSON has by RFC 7946, to {words}"
        return VectorSystem(found.transformer, note)
    named = _named_crs(content)
    if named:
        return VectorSystem(None, f"{name} names the CRS '{named}', which is not known: taken for {words}")
    return VectorSystem(
        None, f"{name} names no CRS, and its coordinates are no longitudes and latitudes: taken for {words}"
    )


def stated_crs(content: Mapping[str, Any]) -> str | None:
    """The CRS that the old member "crs" of GeoJSON names by code or name, None where there is none that is known."""
    text = _named_crs(content)
    found = CODE.search(text)
    return _code_of_name(text) if found is None else f"{found[1].upper()}:{found[2].upper()}"


def _named_crs(content: Mapping[str, Any]) -> str:
    member = content.get("crs")
    named = ((member or {}).get("properties") or {}).get("name", "") if isinstance(member, Mapping) else ""
    return str(named).strip()


def _code_of_name(text: str) -> str | None:
    """'EPSG:25833' of 'ETRS89 / UTM zone 33N'; PROJ also answers to names that only look alike, which do not count."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        found = CRS.from_user_input(text) if text else None
    except CRSError:
        return None
    code = None if found is None or found.name.lower() != text.lower() else found.to_authority()
    return None if code is None else ":".join(code)
