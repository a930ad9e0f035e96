"""What a block folder holds and what it lacks, before anything is adjusted."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerotri.conventions import FilePath, counted
from aerotri.formats.results.json_text import number_or_none
from aerotri.observations import Block
from aerotri.public.argument_types import with_checked_types

if TYPE_CHECKING:
    from aerotri.diagnosis.inventory import CameraUse, Extent, GroundPointCounts, Inventory

UNITS = {"deg": "degrees", "gon": "gon", "rad": "radians"}
MOST_CAMERAS = 6
"""Cameras that are named one by one in the text."""
MOST_RAYS = 6
"""Photographs a point from which the numbers of points are added up in the text."""


@dataclass(frozen=True, eq=False, repr=False)
class BlockCheck:
    """What `aerotri.check` found.

    Parameters
    ----------
    block : as it was read. inventory : what it holds, counted.
    angle_unit, image_unit : of its files.
    missing : why it cannot be adjusted, in sentences; empty where it can.
    warnings : what looks wrong. notes : what is worth knowing, such as files that are not read.
    folder : of the block, None for one that comes from elsewhere.
    """

    block: Block
    inventory: Inventory
    angle_unit: str
    image_unit: str
    missing: tuple[str, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    folder: Path | None = None

    @property
    def can_be_adjusted(self) -> bool:
        """Whether nothing is missing for an adjustment."""
        return not self.missing

    @property
    def summary(self) -> dict[str, Any]:
        """What the command prints as JSON."""
        found = self.inventory
        content = asdict(found)
        content["image_points"]["rays_per_point"] = [
            {"photographs": rays, "points": count} for rays, count in found.image_points.rays_per_point.items()
        ]
        content["image_points"]["sigma_um"] = number_or_none(found.image_points.sigma_um)
        for one in content["extents"]:
            # a coordinate that no point of the group has
            one |= {end: list(map(number_or_none, one[end])) for end in ("low", "high")}
        return {
            "block": self.block.name,
            "can_be_adjusted": self.can_be_adjusted,
            "missing": list(self.missing),
            "warnings": list(self.warnings),
            "notes": list(self.notes),
            "crs": self.block.crs,
            "rotation": self.block.rotation,
            "angle_unit": self.angle_unit,
            "image_unit": self.image_unit,
            **content,
        }

    def lines(self) -> list[str]:
        """The same in lines, as the command prints it."""
        return [
            *_heading(self),
            *_extents(self.inventory.extents),
            *(f"note: {text}" for text in self.notes),
            *(f"warning: {text}" for text in self.warnings),
            *(f"missing: {text}" for text in self.missing),
            self._conclusion(),
        ]

    def _conclusion(self) -> str:
        if not self.can_be_adjusted:
            return "The block cannot be adjusted yet."
        if not self.warnings:
            return "The block can be adjusted."
        which = "warning" if len(self.warnings) == 1 else f"{len(self.warnings)} warnings"
        return f"The block can be adjusted, but look at the {which} above first."

    def __repr__(self) -> str:
        able = "can be adjusted" if self.can_be_adjusted else "cannot be adjusted"
        return (
            f"<aerotri.BlockCheck of {self.block.name!r}: {able}; {len(self.missing)} missing, "
            f"{len(self.warnings)} warnings>"
        )

    def _repr_html_(self) -> str:
        rows = "".join(f"<li>{escape(line)}</li>" for line in self.lines() if not line.startswith("  "))
        return f"<div><b>{escape(self.block.name)}</b><ul>{rows}</ul></div>"


@with_checked_types
def check(block: Block | FilePath, *, control_prefix: str = "", geoid: FilePath | None = None) -> BlockCheck:
    """Read a block, count what it holds, and say what looks wrong and what an adjustment lacks; nothing is adjusted.

    Parameters
    ----------
    block : a block, or the folder of one.
    control_prefix : what image points have before the names of control points.
    geoid : grid of geoid undulations for a coordinate system that has none of its own.

    Returns
    -------
    BlockCheck
        Look at `can_be_adjusted`, `missing` and `warnings` first.

    Raises
    ------
    InputError
        When the block cannot be read.

    Examples
    --------
    >>> import aerotri
    >>> found = aerotri.check(aerotri.simulate(aerotri.example_flight(), seed=1).block)
    >>> found.can_be_adjusted, found.inventory.photographs, found.inventory.control.count
    (True, 12, 6)
    """
    from aerotri.coordinates.metric import in_metres
    from aerotri.diagnosis.inventory import inventory
    from aerotri.diagnosis.suspicions import suspicions
    from aerotri.observations.names import with_control_prefix
    from aerotri.pipeline.rehearsal import rehearse

    folder, angle_unit, image_unit, unread = None, "deg", "mm", ()
    if not isinstance(block, Block):
        folder, angle_unit, image_unit, unread = _of_folder(Path(block))
        block = _read(Path(block))
    metric, note = in_metres(with_control_prefix(block, control_prefix), geoid)
    found, tried = inventory(metric), rehearse(metric, geoid)
    said = (*suspicions(metric, found, UNITS[angle_unit]), *tried.doubts)
    warnings = (*said, *(text for text in tried.warnings if not _is_said(text, said)))
    notes = (*((note,) if note else ()), *unread)
    return BlockCheck(metric, found, angle_unit, image_unit, tried.missing, warnings, notes, folder)


def _read(place: Path) -> Block:
    from aerotri.formats.block.folder import read_block

    # a block without photographs or image points is a block that has something missing
    return read_block(place, rays_needed=False, images_needed=False)


def _of_folder(place: Path) -> tuple[Path, str, str, tuple[str, ...]]:
    """The folder, the units of its angles and image points, and sentences about what is not read in it."""
    from aerotri.formats.block.folder import settings_file
    from aerotri.formats.block.settings import read_block_toml
    from aerotri.formats.block.template import example_in_words
    from aerotri.formats.block.unread import unread_in_words

    toml = settings_file(place)
    model = read_block_toml(toml).model
    return toml.parent, model.angle_unit, model.image_unit, (*example_in_words(toml, model), *unread_in_words(toml))


def _is_said(text: str, said: tuple[str, ...]) -> bool:
    """Whether a warning of the adjustment is one that was given in other words."""
    return text in said or any(
        ending in text and any(words in one for one in said)
        for ending, words in (
            ("measured in one photograph only, left out", "measured in one photograph only"),
            ("without image points, left out", " without image points ("),
        )
    )


def _heading(found: BlockCheck) -> list[str]:
    i, block = found.inventory, found.block
    where = "local coordinates" if block.crs == "local" else block.crs
    lines = [
        f"{block.name}: {where}; image points in {found.image_unit}, angles in {UNITS[found.angle_unit]}, "
        f"{block.rotation}"
    ]
    strips = f" in {counted(len(i.strips), 'strip')}" if i.strips else ""
    lines.append(f"{counted(i.photographs, 'photograph')}{strips}")
    lines += [
        f"  camera {one.name}: {counted(one.photographs, 'photograph')}, {_kind(one)}, {one.size_px[0]} × "
        f"{one.size_px[1]} px of {one.pixel_um:g} µm, focal length {one.focal_length_mm:g} mm"
        for one in i.cameras[:MOST_CAMERAS]
    ]
    if len(i.cameras) > MOST_CAMERAS:
        lines.append(f"  and {counted(len(i.cameras) - MOST_CAMERAS, 'more camera')}")
    lines.append(
        f"start values: {counted(i.with_start_position, 'position')}, {counted(i.with_start_angles, 'attitude')}; "
        f"observed: {counted(i.with_gnss, 'GNSS position')}, {counted(i.with_ins, 'INS attitude')}"
    )
    return [*lines, *_image_points(i), _ground("control points", i.control), _ground("check points", i.check)]


def _kind(camera: CameraUse) -> str:
    """'frame', 'frame with a fisheye lens'."""
    return f"{camera.model} with a fisheye lens" if camera.projection == "fisheye" else camera.model


def _image_points(i: Inventory) -> list[str]:
    p = i.image_points
    if not p.count:
        return ["no image points"]
    many = sum(count for rays, count in p.rays_per_point.items() if rays >= MOST_RAYS)
    few = [f"{rays}: {count}" for rays, count in p.rays_per_point.items() if rays < MOST_RAYS]
    by_rays = ", ".join([*few, *([f"{MOST_RAYS} and more: {many}"] if many else [])])
    return [
        f"{counted(p.count, 'image point')} of {counted(p.points, 'point')}, {p.median:.0f} in a photograph "
        f"({p.fewest} at least), "
        f"σ {p.sigma_um:.3g} µm",
        f"  photographs a point: {p.mean_rays:.1f} on average; points by their number of photographs {by_rays}",
    ]


def _ground(what: str, points: GroundPointCounts) -> str:
    if not points.count:
        return f"no {what}"
    partly = [
        f"{count} {kind} only" for count, kind in ((points.plan_only, "X, Y"), (points.height_only, "Z")) if count
    ]
    lonely = len(points.without_image_points)
    return f"{counted(points.count, what.removesuffix('s'))}, " + ", ".join(
        [*partly, f"{points.with_image_points} with image points" + (f", {lonely} without" if lonely else "")]
    )


def _extents(extents: tuple[Extent, ...]) -> list[str]:
    if not extents:
        return []
    lines = ["smallest and largest coordinates, m:"]
    for one in extents:
        axes = zip("XYZ", one.low, one.high, strict=True)
        spans = ", ".join(f"{axis} {low:.1f} … {high:.1f}" for axis, low, high in axes)
        lines.append(f"  {one.name} ({one.count}): {spans}")
    return lines
