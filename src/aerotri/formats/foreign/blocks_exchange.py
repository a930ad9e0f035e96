"""Bentley's BlocksExchange XML (ContextCapture, iTwin Capture) as a block; many other programs write it too.

Cameras, orientations, positions before the adjustment, control and check points, tie points and coordinate systems are
read; see `blocks_exchange_xml` for units, axes and signs.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.formats.assembly.parts import Reading, no_sigma
from aerotri.formats.foreign.blocks_exchange_lens import with_settled_lens
from aerotri.formats.foreign.blocks_exchange_xml import (
    REMEDY,
    USED,
    Photogroup,
    Pose,
    Systems,
    XmlPlace,
    photogroup,
    pose_of,
)
from aerotri.formats.foreign.colmap_rigs import COLMAP_FROM_CAMERA
from aerotri.formats.foreign.reconstruction import Reconstruction, check_names, names_of_paths
from aerotri.formats.foreign.world_systems import WorldSystem, coordinates_in, placed, target_of
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.sigmas import impossible_sigmas, why_impossible
from aerotri.formats.text.text_lines import first_lines
from aerotri.formats.text.xml_text import read_xml
from aerotri.observations import Block, Control, GnssIns

ROOT = "BlocksExchange"
CONTROL_SIGMA_M, POSITION_SIGMA_M = 0.01, 10.0
"""Standard deviations of control points and positions whose accuracy the file does not tell; chosen [C]: that of a
surveyed point, and that of GNSS without corrections."""


@dataclass(frozen=True, eq=False)
class _Photos:
    """The photographs of a block, in the order of the file.

    Parameters
    ----------
    row : by id. groups : the photogroups; group : (n,) of each. system : of their poses.
    """

    names: list[str]
    row: dict[str, int]
    groups: list[Photogroup]
    group: np.ndarray
    poses: list[Pose]
    system: WorldSystem


@dataclass(frozen=True, eq=False)
class _Points:
    """Control or tie points and their measurements.

    Parameters
    ----------
    xyz, sigma : (N, 3), NaN where unknown. is_check : (N,). systems : of each point.
    image, point : (m,). px : (m, 2) from the corner. left : measurements of photographs that are not there, or twice.
    """

    names: list[str]
    xyz: np.ndarray
    sigma: np.ndarray
    is_check: np.ndarray
    systems: list[WorldSystem]
    image: np.ndarray
    point: np.ndarray
    px: np.ndarray
    left: int


def is_blocks_exchange(path: Path) -> bool:
    """Whether an XML file is a BlocksExchange."""
    return path.suffix.lower() == ".xml" and path.is_file() and any(f"<{ROOT}" in line for line in first_lines(path, 5))


def read_blocks_exchange(
    path: FilePath,
    pixel_um: float | None = None,
    geoid: FilePath | None = None,
) -> Reading:
    """The block of a file; of several the one with most photographs.

    Focal lengths and lens are unknown, and the principal point where the file states one. The standard deviation of
    image points is a pixel.

    Parameters
    ----------
    pixel_um : size of a pixel; None: as the file tells, else 1 µm.
    geoid : grid for the heights of the coordinate systems, where PROJ does not have it.

    Raises
    ------
    InputError
        When something is missing, damaged or cannot be expressed, naming the file.
    """
    path = Path(path)
    root = read_xml(path)
    if root.tag != ROOT:
        raise InputError(f"is <{root.tag[:40]}>, no <{ROOT}>", REMEDY, path)
    chosen, messages = _largest_block(root, path)
    systems = Systems(root, path)
    system = systems.of(chosen, WorldSystem())
    photos = _photos(chosen, systems, system)
    control = _points(chosen, "Control", photos, systems, system)
    ties = _points(chosen, "Tie", photos, systems, system)
    reading = _local_block(chosen, photos, control, ties, pixel_um)
    messages += [*_about_photos(photos, pixel_um), *_about_points(control, ties), *_not_used(chosen)]
    reading, said = _in_its_system(reading, photos, control, path, geoid)
    block, about_lens = with_settled_lens(reading.block, geoid)
    return replace(reading, block=block, messages=(*messages, *said, *about_lens))


def _largest_block(root: Element, path: Path) -> tuple[XmlPlace, list[str]]:
    blocks = [XmlPlace(node, f"block {k}", path) for k, node in enumerate(root.findall("Block"), 1)]
    sizes = [len(block.element.findall("Photogroups/Photogroup/Photo")) for block in blocks]
    if not sizes or not max(sizes):
        bulk = any(block.element.find("BulkPhotos/Photo") is not None for block in blocks)
        message = "lists photographs without cameras (BulkPhotos)" if bulk else "holds no photographs"
        raise InputError(message, "export the block after its aerotriangulation", path)
    chosen = blocks[sizes.index(max(sizes))]
    name = chosen.text("Name") or chosen.where
    others = f"of {len(blocks)} blocks '{name[:60]}' is read, the one with most photographs"
    return chosen.name(f"block '{name[:60]}'"), [left_behind(others)] if len(blocks) > 1 else []


def _photos(block: XmlPlace, systems: Systems, system: WorldSystem) -> _Photos:
    places = [place for place in block.children("Photogroups/Photogroup") if place.element.find("Photo") is not None]
    labels = [place.text("Name") or f"camera {k}" for k, place in enumerate(places, 1)]
    several = {label for label, count in Counter(labels).items() if count > 1}
    names = [f"{label} {k}" if label in several else label for k, label in enumerate(labels, 1)]
    check_names(names, "photogroup", block.path, REMEDY)
    groups = [photogroup(place, name) for place, name in zip(places, names, strict=True)]
    of_groups = [systems.of(group.place, system) for group in groups]
    if any(one != of_groups[0] for one in of_groups):
        raise block.error("its photogroups are in several coordinate systems", "export them in one")
    paths, ids, group_of, poses = [], [], [], []
    for number, group in enumerate(groups):
        for photo in group.place.children("Photo"):
            key = photo.text("Id") or str(len(ids))
            photo = photo.name(f"photo {key[:20]}")
            paths.append(photo.text("ImagePath") or f"photo {key}")
            ids.append(key)
            group_of.append(number)
            poses.append(pose_of(photo, group, systems, of_groups[number]))
    row = {key: k for k, key in enumerate(ids)}
    if len(row) < len(ids):
        twice = Counter(ids).most_common(1)[0][0]
        raise block.error(f"two photographs have the id {twice[:20]}")
    names = names_of_paths(paths)
    check_names(names, "photograph", block.path, REMEDY)
    return _Photos(names, row, groups, np.array(group_of, np.int64), poses, of_groups[0])


def _points(block: XmlPlace, kind: str, photos: _Photos, systems: Systems, system: WorldSystem) -> _Points:
    """Control points ('Control') or tie points ('Tie')."""
    holder = block.child(f"{kind}Points")
    places = [] if holder is None else list(holder.children(f"{kind}Point"))
    default = system if holder is None else systems.of(holder, system)
    names, sources, xyz, sigma, is_check = [], [], [], [], []
    image, point, px, left = [], [], [], 0
    for k, place in enumerate(places):
        name = place.text("Name") or (f"t{k + 1}" if kind == "Tie" else f"control point {k + 1}")
        place = place.name(f"{kind.lower()} point '{name[:60]}'")
        names.append(name)
        sources.append(systems.of(place, default))
        xyz.append(_position(place))
        sigma.append(_accuracy(place, xyz[-1]) if kind == "Control" else [np.nan] * 3)
        is_check.append(place.is_true("CheckPoint"))
        seen: set[int] = set()
        for measured in place.children("Measurement"):
            row = photos.row.get(measured.text("PhotoId"))
            if row is None or row in seen:
                left += 1
                continue
            seen.add(row)
            image.append(row)
            point.append(k)
            px.append(photos.groups[photos.group[row]].measured_px(measured))
    return _Points(
        names,
        np.array(xyz, float).reshape(-1, 3),
        np.array(sigma, float).reshape(-1, 3),
        np.array(is_check, bool),
        sources,
        np.array(image, np.int64),
        np.array(point, np.int64),
        np.array(px, float).reshape(-1, 2),
        left,
    )


def _position(place: XmlPlace) -> list[float]:
    """X, Y, Z; NaN where the category leaves them out."""
    position = place.child("Position")
    if position is None:
        return [np.nan] * 3
    category = place.text("Category") or "Full"
    if category not in ("Full", "Horizontal", "Vertical"):
        raise place.error(f"the category '{category[:30]}' is not known", "write Full, Horizontal or Vertical")
    known = {"Full": "xyz", "Horizontal": "xy", "Vertical": "z"}[category]
    return [position.number(key) if key in known else np.nan for key in "xyz"]


def _accuracy(place: XmlPlace, xyz: list[float]) -> list[float]:
    """σ of the coordinates that are known, NaN where the file does not tell."""
    plan, height = (place.number(key, -1.0) for key in ("HorizontalAccuracy", "VerticalAccuracy"))
    found = [plan, plan, height]
    for key in ("HorizontalAccuracy", "VerticalAccuracy"):
        if place.has(key) and impossible_sigmas(np.array(place.number(key))):
            raise place.error(f"{key} {why_impossible(place.number(key))}", "give the point an accuracy, in metres")
    return [np.nan if value < 0.0 or np.isnan(xyz[k]) else value for k, value in enumerate(found)]


def _local_block(block: XmlPlace, photos: _Photos, control: _Points, ties: _Points, pixel_um: float | None) -> Reading:
    """The block in the axes of its poses, without positions and control."""
    cameras = tuple(group.camera.camera(group.name, pixel_um or group.pixel_um or 1.0) for group in photos.groups)
    taken, count = set(control.names), len(control.names)
    named = [f"tie point {name}" if name in taken else name for name in ties.names]
    check_names([*control.names, *named], "point", block.path, "give every point a name of its own")
    rotation = np.array([pose.rotation for pose in photos.poses]) @ COLMAP_FROM_CAMERA
    return Reconstruction(
        cameras,
        photos.names,
        photos.group,
        np.array([pose.centre for pose in photos.poses]),
        rotation,
        [*control.names, *named],
        np.vstack([no_sigma(count), ties.xyz]),
        np.concatenate([control.image, ties.image]),
        np.concatenate([control.point, ties.point + count]),
        np.vstack([control.px, ties.px]),
        kept=count,
    ).reading(block.text("Name")[:60] or block.path.stem)


def _in_its_system(
    reading: Reading, photos: _Photos, control: _Points, path: Path, geoid: FilePath | None
) -> tuple[Reading, list[str]]:
    """Poses, control points and positions in the coordinate system of the block; what to say of it."""
    observed = [pose for pose in photos.poses if np.isfinite(pose.observed).all() and pose.system is not None]
    of_control = [one for one, xyz in zip(control.systems, control.xyz, strict=True) if np.isfinite(xyz).any()]
    others = [*of_control, *(pose.system for pose in observed if pose.system is not None)]
    target = target_of(photos.system, reading.block.images.centre, others)
    said: list[str] = list(dict.fromkeys(taken(one.note) for one in (photos.system, *others) if one.note))
    if photos.system.kind == "local" and target != "local":
        nothing = no_sigma(len(photos.names))
        block = replace(reading.block, crs=target, images=replace(reading.block.images, centre=nothing, angles=nothing))
        reading = Reading(block)
        said.append(
            left_behind(f"orientations are in local coordinates, control points in {target}: no start orientations")
        )
    else:
        reading = placed(reading, photos.system, target, path, geoid)
        if photos.system.kind not in ("local", "plane"):
            said.append(taken(f"{photos.system.in_words}: orientations were brought to {target}"))
    block, about_control = _with_control(reading.block, control, target, path, geoid)
    block, about_positions = _with_positions(block, photos, target, path, geoid)
    return replace(reading, block=block), [*said, *about_control, *about_positions]


def _with_control(
    block: Block, control: _Points, target: str, path: Path, geoid: FilePath | None
) -> tuple[Block, list[str]]:
    xyz, sigma = control.xyz.copy(), control.sigma.copy()
    for system in dict.fromkeys(control.systems):
        rows = [k for k, one in enumerate(control.systems) if one == system and np.isfinite(control.xyz[k]).any()]
        xyz[rows] = coordinates_in(xyz[rows], system, target, path, geoid)
    known = np.isfinite(xyz)
    missing = known & np.isnan(sigma)
    keep = np.flatnonzero(known.any(axis=1))
    found = Control(keep, xyz[keep], np.where(missing, CONTROL_SIGMA_M, sigma)[keep], control.is_check[keep])
    count = int(missing.any(axis=1).sum())
    lost = int((np.isfinite(control.xyz).any(axis=1) & ~known.any(axis=1)).sum())
    said: list[str] = []
    if count:
        said.append(assumed(f"{counted(count, 'control point')} without accuracy: {CONTROL_SIGMA_M:g} m is taken"))
    if lost:
        words = f"left out: {counted(lost, 'control point')} without all three coordinates, which their system needs"
        said.append(left_behind(words))
    return replace(_on_datum(block) if len(keep) else block, control=found), said


def _with_positions(
    block: Block, photos: _Photos, target: str, path: Path, geoid: FilePath | None
) -> tuple[Block, list[str]]:
    poses = photos.poses
    rows = np.array([k for k, pose in enumerate(poses) if np.isfinite(pose.observed).all()], np.int64)
    if not len(rows):
        return block, []
    xyz, sigma = np.empty((len(rows), 3)), np.array([poses[k].sigma for k in rows])
    systems = [poses[k].system or WorldSystem() for k in rows]
    for system in dict.fromkeys(systems):
        own = [k for k, one in enumerate(systems) if one == system]
        xyz[own] = coordinates_in(np.array([poses[rows[k]].observed for k in own]), system, target, path, geoid)
    count = int(np.isnan(sigma).any(axis=1).sum())
    sigma = np.where(np.isnan(sigma), POSITION_SIGMA_M, sigma)
    unknown = no_sigma(len(rows))
    said: list[str] = [
        taken(f"{counted(len(rows), 'position')} of photographs before the adjustment used as observations")
    ]
    if count:
        said.append(assumed(f"{counted(count, 'position')} without accuracy: {POSITION_SIGMA_M:g} m is taken"))
    return replace(_on_datum(block), gnss_ins=GnssIns(rows, xyz, sigma, unknown, unknown, unknown[:, 0])), said


def _on_datum(block: Block) -> Block:
    adjustment = replace(block.settings.adjustment, datum="control")
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def _about_photos(photos: _Photos, pixel_um: float | None) -> list[str]:
    said = []
    for words, count in Counter(words for pose in photos.poses for words in pose.left).items():
        said.append(f"not used: {words}, of {counted(count, 'photograph')}")
    if any(group.camera.focal_px[0] != group.camera.focal_px[1] for group in photos.groups):
        said.append(assumed("AspectRatio is taken as focal length along y by that along x"))
    if pixel_um is None and any(group.pixel_um is None for group in photos.groups):
        said.append(assumed("a pixel counts as 1 µm: state it with --pixel-um"))
    return said


def _about_points(control: _Points, ties: _Points) -> list[str]:
    said = []
    if not ties.names:
        said.append("holds no tie points: only the image points of control points are read")
    left = control.left + ties.left
    if left:
        said.append(f"left out: {counted(left, 'image point')} of photographs that are not there, or twice in one")
    return said


def _not_used(block: XmlPlace) -> list[str]:
    """Elements that mean something here and are not used, by name."""
    found: Counter[str] = Counter()
    for tag, used in USED.items():
        for node in [block.element] if tag == "Block" else block.element.iter(tag):
            found.update(child.tag for child in node if child.tag not in used and (len(child) or child.text))
    names = ", ".join(f"{str(tag)[:40]} ({count})" for tag, count in found.most_common(12))
    return [f"not used: {names}"] if found else []
