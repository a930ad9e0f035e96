"""Start values of the photographs in the CRS of the block: a first orientation brought there, or one that is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.track import strips_of_track
from aerotri.conventions import InputError
from aerotri.coordinates import LocalFrame
from aerotri.coordinates.blocks import frame_of_block
from aerotri.diagnosis.control_marks import Marks, marks_of
from aerotri.formats.assembly import assemble
from aerotri.formats.assembly.parts import OrientationList, PositionList, Reading, no_sigma
from aerotri.functional_model.rotation import angles_from_rotation, exponential, rotation_from_angles
from aerotri.observations import Block, Camera
from aerotri.tie_points.first_orientation import Mapped, map_incrementally
from aerotri.tie_points.georeferencing import is_line, place
from aerotri.tie_points.given import Given, complete, is_held_by_control
from aerotri.tie_points.placed import CONTROL, POSITIONS, Placed, placed_by

LEAST_SIGMA_M = 1e-3
"""Stands for less, 0 too, in the weights of control for a first orientation."""
LOOKS_DOWN = 0.3
"""Length of the mean direction of view, of 1, from which it is one: of photographs to all sides it says nothing."""
SHORTEST_STRIP = 3.0
"""Photographs a strip has on average, where the track is one."""
MOST_LOST = 0.1
"""Share of the photographs without an orientation beyond which it is tried with the principal distance held."""
PLAUSIBLE = 0.1
"""Part by which a principal distance may differ from that of EXIF, which is rounded, before it is not believed."""
Progress = Callable[[str, int, int], None]
"""Told what is going on, how many are done and how many there are."""


@dataclass(frozen=True, eq=False)
class Oriented:
    """Orientation in the local frame of the CRS (None: the block is local), with the cameras that belong to it.

    Parameters
    ----------
    relative : centre (n, 3) and rotation (n, 3, 3) in a frame of the photographs alone, which no list of positions or
        control changes by a single bit; the same as the others where the orientation was given.
    placed : how well it fits what it was brought onto; None where nothing was, or the orientation was given.
    """

    centre: np.ndarray
    rotation: np.ndarray
    cameras: tuple[Camera, ...]
    frame: LocalFrame | None
    messages: tuple[str, ...]
    relative: tuple[np.ndarray, np.ndarray]
    placed: Placed | None = None

    def block_of(self, block: Block) -> Block:
        return replace(block, cameras=self.cameras)

    def in_order(self, rows: np.ndarray, cameras: tuple[Camera, ...]) -> Oriented:
        """The photographs in another order (n,), and the cameras in the order of others of the same names."""
        own = {camera.name: camera for camera in self.cameras}
        cameras = tuple(own.get(camera.name, camera) for camera in cameras)
        return replace(self.kept(rows), cameras=cameras)

    def kept(self, keep: np.ndarray) -> Oriented:
        centre, rotation = self.relative
        return replace(
            self, centre=self.centre[keep], rotation=self.rotation[keep], relative=(centre[keep], rotation[keep])
        )


def orient(
    bare: Block, given: Given, crs: str, positions: PositionList | None, seed: int, progress: Progress
) -> Oriented:
    """The orientation of the photographs of a block of tie points alone.

    Parameters
    ----------
    bare : the block. given, crs, positions : what is known beside it. seed : of random sampling.

    Raises
    ------
    InputError
        When photographs do not hold together, or nothing tells where they are although control should.
    """
    reading = complete(Reading(bare), given, crs, positions)
    if given.orientation is not None:
        return _given_orientation(reading, given.orientation, given.stated)
    count = len(bare.images)

    def report(done: int) -> None:
        progress("first orientation", min(done, count), count)

    mapped, said = _with_most_photographs(bare, map_incrementally(bare, seed, report=report), seed, report), ()
    if not is_held_by_control(reading.block):
        cameras, said = _plausible(bare.cameras, mapped.cameras)
        mapped = map_incrementally(replace(bare, cameras=cameras), seed, report=report) if said else mapped
    frame = None if crs == "local" else frame_of_block(reading.block, given.stated.geoid)
    oriented = _placed(reading.block, mapped, frame, seed)
    return replace(oriented, messages=(*oriented.messages, *said))


def _with_most_photographs(bare: Block, mapped: Mapped, seed: int, report: Callable[[int], None]) -> Mapped:
    """The first orientation, or where it lost photographs that with the principal distance held, if it has more.

    Two vertical photographs hardly determine the principal distance. A pair of them that is taken far off by it does
    not fit the third, and there the orientation ends. The distance stays an unknown of the adjustment.
    """
    tied = np.bincount(bare.image_points.image, minlength=len(bare.images)) > 0
    lost = int((tied & np.isnan(mapped.centre[:, 0])).sum())
    if lost <= MOST_LOST * tied.sum():
        return mapped
    held = tuple(_with_held_distance(camera) for camera in bare.cameras)
    if held == bare.cameras:
        return mapped
    try:
        again = map_incrementally(replace(bare, cameras=held), seed, report=report)
    except InputError:
        return mapped
    if np.isnan(again.centre[:, 0]).sum() >= np.isnan(mapped.centre[:, 0]).sum():
        return mapped
    pairs = zip(bare.cameras, again.cameras, strict=True)
    return replace(again, cameras=tuple(replace(camera, lens=found.lens) for camera, found in pairs))


def _with_held_distance(camera: Camera) -> Camera:
    stated = camera.interior["focal_length_mm"]
    if stated.kind != "free":
        return camera
    return replace(camera, interior={**camera.interior, "focal_length_mm": replace(stated, fixed=True)})


def _plausible(stated: tuple[Camera, ...], found: tuple[Camera, ...]) -> tuple[tuple[Camera, ...], tuple[str, ...]]:
    """The cameras with the principal distances held that came out wrong, and what to say of it.

    Vertical photographs from one height do not determine it without control; small changes between them, such as
    leaves in the wind, then take it far off. Principal point and lens stay free: what they do shows in such
    photographs, and held at zero they bend the block.
    """
    cameras, said = [], []
    for camera, other in zip(stated, found, strict=True):
        ratio = other.focal_length_mm / camera.focal_length_mm
        if abs(ratio - 1.0) > PLAUSIBLE:
            said.append(
                f"the photographs alone give a principal distance of {other.focal_length_mm:.3g} mm for {camera.name}, "
                f"{100 * (ratio - 1):+.0f} % off the stated one: it is held at {camera.focal_length_mm:.4g} mm. "
                "Flying heights depend on it; control points determine it"
            )
            camera = _with_held_distance(camera)
        cameras.append(camera)
    return tuple(cameras), tuple(said)


def _given_orientation(reading: Reading, given: OrientationList, stated: assemble.Statements) -> Oriented:
    start_only = replace(stated, orientation_sigma_m=None, orientation_sigma_deg=None)
    block = assemble.with_orientations(reading, given, start_only).block
    frame = None if block.crs == "local" else frame_of_block(block, stated.geoid)
    _, centre, rotation = in_frame(block, frame)
    return Oriented(centre, rotation, block.cameras, frame, (), (centre, rotation))


def in_frame(block: Block, frame: LocalFrame | None) -> tuple[Block, np.ndarray, np.ndarray]:
    """The block, and its start values in the frame."""
    rotation = rotation_from_angles(block.images.angles, block.rotation)
    if frame is None:
        return block, block.images.centre, rotation
    return block, frame.to_local(block.images.centre), frame.axes_at(block.images.centre) @ rotation


def _placed(block: Block, mapped: Mapped, frame: LocalFrame | None, seed: int) -> Oriented:
    """The first orientation brought onto control points, where three of them are marked, else onto positions."""
    looking = -np.nanmean(mapped.rotation[:, :, 2], axis=0)
    marks = marks_of(replace(block, cameras=mapped.cameras), mapped.centre, mapped.rotation)
    control = block.control
    usable = ~control.is_check & np.isfinite(control.xyz).all(axis=1) & np.isfinite(marks.xyz[:, 0])
    target = control.xyz[usable]
    if len(target) >= 3 and not is_line(target):
        local = target if frame is None else frame.to_local(target)
        sigma = np.hypot(np.maximum(control.sigma[usable], LEAST_SIGMA_M), _sigma_of_marks(marks, usable, local))
        sure = looking if np.linalg.norm(looking) > LOOKS_DOWN else None
        placement = place(marks.xyz[usable], local, sigma, sure, seed)
        names = block.points[control.point][~control.is_check]
        reasons = _why_unusable(block, marks)
        placed = placed_by(CONTROL, names, usable[~control.is_check], placement, reasons)
    else:
        names, source, target, sigma = _positions_of(block, mapped)
        if len(source) < 2:
            return _unplaced(block, mapped, looking)
        local = target if frame is None else frame.to_local(target)
        placement = place(source, local, np.maximum(sigma, LEAST_SIGMA_M), looking, seed)
        placed = placed_by(POSITIONS, names, np.ones(len(names), bool), placement, [])
    rotation = placement.rotation @ mapped.rotation
    relative = mapped.centre, mapped.rotation
    said = (placed.sentence, *placed.doubts())
    return Oriented(placement(mapped.centre), rotation, mapped.cameras, frame, said, relative, placed)


def _sigma_of_marks(marks: Marks, usable: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(k, 1) m, what the marks of the usable points may err by; the scale from how far they are from their middle."""
    source = marks.xyz[usable]
    apart = [np.median(np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1)) for xyz in (source, target)]
    return marks.sigma[usable, None] * float(apart[1] / max(apart[0], 1e-300))


def _why_unusable(block: Block, marks: Marks) -> list[str]:
    """Of every control point, why it is not compared; '' where it may be."""
    control, why = block.control, []
    contradicted = {one.point for one in marks.contradictions}
    rays = np.bincount(block.image_points.point, minlength=len(block.points))[control.point]
    for k in np.flatnonzero(~control.is_check).tolist():
        if not np.isfinite(control.xyz[k]).all():
            why.append("not known in X, Y and Z")
        elif rays[k] < 2:
            why.append("marked in one photograph" if rays[k] else "not marked")
        elif int(control.point[k]) in contradicted:
            why.append("its marks do not meet")
        else:
            why.append("" if np.isfinite(marks.xyz[k, 0]) else "marked in too few oriented photographs")
    return why


def _positions_of(block: Block, mapped: Mapped) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Names of photographs, centres (k, 3) in the frame of the photographs, positions and σ (k, 3) m."""
    observed = block.gnss_ins
    if observed is None:
        return np.zeros(0, str), no_sigma(0), no_sigma(0), no_sigma(0)
    there = np.isfinite(mapped.centre[observed.image, 0]) & np.isfinite(observed.xyz).all(axis=1)
    rows = observed.image[there]
    return block.images.names[rows], mapped.centre[rows], observed.xyz[there], observed.sigma[there]


def _unplaced(block: Block, mapped: Mapped, looking: np.ndarray) -> Oriented:
    """Nothing says where the block is: its own frame, turned so that photographs look down on average."""
    if len(block.control):
        raise InputError(
            "fewer than three control points are marked, and the photographs have no positions",
            "mark three or more control points, each in two photographs or more",
        )
    turn = _rotation_between(looking, np.array([0.0, 0.0, -1.0]))
    said = "neither control points nor positions are given: place, scale and north of the block are arbitrary"
    relative = mapped.centre, mapped.rotation
    return Oriented(mapped.centre @ turn.T, turn @ mapped.rotation, mapped.cameras, None, (said,), relative)


def _rotation_between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The shortest rotation that brings a direction onto another (Rodrigues)."""
    a, b = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis = np.cross(a, b)
    size = float(np.linalg.norm(axis))
    return exponential(axis / max(size, 1e-300) * np.arctan2(size, a @ b))


def with_start_values(reading: Reading, oriented: Oriented) -> Reading:
    """Start values in the CRS, the cameras found, and strips where the photographs make a track."""
    block, frame = reading.block, oriented.frame
    centre, rotation = oriented.centre, oriented.rotation
    if frame is not None:
        centre = frame.from_local(centre)
        rotation = np.swapaxes(frame.axes_at(centre), 1, 2) @ rotation
    angles = angles_from_rotation(rotation, block.rotation)
    images = replace(block.images, centre=centre, angles=angles, strip=_strips(centre))
    return replace(reading, block=replace(block, images=images, cameras=oriented.cameras))


def _strips(centre: np.ndarray) -> np.ndarray:
    if not np.isfinite(centre).all():
        return np.full(len(centre), "")
    strip = strips_of_track(centre, np.full(len(centre), ""))
    if len(centre) < SHORTEST_STRIP * (strip.max() + 1):
        return np.full(len(centre), "")
    return np.array([str(number + 1) for number in strip.tolist()], dtype=str)
