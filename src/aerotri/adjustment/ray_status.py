"""Which rays take part in an adjustment, and why others do not."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from aerotri.adjustment.unknowns import StartValues
from aerotri.observations import Block


class RayStatus(IntEnum):
    """Whether a ray was adjusted, or why it was left out."""

    USED = 0
    ONE_RAY = 1
    OFF = 2
    NO_START = 3
    NOT_FINITE = 4
    REMOVED = 5
    WEAK_POINT = 6
    WEAK_PHOTOGRAPH = 7
    CONTRADICTING = 8

    @property
    def words(self) -> str:
        """As tables say it."""
        return RAY_STATUS[self]


RAY_STATUS = (
    "used", "one ray", "off", "no start value", "not finite", "removed", "weak point", "weak photograph",
    "contradicting mark",
)  # fmt: skip
"""The words of every `RayStatus`: data snooping removes; a point is weak that its rays do not fix, a photograph that is
tied too weakly; a mark of a control point contradicts the other marks of it."""

WEAK_ENDINGS = (" too weakly tied to the others, set aside", " not fixed in distance by their rays, set aside")


def ray_status(block: Block, start: StartValues, off: np.ndarray | None = None) -> tuple[np.ndarray, list[str]]:
    """Status of every ray, and sentences about those left out; `off` (m,) bool are switched off by the operator.

    A point needs two rays, or one ray and enough known coordinates; a photograph needs start values.
    """
    rays = block.image_points
    status = np.full(len(rays), RayStatus.USED, dtype=np.int8)
    placed, located = np.isfinite(start.centre[:, 0]), np.isfinite(start.points[:, 0])
    status[~placed[rays.image]] = RayStatus.NO_START
    if off is not None:
        status[off] = RayStatus.OFF
    status = with_lonely_rays(block, status)
    status[(status == RayStatus.USED) & ~located[rays.point]] = RayStatus.NO_START
    warnings = []
    count = np.bincount(rays.image, minlength=len(block.images))
    used = np.bincount(rays.image[status == RayStatus.USED], minlength=len(block.images))
    photos, no_rays = np.flatnonzero((count > 0) & ((used == 0) | ~placed)), np.flatnonzero(count == 0)
    if len(no_rays):
        warnings.append(f"{some_names(block.images.names[no_rays], 'photograph')} without image points, left out")
    if len(photos):
        warnings.append(
            f"{some_names(block.images.names[photos], 'photograph')} without start values or usable points, left out"
        )
    left_out = {RayStatus.ONE_RAY: "measured in one photograph only", RayStatus.NO_START: "whose rays do not intersect"}
    for code, words in left_out.items():
        points = np.unique(rays.point[(status == code) & placed[rays.image]])
        if len(points):
            warnings.append(f"{some_names(block.points[points], 'point')} {words}, left out")
    return status, warnings


def with_lonely_rays(block: Block, status: np.ndarray) -> np.ndarray:
    """The status of rays (m,) with those that are alone in their point `RayStatus.ONE_RAY`.

    A point needs two rays, or one ray and enough known coordinates.
    """
    rays, status = block.image_points, status.copy()
    known = np.zeros(len(block.points), dtype=np.int64)
    if block.settings.adjustment.datum == "control":
        control = ~block.control.is_check
        known[block.control.point[control]] = np.isfinite(block.control.xyz[control]).sum(axis=1)
    usable = status == RayStatus.USED
    count = np.bincount(rays.point[usable], minlength=len(block.points))
    weak = (2 * count + known < 4) | ((count == 1) & (known < 3))
    status[usable & weak[rays.point]] = RayStatus.ONE_RAY
    return status


def with_weak_words(block: Block, status: np.ndarray, warnings: tuple[str, ...]) -> tuple[str, ...]:
    """The warnings with sentences about points and photographs that were set aside for their geometry."""
    rays = block.image_points
    kept = [said for said in warnings if not said.endswith(WEAK_ENDINGS)]
    weak = np.unique(rays.image[status == RayStatus.WEAK_PHOTOGRAPH])
    if len(weak):
        kept.append(f"{some_names(block.images.names[weak], 'photograph')}{WEAK_ENDINGS[0]}")
    weak = np.setdiff1d(rays.point[status == RayStatus.WEAK_POINT], rays.point[status == RayStatus.USED])
    if len(weak):
        kept.append(f"{some_names(block.points[weak], 'point')}{WEAK_ENDINGS[1]}")
    return tuple(kept)


def some_names(names: np.ndarray, noun: str) -> str:
    shown = ", ".join(str(name) for name in names[:5])
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"{len(names)} {noun}{'s' if len(names) > 1 else ''} ({shown}{more})"
