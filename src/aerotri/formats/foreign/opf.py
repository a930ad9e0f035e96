"""OPF, the Open Photogrammetry Format of Pix4D, as a block: calibrated cameras, tie points, control and positions.

[L] OPF specification 1.0. The processing system is the base system scaled to one unit, with X and Y exchanged where it
counts north first, and moved: taken back, it is a coordinate system of X east, Y north and heights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerotri.conventions import FilePath, InputError, counted
from aerotri.crs_text import plan_of
from aerotri.formats.assembly.parts import Reading, no_sigma
from aerotri.formats.foreign.opensfm_json import Node
from aerotri.formats.foreign.opf_cameras import Photographs, photographs_of
from aerotri.formats.foreign.opf_files import REMEDY, Resources, container_of, entries, identifier, whole
from aerotri.formats.foreign.opf_points import MatchedPoints, input_points, marks_of, tie_points
from aerotri.formats.foreign.reconstruction import Reconstruction, check_names
from aerotri.formats.foreign.world_systems import WorldSystem, coordinates_in, world_system
from aerotri.formats.text.notes import assumed, left_behind, taken
from aerotri.formats.text.tables import LARGEST_NUMBER, SMALLEST_POSITIVE
from aerotri.observations import Block, Control, GnssIns

EAST_FIRST, NORTH_FIRST = ("east", "north"), ("north", "east")
UNEQUAL = 1e-6
"""Relative difference between the units of the axes above which they are not one [C]."""
ACCURACY = 1.0
"""Accuracy of a mark as Pix4D writes it where nobody has changed it."""


@dataclass(frozen=True)
class _Frame:
    """The processing system.

    Parameters
    ----------
    system : base system. shift : (3,) of the processing system. to_metre : one unit of it. geoid_height : m, added.
    """

    system: WorldSystem
    shift: tuple[float, float, float]
    to_metre: float
    geoid_height: float = 0.0

    def unmoved(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) m, X east, Y north, height, of (n, 3) in the processing system."""
        return (xyz - np.array(self.shift)) * self.to_metre + np.array([0.0, 0.0, self.geoid_height])

    @property
    def crs(self) -> str:
        return self.system.crs or "local"


def read_opf(path: FilePath, pixel_um: float | None = None, geoid: FilePath | None = None) -> Reading:
    """The calibrated project of a container, or of the folder with it.

    Focal lengths, principal points and lens are unknown, the standard deviation of image points is a pixel.

    Parameters
    ----------
    pixel_um : size of a pixel; None: as the project says.
    geoid : grid for heights of control points and positions in another system, where PROJ does not have it.

    Raises
    ------
    InputError
        When a file is missing or damaged, or something cannot be expressed, naming the file.
    """
    container = container_of(Path(path))
    if container is None:
        raise InputError("holds no .opf file, or several", "give the .opf file itself", path)
    resources = Resources(container)
    photographs, frame = photographs_of(resources, pixel_um), _frame(resources)
    gcps, mtps = input_points(resources, "gcps"), input_points(resources, "mtps")
    control = marks_of(gcps, photographs.row)
    manual = marks_of(mtps, photographs.row)
    ties = tie_points(resources.gltf(), photographs.row)
    reading = _local_block(container, photographs, frame, (control, manual, ties))
    messages = [*photographs.messages, *_about(resources, gcps, mtps, (control, manual, ties))]
    messages += [taken(frame.system.note)] if frame.system.note else []
    block, about_control = _with_control(reading.block, resources, frame, gcps, geoid)
    block, about_positions = _with_positions(block, resources, frame, photographs, geoid)
    return replace(reading, block=block, messages=(*messages, *about_control, *about_positions))


def _frame(resources: Resources) -> _Frame:
    if not resources.has("scene-reference-frame"):
        # [L] a frame of which nothing is known has no file
        return _Frame(WorldSystem(note="nothing is known of the coordinate system and the scale"), (0.0, 0.0, 0.0), 1.0)
    node = resources.node("scene-reference-frame")
    crs, change = node.get("crs"), node.get("base_to_canonical")
    system = _system(crs)
    if system.kind == "degrees":
        raise crs.error("counts in degrees, which a scene does not", REMEDY)
    if system.kind == "plane" and change.has("swap_xy"):
        axes, swapped = _axes(crs), change.get("swap_xy").value
        if axes and swapped != (axes == NORTH_FIRST):
            message = f"swap_xy is {str(swapped).lower()}, but the system counts {' and '.join(axes)}"
            raise change.error(message, REMEDY)
    scale = np.array(change.get("scale").numbers(3))
    if scale.min() < SMALLEST_POSITIVE:
        raise change.error("a scale is not greater than 0", REMEDY)
    units = np.array(system.to_metre) / scale
    if np.ptp(units) > UNEQUAL * units.max():
        raise change.error("its scales do not bring the axes to one unit", "export the project in a system in metres")
    x, y, z = change.get("shift").numbers(3)
    return _Frame(system, (x, y, z), float(units[0]), _geoid_height(crs, system))


def _system(crs: Node) -> WorldSystem:
    """The system of a definition; a constant height of the geoid makes its heights ellipsoidal.

    [L] The heights of a system of two dimensions count in the unit of X and Y.
    """
    system = world_system(crs.get("definition").text(), crs.path, heights_as_plan=True)
    if system.kind not in ("plane", "degrees", "local"):
        raise crs.error(f"{system.in_words} cannot be used", "export the project in a projected system")
    return replace(system, crs=plan_of(system.crs)) if crs.has("geoid_height") and system.crs else system


def _geoid_height(crs: Node, system: WorldSystem) -> float:
    """m, added to heights."""
    return crs.get("geoid_height").number() * system.to_metre[2] if crs.has("geoid_height") else 0.0


def _local_block(
    container: Path, photographs: Photographs, frame: _Frame, points: tuple[MatchedPoints, MatchedPoints, MatchedPoints]
) -> Reading:
    """The block in its coordinate system, without control and positions."""
    control, manual, ties = points
    taken_names = {*control.names, *manual.names}
    check_names([*control.names, *manual.names], "point", container, "give every point a name of its own")
    tie_names = [f"tie point {name}" if name in taken_names else name for name in ties.names]
    before = np.cumsum([0, len(control.names), len(manual.names)])
    reading = Reconstruction(
        photographs.cameras,
        photographs.names,
        photographs.camera,
        frame.unmoved(photographs.centre),
        photographs.rotation,
        [*control.names, *manual.names, *tie_names],
        np.vstack([control.xyz, manual.xyz, frame.unmoved(ties.xyz)]),
        np.concatenate([part.image for part in points]),
        np.concatenate([part.point + start for part, start in zip(points, before, strict=True)]),
        np.vstack([part.px for part in points]),
        kept=len(control.names),
    ).reading(container.stem)
    return replace(reading, block=replace(reading.block, crs=frame.crs))


def _with_control(
    block: Block, resources: Resources, frame: _Frame, gcps: list[Node], geoid: FilePath | None
) -> tuple[Block, list[str]]:
    if not gcps:
        return block, []
    xyz, sigma = _places(_projected(resources, "projected-control-points", "projected_gcps"), gcps, frame, geoid)
    is_check = np.array([bool(node.get("is_checkpoint").value) for node in gcps])
    found = Control(np.arange(len(gcps)), xyz, sigma, is_check)
    accuracies = {mark.get("accuracy").number() for gcp in gcps for mark in entries(gcp.get("marks"))} - {ACCURACY}
    words = "not used: the accuracies of marks in the photographs; a pixel is taken"
    return replace(_on_datum(block), control=found), [left_behind(words)] if accuracies else []


def _with_positions(
    block: Block, resources: Resources, frame: _Frame, photographs: Photographs, geoid: FilePath | None
) -> tuple[Block, list[str]]:
    captures, rows, placeless = [], [], 0
    projected = _projected(resources, "projected-input-cameras", "captures")
    for capture in entries(resources.node("input-cameras").get("captures")):
        row = photographs.row.get(whole(capture.get("reference_camera_id")), -1)
        if not capture.has("geolocation") or row < 0:
            continue
        if identifier(capture.get("id")) not in projected and _leads_nowhere(capture, frame):
            placeless += 1
            continue
        captures.append(capture)
        rows.append(row)
    words = f"not used: {counted(placeless, 'position')} of photographs on the earth; the project is in local axes"
    said: list[str] = [left_behind(words)] if placeless else []
    if not captures:
        return block, said
    xyz, sigma = _places(projected, captures, frame, geoid)
    unknown = no_sigma(len(rows))
    observed = GnssIns(np.array(rows, np.int64), xyz, sigma, unknown, unknown, unknown[:, 0])
    said.append(taken(f"{counted(len(rows), 'position')} of photographs used as observations"))
    angles = sum(capture.has("orientation") for capture in captures)
    if angles:
        said.append(left_behind(f"not used: {counted(angles, 'orientation')} before the calibration"))
    return replace(_on_datum(block), gnss_ins=observed), said


def _leads_nowhere(capture: Node, frame: _Frame) -> bool:
    """Whether a position is on the earth, and the project in local axes."""
    return frame.system.kind == "local" and _system(capture.get("geolocation").get("crs")).kind != "local"


def _on_datum(block: Block) -> Block:
    adjustment = replace(block.settings.adjustment, datum="control")
    return replace(block, settings=replace(block.settings, adjustment=adjustment))


def _places(
    projected: dict[int | str, Node], nodes: list[Node], frame: _Frame, geoid: FilePath | None
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and σ, (n, 3) m each: those that Pix4D brought to the processing system, else the original ones.

    Parameters
    ----------
    projected : places in the processing system by identifier.
    """
    xyz, sigma = no_sigma(len(nodes)), no_sigma(len(nodes))
    for k, node in enumerate(nodes):
        found = projected.get(identifier(node.get("id")))
        if found is not None:
            xyz[k] = frame.unmoved(np.array([found.get("coordinates").numbers(3)]))[0]
            sigma[k] = np.array(found.get("sigmas").numbers(3)) * frame.to_metre
        else:
            xyz[k], sigma[k] = _original(node.get("geolocation"), frame, geoid)
        if not sigma[k].min() >= SMALLEST_POSITIVE or not sigma[k].max() <= LARGEST_NUMBER:
            raise node.error("a standard deviation is not greater than 0", REMEDY)
    return xyz, sigma


def _projected(resources: Resources, name: str, section: str) -> dict[int | str, Node]:
    """Places in the processing system by identifier."""
    if not resources.has(name):
        return {}
    found = {}
    for node in entries(resources.node(name).get(section)):
        place = node.get("geolocation") if node.has("geolocation") else node
        if place.has("coordinates"):
            found[identifier(node.get("id"))] = place
    return found


def _original(place: Node, frame: _Frame, geoid: FilePath | None) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and σ in the system of the block, of a place in one of its own, whose axes come in its order."""
    crs = place.get("crs")
    system = _system(crs)
    order = [1, 0, 2] if system.kind != "local" and _axes(crs) == NORTH_FIRST else [0, 1, 2]
    xyz = np.array(place.get("coordinates").numbers(3))[order]
    sigma = np.array(place.get("sigmas").numbers(3))[order]
    found = coordinates_in(xyz[None], system, frame.crs, place.path, geoid)[0]
    in_metres = (1.0, 1.0, 1.0) if system.kind == "degrees" else system.to_metre
    return found + np.array([0.0, 0.0, _geoid_height(crs, system)]), sigma * np.array(in_metres)


def _axes(crs: Node) -> tuple[str, ...]:
    """Where X and Y of a system count to; nothing where the definition does not tell.

    Raises
    ------
    InputError
        When that is neither east and north nor north and east.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        axes = tuple(axis.direction for axis in CRS.from_user_input(crs.get("definition").text()).axis_info[:2])
    except CRSError:
        return ()
    if axes and axes not in (EAST_FIRST, NORTH_FIRST):
        raise crs.error(f"the system counts {' and '.join(axes)}", "export the project in a system of east and north")
    return axes


def _about(resources: Resources, gcps: list[Node], mtps: list[Node], points: tuple[MatchedPoints, ...]) -> list[str]:
    said: list[str] = []
    left = sum(part.left for part in points)
    if left:
        said.append(
            left_behind(f"left out: {counted(left, 'image point')} of photographs not calibrated, or twice in one")
        )
    if resources.gltf() is None:
        said.append("holds no tie points: only the marks of control points are read")
    for name, words in (("constraints", "constraints on scale and orientation"), ("gps-bias", "the bias of GNSS")):
        if resources.has(name):
            said.append(left_behind(f"not used: {words}"))
    checks = sum(bool(node.get("is_checkpoint").value) for node in mtps)
    if checks:
        said.append(assumed(f"{counted(checks, 'tie point')} measured by hand as check points count as tie points"))
    return said
