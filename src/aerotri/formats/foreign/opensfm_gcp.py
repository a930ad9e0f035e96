"""OpenSfM's ground_control_points.json: control and check points with their image points.

[L] OpenSfM's documentation and io.py: a point has an id, a position with latitude, longitude and, where it is known,
altitude (WGS 84), and observations with shot_id and projection. A projection is a part of the longer side of the
format, from the image centre, x right, y down. Newer files name a crs at the top; positions that count in metres are
then read as x, y, z. A role of METRICS_ONLY is that of a check point.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.coordinates.georeference import is_projected
from aerotri.coordinates.stated_systems import StatedSystem, stated_system
from aerotri.crs_text import plan_of
from aerotri.foreign_json import json_head, read_foreign_json
from aerotri.formats.assembly.parts import PointList, RayList, no_sigma, texts
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.foreign.reconstruction import check_names
from aerotri.formats.text.notes import left_behind

NAME = "ground_control_points.json"
REMEDY = "write the file again with OpenSfM"
CONTROL_ROLES, CHECK_ROLES = ("optimization", "gcp", "control", "0"), ("metrics_only", "check", "checkpoint", "1")
PLACES = {True: ("x", "y", "z"), False: ("longitude", "latitude", "altitude")}
"""Names of the coordinates, of a system in metres and in degrees."""


def is_opensfm_gcp(path: Path) -> bool:
    """Whether a JSON file holds points with observations."""
    head = json_head(path)
    return head.lstrip("\ufeff \t\r\n").startswith("{") and '"points"' in head and '"observations"' in head


def read_opensfm_gcp(path: FilePath) -> PointList:
    """The points of a file; a point without position is a point of its observations alone.

    Raises
    ------
    InputError
        Naming the point: something is missing or no number, a point twice in a photograph, a role that is not known.
    """
    path = Path(path)
    root = Node(read_foreign_json(path, REMEDY), "the file", path, REMEDY)
    system = _system(root)
    metric = bool(system.crs) and is_projected(plan_of(system.crs))
    points = _list(root.get("points"))
    names, xyz, is_check = [], [], []
    images: dict[str, int] = {}
    image, point, xy = [], [], []
    for row, entry in enumerate(points):
        name = _name(entry.get("id"))
        entry = root.at(entry.value, f"point '{name[:60]}'")
        names.append(name)
        xyz.append(_position(entry, PLACES[metric]))
        is_check.append(_is_check(entry))
        seen: set[str] = set()
        for observed in _list(entry.get("observations")):
            shot = observed.get("shot_id").text()
            if shot in seen:
                raise entry.error(f"is twice in photograph '{shot[:60]}'", "keep one of its observations")
            seen.add(shot)
            if observed.has("projection"):
                image.append(images.setdefault(shot, len(images)))
                point.append(row)
                xy.append(observed.get("projection").numbers(2))
    check_names(names, "point", path, "give every point an id of its own")
    unplaced = int(np.isnan(np.array(xyz, float).reshape(-1, 3)).all(axis=1).sum())
    words = f"{path.name}: {counted(unplaced, 'point')} without position: not control points"
    said = [left_behind(words)] if unplaced else []
    return _point_list(path, system, (names, xyz, is_check), (images, image, point, xy), tuple(said))


def _point_list(
    path: Path,
    system: StatedSystem,
    points: tuple[list[str], list[list[float]], list[bool]],
    rays: tuple[dict[str, int], list[int], list[int], list[list[float]]],
    messages: tuple[str, ...],
) -> PointList:
    names, xyz, is_check = points
    images, image, point, xy = rays
    place = np.array(xyz, float).reshape(-1, 3) * system.to_metre
    known = np.isfinite(place).any(axis=1)
    return PointList(
        path=path,
        points=texts(names)[known],
        xyz=place[known],
        sigma=no_sigma(int(known.sum())),
        is_check=np.array(is_check, bool)[known],
        crs=system.crs,
        heights="ellipsoidal",
        rays=RayList(
            path=path,
            images=texts(list(images)),
            cameras=np.full(len(images), ""),
            points=texts(names),
            image=np.array(image, np.int64),
            point=np.array(point, np.int64),
            xy=np.array(xy, float).reshape(-1, 2),
            unit="part",
            focal_length_mm=np.full(len(images), np.nan),
        ),
        messages=messages,
    )


def _system(root: Node) -> StatedSystem:
    if not root.has("crs"):
        return StatedSystem("EPSG:4326")
    text = root.get("crs").text()
    try:
        found = stated_system(text)
    except InputError as error:
        raise InputError(error.message, error.remedy, root.path) from error
    if found is None or not found.crs or not np.isfinite(found.to_metre).all():
        raise root.error(f"the coordinate system '{text[:80]}' cannot be used", "write it as EPSG:n or EPSG:n+m")
    return found


def _list(node: Node) -> list[Node]:
    if not isinstance(node.value, list):
        raise node.error("is no list", REMEDY)
    return [node.at(value, f"{node.where}[{k}]") for k, value in enumerate(node.value)]


def _name(node: Node) -> str:
    return str(node.value) if isinstance(node.value, int) and not isinstance(node.value, bool) else node.text()


def _position(point: Node, keys: tuple[str, str, str]) -> list[float]:
    """X, Y, Z or longitude, latitude, height; NaN where unknown."""
    place = point.get("position") if point.has("position") else None
    if place is None or place.value == {}:
        return [np.nan] * 3
    x, y = place.get(keys[0]).number(), place.get(keys[1]).number()
    if keys[0] == "longitude" and (abs(x) > 360.0 or abs(y) > 90.0):
        raise point.error("its position is no longitude and latitude", "correct it, or name its crs")
    return [x, y, place.get(keys[2]).number() if place.has(keys[2]) else np.nan]


def _is_check(point: Node) -> bool:
    if not point.has("role"):
        return False
    role = str(point.get("role").value).lower()
    if role not in (*CONTROL_ROLES, *CHECK_ROLES):
        raise point.error(f"the role '{role[:40]}' is not known", "write OPTIMIZATION or METRICS_ONLY")
    return role in CHECK_ROLES
