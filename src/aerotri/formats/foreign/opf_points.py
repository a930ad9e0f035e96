"""Tie points, control points and positions of an OPF project, in its processing system.

[L] OPF specification 1.0. The points of a calibration have, each, a range of matches: 40 bits for the first and 24 for
their number; a match has a camera and its pixel coordinates. A node's matrix leads to axes with y up, where z up is
meant here.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.foreign.opf_files import REMEDY, Gltf, Resources, entries, matrix_of, whole
from aerotri.formats.text.tables import LARGEST_FORMAT_PX, LARGEST_NUMBER

MATCHES = "OPF_mesh_primitive_matches"
UNSIGNED, FLOAT = 5125, 5126
OFFSET_BITS = 40
FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class MatchedPoints:
    """Points and their image points.

    Parameters
    ----------
    names : of the points. xyz : (N, 3), NaN where unknown. image, point : (m,). px : (m, 2) from the corner.
    left : image points of photographs that are not calibrated, or twice in one.
    """

    names: list[str]
    xyz: np.ndarray
    image: np.ndarray
    point: np.ndarray
    px: np.ndarray
    left: int = 0


def tie_points(path: Path | None, row: dict[int, int]) -> MatchedPoints:
    """The tie points of a calibration; none without a file.

    Parameters
    ----------
    row : of the photographs, by their id.

    Raises
    ------
    InputError
        When a file is missing or damaged.
    """
    nothing = MatchedPoints([], np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 2)))
    if path is None:
        return nothing
    gltf = Gltf(path)
    scene = gltf.element("scenes", gltf.root.get("scene"))
    parts = []
    for number in entries(scene.get("nodes")):
        node = gltf.element("nodes", number)
        (primitive,) = entries(gltf.element("meshes", node.get("mesh")).get("primitives"))[:1] or [None]
        if primitive is None or not primitive.has("extensions") or not primitive.get("extensions").has(MATCHES):
            continue
        parts.append(_of_primitive(gltf, primitive, matrix_of(node), row))
    return _joined(parts) if parts else nothing


def _of_primitive(gltf: Gltf, primitive: Node, matrix: np.ndarray, row: dict[int, int]) -> MatchedPoints:
    matches = primitive.get("extensions").get(MATCHES)
    position = gltf.array(primitive.get("attributes").get("POSITION"), FLOAT, "VEC3").astype(float)
    ranges = gltf.array(matches.get("pointIndexRanges"), UNSIGNED, "VEC2").astype(np.uint64)
    camera = gltf.array(matches.get("cameraIds"), UNSIGNED, "SCALAR").astype(np.int64)
    if not matches.has("imagePoints"):
        raise matches.error("its matches have no image points", "export the project with them")
    px = gltf.array(matches.get("imagePoints").get("pixelCoordinates"), FLOAT, "VEC2").astype(float)
    packed = ranges[:, 0] | (ranges[:, 1] << np.uint64(32))
    first = (packed & np.uint64((1 << OFFSET_BITS) - 1)).astype(np.int64)
    count = (packed >> np.uint64(OFFSET_BITS)).astype(np.int64)
    uids = [whole(node) for node in entries(matches.get("cameraUids"))]
    whole_ranges = len(ranges) == len(position) and bool((first + count <= len(camera)).all())
    if not whole_ranges or len(px) != len(camera) or (len(camera) and camera.max() >= len(uids)):
        raise matches.error("its ranges lead beyond the matches", REMEDY)
    if not (np.abs(px) <= LARGEST_FORMAT_PX).all() or not (np.abs(position) <= LARGEST_NUMBER).all():
        raise matches.error("a point or an image point lies at no possible place", REMEDY)
    place = position @ matrix[:3, :3].T + matrix[:3, 3]
    return _matched(
        place @ FROM_Y_UP.T, first, count, camera, px, np.array([row.get(uid, -1) for uid in uids], np.int64)
    )


def _matched(
    xyz: np.ndarray, first: np.ndarray, count: np.ndarray, camera: np.ndarray, px: np.ndarray, rows: np.ndarray
) -> MatchedPoints:
    """The image points in photographs that are there, once in each."""
    point = np.repeat(np.arange(len(xyz)), count)
    match = np.arange(len(point)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    image = rows[camera[match]] if len(rows) else np.zeros(0, np.int64)
    keep = np.flatnonzero(image >= 0)
    _, once = np.unique(point[keep] * (len(rows) + 1) + image[keep], return_index=True)
    keep = keep[np.sort(once)]
    names = [f"t{k + 1}" for k in range(len(xyz))]
    return MatchedPoints(names, xyz, image[keep], point[keep], px[match[keep]], len(point) - len(keep))


def _joined(parts: list[MatchedPoints]) -> MatchedPoints:
    before = np.cumsum([0, *(len(part.names) for part in parts)])
    return MatchedPoints(
        [f"t{k + 1}" for k in range(int(before[-1]))],
        np.vstack([part.xyz for part in parts]),
        np.concatenate([part.image for part in parts]),
        np.concatenate([part.point + start for part, start in zip(parts, before[:-1], strict=True)]),
        np.vstack([part.px for part in parts]),
        sum(part.left for part in parts),
    )


def marks_of(nodes: list[Node], row: dict[int, int]) -> MatchedPoints:
    """Control points, or tie points that a person has measured, with their image points and without coordinates.

    Raises
    ------
    InputError
    """
    names, image, point, px, left = [], [], [], [], 0
    for k, node in enumerate(nodes):
        names.append(node.get("id").text())
        seen: set[int] = set()
        for mark in entries(node.get("marks")):
            photograph = row.get(whole(mark.get("camera_id")), -1)
            if photograph < 0 or photograph in seen:
                left += 1
                continue
            seen.add(photograph)
            image.append(photograph)
            point.append(k)
            px.append(mark.get("position_px").numbers(2))
    return MatchedPoints(
        names,
        np.full((len(names), 3), np.nan),
        np.array(image, np.int64),
        np.array(point, np.int64),
        np.array(px, float).reshape(-1, 2),
        left,
    )


def input_points(resources: Resources, key: str) -> list[Node]:
    """Entries 'gcps' or 'mtps' of the input control points; [] where there are none."""
    return entries(resources.node("input-control-points").get(key)) if resources.has("input-control-points") else []
