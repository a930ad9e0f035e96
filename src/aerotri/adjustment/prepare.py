"""From a block to equations: which rays take part, datum, observed centres; what cannot be adjusted is named."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerotri.adjustment.datum import free_motions, minimal_coordinates
from aerotri.adjustment.extra_observations import extra_observations
from aerotri.adjustment.normal_equations import ExtraObservations, NormalSystem
from aerotri.adjustment.robust import STAGES
from aerotri.adjustment.start_values import start_values
from aerotri.adjustment.unknowns import (
    ORIENTATION_ELEMENTS,
    StartValues,
    State,
    Unknowns,
    build_unknowns,
    hold_orientation,
    hold_points,
)
from aerotri.conventions import InputError
from aerotri.functional_model.atmosphere import corrected_image_points
from aerotri.observations import Block
from aerotri.observations.names import partnerless_in_words

USED, ONE_RAY, OFF, NO_START, NOT_FINITE, REMOVED, WEAK_POINT, WEAK_PHOTOGRAPH = range(8)
"""Status of a ray; the words stand in `statistics.adjusted_block.RAY_STATUS`."""


WEAK_ENDINGS = (" too weakly tied to the others, set aside", " not fixed in distance by their rays, set aside")


class NoStartValuesError(InputError):
    """No photograph has start values, and none could be had."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A block ready to be adjusted: the system, the start state, the status of every ray, what to tell the user."""

    system: NormalSystem
    state: State
    ray_status: np.ndarray
    warnings: tuple[str, ...]


def prepare(block: Block, given_points: np.ndarray | None = None) -> Prepared:
    """Set up the adjustment of a block.

    Parameters
    ----------
    given_points : (N, 3) m, start values of points where known.

    Raises
    ------
    InputError
        For settings this version cannot honour, and when no photograph has start values.
    """
    check_settings(block)
    block, off = with_edits(block)
    start = start_values(block, given_points)
    if not np.isfinite(start.centre).all(axis=1).any():
        raise NoStartValuesError(
            "no photograph has start values, and none sees four known points",
            "give X0, Y0, Z0, omega, phi, kappa of some photographs in images.csv, or more control points",
            file="images.csv",
        )
    status, warnings = ray_status(block, start, off)
    measured = _freed_of_the_air(block, start)
    system, state = build_system(measured, start, status)
    lonely = partnerless_in_words(block) if block.settings.adjustment.datum == "control" else ()
    return Prepared(system, state, status, (*warnings, *lonely, *_held_in_words(system.unknowns)))


def _held_in_words(unknowns: Unknowns) -> tuple[str, ...]:
    count, points = int(unknowns.control_held.sum()), int(unknowns.control_held.any(axis=1).sum())
    if not count:
        return ()
    return (f"{count} coordinates of {points} control points have σ = 0 and are held at their given values",)


def _freed_of_the_air(block: Block, start: StartValues) -> Block:
    """The block with image points corrected for refraction and earth curvature, as its settings ask."""
    if block.settings.refraction == "off" and block.settings.earth_curvature == "off":
        return block
    ground = float(np.nanmedian(start.points[:, 2])) + start.origin[2]
    xy = corrected_image_points(block, start.rotation, start.centre + start.origin, ground)
    return replace(block, image_points=replace(block.image_points, xy=xy))


def build_system(
    block: Block, start: StartValues, status: np.ndarray, held: list[tuple[int, int]] | None = None
) -> tuple[NormalSystem, State]:
    """The normal system of the rays that take part, and its start state.

    Parameters
    ----------
    status : (m,) of the rays. held : (row of the block's points, axis) of coordinates held for a minimal or inner
        datum; chosen anew where None.
    """
    unknowns, state = build_unknowns(block, start, status == USED)
    unknowns, extras = extra_observations(unknowns, state)
    state = replace(state, shared=np.array(unknowns.shared.start, dtype=float))
    unknowns = _with_datum(unknowns, state, extras, held)
    return NormalSystem(unknowns, extras, state.centre[:, :2]), state


def check_settings(block: Block) -> None:
    """Refuse what is not built, rather than pass over it.

    Raises
    ------
    InputError
    """
    s = block.settings
    refused = [
        (s.adjustment.robust not in STAGES, f'robust = "{s.adjustment.robust}"', f"use {', '.join(STAGES)}"),
    ]
    for wrong, what, remedy in refused:
        if wrong:
            raise InputError(f"{what} is not built into this version", remedy, file="block.toml")
    if s.adjustment.datum == "fixed" and not s.adjustment.datum_fixed:
        raise InputError(
            'datum = "fixed" needs the elements to hold', 'give datum_fixed = ["photo:X0", …]', file="block.toml"
        )
    names = set(block.images.names.tolist())
    for image, element in s.adjustment.datum_fixed:
        if image not in names or element not in ORIENTATION_ELEMENTS:
            raise InputError(
                f"datum_fixed names '{image}:{element}'",
                f"name a photograph and one of {', '.join(ORIENTATION_ELEMENTS)}",
                file="block.toml",
            )
    unknown = set(s.adjustment.datum_points) - set(block.points.tolist())
    if unknown:
        raise InputError(
            f"datum_points names '{min(unknown)}', which is no point of the block",
            "correct the list",
            file="block.toml",
        )


def with_edits(block: Block) -> tuple[Block, np.ndarray]:
    """The block with the operator's decisions about control, and the rays (m,) bool that are switched off.

    `off` without a photograph takes out the coordinates of a control point, whose rays stay, or every ray of a point
    that is none.
    """
    off = np.zeros(len(block.image_points), dtype=bool)
    edits, control = block.edits, block.control
    if edits is None or not len(edits):
        return block, off
    xyz, is_check = control.xyz.copy(), control.is_check.copy()
    row = {int(point): k for k, point in enumerate(control.point)}
    for image, point, action in zip(edits.image.tolist(), edits.point.tolist(), edits.action.tolist(), strict=True):
        if action != "off":
            is_check[row[point]] = action == "check"
        elif image >= 0 or point not in row:
            off |= (block.image_points.point == point) & ((image < 0) | (block.image_points.image == image))
        else:
            xyz[row[point]] = np.nan
    return replace(block, control=replace(control, xyz=xyz, is_check=is_check)), off


def ray_status(block: Block, start: StartValues, off: np.ndarray | None = None) -> tuple[np.ndarray, list[str]]:
    """Status of every ray, and sentences about those left out; `off` (m,) bool are switched off by the operator.

    A point needs two rays, or one ray and enough known coordinates; a photograph needs start values.
    """
    rays = block.image_points
    status = np.full(len(rays), USED, dtype=np.int8)
    status[~np.isfinite(start.centre[rays.image, 0])] = NO_START
    if off is not None:
        status[off] = OFF
    status = with_lonely_rays(block, status)
    status[(status == USED) & ~np.isfinite(start.points[rays.point, 0])] = NO_START
    warnings = []
    photos = np.setdiff1d(np.unique(rays.image), np.unique(rays.image[status == USED]))
    photos = np.union1d(photos, np.flatnonzero(~np.isfinite(start.centre[:, 0])))
    no_rays = np.setdiff1d(np.arange(len(block.images)), np.unique(rays.image))
    if len(no_rays):
        warnings.append(f"{some_names(block.images.names[no_rays], 'photograph')} without image points, left out")
    photos = np.setdiff1d(photos, no_rays)
    if len(photos):
        warnings.append(
            f"{some_names(block.images.names[photos], 'photograph')} without start values or usable points, left out"
        )
    for code, words in ((ONE_RAY, "measured in one photograph only"), (NO_START, "whose rays do not intersect")):
        points = np.unique(rays.point[(status == code) & np.isfinite(start.centre[rays.image, 0])])
        if len(points):
            warnings.append(f"{some_names(block.points[points], 'point')} {words}, left out")
    return status, warnings


def with_lonely_rays(block: Block, status: np.ndarray) -> np.ndarray:
    """The status of rays (m,) with those that are alone in their point `ONE_RAY`.

    A point needs two rays, or one ray and enough known coordinates.
    """
    rays, status = block.image_points, status.copy()
    known = np.zeros(len(block.points), dtype=np.int64)
    if block.settings.adjustment.datum == "control":
        control = ~block.control.is_check
        known[block.control.point[control]] = np.isfinite(block.control.xyz[control]).sum(axis=1)
    usable = status == USED
    count = np.bincount(rays.point[usable], minlength=len(block.points))
    weak = (2 * count + known < 4) | ((count == 1) & (known < 3))
    status[usable & weak[rays.point]] = ONE_RAY
    return status


def with_weak_words(block: Block, status: np.ndarray, warnings: tuple[str, ...]) -> tuple[str, ...]:
    """The warnings with sentences about points and photographs that were set aside for their geometry."""
    rays = block.image_points
    kept = [said for said in warnings if not said.endswith(WEAK_ENDINGS)]
    weak = np.unique(rays.image[status == WEAK_PHOTOGRAPH])
    if len(weak):
        kept.append(f"{some_names(block.images.names[weak], 'photograph')}{WEAK_ENDINGS[0]}")
    weak = np.setdiff1d(rays.point[status == WEAK_POINT], rays.point[status == USED])
    if len(weak):
        kept.append(f"{some_names(block.points[weak], 'point')}{WEAK_ENDINGS[1]}")
    return tuple(kept)


def some_names(names: np.ndarray, noun: str) -> str:
    shown = ", ".join(str(name) for name in names[:5])
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"{len(names)} {noun}{'s' if len(names) > 1 else ''} ({shown}{more})"


def _with_datum(
    unknowns: Unknowns, state: State, extras: list[ExtraObservations], held: list[tuple[int, int]] | None
) -> Unknowns:
    settings = unknowns.block.settings.adjustment
    if settings.datum == "fixed":
        return hold_orientation(unknowns, settings.datum_fixed)
    if settings.datum in ("minimal", "inner"):
        unknowns = replace(unknowns, motions=free_motions(unknowns, extras, state))
        if held is None:
            return hold_points(unknowns, minimal_coordinates(unknowns, state))
        row = {int(point): k for k, point in enumerate(unknowns.points)}
        return hold_points(unknowns, [(row[point], axis) for point, axis in held])
    return unknowns
